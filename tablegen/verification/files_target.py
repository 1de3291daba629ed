"""A target for builds without a sequencer, and for a check of the files alone: nothing is played."""

from dataclasses import dataclass
from pathlib import Path

from tablegen.manifest.read import StoredBuild
from tablegen.verification.build_report import Outcome, PlayJob


@dataclass(frozen=True)
class FilesTarget:
    """The files of every format, compared with the manifest."""

    format_name: None = None

    def require(self) -> None:
        """Accept every machine: no tool is needed."""

    def refuse(self, folder: Path, stored: StoredBuild) -> None:
        """Accept every build."""

    def play(self, job: PlayJob) -> Outcome:
        """Return an outcome without playback."""
        return Outcome([])
