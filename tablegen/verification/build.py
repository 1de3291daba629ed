"""Verify a build in its directory: its files, then what its own sequencer plays of its own numbers."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from tablegen import __version__
from tablegen.manifest.read import NotABuild, StoredBuild, read_manifest
from tablegen.verification.checks import Check
from tablegen.verification.directory import some, wrong_files
from tablegen.verification.session import BuildSession, needed_ticks

Progress = Callable[[str | Callable[[], str]], None]


@dataclass(frozen=True)
class Outcome:
    """What came of playing: without a session nothing was played, and a check says why."""

    checks: list[Check]
    session: BuildSession | None = None
    difference: str | None = None  # the first tick that differs


class Target(Protocol):
    """A language in which a build has its sequencer, and something that plays it."""

    def require(self) -> None:
        """Raise ``ToolMissing`` unless all that it needs is there."""

    def refuse(self, folder: Path, stored: StoredBuild) -> None:
        """Raise ``NotABuild`` for a build that it cannot play."""

    def check_files(self, folder: Path, stored: StoredBuild) -> list[Check]:
        """Constants and words of the build's files against the manifest."""

    def play(
        self, folder: Path, work: Path, stored: StoredBuild, most_ticks: int, seed: int, progress: Progress
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
    stored = read_manifest(folder)
    target.refuse(folder, stored)
    target.require()
    progress("hashing the files")
    checks = [*_file_checks(folder, stored), *target.check_files(folder, stored)]
    outcome = target.play(folder, work, stored, most_ticks, seed, progress)
    notes = []
    if stored.manifest.tablegen != __version__:
        notes.append(f"built by tablegen {stored.manifest.tablegen}, verified by {__version__}")
    if outcome.session is not None:
        notes += _coverage(stored, outcome.session)
    return Report(stored.manifest.name, checks + outcome.checks, outcome.difference, notes)


def _file_checks(folder: Path, stored: StoredBuild) -> list[Check]:
    manifest = stored.manifest
    hashed = None
    if stored.own_hash != manifest.hash:
        hashed = "manifest: edited: the hash of its plan is another than it says; build it again"
    wrong = wrong_files(folder, stored)
    return [
        Check("manifest", "its own hash", "1 plan", failure=hashed),
        differing_check("files", "SHA-256 in the manifest", f"{len(manifest.files)} files", wrong),
    ]


def differing_check(subject: str, against: str, compared: str, wrong: list[str]) -> Check:
    """The check of many things that are all to be equal; ``wrong`` are those that are not."""
    failure = f"{subject}: {some(wrong)}" if wrong else None
    return Check(subject, against, compared, f"{len(wrong)} differ", "0", failure)


def _coverage(stored: StoredBuild, session: BuildSession) -> list[str]:
    """What the ticks did not suffice for."""
    needed = needed_ticks(stored.program)
    notes = []
    if not session.whole_frame:
        ticks = stored.program.schedule.frame_ticks
        notes.append(f"not a whole frame of {ticks} ticks was played; --ticks {needed} plays one")
    if not session.swapped_in_frame:
        notes.append(f"no line ended in time for a swap in mid-frame; --ticks {needed} has one")
    return notes


__all__ = ["NotABuild", "Outcome", "Progress", "Report", "Target", "differing_check", "verify_build"]
