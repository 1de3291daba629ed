"""A series on a grid, of which a quarter is summed, against the sum of its harmonics at every point."""

import mpmath as mp
import numpy as np
import pytest

from tablegen.numerics.arrays import Floats
from tablegen.numerics.turns import sine_and_cosine
from tablegen.waveform import series as module
from tablegen.waveform.series import FourierSeries, on_one_grid


def random_series(harmonics: int, seed: int) -> FourierSeries:
    """Coefficients that fall like those of a line, none of them 0."""
    rng = np.random.default_rng(seed)
    fall = 1.0 / np.arange(1.0, harmonics + 1.0) ** 2
    return FourierSeries(0.43, fall * rng.normal(size=harmonics), fall * rng.normal(size=harmonics))


def plain_sum(series: FourierSeries, count: int, derivative: int) -> Floats:
    """Every point by itself, term by term, harmonics in order."""
    k, total = np.arange(count), np.full(count, 0.0 if derivative else series.a0)
    sines, cosines = sine_and_cosine(k / count)
    for n in range(1, series.harmonics + 1):
        a, b = float(series.a[n - 1]), float(series.b[n - 1])
        for _ in range(derivative):
            a, b = b, -a
        at, factor = n * k % count, 1.0
        for _ in range(derivative):
            factor *= 2.0 * np.pi * n
        total += factor * a * cosines[at] + factor * b * sines[at]
    return total


@pytest.mark.parametrize("kept", [module._CACHED, 0], ids=["kept", "one by one"])
@pytest.mark.parametrize("derivative", [0, 1, 2, 3])
@pytest.mark.parametrize("harmonics", [1, 2, 31, 64])
def test_a_power_of_two_has_every_bit_of_the_plain_sum(
    harmonics: int, derivative: int, kept: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_CACHED", kept)
    series = random_series(harmonics, harmonics)
    for count in (8, 256, 2048):
        assert series.on_grid(count, derivative).tobytes() == plain_sum(series, count, derivative).tobytes()


@pytest.mark.parametrize("kept", [module._CACHED, 0], ids=["kept", "one by one"])
@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6, 7, 10, 12, 331, 992, 1250])
def test_any_other_grid_is_right_to_some_last_places(count: int, kept: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_CACHED", kept)
    series = random_series(31, count)
    for derivative in range(4):
        right = plain_sum(series, count, derivative)
        largest = (2.0 * np.pi * 31) ** derivative
        assert np.max(np.abs(series.on_grid(count, derivative) - right)) < 2e-14 * largest


def test_a_grid_against_mpmath() -> None:
    series, count = random_series(5, 9), 12
    for k, value in enumerate(series.on_grid(count).tolist()):
        right = mp.mpf(series.a0)
        for n in range(1, 6):
            turns = mp.mpf(2 * n * k) / count
            right += mp.mpf(float(series.a[n - 1])) * mp.cospi(turns) + mp.mpf(float(series.b[n - 1])) * mp.sinpi(turns)
        assert abs(value - right) < 1e-15


def test_the_comparison_sees_one_harmonic_that_is_off() -> None:
    series = random_series(8, 1)
    wrong = series.a.copy()
    wrong[7] *= 1.0 + 1e-13
    off = FourierSeries(series.a0, wrong, series.b).on_grid(256)
    assert off.tobytes() != plain_sum(series, 256, 0).tobytes()


@pytest.mark.parametrize("harmonics", [1, 12, 63])
def test_series_on_one_grid_are_those_of_each(harmonics: int) -> None:
    """Bit for bit; also of an odd grid, of means, and of more waves than are cached."""
    random = np.random.default_rng(harmonics)
    for count, mean in ((256, 0.0), (250, 0.0), (255, 0.0), (64, 0.1), (1 << 14, 0.0)):
        series = [FourierSeries(mean, *random.normal(size=(2, harmonics))) for _ in range(19)]
        expected = np.stack([one.on_grid(count) for one in series])
        assert on_one_grid(series, count).tobytes() == expected.tobytes()
