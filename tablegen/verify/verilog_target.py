"""The Verilog sequencer of a build in a simulator: its own modules play the words of its own memory files."""

import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from tablegen.recorded import NotABuild, Recorded
from tablegen.registers import program_words
from tablegen.verify import worker
from tablegen.verify.bench import RECORD, SCRIPT, SequencerBench, Shape
from tablegen.verify.build import Outcome, Progress, differing_check
from tablegen.verify.checks import (
    Check,
    check_codes,
    check_nothing_counted,
    check_timing,
    first_difference,
    make_record,
)
from tablegen.verify.directory import copies, memory_words, some, wrong_constants, wrong_memories
from tablegen.verify.placement import Placement
from tablegen.verify.session import Memories, make_session
from tablegen.verify.simulate import SimulationFailed, require
from tablegen.verify.stream import read_record

_RECORD_LINE = 17  # bytes of a recorded tick
_SINE = "sine.mem"
_MOST_WORDS = 1 << 16  # of a table, as the sequencer addresses them


@dataclass(frozen=True)
class VerilogTarget:
    """A simulator, and how the sequencer is placed."""

    simulator: str
    placement: Placement

    def require(self) -> None:
        """The simulator and cocotb."""
        require(self.simulator)

    def refuse(self, folder: Path, recorded: Recorded) -> None:
        """``direct`` tables may be longer than the sequencer's addresses."""
        for name, axis in recorded.axes:
            if len(axis.table.words) > _MOST_WORDS:
                raise NotABuild(
                    f"{folder}: the table of {name} has {len(axis.table.words)} words, dac_sequencer.v plays at most "
                    f"{_MOST_WORDS}; mode = 'interpolated' needs fewer"
                )
        placement = self.placement
        if placement.fourier and not any(placement.renders(axis) for axis in (recorded.program.x, recorded.program.y)):
            raise NotABuild(
                f"{folder}: both tables are direct, and no device renders those; verify it without --fourier"
            )

    def check_files(self, folder: Path, recorded: Recorded) -> list[Check]:
        """The Verilog header and the memory files."""
        constants, differing = wrong_constants(folder, recorded)
        words, flipped = wrong_memories(folder, recorded)
        return [
            differing_check("header", "manifest", f"{constants} constants", differing),
            differing_check("memories", "manifest", f"{words} words", flipped),
        ]

    def play(
        self, folder: Path, work: Path, recorded: Recorded, most_ticks: int, seed: int, progress: Progress
    ) -> Outcome:
        """One session on the simulator."""
        simulator, placement = self.simulator, self.placement
        memories, missing = _memories(folder, work, recorded, placement)
        modules = recorded.runtime(".v")
        sources, absent = copies(folder, modules, work / "rtl")
        if not modules:
            absent = ["the build holds no dac_*.v"]
        if missing or absent:
            return Outcome([Check("simulation", simulator, "nothing", failure="simulation: " + some(missing + absent))])

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
        job = {
            "simulator": simulator,
            "shape": asdict(Shape.of((recorded.program.x, recorded.program.y))),
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
            got = read_record(work / RECORD)
        except (SimulationFailed, OSError, ValueError) as error:
            return Outcome([Check("simulation", simulator, f"{ticks} ticks", failure=f"simulation: {error}")])
        progress("comparing")
        record = make_record(recorded, session.script.expected, got)
        counted = [int(count) for count in status["counts"]]
        checks = [
            *check_codes(record, recorded),
            check_nothing_counted(record, recorded, counted, session.script.counts, bool(status["refused"])),
            check_timing(record, status),
        ]
        return Outcome(checks, session, first_difference(record, recorded))


def play_job(folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """Compile and play the script that stands in ``folder``; in a process that can be ended. The bench's counters."""
    sources = [Path(source) for source in job["sources"]]
    bench = SequencerBench(job["simulator"], Shape(**job["shape"]), folder, job["parameters"], sources)
    return bench.run(job["clocks"])


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
