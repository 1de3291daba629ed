"""The integer arithmetic against exact fractions: rounding, phase, interpolation, synthesis, output."""

from fractions import Fraction
from math import floor

import mpmath as mp
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tablegen.compensation.hysteresis import BranchShape
from tablegen.compensation.line import LineShape
from tablegen.fixedpoint.converter import fit_gain
from tablegen.fixedpoint.interpolation import FRACTION_BITS, guard_bits, interpolate
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.phase import MAXIMUM_TICKS, RationalPhase
from tablegen.fixedpoint.rounding import round_half_up, saturate, shift_round, signed_limits
from tablegen.fixedpoint.synthesis import encode, sine_table, synthesize
from tablegen.waveform.closed_form import fourier_series
from tablegen.waveform.series import FourierSeries

HALF = Fraction(1, 2)


def nearest(x: Fraction) -> int:
    """Ties up: the rule, in exact arithmetic."""
    return floor(x + HALF)


@given(st.floats(-(2.0**52), 2.0**52))
def test_round_half_up(x: float) -> None:
    assert int(round_half_up(np.array(x))) == nearest(Fraction(x))


@pytest.mark.parametrize(
    ("x", "rounded"), [(0.5, 1), (-0.5, 0), (1.5, 2), (2.5, 3), (-1.5, -1), (0.49999999999999994, 0), (-2.5000001, -3)]
)
def test_ties_go_up(x: float, rounded: int) -> None:
    assert int(round_half_up(np.array(x))) == rounded


@given(st.integers(-(2**61), 2**61), st.integers(1, 60))
def test_shift_round(value: int, bits: int) -> None:
    exact = nearest(Fraction(value, 1 << bits))
    assert shift_round(value, bits) == exact
    assert int(shift_round(np.array([value]), bits)[0]) == exact


@pytest.mark.common
@given(st.integers(-(2**40), 2**40), st.integers(2, 32))
def test_saturation_never_wraps(value: int, bits: int) -> None:
    low, high = signed_limits(bits)
    assert int(saturate(np.array([value]), bits)[0]) == min(max(value, low), high)


@given(st.integers(2, MAXIMUM_TICKS), st.data())
def test_phase_is_exactly_the_floor(ticks: int, data: st.DataObject) -> None:
    phase = RationalPhase(ticks)
    k = data.draw(st.integers(0, ticks - 1))
    assert int(phase.at(np.array([k]))[0]) == (k << 32) // ticks
    assert phase.step * ticks + phase.remainder == 1 << 32


@example(1250)
@example(250000)
@given(st.integers(2, 3000))
@settings(deadline=None)
def test_step_and_remainder_walk_the_same_phases_and_close(ticks: int) -> None:
    """That the walk closes makes every line the first one over again: no drift after any number of lines."""
    phase = RationalPhase(ticks)
    accumulator = rest = 0
    for k in range(ticks):
        assert accumulator == (k << 32) // ticks
        accumulator += phase.step
        rest += phase.remainder
        if rest >= ticks:
            rest -= ticks
            accumulator += 1
    assert (accumulator, rest) == (1 << 32, 0)


def test_no_drift_over_a_million_lines() -> None:
    """After 10^6 lines of the example the accumulated phase is that of the first line, to the last bit.

    The accumulator is walked in closed form, L k ticks at once; a rounded single step of 2^32 / L, the usual
    DDS, has slipped by a fifth of a line by then.
    """
    phase = RationalPhase(1250)
    ticks = 1250 * 10**6
    carries = (ticks * phase.remainder) // 1250
    assert (ticks * phase.step + carries) % (1 << 32) == 0
    assert (ticks * phase.remainder) % 1250 == 0
    drifted = (ticks * round(2**32 / 1250)) % (1 << 32)
    assert min(drifted, (1 << 32) - drifted) / 2**32 > 0.04


def test_phase_of_no_ticks_is_refused() -> None:
    with pytest.raises(ValueError, match="0 ticks"):
        RationalPhase(0)
    with pytest.raises(ValueError, match="2147483648 ticks"):
        RationalPhase(1 << 31)


tables = st.integers(2, 9).flatmap(
    lambda p: st.tuples(
        st.integers(8, 24).flatmap(
            lambda bits: st.tuples(
                st.just(bits),
                st.lists(st.integers(*signed_limits(bits)), min_size=1 << p, max_size=1 << p),
            )
        )
    )
)


@pytest.mark.common
@settings(max_examples=60)
@given(tables, st.lists(st.integers(0, 2**32 - 1), min_size=1, max_size=30))
def test_interpolation_is_the_rounded_line(table: tuple[tuple[int, list[int]]], phases: list[int]) -> None:
    ((bits, words),) = table
    guard, index_bits = guard_bits(bits), len(words).bit_length() - 1
    samples = interpolate(np.array(words), np.array(phases), guard)
    for phase, sample in zip(phases, samples.tolist(), strict=True):
        index, rest = divmod(phase, 1 << (32 - index_bits))
        fraction = rest >> (32 - index_bits - FRACTION_BITS)
        here, there = words[index], words[(index + 1) % len(words)]
        exact = (here << guard) + Fraction((there - here) * fraction, 1 << (FRACTION_BITS - guard))
        assert sample == nearest(exact)
        assert min(here, there) << guard <= sample <= max(here, there) << guard


def test_a_sixteen_bit_table_needs_no_more_than_32_bits() -> None:
    """The bound that FRACTION_BITS = 15 was chosen for, at the worst two words there are."""
    low, high = signed_limits(16)
    largest = (high - low) * ((1 << FRACTION_BITS) - 1) + (1 << (FRACTION_BITS - guard_bits(16) - 1))
    assert largest < 1 << 31
    assert [16 + guard_bits(16), 21 + guard_bits(21), 24 + guard_bits(24)] == [20, 25, 25]


@pytest.mark.parametrize("length", [4, 64, 2048, 65536, 1250, 997])
def test_sine_table_is_odd_and_rounded_right(length: int) -> None:
    table = sine_table(length)
    mp.mp.dps = 30
    for j in range(0, length, max(1, length // 97)):
        exact = mp.sinpi(mp.mpf(2 * j) / length) * 2**30
        assert abs(mp.mpf(int(table[j])) - exact) <= mp.mpf(0.5) + mp.mpf(10) ** -6
    assert table[0] == 0
    assert np.array_equal(table[1:], -table[:0:-1])
    if length % 4 == 0:
        quarter = table[: length // 4 + 1]
        assert quarter[-1] == 1 << 30
        assert np.array_equal(table[length // 4 : length // 2 + 1], quarter[::-1])


SECTION_8 = LineShape(0.5, BranchShape.harmonic(0.035, 0.37), BranchShape.harmonic(0.085, 0.48))


@pytest.mark.parametrize("length", [64, 2048, 1250, 999])
@pytest.mark.parametrize("bits", [8, 16, 24])
def test_synthesis_is_the_exact_sum_and_close_to_the_waveform(length: int, bits: int) -> None:
    series = fourier_series(SECTION_8, 20)
    words = encode(series.a0, series.a, series.b, 1.002)
    rendered = synthesize(words, length, bits)
    sines = sine_table(length).tolist()
    cosines = [round(mp.cospi(mp.mpf(2 * j) / length) * 2**30) for j in range(length)]
    low, high = signed_limits(bits)
    for k in range(0, length, max(1, length // 61)):
        total = words.a0 << 30
        for n in range(1, 21):
            total += int(words.a[n - 1]) * cosines[n * k % length] + int(words.b[n - 1]) * sines[n * k % length]
        assert int(rendered[k]) == min(max(nearest(Fraction(total, 1 << (60 - (bits - 1)))), low), high)
    ideal = (2 * series.value(np.arange(length) / length) - 1) / 1.002 * 2 ** (bits - 1)
    assert float(np.max(np.abs(rendered - ideal))) <= 0.5 + 41 * 2.0 ** (bits - 1 - 30)


def test_words_decode_to_the_waveform() -> None:
    series = fourier_series(SECTION_8, 64)
    words, unit = encode(series.a0, series.a, series.b, 1.5), 1.5 / 2**31
    assert 0.5 + unit * words.a0 == pytest.approx(series.a0, abs=1e-9)
    assert unit * words.a == pytest.approx(series.a, abs=1e-9)
    assert unit * words.b == pytest.approx(series.b, abs=1e-9)


def test_synthesis_saturates_instead_of_wrapping() -> None:
    series = FourierSeries(0.5, np.array([0.6]), np.array([0.0]))  # 2 w - 1 reaches 1.2
    words = synthesize(encode(series.a0, series.a, series.b, 1.0), 64, 8)
    assert (words.max(), words.min()) == (127, -128)


@pytest.mark.parametrize(("a0", "a"), [(0.5, [1.1]), (0.5, [0.4] * 6)])
def test_words_that_could_overflow_are_refused(a0: float, a: list[float]) -> None:
    """A word beyond Q2.30, and a sum beyond the 64-bit accumulator: found before a device could."""
    series = FourierSeries(a0, np.array(a), np.zeros(len(a)))
    with pytest.raises(OverflowError, match=r"does not fit 32 bits|the accumulator holds 4"):
        encode(series.a0, series.a, series.b, 1.0)


outputs = st.builds(
    lambda bits, table_bits, gain, share, coding: (
        Output(
            gain_word=gain,
            gain_q=16 + table_bits + guard_bits(table_bits) - bits,
            offset_word=floor(share * (1 << bits) * (1 << (16 + table_bits + guard_bits(table_bits) - bits))),
            code_min=0,
            code_max=(1 << bits) - 1,
            max_step=1,
            park_code=0,
            dac_bits=bits,
            coding=coding,
            align="right",
            word_bits=bits,
        ),
        table_bits,
    ),
    st.integers(8, 24),
    st.integers(8, 24),
    st.integers(-(2**17), 2**17 - 1),
    st.floats(0.0, 0.999),
    st.sampled_from(["offset-binary", "twos-complement"]),
)


@given(outputs, st.data())
def test_output_is_rounded_once_and_never_wraps(case: tuple[Output, int], data: st.DataObject) -> None:
    """Also the widest case, a 24-bit table at a gain of -2^17: int64 equals Python's unbounded integers."""
    output, bits = case
    assert output.gain_q >= 1
    low, high = signed_limits(bits + guard_bits(bits))
    sample = data.draw(st.integers(low, high))
    exact = nearest(Fraction(output.gain_word * sample + output.offset_word, 1 << output.gain_q))
    assert int(output.unclamped(np.array([sample]))[0]) == exact
    code = int(output.code(np.array([sample]))[0])
    assert code == min(max(exact, output.code_min), output.code_max)
    word = output.word(code)
    assert 0 <= word < 1 << output.dac_bits
    if output.coding == "twos-complement":
        signed = word - (1 << output.dac_bits) if word >> (output.dac_bits - 1) else word
        assert signed == code - (1 << (output.dac_bits - 1))


def test_left_alignment_shifts_the_coded_word() -> None:
    output = Output(1, 20, 0, 0, 4095, 1, 0, 12, "twos-complement", "left", 16)
    assert [output.word(code) for code in (0, 2048, 4095)] == [0x8000, 0x0000, 0x7FF0]


@given(st.floats(1.0, 2.0**23), st.floats(1.0, 1.5), st.integers(8, 24), st.integers(16, 24))
def test_gain_times_scale_is_exact(amplitude: float, peak: float, bits: int, dac_bits: int) -> None:
    """The rounding of the gain goes into the table's scale: their product is the drive, to a float's precision."""
    full = 2.0 ** (dac_bits - 1)
    if amplitude * peak > full:
        return
    gain_word, scale = fit_gain(amplitude, peak, bits, dac_bits)
    assert 1 <= gain_word < 1 << 17
    assert gain_word / 2**16 / scale * full == pytest.approx(amplitude, rel=1e-15)
    assert peak / scale * 2.0 ** (bits - 1) <= 2.0 ** (bits - 1) - 1 + 1e-6
    assert fit_gain(-amplitude, peak, bits, dac_bits) == (-gain_word, scale)
