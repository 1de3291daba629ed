"""The sequencers behind a model of a device: tick by tick, or whole lines at once for virtual time."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import AxisProgram, ScanProgram
from tablegen.device.sequencer import Fault, Sequencer, Tick, can_keep
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.link.messages import DeviceState

MAX_REQUESTS = 8  # requests that a sequencer in C queues until its next tick


class Player(Protocol):
    """A sequencer as the link sees it; requests return False, and change nothing, where too many wait for a tick."""

    @property
    def swaps(self) -> int:
        """The number of programs that were swapped in since the start."""

    @property
    def line(self) -> int:
        """The line number within the frame."""

    @property
    def swapped_at(self) -> int:
        """The line of the old program at the last swap."""

    @property
    def state(self) -> DeviceState:
        """The state after the last tick."""

    @property
    def playing(self) -> ScanProgram | None:
        """The active program."""

    @property
    def faults(self) -> int:
        """The sticky faults as bits: 1 slew, 2 clamp, 4 overrun, 8 underrun."""

    @property
    def fault_counts(self) -> tuple[int, int, int, int]:
        """The counts of the faults, in the order of the bits."""

    @property
    def writable(self) -> bool:
        """True if no program waits to be swapped in, nor will."""

    @property
    def starts(self) -> bool:
        """True if a trigger waits for the next tick, and no park behind it; ``state`` knows nothing of it yet."""

    def has_room(self, requests: int) -> bool:
        """Return True if so many requests may follow before the next tick."""

    def commit(self, program: ScanProgram, mode: CommitMode = CommitMode.LINE) -> bool:
        """Commit a program, to be swapped in as its mode says, or on the next tick where no scan plays."""

    def withdraw(self) -> bool:
        """Withdraw a program that was committed and is not swapped in yet."""

    def arm(self, frames: int) -> bool:
        """Let the next trigger start so many frames; 0 is without end."""

    def trigger(self) -> bool:
        """Start at line 0."""

    def park(self) -> bool:
        """Park after the current tick; no frame follows."""

    def clear(self) -> bool:
        """Clear the faults."""

    def advance(self, ticks: int) -> None:
        """Play so many ticks."""

    def restart(self, program: ScanProgram | None = None) -> None:
        """Restart as at power-up, with this program in place of the one of the firmware."""


class _Queue:
    """The requests that wait for the next tick, as in the C runtime."""

    def __init__(self, boot: ScanProgram | None) -> None:
        self._boot = boot
        self._requests: list[Callable[[], None]] = []
        self._commits = 0
        self.swaps = self.swapped_at = 0
        self.starts = False  # a trigger waits, and no park behind it
        self.restart()

    def restart(self, program: ScanProgram | None = None) -> None:
        """Restart as at power-up: this program, or else the boot program, if there is one, waits for the first tick."""
        self._requests.clear()
        self._commits = self.swaps = self.swapped_at = 0
        self.starts = False
        self._power_up()
        first = program or self._boot
        if first is not None:
            self.commit(first)

    def _power_up(self) -> None:
        raise NotImplementedError

    def _take(self, program: ScanProgram, mode: CommitMode) -> None:
        raise NotImplementedError

    def commit(self, program: ScanProgram, mode: CommitMode = CommitMode.LINE) -> bool:
        """Commit a program, to be swapped in at the next start of a line, or of a frame as its mode says."""

        def act() -> None:
            self._commits -= 1
            self._take(program, mode)

        accepted = self._ask(act)
        self._commits += accepted
        return accepted

    def trigger(self) -> bool:
        """Start at line 0."""
        accepted = self._ask(self._trigger)
        self.starts = self.starts or accepted
        return accepted

    def park(self) -> bool:
        """Park after the current tick; no frame follows."""
        accepted = self._ask(self._park)
        self.starts = self.starts and not accepted
        return accepted

    def _trigger(self) -> None:
        raise NotImplementedError

    def _park(self) -> None:
        raise NotImplementedError

    def has_room(self, requests: int) -> bool:
        """Return True if so many requests may follow before the next tick."""
        return len(self._requests) + requests <= MAX_REQUESTS

    def _ask(self, act: Callable[[], None]) -> bool:
        if not self.has_room(1):
            return False
        self._requests.append(act)
        return True

    def _answer(self) -> None:
        self.starts = False
        while self._requests:
            self._requests.pop(0)()


class SequencerPlayer(_Queue):
    """A player of every tick of ``tablegen.device.sequencer``; ``on_tick`` gets generation, line and tick of each."""

    def __init__(
        self,
        boot: ScanProgram | None,
        codes: tuple[int, int] = (0, 0),
        on_tick: Callable[[int, int, Tick], None] | None = None,
    ) -> None:
        self._codes, self._on_tick = codes, on_tick
        self._last: Tick | None = None
        super().__init__(boot)

    def _power_up(self) -> None:
        self.sequencer = Sequencer(None, codes=self._codes)
        self._last = None

    def _take(self, program: ScanProgram, mode: CommitMode) -> None:
        self.sequencer.commit(program, mode)

    @property
    def line(self) -> int:
        """The line number within the frame."""
        return self.sequencer.line

    @property
    def state(self) -> DeviceState:
        """The state after the last tick."""
        if self.swaps == 0:
            return DeviceState.NO_PROGRAM
        assert self._last is not None
        return (
            DeviceState.PLAYING
            if self._last.playing
            else DeviceState.PARKED
            if self._last.parked
            else DeviceState.PARKING
        )

    @property
    def playing(self) -> ScanProgram | None:
        """The active program."""
        return self.sequencer.playing

    @property
    def faults(self) -> int:
        """The faults slew and clamp; the others need a clock."""
        return int(self.sequencer.faults)

    @property
    def fault_counts(self) -> tuple[int, int, int, int]:
        """The counts of the faults, in the order of the bits."""
        counts = self.sequencer.fault_counts
        return counts[Fault.SLEW], counts[Fault.CLAMP], 0, 0

    @property
    def writable(self) -> bool:
        """True if no program waits to be swapped in, nor will."""
        return self._commits == 0 and self.sequencer.idle is None

    def withdraw(self) -> bool:
        """Withdraw the program that waits."""
        return self._ask(self.sequencer.withdraw)

    def arm(self, frames: int) -> bool:
        """Let the next trigger start so many frames; 0 is without end."""
        return self._ask(lambda: self.sequencer.arm(frames))

    def _trigger(self) -> None:
        self.sequencer.trigger()

    def _park(self) -> None:
        self.sequencer.park()

    def clear(self) -> bool:
        """Clear the faults."""
        return self._ask(self.sequencer.clear_faults)

    def advance(self, ticks: int) -> None:
        """Play so many ticks."""
        for _ in range(ticks):
            self._answer()
            before = self.sequencer.line
            # A swap and a trigger begin at line 0; the line of a tick is the one before the tick is over.
            keeps = self.sequencer.keeps_frame()
            tick = self._last = self.sequencer.step()
            begins = tick.swapped and tick.playing and not keeps
            if tick.swapped:
                self.swaps += 1
                self.swapped_at = before
            if self._on_tick is not None:
                self._on_tick(self.swaps, 0 if begins else before, tick)


class LinePlayer(_Queue):
    """A player of lines, frames, swaps and requests on the ticks of ``SequencerPlayer``, without codes and faults.

    The duration of parking follows from the code at which it begins, exactly where no swap was being caught up with
    and no axis is shaped.
    """

    def __init__(self, boot: ScanProgram | None, codes: tuple[int, int] = (0, 0)) -> None:
        self._codes = codes
        super().__init__(boot)

    def _power_up(self) -> None:
        self.playing: ScanProgram | None = None
        self._waits: ScanProgram | None = None
        self._mode = CommitMode.LINE
        self._running = self._armed = self._endless = False
        self._armed_frames = self._frames_left = 0
        self._tick = self.line = 0
        self._parks_for = 0  # ticks
        self._played = False  # the last tick
        self.faults = 0
        self.fault_counts = 0, 0, 0, 0

    def _take(self, program: ScanProgram, mode: CommitMode) -> None:
        self._waits, self._mode = program, mode

    @property
    def state(self) -> DeviceState:
        """The state after the last tick."""
        if self.swaps == 0:
            return DeviceState.NO_PROGRAM
        return DeviceState.PLAYING if self._played else DeviceState.PARKING if self._parks_for else DeviceState.PARKED

    @property
    def writable(self) -> bool:
        """True if no program waits to be swapped in, nor will."""
        return self._commits == 0 and self._waits is None

    def withdraw(self) -> bool:
        """Withdraw the program that waits."""

        def act() -> None:
            self._waits = None
            if self.playing is None:
                self._running = False

        return self._ask(act)

    def arm(self, frames: int) -> bool:
        """Let the next trigger start so many frames; 0 is without end."""

        def act() -> None:
            self._armed, self._armed_frames = True, frames

        return self._ask(act)

    def _trigger(self) -> None:
        if self._armed and not self._running and (self.playing or self._waits) is not None:
            self._armed, self._running = False, True
            self._endless, self._frames_left = self._armed_frames == 0, self._armed_frames
            self._tick = self.line = 0

    def _park(self) -> None:
        if self._running and self.playing is not None:
            self._parks_for = self._way_to_park(self.playing)
        self._armed = self._running = False

    def clear(self) -> bool:
        """Clear the faults, of which there are none."""
        return self._ask(lambda: None)

    def advance(self, ticks: int) -> None:
        """Play so many ticks, a line at a time."""
        while ticks:
            self._answer()
            if self._waits is not None and (not self._running or self._at_swap()):
                self._swap(self._waits)
            if self._running and self.playing is not None:
                ticks -= self._play(self.playing, ticks)
            else:
                self._played = False
                rest = min(ticks, self._parks_for) or ticks
                self._parks_for = max(self._parks_for - rest, 0)
                ticks -= rest

    def _at_swap(self) -> bool:
        return self._tick == 0 and (self._mode is not CommitMode.FRAME or self.line == 0)

    def _swap(self, program: ScanProgram) -> None:
        old, self.playing, self._waits = self.playing, program, None
        self.swaps += 1
        self.swapped_at = self.line
        if self._running:
            keeps = self._mode is CommitMode.KEEP and old is not None and can_keep(old, program)
            self.line = self.line if keeps else 0
        else:
            from_codes = self._codes if old is None else (old.x.output.park_code, old.y.output.park_code)
            self._parks_for = max(self._parks_for, _ramp(program, from_codes))

    def _play(self, program: ScanProgram, most: int) -> int:
        """Play at most so many ticks of the line, and return how many."""
        ticks = min(most, program.schedule.ticks - self._tick)
        self._played = True
        self._tick += ticks
        if self._tick == program.schedule.ticks:
            self._tick = 0
            self.line += 1
            if self.line == program.schedule.lines:
                self._end_frame(program)
        return ticks

    def _end_frame(self, program: ScanProgram) -> None:
        self.line = 0
        if self._endless:
            return
        self._frames_left -= 1
        if self._frames_left == 0:
            self._running = False
            self._parks_for = self._way_to_park(program)

    def _way_to_park(self, program: ScanProgram) -> int:
        """Return the ticks of parking from the last tick that was played."""
        schedule = program.schedule
        k = (self.line * schedule.ticks + self._tick - 1) % schedule.frame_ticks
        return _ramp(program, (_code(program.x, k), _code(program.y, k)))


def _code(axis: AxisProgram, k: int) -> int:
    """Return the code of a tick of the frame."""
    if isinstance(axis, FrameProgram):
        line, tick = divmod(k, axis.fast.phase.ticks)
        return int(axis.output.clamp(axis.at(line, np.array([tick])))[0])
    return int(axis.output.code(axis.samples(np.array([k % axis.ticks])))[0])


def _ramp(program: ScanProgram, codes: tuple[int, int]) -> int:
    """Return the ticks of the ramp from these codes to the park codes of both axes."""
    return max(
        -(-abs(axis.output.park_code - code) // axis.output.max_step)
        for axis, code in zip((program.x, program.y), codes, strict=True)
    )
