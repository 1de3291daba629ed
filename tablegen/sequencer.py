"""The integer model of the sequencer: the specification that C and Verilog equal on every tick.

``Sequencer`` is a device: two banks, a state, and a tick. ``play_line`` is the undisturbed line of a program.
What happens on which tick is stated in ``docs/sequencer.md``; the arithmetic stands in ``tablegen.fixedpoint``.
"""

from dataclasses import dataclass, field
from enum import Enum, IntFlag

import numpy as np

from tablegen.fixedpoint.program import Program
from tablegen.numerics.arrays import Bools, Ints
from tablegen.plan import Plan
from tablegen.schedule import Schedule, Window


class State(Enum):
    """What the sequencer is doing."""

    PARKED = "parked"
    RUNNING = "running"
    PARKING = "parking"


class Fault(IntFlag):
    """Sticky faults; cleared only on request."""

    NONE = 0
    SLEW = 1  # the slew guard held a code back although the output had caught up with its program
    CLAMP = 2  # a code had to be held inside [code_min, code_max]


@dataclass(frozen=True, eq=False)
class DualProgram:
    """What a bank holds: both axes and the schedule they share."""

    x: Program
    y: Program
    schedule: Schedule

    @classmethod
    def of(cls, plan: Plan) -> "DualProgram":
        """The program of a plan."""
        return cls(plan.x.program, plan.y.program, plan.schedule)


@dataclass(frozen=True, slots=True)
class Tick:
    """What leaves the sequencer on one tick: two codes, markers, and whether a bank was taken."""

    x: int
    y: int
    line: bool = False
    frame: bool = False
    pixel: bool = False
    backward: bool = False
    valid: bool = False
    swapped: bool = False


@dataclass(frozen=True, eq=False)
class LineTicks:
    """One line as arrays of shape (ticks,): codes of both axes and the markers of every tick."""

    x: Ints
    y: Ints
    line: Bools
    frame: Bools
    pixel: Bools
    backward: Bools
    valid: Bools


def pixel_starts(window: Window, pixels: int) -> Ints:
    """Ticks at which pixels start: i-th tick of the window where floor(i pixels / count) exceeds the one before.

    A device adds ``pixels`` to an accumulator and takes off ``count`` when it can: no multiplier.
    """
    i = np.arange(window.count, dtype=np.int64)
    pixel = i * pixels // max(window.count, 1)
    return window.first + i[np.diff(pixel, prepend=-1) > 0]


def play_line(program: DualProgram, line: int, settled: bool = True) -> LineTicks:
    """Line ``line`` of a frame in steady state: the slew guard untouched, ``valid`` as after settling."""
    schedule = program.schedule
    k = np.arange(schedule.ticks, dtype=np.int64)
    pixel = np.zeros(schedule.ticks, dtype=np.bool_)
    inside = np.zeros(schedule.ticks, dtype=np.bool_)
    for window in (schedule.forward, schedule.backward):
        if window.count:
            pixel[pixel_starts(window, schedule.pixels)] = True
            inside[window.first : window.stop] = True
    images = line in schedule.up or line in schedule.down
    return LineTicks(
        x=program.x.codes(k),
        y=program.y.codes(line * schedule.ticks + k),
        line=k == 0,
        frame=(k == 0) & (line == 0),
        pixel=pixel,
        backward=k >= schedule.turn_tick,
        valid=inside & images & settled,
    )


@dataclass
class Sequencer:
    """A device, tick by tick.

    ``commit`` fills the idle bank; it is taken at the next line start, or on the next tick while no line plays.
    ``arm`` and ``trigger`` start ``frames`` frames (0: without end) from line 0; ``park`` ends them at once. Parked
    and parking outputs follow the park code under the slew guard of the bank that plays.
    """

    playing: DualProgram
    idle: DualProgram | None = None
    state: State = State.PARKED
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
        self._x, self._y = self.playing.x.output.park_code, self.playing.y.output.park_code
        self._line_ticks: LineTicks | None = None
        self._clamped: Bools = np.zeros(0, dtype=np.bool_)

    @property
    def codes(self) -> tuple[int, int]:
        """The codes at the converters now."""
        return self._x, self._y

    def commit(self, program: DualProgram) -> None:
        """Put a program into the idle bank, complete and checked, to be taken at the next line start."""
        self.idle = program

    def arm(self, frames: int = 0) -> None:
        """Let the next trigger start so many frames; 0 is without end."""
        self.armed = True
        self._armed_frames = frames  # a scan that plays keeps its own count

    def trigger(self) -> bool:
        """Start at line 0 on the next tick; ignored unless armed and parked. Tells whether it was taken."""
        if not self.armed or self.state is not State.PARKED:
            return False
        self.armed = False
        self._endless = self._armed_frames == 0
        self.frames_left = self._armed_frames
        self.state = State.RUNNING
        self._begin()
        return True

    def park(self) -> None:
        """Ramp to the park codes from the next tick on, and hold them."""
        self.armed = False
        if self.state is State.RUNNING:
            self.state = State.PARKING

    def reset(self) -> None:
        """As at power-up, but for the codes: they ramp to the park codes, since a reset must not be a jump."""
        self.park()
        self.idle = None
        self.state = State.PARKING
        self.clear_faults()

    def clear_faults(self) -> None:
        """Forget sticky faults and their counts."""
        self.faults = Fault.NONE
        self.fault_counts = dict.fromkeys(self.fault_counts, 0)

    def step(self) -> Tick:
        """Play one tick and return what leaves."""
        swapped = False
        if self.idle is not None and (self.state is not State.RUNNING or self.tick == 0):
            self.playing, self.idle = self.idle, None
            swapped = True
            if self.state is State.RUNNING:
                self._begin()
        if self.state is not State.RUNNING:
            return self._rest(swapped)

        if self.tick == 0:
            self._line_ticks = play_line(self.playing, self.line)
            self._clamped = self._outside(self.line)
        line = self._line_ticks
        assert line is not None
        k = self.tick
        reached = self._approach(int(line.x[k]), int(line.y[k]))
        if self._clamped[k]:
            self._fault(Fault.CLAMP)
        if reached:
            self.catching_up = False
        elif not self.catching_up:
            self._fault(Fault.SLEW)
        out = Tick(
            x=self._x,
            y=self._y,
            line=bool(line.line[k]),
            frame=bool(line.frame[k]),
            pixel=bool(line.pixel[k]),
            backward=bool(line.backward[k]),
            valid=bool(line.valid[k]) and reached and self.settle_left == 0,
            swapped=swapped,
        )
        self._advance()
        return out

    def _begin(self) -> None:
        """A program starts at its own line 0, unsettled, and away from where the output is."""
        self.tick = self.line = 0
        self.settle_left = self.playing.schedule.settle_lines
        self.catching_up = True

    def _advance(self) -> None:
        schedule = self.playing.schedule
        self.tick += 1
        if self.tick < schedule.ticks:
            return
        self.tick = 0
        self.settle_left = max(self.settle_left - 1, 0)
        self.line += 1
        if self.line < schedule.lines:
            return
        self.line = 0
        if not self._endless:
            self.frames_left -= 1
            if self.frames_left == 0:
                self.state = State.PARKING

    def _rest(self, swapped: bool) -> Tick:
        reached = self._approach(self.playing.x.output.park_code, self.playing.y.output.park_code)
        if reached:
            self.state = State.PARKED
        return Tick(x=self._x, y=self._y, swapped=swapped)

    def _approach(self, x: int, y: int) -> bool:
        """Move both codes towards their targets, by at most max_step each; whether both arrived."""
        x_step, y_step = self.playing.x.output.max_step, self.playing.y.output.max_step
        self._x += min(max(x - self._x, -x_step), x_step)
        self._y += min(max(y - self._y, -y_step), y_step)
        return (self._x, self._y) == (x, y)

    def _outside(self, line: int) -> Bools:
        """Ticks of a line on which the clamp changes a code of either axis."""
        schedule, out = self.playing.schedule, np.zeros(self.playing.schedule.ticks, dtype=np.bool_)
        k = np.arange(schedule.ticks, dtype=np.int64)
        for program, at in ((self.playing.x, k), (self.playing.y, line * schedule.ticks + k)):
            code = program.output.unclamped(program.samples(at))
            out |= (code < program.output.code_min) | (code > program.output.code_max)
        return out

    def _fault(self, fault: Fault) -> None:
        self.faults |= fault
        self.fault_counts[fault] += 1
