"""Verify a build in its directory: its files, then what its own sequencer plays of its own numbers."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from tablegen import __version__
from tablegen.recorded import NotABuild, Recorded, read_manifest
from tablegen.verify.checks import Check
from tablegen.verify.directory import some, wrong_files
from tablegen.verify.session import Session, needed_ticks

Progress = Callable[[str | Callable[[], str]], None]


@dataclass(frozen=True)
class Outcome:
    """What came of playing: without a session nothing was played, and a check says why."""

    checks: list[Check]
    session: Session | None = None
    difference: str | None = None  # the first tick that differs


class Target(Protocol):
    """A language in which a build has its sequencer, and something that plays it."""

    def require(self) -> None:
        """Raise ``ToolMissing`` unless all that it needs is there."""

    def refuse(self, folder: Path, recorded: Recorded) -> None:
        """Raise ``NotABuild`` for a build that it cannot play."""

    def check_files(self, folder: Path, recorded: Recorded) -> list[Check]:
        """Constants and words of the build's files against the manifest."""

    def play(
        self, folder: Path, work: Path, recorded: Recorded, most_ticks: int, seed: int, progress: Progress
    ) -> Outcome:
        """Play the build in ``folder``, in the directory ``work``, and check what comes."""


@dataclass(frozen=True)
class Report:
    """What came of a verification."""

    name: str
    checks: list[Check]
    difference: str | None
    notes: list[str]

    @property
    def failures(self) -> list[str]:
        """What every failed check has to say."""
        return [check.failure for check in self.checks if check.failure is not None]


def verify_build(folder: Path, work: Path, target: Target, most_ticks: int, seed: int, progress: Progress) -> Report:
    """Verify the build in ``folder`` for a target; it is played in ``work``, an empty directory.

    Raises ``NotABuild`` and ``ToolMissing``. Everything else that is wrong is a failed check, and none hides another.
    """
    recorded = read_manifest(folder)
    target.refuse(folder, recorded)
    target.require()
    progress("hashing the files")
    checks = [*_file_checks(folder, recorded), *target.check_files(folder, recorded)]
    outcome = target.play(folder, work, recorded, most_ticks, seed, progress)
    notes = []
    if recorded.manifest.tablegen != __version__:
        notes.append(f"built by tablegen {recorded.manifest.tablegen}, verified by {__version__}")
    if outcome.session is not None:
        notes += _coverage(recorded, outcome.session)
    return Report(recorded.manifest.name, checks + outcome.checks, outcome.difference, notes)


def _file_checks(folder: Path, recorded: Recorded) -> list[Check]:
    manifest = recorded.manifest
    hashed = None
    if recorded.own_hash != manifest.hash:
        hashed = "manifest: edited: the hash of its plan is another than it says; build it again"
    wrong = wrong_files(folder, recorded)
    return [
        Check("manifest", "its own hash", "1 plan", failure=hashed),
        differing_check("files", "SHA-256 in the manifest", f"{len(manifest.files)} files", wrong),
    ]


def differing_check(subject: str, against: str, compared: str, wrong: list[str]) -> Check:
    """The check of many things that are all to be equal; ``wrong`` are those that are not."""
    failure = f"{subject}: {some(wrong)}" if wrong else None
    return Check(subject, against, compared, f"{len(wrong)} differ", "0", failure)


def _coverage(recorded: Recorded, session: Session) -> list[str]:
    """What the ticks did not suffice for."""
    needed = needed_ticks(recorded.program)
    notes = []
    if not session.whole_frame:
        ticks = recorded.program.schedule.frame_ticks
        notes.append(f"not a whole frame of {ticks} ticks was played; --ticks {needed} plays one")
    if not session.swapped_in_frame:
        notes.append(f"no line ended in time for a swap in mid-frame; --ticks {needed} has one")
    return notes


__all__ = ["NotABuild", "Outcome", "Progress", "Report", "Target", "differing_check", "verify_build"]
