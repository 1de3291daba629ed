"""The sequencer with a slow part: its lines are those of the frame, tick by tick, many at once, and over swaps."""

from fractions import Fraction
from math import floor

import numpy as np
import pytest
from frame_programs import scan_program
from hypothesis import given, settings
from hypothesis import strategies as st
from programs import random_schedule
from replacing import replace

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import AxisProgram, DualProgram, ScanProgram, require_dual
from tablegen.device.played_lines import play_line
from tablegen.device.sequencer import Fault, Sequencer, can_keep
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.numerics.arrays import Ints
from tablegen.verification.play.sequencer_shape import SequencerShape

SHAPES = (SequencerShape(16, 3, 4, 16, 3, 3, 16), SequencerShape(16, 1, 5, 16, 1, 4, 16))
SLOW = ("xy", "x", "y")


def made(seed: int, slow: str, kind: str, lines: int | None = None, ticks: int | None = None) -> ScanProgram:
    """A program without limits to its codes or steps."""
    rng = np.random.default_rng(seed)
    schedule = random_schedule(rng, ticks or int(rng.integers(20, 90)), 1)
    schedule = replace(schedule, lines=lines or int(rng.integers(1, 9)))
    program = scan_program(rng, SHAPES[seed % 2], schedule, slow, kind)

    def free(axis: AxisProgram) -> AxisProgram:
        output = replace(axis.output, code_min=0, code_max=65535, max_step=65535)
        if isinstance(axis, FrameProgram):
            return replace(axis, fast=replace(axis.fast, output=output))
        return replace(axis, output=output)

    return replace(program, x=free(program.x), y=free(program.y))


def frame_of(axis: AxisProgram, lines: int, ticks: int) -> Ints:
    """The codes of a frame by the formula of a whole frame, or by the program of a line."""
    if isinstance(axis, FrameProgram):
        return axis.frame()
    return axis.codes(np.arange(lines * ticks) % axis.ticks).reshape(lines, ticks)


def started(program: ScanProgram, frames: int = 0) -> Sequencer:
    device = Sequencer(None)
    device.commit(program)
    device.arm(frames)
    device.trigger()
    return device


@pytest.mark.parametrize("slow", SLOW)
@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 1 << 20), kind=st.sampled_from(["smooth", "wild"]))
def test_a_scan_plays_its_frame_again_and_again(slow: str, seed: int, kind: str) -> None:
    program = made(seed, slow, kind)
    lines, ticks = program.schedule.lines, program.schedule.ticks
    device = started(program, frames=2)
    played = [device.step() for _ in range(2 * lines * ticks)]
    for name in "xy":
        codes = np.array([getattr(tick, name) for tick in played]).reshape(2, lines, ticks)
        frame = frame_of(getattr(program, name), lines, ticks)
        assert np.array_equal(codes[0], frame), name
        assert np.array_equal(codes[1], frame), name
    assert [tick.line for tick in played] == [k % ticks == 0 for k in range(2 * lines * ticks)]
    assert not device.running


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 1 << 20), slow=st.sampled_from(SLOW), data=st.data())
def test_many_ticks_at_once_are_those_one_by_one(seed: int, slow: str, data: st.DataObject) -> None:
    """With limits that clamp and steps that the guard limits, as the helper makes them."""
    rng = np.random.default_rng(seed)
    schedule = replace(random_schedule(rng, 40, 1), lines=int(rng.integers(1, 7)))
    program = scan_program(rng, SHAPES[seed % 2], schedule, slow, "smooth")
    one, many = started(program), started(program)
    done = 0
    while done < 700:
        most = data.draw(st.integers(1, 300))
        if (block := many.ahead(most)) is None:
            assert many.step() == one.step()
            done += 1
            continue
        lines, faults = block
        for k in range(len(lines.x)):
            tick = one.step()
            assert (tick.x, tick.y, tick.valid, int(tick.faults)) == (
                lines.x[k], lines.y[k], lines.valid[k], faults[k],
            )  # fmt: skip
        done += len(lines.x)
    assert one.fault_counts == many.fault_counts


def test_each_tick_is_that_of_the_formula() -> None:
    """Of exact fractions, from the words of the decision, without the arrays of the model."""
    program = made(6, "xy", "smooth", lines=5, ticks=37)
    x = program.x
    assert isinstance(x, FrameProgram)
    slow = [int(x.slow.at(np.array(line), 5)) for line in range(6)]
    device = started(program)
    for line in range(5):
        mixed = replace(x.fast, words=x.table(line))
        way = slow[line + 1] - slow[line]
        ramp = abs(way) * ((1 << 32) // 37) // (1 << 32) * (1 if way > 0 else -1)
        for k in range(37):
            value = int(x.gains.at(np.array(line))) * int(mixed.samples(np.array(k))) + slow[line] + k * ramp
            code = floor(Fraction(value, 1 << x.output.gain_q) + Fraction(1, 2))
            assert device.step().x == min(max(code, 0), 65535)


@pytest.mark.parametrize("slow", ["xy", "y"])
def test_keep_goes_on_at_the_line_that_is_due(slow: str) -> None:
    """The lines of the new program from that line on; y of both has a slow part, x need not."""
    first, second = made(2, slow, "smooth", 7, 30), made(4, "y", "smooth", 7, 30)
    assert can_keep(first, second)
    for tick in (1, 45, 89, 90):
        device = started(first)
        for _ in range(tick):
            device.step()
        device.commit(second, CommitMode.KEEP)
        before = [device.step() for _ in range(-tick % 30)]
        line = -(-tick // 30)
        codes = np.array([(t.x, t.y) for t in (device.step() for _ in range(4 * 30))]).reshape(4, 30, 2)
        assert not any(t.swapped for t in before)
        for place, name in enumerate("xy"):
            wanted = frame_of(getattr(second, name), 7, 30)[line : line + 4]
            assert np.array_equal(codes[:, :, place], wanted)


def test_only_a_y_of_the_same_kind_is_kept() -> None:
    """With a slow part and without, y counts its place in other advances."""
    slow, plain = made(2, "xy", "smooth", 7, 30), made(4, "x", "smooth", 7, 30)
    assert can_keep(slow, made(8, "y", "smooth", 7, 30))
    assert not can_keep(slow, plain)
    assert not can_keep(plain, slow)
    assert not can_keep(slow, made(8, "xy", "smooth", 6, 30))
    assert not can_keep(slow, made(8, "xy", "smooth", 7, 31))


def test_faults_park_and_start_are_as_of_every_program() -> None:
    """Negative control of the tests above too: a guard of one code a tick plays other codes, and reports it."""
    program = made(2, "xy", "smooth", 3, 50)
    x = program.x
    assert isinstance(x, FrameProgram)
    guarded = replace(x, fast=replace(x.fast, output=replace(x.output, max_step=1, code_max=30000)))
    device = started(replace(program, x=guarded))
    codes = np.array([device.step().x for _ in range(40_000)])
    assert np.all(np.abs(np.diff(codes)) <= 1)
    assert not np.array_equal(codes[-150:], frame_of(x, 3, 50).ravel())
    device.park()
    for _ in range(40_000):
        device.step()
    assert device.codes == (x.output.park_code, program.y.output.park_code)
    assert device.parked
    assert Fault.CLAMP in device.faults or max(codes) < 30000


def test_one_line_plays_as_in_the_frame() -> None:
    program = made(2, "xy", "wild", 6, 30)
    for line in (0, 3, 5):
        played = play_line(program, line)
        assert np.array_equal(played.x, frame_of(program.x, 6, 30)[line])
        assert np.array_equal(played.y, frame_of(program.y, 6, 30)[line])


def test_lines_and_ticks_have_to_be_those_of_the_schedule() -> None:
    program = made(2, "x", "smooth", 6, 30)
    for schedule in (replace(program.schedule, lines=5), replace(program.schedule, ticks=31)):
        with pytest.raises(ValueError, match="x has 6 lines of 30 ticks, the schedule "):
            replace(program, schedule=schedule)


def test_the_link_and_verilog_take_no_slow_part() -> None:
    program = made(2, "x", "smooth", 6, 30)
    with pytest.raises(ValueError, match="and the Verilog of a scan at an angle"):
        require_dual(program)
    assert isinstance(program.y, FrameProgram) is False
    dual = DualProgram(program.y, program.y, program.schedule)  # type: ignore[arg-type]
    assert require_dual(dual) is dual
