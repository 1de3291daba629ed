"""Scripts for a sequencer with SLOW_PART: programs with a slow part, and when it takes a commit or a trigger."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from building import REPOSITORY
from frame_programs import common_knots, scan_program, shaped_scan
from numpy.random import Generator
from programs import random_schedule
from replacing import replace

from tablegen.base.resources import verilog_runtime
from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import AxisProgram, ScanProgram
from tablegen.device.registers import program_words
from tablegen.fixedpoint.frame_program import FrameProgram, Knots
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import PROGRAM, X_TABLE, Y_TABLE, Script

SLOW_FOLDER = REPOSITORY / "firmware_templates" / "verilog" / "slow"
SLOW_INDEX_BITS = 7
SLOW_PART: dict[str, int | str] = {"SLOW_PART": 1, "LOW_AREA": 1, "SLOW_INDEX_BITS": SLOW_INDEX_BITS}
X_PARTS, Y_PARTS = 5, 6
SECOND, SLOW, GAINS, RATIOS = (part << 14 for part in range(4))
DRAIN = 200


def slow_sources() -> list[Path]:
    """The modules of a sequencer that has the slow part."""
    return [*verilog_runtime(), *sorted(SLOW_FOLDER.glob("*.v"))]


def slow_pace(shape: SequencerShape, shaping: int = 0) -> int:
    """The fewest clocks from tick to tick."""
    return (93 if 3 in (shape.x_interpolated, shape.y_interpolated) else 44) + (2 if shaping else 0)


def line_clocks(shape: SequencerShape) -> int:
    """No line takes more clocks to be worked out, while no tick comes."""
    longest = (shape.x_index_bits, shape.y_index_bits)
    return sum(17 + 2 * (143 + SLOW_INDEX_BITS) + 36 + 2 * (126 + 1) + 11 * (1 << bits) for bits in longest) + 4


def least_ticks(shape: SequencerShape, pace: int) -> int:
    """The ticks of the shortest line that is always ready in time; two clocks of each tick are not the engine's."""
    return -(-line_clocks(shape) // (pace - 2)) + 2


@dataclass
class SlowScript(Script):
    """A script of programs with a slow part, on both axes, shaped up to the order ``shaping``."""

    drain: int = DRAIN
    shape: SequencerShape = field(default_factory=lambda: SequencerShape(16, 3, 4, 16, 3, 4, 16))
    shaping: int = 0
    played: list[ScanProgram] = field(default_factory=list)  # one a swap

    def _swapped(self) -> None:
        assert self.model.playing is not None
        self.played.append(self.model.playing)

    @property
    def pace(self) -> int:
        """The fewest clocks from tick to tick."""
        return slow_pace(self.shape, self.shaping)

    @property
    def endless(self) -> bool:
        """True if the scan that plays has no end."""
        return self.model._endless

    def put(self, program: ScanProgram) -> None:
        """Write a whole program."""
        self.wait_writable()
        assert self.writable, "a program waits to be taken"
        self.write(PROGRAM, program_words(program.schedule, program.x, program.y))
        for axis, table, parts in ((program.x, X_TABLE, X_PARTS), (program.y, Y_TABLE, Y_PARTS)):
            assert isinstance(axis, FrameProgram)
            self.write(table, axis.fast.words)
            self.write(parts, axis.second, SECOND)
            self.write(parts, axis.slow.words, SLOW)
            self.write(parts, axis.gains.words, GAINS)
            self.write(parts, axis.ratios.words, RATIOS)

    def swap(self, program: ScanProgram, mode: CommitMode = CommitMode.LINE) -> None:
        """Commit the program that was put: a scan plays on to the end of the next line, the one that works it out.

        With the mode ``FRAME`` that is the last line of a frame: not the one of the commit, nor one before.
        """
        playing = self.model.playing
        if not self.model.running or playing is None:
            self.commit_at_rest(program, mode)
            return
        # As the clock of the commit passes, so does a tick of it.
        self.wait(1 if self._until == 0 else 0)
        ticks = playing.schedule.ticks
        left = self._until - 1 + (ticks - self.model.tick) % ticks * self._period
        self.request("commit", program=program, commit_clocks=left + 2, mode=mode)  # type: ignore[arg-type]

    def commit_at_rest(self, program: ScanProgram, mode: CommitMode = CommitMode.LINE) -> None:
        """Commit while nothing plays, and wait for its first line before the ticks go on."""
        period = self._period
        self.come_to_rest()
        self.request("commit", program=program, mode=mode)  # type: ignore[arg-type]
        self.wait(line_clocks(self.shape) + 4)
        self.tick_every(period)

    def forget_commit(self) -> None:
        """Leave out of the model what was committed: when the device takes it is what a test looks for."""
        self._commits = None

    def park(self) -> None:
        """Park, and let pass what a device needs until it is ready for the next trigger, or for a commit that waits."""
        period = self._period
        self.request("park")
        self.come_to_rest()
        self.wait(line_clocks(self.shape))
        if self._commits is not None:
            self._commits_at = self.clocks + 1
            self.wait(2)
        self.tick_every(period)

    def start(self, *names: str, frames: int = 0) -> None:
        """Trigger a scan once its line is ready."""
        period = self._period
        self.come_to_rest()
        self.wait(line_clocks(self.shape))
        self.request("arm", "trigger", *names, frames=frames)
        self.tick_every(period)


def random_scan(
    rng: Generator, shape: SequencerShape, ticks: int, lines: int, kind: str, shaping: int = 0
) -> ScanProgram:
    """A random program with a slow part on both axes, of a line of so many ticks, shaped up to an order."""
    program = scan_program(rng, shape, random_schedule(rng, ticks, lines), kind=kind)
    program = common_knots(rng, program) if kind == "wild" else _tame_ratios(program)
    return shaped_scan(rng, program, shaping) if shaping else program


def straight(program: ScanProgram) -> ScanProgram:
    """The program whose x plays its fast table alone, as one without a slow part."""
    assert isinstance(program.x, FrameProgram)
    return replace(program, x=FrameProgram.straight(program.x.fast, program.schedule.lines))


def slow_play(rng: Generator, script: SlowScript, samples: int, most_lines: int) -> None:
    """Random programs, each of them played for a while, with whatever a host may ask meanwhile."""
    pace = script.pace
    least = least_ticks(script.shape, pace)
    script.tick_every(pace)
    while len(script.expected) < samples:
        ticks, lines = least + int(rng.integers(0, 9)), int(rng.integers(1, most_lines + 1))
        program = random_scan(rng, script.shape, ticks, lines, str(rng.choice(["smooth", "wild"])), script.shaping)
        script.put(program)
        script.swap(program)
        script.wait_ticks(3 * (least + 9) if script.model.running else 2)
        for _ in range(int(rng.integers(1, 4))):
            if not script.model.running:
                script.start(frames=int(rng.integers(0, 3)))
            script.wait_ticks(int(rng.integers(1, 3 * ticks)))
            if rng.random() < 0.3:
                script.request("clear_faults")
            if rng.random() < 0.2:
                script.request("arm", "trigger")  # armed for later, or where a scan has ended
            if rng.random() < 0.3:
                script.park()
            if script.model.running and not script.endless:
                script.wait_ticks(2 * program.schedule.frame_ticks)


def slow_modes(rng: Generator, script: SlowScript, swaps: int) -> None:
    """Commits of every mode at any tick of a scan that seldom parks; most programs have the frame of the last one."""
    pace = script.pace
    least = least_ticks(script.shape, pace)
    script.tick_every(pace)
    size = least + 2, 3
    for _ in range(swaps):
        if rng.random() < 0.35:
            size = least + int(rng.integers(0, 9)), int(rng.integers(1, 6))
        program = random_scan(rng, script.shape, *size, str(rng.choice(["smooth", "wild"])), script.shaping)
        script.put(program)
        if script.model.running:
            script.wait_ticks(int(rng.integers(1, size[0])))
        script.swap(program, CommitMode(int(rng.choice([0, 1, 1, 2]))))
        if script.model.running and rng.random() < 0.15:
            script.wait_ticks(int(rng.integers(1, 2 * size[0])))
            script.park()
        if not script.model.running:
            script.wait_ticks(2)
            script.start()
        while script.waiting:
            script.wait_ticks(1)
        script.wait_ticks(int(rng.integers(1, 2 * size[0])))


def _tame_ratios(program: ScanProgram) -> ScanProgram:
    """The program with ratios at the lines of its gains, within an eighth of their range."""

    def axis(each: AxisProgram) -> AxisProgram:
        assert isinstance(each, FrameProgram)
        words = np.resize(each.ratios.words, len(each.gains.words))
        return replace(each, ratios=Knots(words, each.gains.spacing))

    return replace(program, x=axis(program.x), y=axis(program.y))
