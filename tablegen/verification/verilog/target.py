"""The Verilog sequencer of a build in a simulator: its own modules play the words of its own memory files.

On Icarus a long frame is played apart from the rest, with multiplier blocks in place of look-up tables, at the same
time: that takes half as long.
"""

import shutil
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tablegen.device.by_turns import not_by_turns
from tablegen.device.registers import program_words
from tablegen.emit.stored import stored_content
from tablegen.emit.turned_content import content_beside
from tablegen.manifest.read import NotABuild, StoredBuild
from tablegen.verification import process_group as worker
from tablegen.verification.build_report import Outcome, PlayJob, differing_check
from tablegen.verification.checks.directory import copies, memory_words, some
from tablegen.verification.checks.played_checks import (
    Check,
    check_codes,
    check_faults,
    check_no_faults,
    check_outputs,
    check_states,
    check_timing,
    check_waveform,
    check_whole,
    check_wires,
    first_difference,
)
from tablegen.verification.coverage import unplayed_verilog
from tablegen.verification.failures import SimulationFailed
from tablegen.verification.play.capture import Capture, make_capture
from tablegen.verification.play.loading import Memories
from tablegen.verification.play.placement import Placement
from tablegen.verification.play.sequencer_shape import CAPTURE, SCRIPT, SequencerShape
from tablegen.verification.play.session import BuildSession, make_session, needed_ticks
from tablegen.verification.play.stream import read_capture, read_states
from tablegen.verification.verilog.bench import (
    COUNT_BITS,
    OUTPUT_BENCH,
    STATES,
    TOP,
    WORDS,
    bench_parameters,
    bench_text,
    different_constants,
    expected_constants,
    read_outputs,
    read_wires,
    write_boot_files,
)
from tablegen.verification.verilog.outputs import played_outputs
from tablegen.verification.verilog.sequencer_bench import STREAM_BENCH, run_bench
from tablegen.verification.verilog.simulate import Design, compile_design, require
from tablegen.verification.verilog.top_play import TopPlay
from tablegen.verification.verilog.turned_play import TurnedPlay

_SESSION_TICKS = 30_000  # of the program of a build, in a session that has its frame apart
_CAPTURED_TICK_BYTES = 17  # bytes of a captured tick
_SINE = "sine.mem"
_MAX_TABLE_WORDS = 1 << 16  # words of a table that the sequencer can address


@dataclass(frozen=True)
class VerilogTarget:
    """A simulator, and the placement of the sequencer; with ``separate_frame`` a long frame is played by itself.

    The sequencer of z has one placement.
    """

    simulator: Literal["icarus", "verilator"]
    placement: Placement
    separate_frame: bool = False
    ticks_of_z: int | None = None  # most ticks of the output z; None: as many as of x and y
    format_name: str = "verilog"

    def require(self) -> None:
        """Check that the simulator and cocotb are installed."""
        require(self.simulator)

    def refuse(self, folder: Path, stored: StoredBuild) -> None:
        """Check that the sequencer can play the tables; direct ones may be longer than its addresses.

        Raises
        ------
        NotABuild
            If a table is too long, Fourier words are to be rendered and both tables are direct, or both axes are to
            play by turns and cannot.
        """
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
        if placement.axis == "alternate":
            if placement.fourier:
                raise NotABuild(
                    f"{folder}: ALTERNATE renders no Fourier words; verify it without --fourier, or with --axis serial"
                )
            obstacle = not_by_turns(stored.program.x, stored.program.y)
            if obstacle:
                raise NotABuild(f"{folder}: ALTERNATE {obstacle[0]}: {obstacle[1]}; or verify it with --axis serial")

    def play(self, job: PlayJob) -> Outcome:
        """Play a session on the simulator, and a frame beside it where that takes too long; then z."""
        return self._with_z(job, self._played(job))

    def _played(self, job: PlayJob) -> Outcome:
        """Play the sequencer of x and y."""
        stored, work, name = job.stored, job.work, job.stored.manifest.name
        memories, missing = _memories(job.folder, work, stored, self.placement)
        present = {path.name for path in job.folder.glob("dac_*.v")}
        modules = sorted({*stored.runtime(".v"), *present})
        sources, absent = copies(job.folder, [*modules, f"{name}.vh"], work / "rtl")
        if not modules:
            absent = ["the build holds no dac_*.v"]
        if missing or absent:
            why = "simulation: " + some(missing + absent)
            return Outcome([Check("simulation", self.simulator, "nothing", failure=why)])
        assert memories is not None
        job.progress("playing the integer model")
        runs = self._runs(job, memories)
        runs[0].tops = [
            TopPlay.of(stored_content(stored), job.most_ticks, self.placement.axis, output)
            for output in played_outputs(stored.formats)
            if (job.folder / f"{name}_{output}.v").is_file()
        ]
        for run in runs:
            run.prepare(self.simulator, stored, sources[:-1], job.folder)
        job.progress(lambda: ", ".join(run.progress(self.simulator) for run in runs))
        try:
            statuses = worker.run_all(__name__, [(run.folder, run.job) for run in runs])
            captures = [make_capture(stored, run.session.script, read_capture(run.folder / CAPTURE)) for run in runs]
            job.progress("comparing")
            return self._outcome(job, runs, statuses, captures)
        except (SimulationFailed, OSError, ValueError) as error:
            ticks = sum(len(run.session.script.expected) for run in runs)
            return Outcome([Check("simulation", self.simulator, f"{ticks} ticks", failure=f"simulation: {error}")])

    def _with_z(self, job: PlayJob, outcome: Outcome) -> Outcome:
        """Play the top of the output z too, where the scan has one."""
        of_z = content_beside(stored_content(job.stored))
        if of_z is None:
            return outcome
        frame, line = of_z.program.schedule.frame_ticks, of_z.program.schedule.ticks
        ticks = min(frame + line, job.most_ticks if self.ticks_of_z is None else self.ticks_of_z)
        notes = list(outcome.notes)
        if ticks < frame:
            notes.append(f"{ticks} of the {frame} ticks of a frame of z were played; --ticks {frame} plays them all")
        job.progress(f"{self.simulator} plays {ticks} ticks of z")
        checks = TurnedPlay(of_z, ticks, ", z").checks(job.folder, job.work / "verilog_z", self.simulator)
        return replace(outcome, checks=outcome.checks + checks, notes=notes)

    def _runs(self, job: PlayJob, memories: Memories) -> "list[SimulatedRun]":
        """Return the session as it is placed, and a whole frame with multiplier blocks (twice as fast)."""
        program, seed = job.stored.program, job.seed
        placement = self.placement.playing(program)
        separate_frame = self.separate_frame and min(needed_ticks(program), job.most_ticks) > _SESSION_TICKS
        most = _SESSION_TICKS if separate_frame else job.most_ticks
        runs = [SimulatedRun(job.work, make_session(program, memories, most, seed, placement), placement, memories)]
        if separate_frame:
            (job.work / "frame").mkdir(exist_ok=True)
            blocks = Placement("blocks").playing(program)
            session = make_session(program, memories, job.most_ticks, seed, blocks, requests=False, wired=False)
            runs.append(SimulatedRun(job.work / "frame", session, blocks, memories))
        return runs

    def _outcome(
        self,
        job: PlayJob,
        runs: "list[SimulatedRun]",
        statuses: list[dict[str, Any]],
        captures: list[Capture],
    ) -> Outcome:
        stored, run, capture, status = job.stored, runs[0], captures[0], statuses[0]
        script, most_counted = run.session.script, (1 << COUNT_BITS) - 1
        words = read_capture(run.folder / WORDS)
        sent = {"x": words & np.uint64(0xFFFFFFFF), "y": words >> np.uint64(32)}
        counted = [int(count) for count in status["counts"]]
        counts = [min(count, most_counted) for count in script.all_counts]
        states = read_states([int(word) for word in read_capture(run.folder / STATES)])
        content = stored_content(stored)
        checks = [
            differing_check(
                "verilog header",
                "manifest, by the simulator",
                f"{len(expected_constants(content))} constants",
                different_constants(run.folder, content.name, expected_constants(content)),
            ),
            *check_codes(capture, stored, {axis: part.astype(np.int64) for axis, part in sent.items()}),
            *check_waveform(captures[-1], stored, job.limits),
            check_wires(capture, stored, read_wires(run.folder), run.session.wired_ticks),
            *check_outputs(read_outputs(run.folder)),
            check_no_faults(capture),
            check_faults(capture, counted, counts),
            check_states(script.states, states, most_counted),
            check_timing(capture, status),
        ]
        checks += [top.check(run.folder) for top in run.tops]
        if len(runs) > 1:
            checks.append(check_whole("frame", captures[1], ", multiplier blocks"))
        differences = [first_difference(one) for one in captures]
        programs = (stored.program.x, stored.program.y)
        whole = len(runs) > 1 and runs[1].session.whole_frame
        unplayed = unplayed_verilog(
            (name for name in stored.manifest.files if name.endswith(".v")),
            [one.placement for one in runs],
            programs,
            stored.program.schedule.pixel_table is not None,
            stored.z is not None,
        )
        tops = [*(f"{content.name}_{top.output}.v" for top in run.tops), f"{content.name}_z_top.v"]
        unplayed = [name for name in unplayed if name not in tops]
        return Outcome(checks, run.session, next(filter(None, differences), None), whole, unplayed=unplayed)


@dataclass
class SimulatedRun:
    """A session in a folder of its own."""

    folder: Path
    session: BuildSession
    placement: Placement
    memories: Memories
    tops: list[TopPlay] = field(default_factory=list)  # play beside the session
    job: dict[str, Any] = field(default_factory=dict)

    def prepare(self, simulator: str, stored: StoredBuild, sources: list[Path], build: Path) -> None:
        """Write the script and the bench, and say what is to be compiled."""
        script, folder = self.session.script, self.folder
        (folder / SCRIPT).write_text(script.text(), "ascii")
        shape = SequencerShape.of((stored.program.x, stored.program.y))
        bench = folder / f"{TOP}.v"
        write_boot_files(folder)
        index_bits, outputs = (shape.x_index_bits, shape.y_index_bits), [top.output for top in self.tops]
        bench.write_text(bench_text(stored_content(stored), index_bits, outputs), "ascii")
        beside = [path for top in self.tops for path in top.prepare(build, folder, folder / simulator)]
        harmonics = max(self.memories.x_harmonics, self.memories.y_harmonics)
        self.job = {
            "simulator": simulator,
            "sources": [str(path) for path in (*sources, STREAM_BENCH, OUTPUT_BENCH, *beside, bench)],
            "includes": [str(sources[0].parent)],
            "parameters": {
                **bench_parameters(SCRIPT, CAPTURE, self.session.wired_ticks > 0),
                "X_POWER_UP_CODE": script.power_up[0],
                "Y_POWER_UP_CODE": script.power_up[1],
                **self.placement.parameters(harmonics, f"../{_SINE}"),
            },
            "clocks": max([script.clocks, *(top.clocks for top in self.tops)]),
        }

    def progress(self, simulator: str) -> str:
        """Return the progress in words."""
        ticks = len(self.session.script.expected)
        try:
            ticks_played = (self.folder / CAPTURE).stat().st_size // _CAPTURED_TICK_BYTES
        except OSError:
            return f"compiling for {simulator}"
        return f"{simulator} has played {ticks_played} of {ticks} ticks"


def play_job(folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """Compile and play the script in ``folder``, in a process that can be ended; return the bench's counters."""
    sources, includes = ([Path(path) for path in job[key]] for key in ("sources", "includes"))
    design = Design(sources, TOP, job["parameters"], includes)
    compiled = compile_design(job["simulator"], design, folder / job["simulator"], cached=True)
    return run_bench(compiled, folder, job["clocks"])


def _memories(folder: Path, work: Path, stored: StoredBuild, placement: Placement) -> tuple[Memories | None, list[str]]:
    """Read the words of the memory files; return them, and what is wrong where they cannot be read."""
    name, program = stored.manifest.name, stored.program
    files = [("program", len(program_words(program.schedule, program.x, program.y)))]
    harmonics = []
    for (axis, content), played in zip(stored.axes, (program.x, program.y), strict=True):
        rendered = placement.renders(played)
        harmonics.append(content.fourier.harmonics if rendered else 0)
        files.append((f"{axis}_fourier", 2 * harmonics[-1] + 1) if rendered else (axis, len(played.words)))
    if program.schedule.pixel_table is not None:
        files.append(("pixels", 2 * program.schedule.pixels))
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
    if wrong:
        return None, wrong
    pixels = words[3] if len(words) > 3 else ()
    return Memories(words[0], words[1], words[2], harmonics[0], harmonics[1], pixels), wrong
