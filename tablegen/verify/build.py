"""Verify a build in its directory: its files, then what its own sequencer plays from its own memory files."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tablegen import __version__
from tablegen.registers import program_words
from tablegen.verify import worker
from tablegen.verify.bench import RECORD, SCRIPT, Shape
from tablegen.verify.checks import Check, check_record, first_difference, make_record
from tablegen.verify.directory import memory_words, some, wrong_constants, wrong_files, wrong_memories
from tablegen.verify.placement import Placement
from tablegen.verify.recorded import NotABuild, Recorded, read_manifest
from tablegen.verify.session import Memories, Session, make_session, needed_ticks
from tablegen.verify.simulate import SimulationFailed, require
from tablegen.verify.stream import read_record

_RECORD_LINE = 17  # bytes of a recorded tick
_SINE = "sine.mem"
_MOST_WORDS = 1 << 16  # of a table, as the sequencer addresses them


@dataclass(frozen=True)
class Report:
    """What came of a verification."""

    name: str
    checks: list[Check]
    difference: str | None  # the first tick that differs
    notes: list[str]

    @property
    def failures(self) -> list[str]:
        """What every failed check has to say."""
        return [check.failure for check in self.checks if check.failure is not None]


def verify_build(
    folder: Path,
    work: Path,
    simulator: str,
    most_ticks: int,
    seed: int,
    placement: Placement,
    progress: Callable[[str | Callable[[], str]], None],
) -> Report:
    """Verify the build in ``folder``; the simulation takes place in ``work``, an empty directory.

    Raises ``NotABuild`` and ``ToolMissing``. Everything else that is wrong is a failed check, and none hides another.
    """
    recorded = read_manifest(folder)
    _check_playable(folder, recorded, placement)
    require(simulator)
    progress("hashing the files")
    checks = _file_checks(folder, recorded)
    notes = []
    if recorded.manifest.tablegen != __version__:
        notes.append(f"built by tablegen {recorded.manifest.tablegen}, verified by {__version__}")
    memories, missing = _memories(folder, work, recorded, placement)
    sources, absent = _sources(folder, work, recorded)
    if missing or absent:
        checks.append(Check("simulation", simulator, "nothing", failure="simulation: " + some(missing + absent)))
        return Report(recorded.manifest.name, checks, None, notes)

    progress("playing the integer model")
    assert memories is not None
    session = make_session(recorded.program, memories, most_ticks, seed, placement)
    (work / SCRIPT).write_text(session.script.text(), "ascii")
    ticks = len(session.script.expected)

    def played() -> str:
        try:
            done = (work / RECORD).stat().st_size // _RECORD_LINE
        except OSError:
            return f"compiling for {simulator}"
        return f"{simulator} has played {done} of {ticks} ticks"

    progress(played)
    parks = recorded.program.x.output.park_code, recorded.program.y.output.park_code
    shape = Shape.of((recorded.program.x, recorded.program.y))
    parameters = {
        "X_POWER_UP_CODE": parks[0],
        "Y_POWER_UP_CODE": parks[1],
        **placement.parameters(max(memories.x_harmonics, memories.y_harmonics), str(work / _SINE)),
    }
    try:
        status = worker.run(work, simulator, shape, sources, parameters, session.script.clocks)
        got = read_record(work / RECORD)
    except (SimulationFailed, OSError, ValueError) as error:
        checks.append(Check("simulation", simulator, f"{ticks} ticks", failure=f"simulation: {error}"))
        return Report(recorded.manifest.name, checks, None, notes)
    progress("comparing")
    record = make_record(recorded, session.script.expected, got)
    checks += check_record(record, recorded, status, session.script.counts)
    notes += _coverage(recorded, session)
    return Report(recorded.manifest.name, checks, first_difference(record, recorded), notes)


def _check_playable(folder: Path, recorded: Recorded, placement: Placement) -> None:
    """``direct`` tables may be longer than the sequencer's addresses."""
    for name, axis in recorded.axes:
        if len(axis.table.words) > _MOST_WORDS:
            raise NotABuild(
                f"{folder}: the table of {name} has {len(axis.table.words)} words, dac_sequencer.v plays at most "
                f"{_MOST_WORDS}; mode = 'interpolated' needs fewer"
            )
    if placement.fourier and not any(placement.renders(axis) for axis in (recorded.program.x, recorded.program.y)):
        raise NotABuild(f"{folder}: both tables are direct, and no device renders those; verify it without --fourier")


def _file_checks(folder: Path, recorded: Recorded) -> list[Check]:
    manifest = recorded.manifest
    wrong = wrong_files(folder, recorded)
    constants, differing = wrong_constants(folder, recorded)
    words, flipped = wrong_memories(folder, recorded)
    hashed = None
    if recorded.own_hash != manifest.hash:
        hashed = "manifest: edited: the hash of its plan is another than it says; build it again"
    return [
        Check("manifest", "its own hash", "1 plan", failure=hashed),
        Check(
            "files",
            "SHA-256 in the manifest",
            f"{len(manifest.files)} files",
            f"{len(wrong)} differ",
            "0",
            f"files: {some(wrong)}" if wrong else None,
        ),
        Check(
            "header",
            "manifest",
            f"{constants} constants",
            f"{len(differing)} differ",
            "0",
            f"header: {some(differing)}" if differing else None,
        ),
        Check(
            "memories",
            "manifest",
            f"{words} words",
            f"{len(flipped)} differ",
            "0",
            f"memories: {some(flipped)}" if flipped else None,
        ),
    ]


def _memories(folder: Path, work: Path, recorded: Recorded, placement: Placement) -> tuple[Memories | None, list[str]]:
    """The words of the memory files, and what is wrong where they cannot be had."""
    name, program = recorded.manifest.name, recorded.program
    files = [("program", len(program_words(program.schedule, program.x, program.y)))]
    harmonics = []
    for (axis, content), played in zip(recorded.axes, (program.x, program.y), strict=True):
        rendered = placement.renders(played)
        harmonics.append(content.fourier.harmonics if rendered else 0)
        files.append((f"{axis}_fourier", 2 * harmonics[-1] + 1) if rendered else (axis, len(played.words)))
    words, wrong = [], []
    for suffix, count in files:
        try:
            words.append(memory_words(folder / f"{name}_{suffix}.mem", count))
        except ValueError as error:
            wrong.append(str(error))
    if placement.fourier:
        try:
            shutil.copyfile(folder / f"{name}_sine.mem", work / _SINE)
        except OSError as error:
            wrong.append(f"{name}_sine.mem cannot be read: {error.strerror or error}")
    return (None if wrong else Memories(words[0], words[1], words[2], *harmonics)), wrong


def _sources(folder: Path, work: Path, recorded: Recorded) -> tuple[list[Path], list[str]]:
    """Copies of the build's own modules: make, and with it Verilator, does not like every path."""
    sources, wrong = [], []
    (work / "rtl").mkdir(exist_ok=True)
    for name in recorded.runtime:
        copy = work / "rtl" / name
        try:
            shutil.copyfile(folder / name, copy)
        except FileNotFoundError:
            wrong.append(f"{name} is missing")
        except OSError as error:
            wrong.append(f"{name} cannot be read: {error.strerror or error}")
        sources.append(copy)
    return sources, wrong if sources else ["the build holds no dac_*.v"]


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


__all__ = ["NotABuild", "Report", "verify_build"]
