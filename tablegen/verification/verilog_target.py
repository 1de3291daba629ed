"""The Verilog sequencer of a build in a simulator: its own modules play the words of its own memory files."""

import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tablegen.device.registers import program_words
from tablegen.manifest.read import NotABuild, StoredBuild
from tablegen.verification import worker
from tablegen.verification.bench import CAPTURE, SCRIPT, SequencerBench, SequencerShape
from tablegen.verification.build import Outcome, Progress
from tablegen.verification.checks import (
    Check,
    check_codes,
    check_nothing_counted,
    check_timing,
    first_difference,
    make_capture,
)
from tablegen.verification.directory import copies, memory_words, some
from tablegen.verification.placement import Placement
from tablegen.verification.session import Memories, make_session
from tablegen.verification.simulate import SimulationFailed, require
from tablegen.verification.stream import read_capture

_CAPTURED_TICK_BYTES = 17  # bytes of a captured tick
_SINE = "sine.mem"
_MAX_TABLE_WORDS = 1 << 16  # words of a table that the sequencer can address


@dataclass(frozen=True)
class VerilogTarget:
    """A simulator, and how the sequencer is placed."""

    simulator: str
    placement: Placement
    format_name: str = "verilog"

    def require(self) -> None:
        """The simulator and cocotb."""
        require(self.simulator)

    def refuse(self, folder: Path, stored: StoredBuild) -> None:
        """``direct`` tables may be longer than the sequencer's addresses."""
        for name, axis in stored.axes:
            if len(axis.table.words) > _MAX_TABLE_WORDS:
                raise NotABuild(
                    f"{folder}: the table of {name} has {len(axis.table.words)} words, dac_sequencer.v plays at most "
                    f"{_MAX_TABLE_WORDS}; mode = 'interpolated' needs fewer"
                )
        placement = self.placement
        if placement.fourier and not any(placement.renders(axis) for axis in (stored.program.x, stored.program.y)):
            raise NotABuild(
                f"{folder}: both tables are direct, and no device renders those; verify it without --fourier"
            )

    def play(
        self, folder: Path, work: Path, stored: StoredBuild, most_ticks: int, seed: int, progress: Progress
    ) -> Outcome:
        """One session on the simulator."""
        simulator, placement = self.simulator, self.placement
        memories, missing = _memories(folder, work, stored, placement)
        modules = stored.runtime(".v")
        sources, absent = copies(folder, modules, work / "rtl")
        if not modules:
            absent = ["the build holds no dac_*.v"]
        if missing or absent:
            return Outcome([Check("simulation", simulator, "nothing", failure="simulation: " + some(missing + absent))])

        progress("playing the integer model")
        assert memories is not None
        session = make_session(stored.program, memories, most_ticks, seed, placement)
        (work / SCRIPT).write_text(session.script.text(), "ascii")
        ticks = len(session.script.expected)

        def played() -> str:
            try:
                done = (work / CAPTURE).stat().st_size // _CAPTURED_TICK_BYTES
            except OSError:
                return f"compiling for {simulator}"
            return f"{simulator} has played {done} of {ticks} ticks"

        progress(played)
        parks = stored.program.x.output.park_code, stored.program.y.output.park_code
        job = {
            "simulator": simulator,
            "shape": asdict(SequencerShape.of((stored.program.x, stored.program.y))),
            "sources": [str(path) for path in sources],
            "parameters": {
                "X_POWER_UP_CODE": parks[0],
                "Y_POWER_UP_CODE": parks[1],
                **placement.parameters(max(memories.x_harmonics, memories.y_harmonics), str(work / _SINE)),
            },
            "clocks": session.script.clocks,
        }
        try:
            status = worker.run(work, __name__, job)
            got = read_capture(work / CAPTURE)
        except (SimulationFailed, OSError, ValueError) as error:
            return Outcome([Check("simulation", simulator, f"{ticks} ticks", failure=f"simulation: {error}")])
        progress("comparing")
        capture = make_capture(stored, session.script.expected, got)
        counted = [int(count) for count in status["counts"]]
        checks = [
            *check_codes(capture, stored),
            check_nothing_counted(capture, stored, counted, session.script.counts, bool(status["refused"])),
            check_timing(capture, status),
        ]
        return Outcome(checks, session, first_difference(capture, stored))


def play_job(folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """Compile and play the script that stands in ``folder``; in a process that can be ended. The bench's counters."""
    sources = [Path(source) for source in job["sources"]]
    bench = SequencerBench(job["simulator"], SequencerShape(**job["shape"]), folder, job["parameters"], sources)
    return bench.run(job["clocks"])


def _memories(folder: Path, work: Path, stored: StoredBuild, placement: Placement) -> tuple[Memories | None, list[str]]:
    """The words of the memory files, and what is wrong where they cannot be had."""
    name, program = stored.manifest.name, stored.program
    files = [("program", len(program_words(program.schedule, program.x, program.y)))]
    harmonics = []
    for (axis, content), played in zip(stored.axes, (program.x, program.y), strict=True):
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
