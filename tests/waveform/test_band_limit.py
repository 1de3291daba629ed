"""Band limits: the paper's scaling error over the window, the range, the acceleration."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scaling import SECTION_8, scaling_error, worst

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.line import LineShape
from tablegen.config.schema import BandLimit
from tablegen.planning.band_limit import band_limited
from tablegen.waveform import window_fit
from tablegen.waveform.closed_form import fourier_series
from tablegen.waveform.sampler import Sampler
from tablegen.waveform.series import FourierSeries


@pytest.mark.parametrize(("harmonics", "percent"), [(32, 0.02), (21, 0.3), (16, 1.2)])
def test_window_is_straight_inside_and_gentle_outside(harmonics: int, percent: float) -> None:
    fitted = band_limited(SECTION_8, BandLimit(method="window"), harmonics)
    truncated = band_limited(SECTION_8, BandLimit(method="truncate"), harmonics)
    assert worst(SECTION_8, fitted) <= percent
    w = Sampler(fitted, 20000).at(np.arange(20000))
    assert float(w.min()) >= 0.0
    assert float(w.max()) <= 1.0
    assert fitted.peak_acceleration() <= truncated.peak_acceleration()


def test_figures_of_the_design() -> None:
    """13 % for the paper's low-pass at H = 32, as large as the hysteresis it set out to remove; 1.1 % for sigma."""
    assert worst(SECTION_8, band_limited(SECTION_8, BandLimit(method="truncate"), 32)) == pytest.approx(13.5, abs=0.5)
    assert worst(SECTION_8, band_limited(SECTION_8, BandLimit(method="lanczos"), 32)) == pytest.approx(1.1, abs=0.05)


def test_truncate_keeps_the_coefficients_and_lanczos_damps_them() -> None:
    series = fourier_series(SECTION_8, 10)
    truncated = band_limited(SECTION_8, BandLimit(method="truncate"), 10)
    damped = band_limited(SECTION_8, BandLimit(method="lanczos"), 10)
    assert truncated.a.tolist() == series.a.tolist()
    assert damped.b == pytest.approx(series.b * np.sinc(np.arange(1, 11) / 11))
    assert damped.a0 == series.a0


@pytest.mark.parametrize(("harmonics", "times"), [(16, 1.6), (21, 1.8), (32, 2.5)])
def test_chebyshev_nodes_are_what_levels_the_error(
    monkeypatch: pytest.MonkeyPatch, harmonics: int, times: float
) -> None:
    """The control: the same fit at evenly spaced nodes lets the error pile up at the edges of the window."""
    levelled = worst(SECTION_8, band_limited(SECTION_8, BandLimit(), harmonics))

    def even(turn: float, harmonics: int, window: tuple[float, float], both: bool) -> np.ndarray:
        x = window[0] + (window[1] - window[0]) * (np.arange(4 * harmonics) + 0.5) / (4 * harmonics)
        return np.concatenate([turn * x, turn + (1.0 - turn) * (1.0 - x)])

    monkeypatch.setattr(window_fit, "_nodes", even)
    piled_up = worst(SECTION_8, band_limited(SECTION_8, BandLimit(), harmonics))
    assert piled_up > times * levelled


def test_a_fit_that_is_kept_is_the_one_of_these_values_and_slopes() -> None:
    """Any last bit of a value or of a slope is another fit; the control is what is asked for again."""
    times = window_fit._nodes(0.5, 16, (0.1, 0.9), True)
    value, slope = SECTION_8.value(times), SECTION_8.slope(times)

    def fitted(harmonics: int, *arrays: np.ndarray) -> FourierSeries:
        return window_fit._fitted(*(each.tobytes() for each in arrays), harmonics)

    first = fitted(16, times, value, slope)
    assert fitted(16, times, value.copy(), slope) is first
    for which in (value, slope):
        which[3] = np.nextafter(which[3], 2.0)
        other = fitted(16, times, value, slope)
        assert other is not first
        assert other.a.tobytes() != first.a.tobytes()
        first = other
    assert fitted(17, times, value, slope).harmonics == 17
    again = window_fit._fitted.__wrapped__(times.tobytes(), value.tobytes(), slope.tobytes(), 16)
    assert (again.a0, again.a.tobytes(), again.b.tobytes()) == (first.a0, first.a.tobytes(), first.b.tobytes())


def test_forward_only_leaves_the_way_back_free() -> None:
    """A sawtooth whose flyback need not be straight is straighter forward, and its flyback gentler."""
    shape = LineShape(0.7, SECTION_8.forward, SECTION_8.backward)
    both = band_limited(shape, BandLimit(directions="both"), 16)
    forward = band_limited(shape, BandLimit(directions="forward"), 16)
    assert scaling_error(shape, forward, 0.1, 0.9, True) < 0.1 * scaling_error(shape, both, 0.1, 0.9, True)
    assert forward.peak_acceleration() < both.peak_acceleration()


def test_the_range_is_held_where_the_free_fit_would_leave_it() -> None:
    """turn 0.5, forward only: the free turnaround would swing to 1.1; held, it stays inside and loses little."""
    series = band_limited(SECTION_8, BandLimit(directions="forward"), 16)
    w = Sampler(series, 20000).at(np.arange(20000))
    assert float(w.min()) >= 0.0
    assert float(w.max()) <= 1.0
    assert scaling_error(SECTION_8, series, 0.1, 0.9, True) < 0.05


def test_what_cannot_be_held_is_refused() -> None:
    with pytest.raises(Unphysical, match="16 harmonics straight in this window swing over"):
        band_limited(SECTION_8, BandLimit(window=(0.0, 1.0), directions="forward"), 16)


@pytest.mark.common
@settings(max_examples=25)
@given(st.floats(0.2, 0.95), st.floats(0.03, 0.2), st.integers(12, 64), st.booleans())
def test_the_fit_minimises_what_it_says(turn: float, low: float, harmonics: int, both: bool) -> None:
    """The objective, evaluated by hand, rises in every direction tried (where the range does not bind)."""
    shape = LineShape(turn, SECTION_8.forward, SECTION_8.backward)
    limit = BandLimit(window=(low, 1 - low), directions="both" if both else "forward")
    try:
        series = band_limited(shape, limit, harmonics)
    except Unphysical:
        return
    w = Sampler(series, 4096).at(np.arange(4096))
    if w.min() < 0.0011 or w.max() > 0.9989:
        return
    count = 4 * harmonics + 32
    x = low + (1 - 2 * low) * (0.5 - 0.5 * np.cos(np.pi * (np.arange(count) + 0.5) / count))
    t = np.concatenate([turn * x, turn + (1 - turn) * (1 - x)]) if both else turn * x
    n = np.arange(1, harmonics + 1)
    cos, sin = np.cos(2 * np.pi * np.outer(t, n)), np.sin(2 * np.pi * np.outer(t, n))
    u, du = shape.value(t), shape.slope(t)

    def objective(a0: float, a: np.ndarray, b: np.ndarray) -> float:
        slope = 2 * np.pi * (cos @ (n * b) - sin @ (n * a))
        value = a0 + cos @ a + sin @ b
        fit = np.mean(((slope - du) / du) ** 2) + 100.0 * np.mean((value - u) ** 2)
        return float(fit + 1e-12 * np.sum((2 * np.pi * n) ** 4 * (a**2 + b**2)) / 2)

    best = objective(series.a0, series.a, series.b)
    random = np.random.default_rng(harmonics)
    for _ in range(20):
        step = 1e-4 * random.standard_normal(2 * harmonics + 1) / np.concatenate([[1], n**2, n**2])
        moved = objective(series.a0 + step[0], series.a + step[1 : harmonics + 1], series.b + step[harmonics + 1 :])
        assert moved >= best - 1e-13


@pytest.mark.parametrize("count", [50, 1250, 9999, 50000, 250001])
def test_sampler_is_the_series(count: int) -> None:
    series = band_limited(SECTION_8, BandLimit(), 20)
    sampler = Sampler(series, count)
    start, stop = count // 7, count // 7 + min(400, count // 3)
    exact = series.value(np.arange(start, stop) / count)
    assert sampler.at(np.arange(start, stop)) == pytest.approx(exact, abs=2e-12)
    assert sampler.at(np.array([0, count - 1])) == pytest.approx(series.value([0.0, (count - 1) / count]), abs=2e-12)
