"""A build without a sequencer, or one whose files alone are to be checked: nothing is played."""

from dataclasses import dataclass
from pathlib import Path

from tablegen.manifest.read import StoredBuild
from tablegen.verification.build_report import Outcome, PlayJob


@dataclass(frozen=True)
class FilesTarget:
    """The files of every format against the manifest."""

    format_name: None = None

    def require(self) -> None:
        """Nothing is needed."""

    def refuse(self, folder: Path, stored: StoredBuild) -> None:
        """No build is refused."""

    def play(self, job: PlayJob) -> Outcome:
        """Nothing is played."""
        return Outcome([])
