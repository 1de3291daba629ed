"""The integer model of the sequencer: the specification that C and Verilog equal on every tick.

``Sequencer`` is a device: two banks, a state, and a tick.
What happens on which tick is stated in ``docs/sequencer.md``; the arithmetic stands in ``tablegen.fixedpoint``.
"""

from dataclasses import dataclass, field
from enum import Enum, IntFlag

import numpy as np

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import AxisProgram, ScanProgram
from tablegen.device.played_lines import LineTicks, PlayedLines
from tablegen.device.schedule import Schedule
from tablegen.device.slew import limit_slew
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.numerics.arrays import Bools, Ints

_MOST_TICKS = 1 << 14  # ticks of lines that are computed at a time, so that they fit the cache


class SequencerState(Enum):
    """The states of the sequencer."""

    PARKED = "parked"
    RUNNING = "running"
    PARKING = "parking"


class Fault(IntFlag):
    """Sticky faults; cleared only on request."""

    NONE = 0
    SLEW = 1  # the slew guard limited a step after the output had reached the waveform
    CLAMP = 2  # a code was clamped to [code_min, code_max]


@dataclass(frozen=True, slots=True)
class Tick:
    """The outputs of the sequencer on one tick: two codes, markers, what it did, and the faults so far."""

    x: int
    y: int
    line: bool = False
    frame: bool = False
    pixel: bool = False
    backward: bool = False
    valid: bool = False
    swapped: bool = False
    playing: bool = False
    parked: bool = False
    faults: Fault = Fault.NONE


@dataclass
class Sequencer:
    """A device, tick by tick.

    ``commit`` fills the idle bank; it is swapped in at the next line start, with ``CommitMode.FRAME`` at the next frame
    start, or on the next tick while no line plays.
    ``arm`` and ``trigger`` start ``frames`` frames (0: without end) from line 0; ``park`` ends them at once. Parked
    and parking outputs follow the park code under the slew guard of the bank that plays. A device without a program
    (``playing`` is None) holds its ``codes``. It ignores triggers, unless its first program is committed: then the scan
    starts when that program is swapped in.
    """

    playing: ScanProgram | None
    codes: tuple[int, int] = (0, 0)  # at the converters now; with a program, its park codes
    idle: ScanProgram | None = None
    mode: CommitMode = CommitMode.LINE  # of the last commit
    running: bool = False
    parked: bool = False
    armed: bool = False
    faults: Fault = Fault.NONE
    fault_counts: dict[Fault, int] = field(default_factory=lambda: {Fault.SLEW: 0, Fault.CLAMP: 0})
    tick: int = 0
    line: int = 0
    frames_left: int = 0
    settle_left: int = 0
    catching_up: bool = False

    def __post_init__(self) -> None:
        self._endless = True
        self._armed_frames = 0
        if self.playing is not None:
            self.codes = self.playing.x.output.park_code, self.playing.y.output.park_code
            self.parked = True
        self._lines: PlayedLines | None = None
        # Lines that were computed ahead, where their codes are clamped, and the next tick in them.
        self._ticks: LineTicks | None = None
        self._clamped: Bools = np.zeros(0, dtype=np.bool_)
        self._at = 0

    @property
    def state(self) -> SequencerState:
        """The state after the last tick and the requests since."""
        return (
            SequencerState.RUNNING if self.running else SequencerState.PARKED if self.parked else SequencerState.PARKING
        )

    def commit(self, program: ScanProgram, mode: CommitMode = CommitMode.LINE) -> None:
        """Put a complete and checked program into the idle bank, to be swapped in as the mode says."""
        self.idle, self.mode = program, mode

    def withdraw(self) -> None:
        """Discard a committed program that was not swapped in yet, and the scan of it if it is the first one."""
        self.idle = None
        if self.playing is None:
            self.running = False

    def arm(self, frames: int = 0) -> None:
        """Let the next trigger start that many frames; 0 is without end."""
        self.armed = True
        self._armed_frames = frames  # a scan that plays keeps its own count

    def trigger(self) -> bool:
        """Start at line 0 on the next tick; ignored unless armed, not running, and with a program to play.

        A committed program counts: the next tick swaps it in. The codes need not have parked: in a pipeline that is not
        known yet, and the slew guard acts anyway.
        """
        program = self.idle if self.playing is None else self.playing
        if not self.armed or self.running or program is None:
            return False
        self.armed = self.parked = False
        self._endless = self._armed_frames == 0
        self.frames_left = self._armed_frames
        self.running = True
        self._begin(program)
        return True

    def park(self) -> None:
        """Ramp to the park codes from the next tick on, and hold them."""
        self.armed = self.running = False

    def reset(self) -> None:
        """Reset to power-up, except program and codes: they ramp to the park codes, since a reset must not jump."""
        self.park()
        self.parked = False
        self.withdraw()
        self.clear_faults()

    def clear_faults(self) -> None:
        """Clear sticky faults and their counts."""
        self.faults = Fault.NONE
        self.fault_counts = dict.fromkeys(self.fault_counts, 0)

    def step(self) -> Tick:
        """Play one tick and return the outputs."""
        swapped = False
        if self.idle is not None and (not self.running or self._at_swap()):
            continues = self.keeps_frame()
            self.playing, self.idle = self.idle, None
            swapped = True
            if self.running:
                self._begin(self.playing, self.line if continues else 0)
        if not self.running or self.playing is None:
            return self._rest(swapped)

        line, k = self._next_lines(self.playing.schedule), self._at
        reached = self._approach(self.playing, int(line.x[k]), int(line.y[k]))
        if self._clamped[k]:
            self._fault(Fault.CLAMP)
        if reached:
            self.catching_up = False
        elif not self.catching_up:
            self._fault(Fault.SLEW)
        out = Tick(
            *self.codes,
            line=bool(line.line[k]),
            frame=bool(line.frame[k]),
            pixel=bool(line.pixel[k]),
            backward=bool(line.backward[k]),
            valid=bool(line.valid[k]) and reached and self.settle_left == 0 and not self.faults,
            swapped=swapped,
            playing=True,
            faults=self.faults,
        )
        self._advance(self.playing.schedule)
        return out

    def ahead(self, most: int) -> tuple[LineTicks, Ints] | None:
        """Play the next ticks of a frame at once, at most ``most``, with the results of ``step`` for each of them.

        Returns them with their faults so far, shape (ticks,); None where nothing plays, or another program begins.
        """
        program = self.playing
        if not self.running or program is None or (self.idle is not None and self._at_swap()):
            return None
        lines, period = self._next_lines(program.schedule), program.schedule.ticks
        # It is swapped in where the next line begins; lines are computed ahead up to the end of a frame at most.
        if self.idle is not None and self.mode != CommitMode.FRAME:
            most = min(most, period - self.tick)
        part = slice(self._at, min(self._at + most, len(lines.x)))
        x = limit_slew(lines.x[part], self.codes[0], program.x.output.max_step)
        y = limit_slew(lines.y[part], self.codes[1], program.y.output.max_step)
        reached = (x == lines.x[part]) & (y == lines.y[part])
        slewed = ~reached
        if self.catching_up:  # no fault until the output has reached the waveform
            slewed &= np.logical_or.accumulate(reached)
            self.catching_up = not reached.any()
        faults = np.full(len(x), int(self.faults), dtype=np.int64)
        for fault, occurs in ((Fault.SLEW, slewed), (Fault.CLAMP, self._clamped[part])):
            if count := int(np.count_nonzero(occurs)):
                faults |= np.logical_or.accumulate(occurs) * int(fault)
                self.fault_counts[fault] += count
        valid = lines.valid[part] & reached & (faults == 0)
        valid[: max(self.settle_left * period - self.tick, 0)] = False
        markers = lines.line[part], lines.frame[part], lines.pixel[part], lines.backward[part]
        self.codes, self.faults = (int(x[-1]), int(y[-1])), Fault(int(faults[-1]))
        self._advance(program.schedule, len(x))
        return LineTicks(x, y, *markers, valid), faults

    def _next_lines(self, schedule: Schedule) -> LineTicks:
        """Return the lines that are played now, or compute the next ones after their end: first one, then ever more."""
        assert self._lines is not None
        if self._ticks is None or self._at == len(self._ticks.x):
            before = 0 if self._ticks is None else len(self._ticks.x) // schedule.ticks
            count = max(min(2 * before, _MOST_TICKS // schedule.ticks, schedule.lines - self.line), 1)
            unclamped = self._lines.unclamped(self.line, count)
            self._ticks, self._at = self._lines.ticks(self.line, unclamped), 0
            self._clamped = (self._ticks.x != unclamped[0]) | (self._ticks.y != unclamped[1])
        return self._ticks

    def keeps_frame(self) -> bool:
        """Return True if the committed program continues the frame of the active one."""
        next_program, playing = self.idle, self.playing
        if self.mode != CommitMode.KEEP or next_program is None or playing is None:
            return False
        return can_keep(playing, next_program)

    def _at_swap(self) -> bool:
        """Return True if the next tick of a running scan is one on which the mode of the commit swaps."""
        return self.tick == 0 and (self.mode != CommitMode.FRAME or self.line == 0)

    def _begin(self, program: ScanProgram, line: int = 0) -> None:
        """Start a line of a program, unsettled, and away from where the output is."""
        self.tick, self.line = 0, line
        self.settle_left = program.schedule.settle_lines
        self.catching_up = True
        self._lines, self._ticks = PlayedLines(program), None

    def _advance(self, schedule: Schedule, ticks: int = 1) -> None:
        """Advance by ``ticks`` ticks of a frame."""
        self._at += ticks
        lines, self.tick = divmod(self.tick + ticks, schedule.ticks)
        self.settle_left = max(self.settle_left - lines, 0)
        self.line += lines
        if self.line < schedule.lines:
            return
        self.line = 0
        if not self._endless:
            self.frames_left -= 1
            if self.frames_left == 0:
                self.running = False

    def _rest(self, swapped: bool) -> Tick:
        program = self.playing
        if program is not None:
            self.parked = self._approach(program, program.x.output.park_code, program.y.output.park_code)
        else:
            self.parked = True
        return Tick(*self.codes, swapped=swapped, parked=self.parked, faults=self.faults)

    def _approach(self, program: ScanProgram, x: int, y: int) -> bool:
        """Move both codes towards their targets, by at most max_step each; return True if both arrived."""
        x_step, y_step = program.x.output.max_step, program.y.output.max_step
        x_now, y_now = self.codes
        self.codes = (
            x_now + min(max(x - x_now, -x_step), x_step),
            y_now + min(max(y - y_now, -y_step), y_step),
        )
        return self.codes == (x, y)

    def _fault(self, fault: Fault) -> None:
        self.faults |= fault
        self.fault_counts[fault] += 1


def can_keep(playing: ScanProgram, program: ScanProgram) -> bool:
    """Return True if ``program`` can go on within the frame of ``playing``: y has the same place in both."""
    old, new = playing.schedule, program.schedule
    return (old.ticks, old.lines) == (new.ticks, new.lines) and _place_of(playing.y) == _place_of(program.y)


def _place_of(y: AxisProgram) -> tuple[int, int] | None:
    """Return the advances in which y counts its place in a frame; None with a slow part, whose place is the line."""
    return None if isinstance(y, FrameProgram) else (y.hold, y.phase.ticks)
