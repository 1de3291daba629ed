"""The modes of a commit: the model against a direct reading of the specification, and what each mode promises."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from programs import random_dual
from replacing import replace

from tablegen.device import sequencer as sequencer_module
from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import DualProgram
from tablegen.device.played_lines import PlayedLines, play_line
from tablegen.device.sequencer import Fault, Sequencer, Tick, can_keep
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.shaping import Shaping
from tablegen.verification.play.sequencer_shape import SequencerShape

SHAPE = SequencerShape(16, 1, 4, 16, 1, 3, 16)
TICKS, LINES = 12, 4
REQUESTS = ("line", "keep", "frame", "withdraw", "start", "park", "reset", "clear_faults")


def stepped(program: DualProgram) -> DualProgram:
    """The program with a y that steps once a line."""
    schedule = program.schedule
    return replace(program, y=replace(program.y, phase=RationalPhase(schedule.lines), hold=schedule.ticks))


def smooth(program: DualProgram) -> DualProgram:
    """The program with a y that advances every tick."""
    return replace(program, y=replace(program.y, phase=RationalPhase(program.schedule.frame_ticks), hold=1))


def some_programs(seed: int) -> list[DualProgram]:
    """Programs of one frame whose y advances on every tick or line, and others of other lines and other ticks."""
    rng = np.random.default_rng(seed)

    def program(ticks: int, lines: int) -> DualProgram:
        made = random_dual(rng, SHAPE, (ticks, ticks), kind="tame", lines=(lines, lines))
        return replace(made, schedule=replace(made.schedule, settle_lines=int(rng.integers(0, 3))))

    same = [program(TICKS, LINES) for _ in range(4)]
    others = [program(LINES, TICKS), program(TICKS, LINES + 1), program(TICKS + 1, LINES)]
    return [smooth(same[0]), smooth(same[1]), stepped(same[2]), stepped(same[3]), *map(smooth, others)]


PROGRAMS = some_programs(1)


@dataclass
class Direct:
    """A direct reading of docs/sequencer.md for programs without shaping."""

    playing: DualProgram | None = None
    waiting: tuple[DualProgram, str] | None = None
    running: bool = False
    armed: int | None = None
    k: int = 0
    j: int = 0
    left: int | None = None  # frames; None is without end
    settle: int = 0
    catching_up: bool = False
    codes: tuple[int, int] = (0, 0)
    faults: Fault = Fault.NONE
    counts: Counter[Fault] = field(default_factory=Counter)

    def request(self, name: str, program: DualProgram, frames: int) -> None:
        """Act before the next tick."""
        if name in ("line", "keep", "frame"):
            self.waiting = program, name
        elif name == "start":
            if not self.running and (self.playing is not None or self.waiting is not None):
                self.armed, self.left, self.running = None, frames or None, True
                self.k = self.j = 0
                self.settle = 0 if self.playing is None else self.playing.schedule.settle_lines
                self.catching_up = True
            else:
                self.armed = frames
        if name in ("park", "reset"):
            self.running, self.armed = False, None
        if name in ("withdraw", "reset"):
            self.waiting = None
            self.running = self.running and self.playing is not None
        if name in ("clear_faults", "reset"):
            self.faults, self.counts = Fault.NONE, Counter()

    def step(self) -> Tick:
        """Play one tick."""
        swapped = self._swap()
        old = self.playing
        if old is None:
            return Tick(*self.codes, swapped=swapped, parked=True, faults=self.faults)
        if not self.running:
            parked = self._approach(old.x.output.park_code, old.y.output.park_code)
            return Tick(*self.codes, swapped=swapped, parked=parked, faults=self.faults)
        ideal, k, schedule = play_line(old, self.j), self.k, old.schedule
        reached = self._approach(int(ideal.x[k]), int(ideal.y[k]))
        place = np.array([k]), np.array([self.j * schedule.ticks + k])
        outputs = old.x.output, old.y.output
        raw = [
            int(round_up(output.gain_word * int(axis.samples(at)[0]) + output.offset_word, output.gain_q))
            for output, axis, at in zip(outputs, (old.x, old.y), place, strict=True)
        ]
        if any(not output.code_min <= code <= output.code_max for output, code in zip(outputs, raw, strict=True)):
            self._fault(Fault.CLAMP)
        if reached:
            self.catching_up = False
        elif not self.catching_up:
            self._fault(Fault.SLEW)
        markers = {name: bool(getattr(ideal, name)[k]) for name in ("line", "frame", "pixel", "backward")}
        valid = bool(ideal.valid[k]) and self.settle == 0 and reached and not self.faults
        tick = Tick(*self.codes, **markers, valid=valid, swapped=swapped, playing=True, faults=self.faults)
        self.k += 1
        if self.k == schedule.ticks:
            self.k, self.j, self.settle = 0, self.j + 1, max(self.settle - 1, 0)
        if self.j == schedule.lines:
            self.j = 0
            if self.left is not None:
                self.left -= 1
                self.running = self.left > 0
        return tick

    def _swap(self) -> bool:
        if self.waiting is None:
            return False
        old, (new, mode) = self.playing, self.waiting
        if self.running and (self.k != 0 or (mode == "frame" and self.j != 0)):
            return False
        self.playing, self.waiting = new, None
        if self.running:
            place = (
                None
                if old is None
                else [(one.schedule.ticks, one.schedule.lines, one.y.hold, one.y.phase.ticks) for one in (old, new)]
            )
            if mode != "keep" or place is None or place[0] != place[1]:
                self.j = 0
            self.settle, self.catching_up = new.schedule.settle_lines, True
        return True

    def _approach(self, x: int, y: int) -> bool:
        assert self.playing is not None
        steps = self.playing.x.output.max_step, self.playing.y.output.max_step
        now_x, now_y = (
            now + max(min(target - now, step), -step)
            for now, target, step in zip(self.codes, (x, y), steps, strict=True)
        )
        self.codes = now_x, now_y
        return self.codes == (x, y)

    def _fault(self, fault: Fault) -> None:
        self.faults |= fault
        self.counts[fault] += 1


def round_up(value: int, shift: int) -> int:
    """Round as docs/sequencer.md does: to the nearest, ties up."""
    return (value + (1 << (shift - 1))) >> shift


def ask(model: Sequencer, name: str, program: DualProgram, frames: int) -> None:
    """Make the same request of the model."""
    if name in ("line", "keep", "frame"):
        model.commit(program, CommitMode[name.upper()])
    elif name == "start":
        model.arm(frames)
        model.trigger()
    else:
        getattr(model, name)()


Event = tuple[str, int, int, int]
EVENTS = st.lists(
    st.tuples(
        st.sampled_from((*REQUESTS[:3], *REQUESTS)),
        st.integers(0, len(PROGRAMS) - 1),
        st.sampled_from([0, 0, 1, 2]),
        st.integers(0, 3 * TICKS),
    ),
    min_size=1,
    max_size=16,
)


def first_difference(events: list[Event], seen: Counter[str] | None = None) -> str | None:
    """Play the events with both; return what differs first."""
    model, direct = Sequencer(None), Direct()
    for name, which, frames, ticks in [("line", 0, 0, 0), ("start", 0, 0, 2 * TICKS), *events]:
        ask(model, name, PROGRAMS[which], frames)
        direct.request(name, PROGRAMS[which], frames)
        for _ in range(ticks):
            before = model.line
            got, wanted = model.step(), direct.step()
            if got != wanted:
                return f"{got} and not {wanted}"
            if (model.tick, model.line, model.settle_left) != (direct.k, direct.j, direct.settle) and direct.running:
                return f"line {model.line}, tick {model.tick}, and not {direct.j}, {direct.k}"
            if seen is not None and got.swapped and got.playing:
                seen[f"{model.mode.name} in the middle" if before else model.mode.name] += 1
                seen["goes on"] += before > 0 and not got.frame
        if any(model.fault_counts[fault] != direct.counts[fault] for fault in model.fault_counts):
            return "counts of faults"
    return None


@pytest.mark.common
@settings(max_examples=300, deadline=None)
@given(EVENTS)
def test_the_model_is_a_direct_reading(events: list[Event]) -> None:
    assert first_difference(events) is None


def random_events(seed: int, count: int = 40) -> list[Event]:
    """Requests as those of hypothesis, from a seed."""
    rng = np.random.default_rng(seed)
    names = (*REQUESTS[:3], *REQUESTS[:3], "start", *REQUESTS)
    return [
        (str(rng.choice(names)), int(rng.integers(len(PROGRAMS))), int(rng.choice([0, 0, 0, 2])), int(rng.integers(40)))
        for _ in range(count)
    ]


def test_the_events_reach_every_mode() -> None:
    seen = Counter[str]()
    for seed in range(8):
        assert first_difference(random_events(seed), seen) is None
    assert all(seen[name] for name in ("LINE in the middle", "KEEP in the middle", "FRAME", "goes on")), seen
    assert seen["FRAME in the middle"] == 0


def is_found() -> bool:
    return any(first_difference(random_events(seed)) is not None for seed in range(8))


def test_a_wrong_condition_of_keep_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Control: each part of the condition, left out, makes a difference."""

    def never(playing: DualProgram, program: DualProgram) -> bool:
        return False

    def any_y(playing: DualProgram, program: DualProgram) -> bool:
        old, new = playing.schedule, program.schedule
        return (old.ticks, old.lines) == (new.ticks, new.lines)

    def any_lines(playing: DualProgram, program: DualProgram) -> bool:
        return playing.schedule.ticks == program.schedule.ticks

    def any_ticks(playing: DualProgram, program: DualProgram) -> bool:
        return playing.schedule.lines == program.schedule.lines

    assert not is_found()
    for wrong in (never, any_y, any_lines, any_ticks):
        monkeypatch.setattr(sequencer_module, "can_keep", wrong)
        assert is_found(), wrong.__name__


def test_a_wrong_swap_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Control: a frame that is not waited for, or that every mode waits for."""
    for wrong in (
        lambda self: self.tick == 0,
        lambda self: self.tick == 0 and self.line == 0,
        lambda self: self.tick == 0 and (self.mode != CommitMode.KEEP or self.line == 0),
    ):
        monkeypatch.setattr(Sequencer, "_at_swap", wrong)
        assert is_found()


@pytest.mark.common
@settings(max_examples=150, deadline=None)
@given(EVENTS, st.integers(1, 3 * TICKS))
def test_ticks_at_once_are_single_ticks(events: list[Event], most: int) -> None:
    """`ahead` ends where a mode swaps, and nowhere else plays anything but what `step` does."""
    one, many = Sequencer(None), Sequencer(None)
    for name, which, frames, ticks in [("line", 0, 0, 0), ("start", 0, 0, 5), *events]:
        for model in (one, many):
            ask(model, name, PROGRAMS[which], frames)
        left = ticks
        while left:
            batch = many.ahead(min(left, most))
            if batch is None:
                assert many.step() == one.step()
                left -= 1
                continue
            lines, faults = batch
            left -= len(faults)
            for k, fault in enumerate(faults.tolist()):
                tick = one.step()
                assert not tick.swapped
                assert (tick.x, tick.y, tick.valid, int(tick.faults)) == (lines.x[k], lines.y[k], lines.valid[k], fault)
                assert (tick.line, tick.frame, tick.pixel) == (lines.line[k], lines.frame[k], lines.pixel[k])
        assert (one.tick, one.line, one.settle_left) == (many.tick, many.line, many.settle_left)
        assert one.fault_counts == many.fault_counts


@pytest.mark.parametrize("frames", [0, 3])
@pytest.mark.parametrize("pair", [(0, 1), (2, 3)], ids=["every tick", "every line"])
def test_keep_goes_on_with_the_frame(pair: tuple[int, int], frames: int) -> None:
    old, new = (PROGRAMS[which] for which in pair)
    wide = [replace(axis, output=replace(axis.output, max_step=65535)) for axis in (new.x, new.y)]
    new = replace(new, x=wide[0], y=wide[1])
    for line in range(LINES):
        sequencer = Sequencer(old)
        sequencer.arm(frames)
        sequencer.trigger()
        for _ in range(line * TICKS + 5):
            sequencer.step()
        left = sequencer.frames_left
        sequencer.commit(new, CommitMode.KEEP)
        while not (tick := sequencer.step()).swapped:
            assert tick.playing
        due = (line + 1) % LINES
        assert (sequencer.line, tick.frame) == (due, due == 0)
        assert sequencer.settle_left == new.schedule.settle_lines
        assert sequencer.frames_left == left - (frames > 0 and due == 0)
        ideal = play_line(new, due)
        played = [tick, *(sequencer.step() for _ in range(TICKS - 1))]
        assert [(tick.x, tick.y) for tick in played] == list(zip(ideal.x.tolist(), ideal.y.tolist(), strict=True))


def test_keep_forgets_the_remainders_of_shaped_axes() -> None:
    old, new = (
        replace(
            program,
            x=replace(program.x, output=replace(program.x.output, max_step=65535, shaping=Shaping(2, 0))),
            y=replace(program.y, output=replace(program.y.output, max_step=65535, shaping=Shaping(1, 0))),
        )
        for program in PROGRAMS[:2]
    )
    sequencer = Sequencer(old)
    sequencer.arm()
    sequencer.trigger()
    for _ in range(TICKS + 3):
        sequencer.step()
    sequencer.commit(new, CommitMode.KEEP)
    while not (tick := sequencer.step()).swapped:
        pass
    lines = PlayedLines(new)
    for line in (2, 3, 0, 1):
        ideal = lines.play(line)
        ticks = [tick, *(sequencer.step() for _ in range(TICKS - 1))]
        assert [(tick.x, tick.y) for tick in ticks] == list(zip(ideal.x.tolist(), ideal.y.tolist(), strict=True))
        tick = sequencer.step()


def test_the_last_commit_counts_with_its_mode() -> None:
    for first in CommitMode:
        for last in CommitMode:
            sequencer = Sequencer(PROGRAMS[0])
            sequencer.arm()
            sequencer.trigger()
            for _ in range(TICKS + 2):
                sequencer.step()
            sequencer.commit(PROGRAMS[4], first)
            sequencer.commit(PROGRAMS[1], last)
            ticks = 0
            while not sequencer.step().swapped:
                ticks += 1
            assert sequencer.playing is PROGRAMS[1]
            assert ticks == (3 * TICKS if last == CommitMode.FRAME else TICKS) - 2
            assert sequencer.line == (2 if last == CommitMode.KEEP else 0)


def test_can_keep_needs_the_same_place_of_y() -> None:
    assert can_keep(PROGRAMS[0], PROGRAMS[1])
    assert can_keep(PROGRAMS[2], PROGRAMS[3])
    assert not can_keep(PROGRAMS[0], PROGRAMS[2])
    assert not any(can_keep(PROGRAMS[0], other) for other in PROGRAMS[4:])
