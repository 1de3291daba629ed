"""The fast and the slow part of an axis: exact fractions, the recursion of a device, and the program of a line."""

from fractions import Fraction
from itertools import pairwise
from math import floor
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from tablegen.fixedpoint.frame_program import SUM_BITS, FrameProgram, Knots, SlowTable, ramp
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Mode, Program
from tablegen.fixedpoint.rounding import signed_limits

BITS = 16


def output(mode: Mode = "cubic", gain: int = 1 << 15, offset: int = 1 << 35) -> Output:
    return Output(gain, 20, offset, 0, 65535, 65535, 0, 16, "straight", "right", 16)


def program(words: list[int], ticks: int, mode: Mode = "cubic") -> Program:
    return Program(RationalPhase(ticks), 1, mode, BITS, np.array(words, dtype=np.int64), output(mode))


def ints(low_high: tuple[int, int], count: int) -> st.SearchStrategy[list[int]]:
    return st.lists(st.integers(*low_high), min_size=count, max_size=count)


@st.composite
def frame_programs(draw: st.DrawFn) -> FrameProgram:
    """Any words at all, of tables of 8 words."""
    lines, ticks, knots = draw(st.integers(1, 40)), draw(st.integers(8, 60)), draw(st.integers(2, 5))
    spacing = -(-lines // (knots - 1)) + draw(st.integers(0, 2))
    mode: Mode = draw(st.sampled_from(["cubic", "interpolated"]))
    gains, ratios = (
        Knots(np.array(draw(ints(signed_limits(bits), knots)), dtype=np.int64), spacing) for bits in (18, 16)
    )
    slow = SlowTable(
        np.array(draw(ints(signed_limits(BITS), 8)), dtype=np.int64),
        draw(st.integers(*signed_limits(18))),
        draw(st.integers(0, 1 << 36)),
    )
    second = np.array(draw(ints(signed_limits(8), 8)), dtype=np.int64)
    fast = program(draw(ints(signed_limits(BITS), 8)), ticks, mode)
    return FrameProgram(fast, lines, gains, ratios, second, slow)


def stepped(knots: Knots, lines: int) -> list[int]:
    """Words of lines as a device has them: a division at each knot, additions between."""
    words = []
    for here, after in pairwise(knots.words.tolist()):
        step, rest = divmod(after - here, knots.spacing)
        word, total = here, knots.spacing // 2
        for _ in range(knots.spacing):
            words.append(word)
            word, total = word + step, total + rest
            if total >= knots.spacing:
                word, total = word + 1, total - knots.spacing
    return words[:lines]


@given(st.data())
def test_knots_are_met_and_lines_between_are_the_nearest(data: st.DataObject) -> None:
    words = data.draw(st.lists(st.integers(*signed_limits(18)), min_size=2, max_size=9))
    knots = Knots(np.array(words, dtype=np.int64), data.draw(st.integers(1, 30)))
    line = np.arange(knots.lines + 1)
    values = knots.at(line).tolist()
    assert values[:: knots.spacing] == words
    assert values[:-1] == stepped(knots, knots.lines)
    for at, value in zip(line.tolist(), values, strict=True):
        left, ahead = divmod(at, knots.spacing)
        exact = Fraction(words[left])
        if ahead:
            exact += Fraction((words[left + 1] - words[left]) * ahead, knots.spacing)
        assert abs(value - exact) <= Fraction(1, 2)


@given(st.integers(*signed_limits(43)), st.integers(2, (1 << 31) - 1))
def test_a_ramp_ends_at_the_next_line_or_before(distance: int, ticks: int) -> None:
    word = ramp(distance, RationalPhase(ticks).step)
    ends = ticks * word
    assert min(0, distance) <= ends <= max(0, distance)
    assert abs(distance - ends) < ticks * (1 + Fraction(abs(distance), 1 << 32))
    assert ramp(-distance, RationalPhase(ticks).step) == -word


def test_a_shift_instead_would_pass_the_next_line() -> None:
    """The negative control: rounded downwards, a slow part that falls by 1 falls by 1 in each tick."""
    ticks = 1000
    assert ticks * ((-1 * RationalPhase(ticks).step) >> 32) == -ticks
    assert ramp(-1, RationalPhase(ticks).step) == 0


@settings(max_examples=40)
@given(st.data())
def test_a_program_of_a_line_is_the_special_case(data: st.DataObject) -> None:
    mode: Mode = data.draw(st.sampled_from(["cubic", "interpolated"]))
    line = program(data.draw(ints(signed_limits(BITS), 8)), data.draw(st.integers(8, 60)), mode)
    lines = data.draw(st.integers(1, 6))
    codes = FrameProgram.straight(line, lines).frame()
    assert np.array_equal(codes, np.tile(line.codes(np.arange(line.ticks)), (lines, 1)))


@settings(max_examples=40)
@given(frame_programs())
def test_mixed_words_saturate_and_codes_are_those_of_the_formula(frame: FrameProgram) -> None:
    low, high = signed_limits(BITS)
    codes, ramps = frame.frame(), frame.ramps().tolist()
    slow = [int(frame.slow.at(np.array(line), frame.lines)) for line in range(frame.lines + 1)]
    assert slow[-1] == slow[0]
    gains, ratios = stepped(frame.gains, frame.lines), stepped(frame.ratios, frame.lines)
    for line in range(frame.lines):
        words = [
            min(max(fast + floor(Fraction(ratios[line] * second, 1 << 12) + Fraction(1, 2)), low), high)
            for fast, second in zip(frame.fast.words.tolist(), frame.second.tolist(), strict=True)
        ]
        assert frame.table(line).tolist() == words
        mixed = replace(frame.fast, words=np.array(words, dtype=np.int64))
        for k, sample in enumerate(mixed.samples(np.arange(mixed.ticks)).tolist()):
            total = gains[line] * sample + slow[line] + k * ramps[line]
            assert -(1 << (SUM_BITS - 1)) <= total < 1 << (SUM_BITS - 1)
            assert codes[line, k] == min(max((total + (1 << 19)) >> 20, 0), 65535)


@settings(max_examples=100)
@given(frame_programs(), st.sampled_from([1, 100, 1 << 15]))
def test_bounds_hold_the_extremes(frame: FrameProgram, block: int) -> None:
    """Of any words, in blocks of lines as well as line by line."""
    codes = np.concatenate([frame.unclamped(line) for line in range(frame.lines)])
    steps = np.abs(codes.ravel() - np.roll(codes.ravel(), 1))
    with patch("tablegen.fixedpoint.frame_program._BLOCK", block):
        assert frame.extremes == (np.min(codes), np.max(codes), np.max(steps))
        assert np.array_equal(frame.unclamped(0, frame.lines), codes)
        (least, most, steepest), (low, high, step) = frame.extremes, frame.bounds
    assert np.array_equal(frame.starts, codes[:, 0])
    assert low <= least <= most <= high
    assert steepest <= step


def test_bounds_of_equal_words_are_the_extremes() -> None:
    """The negative control: bounds that are narrower by a code do not hold them."""
    still = FrameProgram.straight(program([700] * 8, 32), 4)
    assert still.bounds[:2] == still.extremes[:2]


def test_mixed_words_reach_both_ends() -> None:
    """What the property above may not draw: sums beyond both ends of the fast words."""
    low, high = signed_limits(BITS)
    fast = program([low, high, low, high, 0, 0, 0, 0], 32)
    second = np.array([127, 127, -128, -128, 127, -128, 0, 0])
    knots = Knots(np.full(2, 1 << 15 - 1, dtype=np.int64), 1)
    frame = FrameProgram(fast, 1, knots, knots, second, SlowTable(np.zeros(8, dtype=np.int64), 0, 0))
    assert frame.table(0).tolist() == [low + 508, high, low, high - 512, 508, -512, 0, 0]


def test_what_does_not_fit_is_refused() -> None:
    line = program([0] * 8, 32)
    straight = FrameProgram.straight(line, 4)
    with pytest.raises(OverflowError, match="a gain does not fit 18 bits"):
        replace(straight, gains=Knots(np.array([0, 1 << 17]), 4))
    with pytest.raises(OverflowError, match="a ratio does not fit 16 bits"):
        replace(straight, ratios=Knots(np.array([-(1 << 15) - 1, 0]), 4))
    with pytest.raises(OverflowError, match="a word of the second table does not fit 8 bits"):
        replace(straight, second=np.full(8, 128))
    with pytest.raises(OverflowError, match="a slow part does not fit 43 bits"):
        replace(straight, slow=SlowTable(np.zeros(8, dtype=np.int64), 0, 1 << 42))
    with pytest.raises(ValueError, match="the ratios reach 3 lines of 4"):
        replace(straight, ratios=Knots(np.zeros(4, dtype=np.int64), 1))
    with pytest.raises(ValueError, match="7 words are mixed into 8"):
        replace(straight, second=np.zeros(7, dtype=np.int64))
    with pytest.raises(ValueError, match="advances every tick"):
        replace(straight, fast=replace(line, hold=2))
    with pytest.raises(ValueError, match="66 knots"):
        Knots(np.zeros(66, dtype=np.int64), 1)
