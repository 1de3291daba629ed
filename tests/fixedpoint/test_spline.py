"""Samples of cubic tables against the recursion that defines B-splines; their words against projections."""

from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.rounding import signed_limits
from tablegen.fixedpoint.spline import SPLINE_FRACTION_BITS, SPLINE_UNIT, cubic, evaluate_segment, of_segments, segments
from tablegen.fixedpoint.spline_words import spline_factors
from tablegen.waveform.series import FourierSeries


def b_spline(degree: int, at: Fraction) -> Fraction:
    """The B-spline on the knots 0, 1, ..., degree + 1, by the recursion of Cox and de Boor."""
    if degree == 0:
        return Fraction(int(0 <= at < 1))
    rising, falling = at * b_spline(degree - 1, at), (degree + 1 - at) * b_spline(degree - 1, at - 1)
    return (rising + falling) / degree


def spline(words: list[int], at: Fraction) -> Fraction:
    """The periodic cubic spline at a time in segments: segment i begins with word i."""
    segment, length = int(at), len(words)
    return sum(
        (words[(segment + ahead) % length] * b_spline(3, at - segment + 3 - ahead) for ahead in range(4)), Fraction(0)
    )


@settings(deadline=None)
@given(st.integers(3, 6), st.integers(8, 21), st.data())
def test_samples_are_those_of_the_recursion(index_bits: int, bits: int, data: st.DataObject) -> None:
    word = st.integers(*signed_limits(bits))
    words = data.draw(st.lists(word, min_size=1 << index_bits, max_size=1 << index_bits))
    phase = data.draw(st.integers(0, (1 << 32) - 1))
    dropped = 32 - index_bits - SPLINE_FRACTION_BITS
    exact = SPLINE_UNIT * spline(words, Fraction(phase >> dropped, 1 << SPLINE_FRACTION_BITS))
    sample = cubic(np.array(words, dtype=np.int64), np.array([phase]))
    assert abs(int(sample[0]) - exact) < 1


@pytest.mark.parametrize("bits", [8, 16, 21])
def test_extreme_words(bits: int) -> None:
    """No sample leaves the 12-fold of its four words, no sum on the way 32 bits, and no product what is documented."""
    low, high = signed_limits(bits)
    shift, half = SPLINE_FRACTION_BITS + 1, 1 << SPLINE_FRACTION_BITS
    fraction = np.arange(1 << SPLINE_FRACTION_BITS)
    for corner in product((low, high), repeat=4):
        sample = evaluate_segment([np.full_like(fraction, word) for word in corner], fraction)
        assert SPLINE_UNIT * min(corner) <= sample.min()
        assert sample.max() <= SPLINE_UNIT * max(corner)
        c0, c1, c2, c3 = corner
        b1, b2, b3 = 12 * (c2 - c0), 24 * (c0 - 2 * c1 + c2), 16 * (c3 - c0 + 3 * (c1 - c2))
        second = b2 + ((b3 * fraction + half) >> shift)
        first = b1 + ((second * fraction + half) >> shift)
        assert max(abs(b3), int(np.abs(second).max()), int(np.abs(first).max())) <= 1 << (bits + 6)
        last = 2 * (c0 + 4 * c1 + c2) + ((first * fraction + half) >> shift)
        assert np.array_equal(sample, last)


def test_a_constant_is_exact() -> None:
    words = np.full(8, -12345, dtype=np.int64)
    assert np.all(cubic(words, RationalPhase(999).at(np.arange(999))) == -12345 * SPLINE_UNIT)


@pytest.mark.common
@pytest.mark.parametrize(("length", "harmonic"), [(8, 1), (8, 3), (16, 7), (32, 4), (128, 32)])
def test_words_are_the_nearest_ones(length: int, harmonic: int) -> None:
    """The least squares over a fine grid, solved as a dense system, are the closed form."""
    a, b = np.zeros(harmonic), np.zeros(harmonic)
    a[-1], b[-1] = 0.3, -0.2
    series = FourierSeries(0.5, a, b)
    fine = 64
    basis = np.zeros((fine * length, length))
    for part in range(fine):
        at = Fraction(2 * part + 1, 2 * fine)
        values = [float(b_spline(3, at + 3 - ahead)) for ahead in range(4)]
        for segment, ahead in product(range(length), range(4)):
            basis[segment * fine + part, (segment + ahead) % length] += values[ahead]
    times = (np.arange(fine * length) + 0.5) / (fine * length)
    found = np.linalg.lstsq(basis, series.value(times), rcond=None)[0]
    words = series.times(*spline_factors(harmonic, length)).value(np.arange(length) / length)
    assert np.allclose(words, found, rtol=0.0, atol=2e-5)


@pytest.mark.common
@pytest.mark.parametrize(("harmonic", "length"), [(1, 32), (1, 64), (2, 128)])
def test_the_error_is_that_of_the_projection(harmonic: int, length: int) -> None:
    """h^4 / 720 of the fourth derivative, the largest value of the Bernoulli polynomial of degree 4 over 4!."""
    series = FourierSeries(0.5, np.zeros(harmonic), np.append(np.zeros(harmonic - 1), 0.5))
    scale = float(1 << 40)  # of words so fine that only the spline itself errs
    words = series.times(*spline_factors(harmonic, length)).value(np.arange(length) / length)
    words = np.rint((2.0 * words - 1.0) * scale)
    at = [Fraction(part, 16) for part in range(16 * length)]
    played = np.array([float(spline([int(word) for word in words], one)) for one in at]) / scale
    wanted = 2.0 * series.value(np.array([float(one) for one in at]) / length) - 1.0
    bound = (2 * np.pi * harmonic / length) ** 4 / 720
    assert 0.98 * bound < np.abs(played - wanted).max() < 1.02 * bound


@pytest.mark.parametrize(("index_bits", "bits"), [(3, 21), (6, 16), (7, 8)])
def test_a_sample_of_segments_is_that_of_its_phase(index_bits: int, bits: int) -> None:
    random = np.random.default_rng(bits)
    low, high = signed_limits(bits)
    table, phase = random.integers(low, high, 1 << index_bits, endpoint=True), random.integers(0, 1 << 32, 5000)
    assert (of_segments(table, *segments(phase, index_bits)) == cubic(table, phase)).all()
