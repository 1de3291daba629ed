"""Residual and scaling error of lines whose distortion is known in closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablegen.compensation.hysteresis import BranchShape
from tablegen.numerics.arrays import Floats
from tablegen.virtual.line_error import ideal_triangle, line_error

FORWARD, BACKWARD = BranchShape.harmonic(0.035, 0.37), BranchShape.harmonic(0.085, 0.48)


def distorted(ticks: int, turn: float) -> Floats:
    """A triangle on a piezo that is the harmonic model: its inverse on each branch, 0..1."""
    t = np.arange(ticks) / ticks
    going = t <= turn
    tau = np.where(going, t / turn, (t - turn) / (1.0 - turn))
    return np.where(going, FORWARD.inverse(tau), 1.0 - BACKWARD.inverse(tau))


@given(st.integers(500, 5000), st.floats(0.2, 0.8), st.floats(-1e4, 1e4), st.floats(1e-2, 1e5))
def test_a_triangle_has_no_error(ticks: int, turn: float, zero: float, size: float) -> None:
    asked = ideal_triangle(ticks, turn)
    error = line_error(zero + size * asked, turn, ideal=asked)
    assert error.size_nm == pytest.approx(size, rel=1e-6)
    for branch in (error.forward, error.backward):
        # Near the turns a sample may lie a tick beyond; the window has none of it.
        assert max(map(abs, branch.residual_range)) < 1e-5 * (1.0 + abs(zero) / size)
        assert branch.scaling_peak_to_peak < 1e-2 * (1.0 + abs(zero) / size)


@pytest.mark.parametrize("turn", [0.5, 0.7])
def test_peaks_are_those_of_the_model(turn: float) -> None:
    """The harmonic model peaks at beta, at u_peak of the drive: forward at 0.37, backward mirrored at 1 - 0.48."""
    error = line_error(300.0 + 1250.0 * distorted(20_000, turn), turn)
    assert error.forward.peak == pytest.approx((-3.5, 0.37), abs=2e-3)
    assert error.backward.peak == pytest.approx((8.5, 0.52), abs=2e-3)
    assert error.size_nm == pytest.approx(1250.0)


def test_scaling_error_is_that_of_the_slope() -> None:
    """Chords of 1/20 against the analytic slope at their middle; the curvature of a chord is below 0.2 %."""
    error = line_error(distorted(20_000, 0.5), 0.5)
    x = error.forward.scaling_position
    for found, shape, sweep in ((error.forward, FORWARD, x), (error.backward, BACKWARD, 1.0 - x)):
        slope = 1.0 / shape.slope(shape.inverse(sweep))
        middle = 1.0 / shape.slope(shape.inverse(0.5))
        assert found.scaling == pytest.approx(100.0 * (1.0 - slope / middle), abs=0.2)
    assert x[0] == pytest.approx(0.125)
    assert x[-1] == pytest.approx(0.875)


def test_directions_are_told_apart() -> None:
    """Negative control: played backwards in time, the two change places and signs."""
    error = line_error(distorted(20_000, 0.5), 0.5)
    swapped = line_error(np.roll(distorted(20_000, 0.5)[::-1], 1), 0.5)
    assert swapped.forward.peak == pytest.approx(error.backward.peak, abs=2e-3)
    assert swapped.backward.peak == pytest.approx(error.forward.peak, abs=2e-3)


def test_rounded_turns_are_no_error() -> None:
    """A line that follows what was asked for, rounded where it turns, is straight in the window."""
    asked = 0.5 + 0.45 * np.clip(2.4 * (ideal_triangle(8000, 0.5) - 0.5) / 0.9 / 1.2, -0.46, 0.46) / 0.45
    inside = np.abs(ideal_triangle(8000, 0.5) - 0.5) <= 0.41
    asked = np.where(inside, ideal_triangle(8000, 0.5), np.clip(asked, 0.05, 0.95))
    error = line_error(7.0 + 100.0 * asked, 0.5, ideal=asked)
    assert error.size_nm == pytest.approx(100.0)
    assert max(map(abs, error.forward.residual_range)) < 1e-6
    # Negative control: without being told, the same line seems larger than it is straight.
    assert max(map(abs, line_error(7.0 + 100.0 * asked, 0.5).forward.residual_range)) > 1.0
