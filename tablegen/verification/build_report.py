"""Verify a build in its directory: its files, then the playback of its own numbers by its own sequencer."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import monotonic
from typing import Protocol

from tablegen.base.input_errors import Unphysical, shortened
from tablegen.emit.content import Content
from tablegen.emit.format import Comparison, Format
from tablegen.emit.stored import stored_content
from tablegen.manifest.read import NotABuild, StoredBuild, read_build
from tablegen.verification.checks.certificate_checks import check_certificates
from tablegen.verification.checks.derived import wrong_derived
from tablegen.verification.checks.directory import some, wrong_files
from tablegen.verification.checks.listing import (
    Written,
    known_formats,
    listed_files,
    unlike_installed,
    written_files,
)
from tablegen.verification.checks.played_checks import Check
from tablegen.verification.checks.tilt import wrong_tilt
from tablegen.verification.play.session import BuildSession, needed_ticks
from tablegen.version import __version__

Progress = Callable[[str | Callable[[], str]], None]


@dataclass(frozen=True)
class Outcome:
    """The outcome of a playback: without a session nothing was played, and a check has the reason."""

    checks: list[Check]
    session: BuildSession | None = None
    difference: str | None = None  # the first tick that differs
    whole_frame: bool = False  # a frame was played apart from the session
    notes: list[str] = field(default_factory=list)
    unplayed: list[str] = field(default_factory=list)  # files, and options of a module


class Target(Protocol):
    """A target of verification: a format that has a sequencer, and a machine that plays it."""

    @property
    def format_name(self) -> str | None:
        """The format that is played; None for a target that plays nothing."""

    def require(self) -> None:
        """Check that the tools of the target are installed.

        Raises
        ------
        ToolMissing
            If one is not.
        """

    def refuse(self, folder: Path, stored: StoredBuild) -> None:
        """Check that the target can play a build.

        Raises
        ------
        NotABuild
            If it cannot.
        """

    def play(self, job: "PlayJob") -> Outcome:
        """Play the build, and check the record."""


@dataclass(frozen=True)
class PlayJob:
    """A job: the build in ``folder`` is played in the directory ``work``; ``limits`` of x and y are in LSB."""

    folder: Path
    work: Path
    stored: StoredBuild
    limits: dict[str, float]
    most_ticks: int
    seed: int
    progress: Progress


@dataclass(frozen=True, repr=False)
class Report:
    """The result of a verification: ``failures`` are empty if every check passed."""

    name: str
    checks: list[Check]
    difference: str | None
    notes: list[str]
    seconds: float = 0.0
    unplayed: list[str] = field(default_factory=list)  # what of the sequencer was not played, where one was

    def __repr__(self) -> str:
        failed = len(self.failures)
        return f"<tablegen report {self.name!r}: {len(self.checks)} checks, {failed or 'none'} failed>"

    @property
    def failures(self) -> list[str]:
        """The messages of all failed checks."""
        return [check.failure for check in self.checks if check.failure is not None]


def verify_build(
    folder: Path,
    work: Path,
    target: Target,
    most_ticks: int,
    seed: int,
    progress: Progress,
    *,
    other_version: bool = False,
) -> Report:
    """Verify the build in ``folder`` for a target.

    Everything that is wrong with the build itself is a failed check, and none hides another.

    Parameters
    ----------
    work
        Empty directory in which the build is played.
    most_ticks
        Bound of the ticks that are played.
    seed
        Seed of the random parts of the session.
    other_version
        True to accept a build of another version, whose runtime cannot be compared with the installed one.

    Raises
    ------
    NotABuild
        If the folder holds no build, or none that this target can play.
    ToolMissing
        If a compiler or simulator is not installed.
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
    watch = Stopwatch()
    progress("hashing the files")
    same = stored.manifest.tablegen == __version__
    known, unknown = known_formats(stored)
    notes = [f"{why}; only the SHA-256 of its files was checked" for why in unknown]
    content = stored_content(stored)
    checks = watch.timed(_manifest_checks(folder, stored))
    checks += watch.timed(_file_checks(folder, stored, content, known, other_version))
    checks += watch.timed(_format_checks(folder, content, known))
    progress("measuring the certificate")
    certificates = check_certificates(stored, same, folder)
    checks += watch.timed(certificates.checks)
    for name, tilt in stored.tilts.items():
        count, wrong = wrong_tilt(stored, tilt)
        checks += watch.timed([differing_check(name, "its plane, certificate", f"{count} codes", wrong)])
    outcome = target.play(PlayJob(folder, work, stored, certificates.limits, most_ticks, seed, progress))
    checks += watch.timed(outcome.checks)
    if not same and other_version:
        notes.append(
            f"built by tablegen {stored.manifest.tablegen}, verified by {__version__}: its runtime was not compared "
            "with the installed one, nor its scaling errors with the words"
        )
    if same and certificates.unknown_models:
        names = " and ".join(map(shortened, certificates.unknown_models))
        notes.append(f"scaling errors of the model {names} were not compared: its equations are not those of tablegen")
    if outcome.session is not None:
        notes += _coverage(stored, outcome)
    return Report(
        stored.manifest.name, checks, outcome.difference, notes + outcome.notes, watch.seconds, outcome.unplayed
    )


class Stopwatch:
    """The time of a verification in s, shared out among its checks."""

    def __init__(self) -> None:
        self._begun = self._last = monotonic()

    @property
    def seconds(self) -> float:
        """The time of all checks."""
        return monotonic() - self._begun

    def timed(self, checks: list[Check]) -> list[Check]:
        """Return these checks with the seconds since the last call."""
        now, last = monotonic(), self._last
        self._last = now
        return [replace(check, seconds=(now - last) / len(checks)) for check in checks]


def _manifest_checks(folder: Path, stored: StoredBuild) -> list[Check]:
    hashed = None
    if stored.own_hash != stored.manifest.hash:
        hashed = "manifest: edited: its plan does not match its hash; build it again"
    count, wrong = wrong_derived(stored)
    return [
        Check("manifest", "its own hash", "1 plan", failure=hashed),
        differing_check("manifest", "its own numbers", f"{count} numbers", wrong),
    ]


def _file_checks(
    folder: Path, stored: StoredBuild, content: Content, formats: list[Format], other_version: bool
) -> list[Check]:
    """Check the files of a build: presence, digests, and those that every build of a version shares."""
    files, version = stored.manifest.files, stored.manifest.tablegen
    same = version == __version__
    written: Written = []
    try:
        written = written_files(content, formats)
        count, unlisted = listed_files(folder, stored, written, same, len(formats) == len(stored.formats))
    except Unphysical as error:
        count, unlisted = 0, [str(error)]
    checks = [
        differing_check("files", "its formats", f"{count} files", unlisted),
        differing_check("files", "SHA-256 in the manifest", f"{len(files)} files", wrong_files(folder, stored)),
    ]
    if same:
        compared, unlike = unlike_installed(folder, stored, written)
        if compared:
            checks.append(differing_check("files", f"tablegen {__version__}", f"{compared} files", unlike))
    elif not other_version:
        why = (
            f"files: built by tablegen {shortened(version)}, and this is {__version__}: its runtime cannot be compared "
            f"with the installed one; build it again, verify it with tablegen {shortened(version)}, or leave the "
            "verdict on its runtime to what is played, with --other-version"
        )
        checks.append(Check("files", f"tablegen {__version__}", "0 files", failure=why))
    return checks


def _format_checks(folder: Path, content: Content, formats: list[Format]) -> list[Check]:
    """Return the checks that each format of the build makes of its files."""
    checks = []
    for one in formats:
        try:
            comparisons = one.check(folder, content)
        except Unphysical as error:  # no build has such a manifest
            comparisons = [Comparison("files", "0 files", [str(error)])]
        checks += [differing_check(f"{one.name} {it.subject}", "manifest", it.compared, it.wrong) for it in comparisons]
    return checks


def differing_check(subject: str, against: str, compared: str, wrong: list[str]) -> Check:
    """Return a check that many things are equal; ``wrong`` lists those that differ."""
    failure = f"{subject}: {some(wrong)}" if wrong else None
    return Check(subject, against, compared, f"{len(wrong)} differ", "0", failure)


def _coverage(stored: StoredBuild, outcome: Outcome) -> list[str]:
    """List what the played ticks were too few to exercise."""
    session = outcome.session
    assert session is not None
    needed = needed_ticks(stored.program)
    notes = []
    if not (session.whole_frame or outcome.whole_frame):
        ticks = stored.program.schedule.frame_ticks
        notes.append(f"not a whole frame of {ticks} ticks was played; --ticks {needed} plays one")
    if not session.swapped_in_frame:
        notes.append(f"too few ticks for a program change within a frame; --ticks {needed} has one")
    return notes


__all__ = ["NotABuild", "Outcome", "PlayJob", "Progress", "Report", "Target", "differing_check", "verify_build"]
