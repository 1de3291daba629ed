"""Verify a build in its directory: its files, then what its own sequencer plays of its own numbers."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from tablegen.emit.format import Comparison
from tablegen.emit.formats import UnknownFormat, get
from tablegen.emit.stored import stored_content
from tablegen.manifest.read import NotABuild, StoredBuild, read_build
from tablegen.problems import Unphysical
from tablegen.verification.checks import Check
from tablegen.verification.directory import some, wrong_files
from tablegen.verification.session import BuildSession, needed_ticks
from tablegen.version import __version__

Progress = Callable[[str | Callable[[], str]], None]


@dataclass(frozen=True)
class Outcome:
    """What came of playing: without a session nothing was played, and a check says why."""

    checks: list[Check]
    session: BuildSession | None = None
    difference: str | None = None  # the first tick that differs


class Target(Protocol):
    """A format in which a build has its sequencer, and something that plays it."""

    @property
    def format_name(self) -> str | None:
        """The format that is played; None where nothing is."""

    def require(self) -> None:
        """Raise ``ToolMissing`` unless all that it needs is there."""

    def refuse(self, folder: Path, stored: StoredBuild) -> None:
        """Raise ``NotABuild`` for a build that it cannot play."""

    def play(
        self, folder: Path, work: Path, stored: StoredBuild, most_ticks: int, seed: int, progress: Progress
    ) -> Outcome:
        """Play the build in ``folder``, in the directory ``work``, and check what comes."""


@dataclass(frozen=True, repr=False)
class Report:
    """What came of a verification: ``failures`` are empty if all is well."""

    name: str
    checks: list[Check]
    difference: str | None
    notes: list[str]

    def __repr__(self) -> str:
        failed = len(self.failures)
        return f"<tablegen report {self.name!r}: {len(self.checks)} checks, {failed or 'none'} failed>"

    @property
    def failures(self) -> list[str]:
        """What every failed check has to say."""
        return [check.failure for check in self.checks if check.failure is not None]


def verify_build(folder: Path, work: Path, target: Target, most_ticks: int, seed: int, progress: Progress) -> Report:
    """Verify the build in ``folder`` for a target; it is played in ``work``, an empty directory.

    Raises ``NotABuild`` and ``ToolMissing``. Everything else that is wrong is a failed check, and none hides another.
    """
    stored = read_build(folder)
    if target.format_name is not None and target.format_name not in stored.formats:
        formats = ", ".join(stored.formats)
        raise NotABuild(
            f"{folder}: this build has the formats {formats}, and no {target.format_name}; "
            f"verify it with another --target, or build it with --format {target.format_name}"
        )
    target.refuse(folder, stored)
    target.require()
    progress("hashing the files")
    notes: list[str] = []
    checks = [*_file_checks(folder, stored), *_format_checks(folder, stored, notes)]
    outcome = target.play(folder, work, stored, most_ticks, seed, progress)
    if stored.manifest.tablegen != __version__:
        notes.append(f"built by tablegen {stored.manifest.tablegen}, verified by {__version__}")
    if outcome.session is not None:
        notes += _coverage(stored, outcome.session)
    return Report(stored.manifest.name, checks + outcome.checks, outcome.difference, notes)


def _file_checks(folder: Path, stored: StoredBuild) -> list[Check]:
    manifest = stored.manifest
    hashed = None
    if stored.own_hash != manifest.hash:
        hashed = "manifest: edited: its plan does not match its hash; build it again"
    wrong = wrong_files(folder, stored)
    return [
        Check("manifest", "its own hash", "1 plan", failure=hashed),
        differing_check("files", "SHA-256 in the manifest", f"{len(manifest.files)} files", wrong),
    ]


def _format_checks(folder: Path, stored: StoredBuild, notes: list[str]) -> list[Check]:
    """What each format of the build finds in its files."""
    content, checks = stored_content(stored), []
    for name in stored.formats:
        try:
            found = get(name).check(folder, content)
        except UnknownFormat as error:
            notes.append(f"{error}; only the SHA-256 of its files was checked")
            continue
        except Unphysical as error:  # no build has such a manifest
            found = [Comparison("files", "0 files", [str(error)])]
        checks += [differing_check(f"{name} {one.subject}", "manifest", one.compared, one.wrong) for one in found]
    return checks


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
        notes.append(f"too few ticks for a program change within a frame; --ticks {needed} has one")
    return notes


__all__ = ["NotABuild", "Outcome", "Progress", "Report", "Target", "differing_check", "verify_build"]
