"""An operator in time: equal to the closed form where it has settled, and to plays that are stepped elsewhere."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from test_operator_waveform import operator, stepped

from tablegen.compensation.dynamics import SecondOrder
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.compensation.operator.in_time import OperatorInTime, late_mode, resonant
from tablegen.numerics.arrays import Floats


def sweep(low: float, high: float, turn: int, count: int) -> Floats:
    """One period of a triangle, from its lower turn to the next one."""
    return low + (high - low) * np.concatenate([np.arange(turn) / turn, 1.0 - np.arange(count + 1) / count])


@pytest.mark.common
@given(low=st.floats(0.02, 0.45), stroke=st.floats(0.05, 0.5), turn=st.integers(5, 90), first=st.integers(0, 60))
def test_settled_line_is_the_closed_form(low: float, stroke: float, turn: int, first: int) -> None:
    period = sweep(low, low + stroke, turn, 100 - turn)
    u = np.concatenate([np.roll(period[:-1], -first)] * 3)
    loop = operator().loop(float(np.min(u)), float(np.max(u)), 1.0, float(np.mean(u)))
    rising = (np.arange(100) + first) % 100 < turn
    expected = loop.extent_nm * np.where(rising, loop.position(u[:100], True), loop.position(u[:100], False))
    y = OperatorInTime(operator()).hysteresis(u)
    assert np.max(np.abs(y[200:] - expected)) < 1e-9 * loop.extent_nm


@pytest.mark.common
@given(st.lists(st.floats(0.05, 0.95), min_size=3, max_size=12))
def test_any_turns_are_those_of_plays_that_are_stepped(turns: list[float]) -> None:
    if max(turns) - min(turns) < 0.1 or np.min(np.abs(np.diff([*turns, turns[0]]))) < 2e-3:
        return
    u = np.concatenate([np.linspace(a, b, 30) for a, b in zip(turns, [*turns[1:], turns[0]], strict=True)])
    y, expected = OperatorInTime(operator()).hysteresis(u), stepped(u)
    # The sensitivity of the operator is that of (1) at the mean of the drive: a factor of all positions.
    error = np.polyval(np.polyfit(y, expected, 1), y) - expected
    # A branch is linear between 1025 points of its loop.
    assert np.max(np.abs(error)) < 2e-3 * (np.max(expected) - np.min(expected))


def test_creep_over_uneven_steps_is_its_response() -> None:
    creep = LogarithmicCreep(0.03, 1e-3, 10.0, 1.0)
    t = np.unique(np.concatenate([np.linspace(0.0, 1.0, 4001), np.random.default_rng(1).uniform(0.0, 1.0, 500)]))
    y = np.cos(2.0 * np.pi * t)
    late = creep.direct * y + sum(share * late_mode(t, y, tau, True).real for share, tau in creep.terms())
    real, imaginary = creep.response(np.array([1.0]))
    expected = float(real[0]) * y - float(imaginary[0]) * np.sin(2.0 * np.pi * t)
    assert np.max(np.abs(late - expected)) < 1e-5


@pytest.mark.parametrize("quality", [0.3, 0.5, 14.0])
def test_resonance_in_time_is_its_response(quality: float) -> None:
    response = SecondOrder(5.0, quality)
    t = np.linspace(0.0, 1.0, 8001)
    y = resonant(t, np.cos(6.0 * np.pi * t), response, True)
    real, imaginary = response.inverse(np.array([3.0]))
    h = 1.0 / complex(float(real[0]), float(imaginary[0]))
    assert np.max(np.abs(y - (h * np.exp(6j * np.pi * t)).real)) < 1e-5 * max(abs(h), 1.0)
