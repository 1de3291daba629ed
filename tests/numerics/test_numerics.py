"""Reproducible arithmetic against mpmath: accuracy, exact zeros, symmetry."""

from decimal import Context, Decimal
from unittest.mock import patch

import mpmath as mp
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tablegen.numerics.arrays import tree_sum, tree_sum_down
from tablegen.numerics.elementary import _step_parts, exp, exps, log10
from tablegen.numerics.fourier import filtered
from tablegen.numerics.linear import Cholesky
from tablegen.numerics.turns import cosine, sinc, sine, sine_and_cosine, sine_and_cosine_of, spherical_bessel_1

mp.mp.dps = 40
turns = st.floats(-1e4, 1e4, allow_nan=False)


@given(turns)
def test_sine_and_cosine_are_within_two_and_a_half_ulp(x: float) -> None:
    exact = mp.mpf(x) - round(x)
    for value, reference in zip(sine_and_cosine(x), (mp.sinpi(2 * exact), mp.cospi(2 * exact)), strict=True):
        ulp = np.spacing(max(abs(float(reference)), 1e-300))
        # Near a zero the argument's own reduction is exact, so the bound holds there as well.
        assert abs(mp.mpf(float(value)) - reference) <= 2.5 * ulp


@given(turns | st.integers(-64, 64).map(lambda eighths: eighths / 16.0))
def test_one_angle_has_the_bits_of_many(x: float) -> None:
    assert np.array(sine_and_cosine_of(x)).tobytes() == np.array(sine_and_cosine([x, 0.1])).T[0].tobytes()


@pytest.mark.common
@given(st.integers(-(10**6), 10**6))
def test_zeros_and_extremes_are_exact(n: int) -> None:
    assert float(sine(n / 2)) == 0.0
    assert float(cosine(n / 2 + 0.25)) == 0.0
    assert float(cosine(n)) == 1.0
    assert float(sine(n + 0.25)) == 1.0
    assert float(sinc(n)) == (1.0 if n == 0 else 0.0)


@given(turns)
def test_symmetry_is_exact(x: float) -> None:
    assert float(sine(-x)) == -float(sine(x))
    assert float(cosine(-x)) == float(cosine(x))


@given(st.floats(-600.0, 600.0))
def test_spherical_bessel_function(y: float) -> None:
    with mp.workdps(60):
        z = mp.pi * mp.mpf(y)
        reference = z / 3 if abs(z) < mp.mpf(10) ** -12 else (mp.sin(z) - z * mp.cos(z)) / z**2
    assert abs(mp.mpf(float(spherical_bessel_1(y))) - reference) < 4e-16


@pytest.mark.parametrize("y", [0.2999999999, 0.3, 0.3000000001, 1e-8, 1e-100, 0.0])
def test_spherical_bessel_function_where_its_two_forms_meet(y: float) -> None:
    with mp.workdps(450):  # the plain formula, with digits to spare for its cancellation
        z = mp.pi * mp.mpf(y)
        reference = (mp.sin(z) - z * mp.cos(z)) / z**2 if y else mp.mpf(0)
    assert float(spherical_bessel_1(y)) == pytest.approx(float(reference), rel=5e-15, abs=1e-300)


@given(st.one_of(st.floats(-709.0, 709.0), st.floats(-1e-3, 1e-3)))
def test_exp_is_correctly_rounded(x: float) -> None:
    assert exp(x) == float(mp.exp(mp.mpf(x)))


@given(st.floats(-760.0, -700.0))
@example(-745.1332191019411)
@example(-745.1332191019412)
def test_a_subnormal_exp_is_rounded_once(x: float) -> None:
    assert exp(x) == float(Decimal(x).exp(Context(prec=60)))


def test_an_exp_that_is_no_double_is_refused() -> None:
    assert exp(709.782712893384) == pytest.approx(1.797693e308, rel=1e-6)
    for x in (709.782712893385, 711.0, 1e300):
        with pytest.raises(OverflowError):
            exp(x)


@given(st.lists(st.floats(-760.0, 709.0), max_size=20))
def test_many_numbers_have_the_exp_of_each(x: list[float]) -> None:
    assert exps(np.array(x)).tobytes() == np.array([exp(one) for one in x]).tobytes()


def test_pairs_decide_nearly_all_numbers() -> None:
    """Those of covariances, with every bit; the negative control: powers that are no pairs have wrong ones."""
    x = np.append(-np.random.default_rng(5).exponential(2.0, 3999), 0.0).reshape(40, 100)
    exact = np.array([exp(one) for one in x.ravel().tolist()]).reshape(x.shape)
    with patch("tablegen.numerics.elementary.exp") as by_integers:
        assert np.array_equal(exps(x), exact)
    assert by_integers.call_count == 0
    first, second, third, high, low = _step_parts()
    with patch("tablegen.numerics.elementary._step_parts", return_value=(first, second, third, high, 0.0 * low)):
        assert np.mean(exps(x) != exact) > 0.05
    with patch("tablegen.numerics.elementary._PAIR_ERROR", 1.0):  # none is decided
        assert np.array_equal(exps(x), exact)
    with pytest.raises(OverflowError):
        exps(np.array([1.0, 720.0]))


@given(st.floats(1e-300, 1e300))
def test_log10_is_correctly_rounded(x: float) -> None:
    assert log10(x) == float(mp.log10(mp.mpf(x)))


@given(st.integers(1, 300), st.integers(0, 2**32 - 1))
def test_tree_sum_is_a_sum(size: int, seed: int) -> None:
    values = np.random.default_rng(seed).standard_normal((3, size))
    assert tree_sum(values) == pytest.approx([float(mp.fsum(row.tolist())) for row in values], abs=1e-12)
    assert tree_sum_down(values.T).tobytes() == tree_sum(values).tobytes()


@pytest.mark.parametrize("size", [1, 2, 7, 65])
def test_cholesky_against_lapack(size: int) -> None:
    random = np.random.default_rng(size)
    root = random.standard_normal((size, size))
    matrix = root @ root.T + size * np.eye(size)
    right = random.standard_normal(size)
    assert Cholesky(matrix).solve(right) == pytest.approx(np.linalg.solve(matrix, right), rel=1e-10)


def test_cholesky_refuses_what_is_not_positive_definite() -> None:
    with pytest.raises(ArithmeticError, match="pivot 1 of 2"):
        Cholesky(np.array([[1.0, 2.0], [2.0, 1.0]]))


@pytest.mark.parametrize("count", [4, 1024])
def test_a_filter_of_harmonics_is_that_of_a_fast_transform(count: int) -> None:
    random = np.random.default_rng(count)
    values, (real, imaginary) = random.standard_normal(count), random.standard_normal((2, count // 2 - 1))
    spectrum = np.fft.rfft(values)
    spectrum[1:-1] *= real + 1j * imaginary
    out = filtered(values, real, imaginary)
    np.testing.assert_allclose(out, np.fft.irfft(spectrum, count), atol=1e-14)
    np.testing.assert_allclose(filtered(values, real * 0.0 + 1.0, imaginary * 0.0), values, atol=1e-14)


@pytest.mark.parametrize(("count", "factors"), [(2, 0), (12, 5), (16, 8)])
def test_a_filter_of_another_length_is_refused(count: int, factors: int) -> None:
    with pytest.raises(ValueError, match=f"{count} values and {factors} factors; a power of 2"):
        filtered(np.zeros(count), np.ones(factors), np.zeros(factors))
