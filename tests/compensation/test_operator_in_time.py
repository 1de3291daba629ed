"""An operator in time: equal to the closed form where it has settled, and to plays that are stepped elsewhere."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from replacing import replace
from test_operator_waveform import operator, stepped

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.dynamics import Measured, SecondOrder
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.compensation.operator.field import Field, Lengths
from tablegen.compensation.operator.in_time import OperatorInTime, Start, late_mode, resonant
from tablegen.compensation.operator.settled import settled
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
    late = creep.direct * y + sum(share * late_mode(t, y, tau, len(t)).real for share, tau in creep.terms())
    real, imaginary = creep.response(np.array([1.0]))
    expected = float(real[0]) * y - float(imaginary[0]) * np.sin(2.0 * np.pi * t)
    assert np.max(np.abs(late - expected)) < 1e-5


@pytest.mark.parametrize("quality", [0.3, 0.5, 14.0])
def test_resonance_in_time_is_its_response(quality: float) -> None:
    response = SecondOrder(5.0, quality)
    t = np.linspace(0.0, 1.0, 8001)
    y = resonant(t, np.cos(6.0 * np.pi * t), response, len(t))
    real, imaginary = response.inverse(np.array([3.0]))
    h = 1.0 / complex(float(real[0]), float(imaginary[0]))
    assert np.max(np.abs(y - (h * np.exp(6j * np.pi * t)).real)) < 1e-5 * max(abs(h), 1.0)


POINTS_HZ = np.concatenate(
    [np.linspace(1.0, 300.0, 300), np.linspace(302.0, 1200.0, 450), np.linspace(1210.0, 8e3, 680)]
)


def in_points(response: SecondOrder, f_hz: Floats = POINTS_HZ) -> Measured:
    """The response as a swept sine measures it."""
    real, imaginary = response.inverse(f_hz)
    h = 1.0 / (real + 1j * imaginary)
    return Measured(f_hz, np.abs(h), np.unwrap(np.angle(h)) / (2.0 * np.pi))


@pytest.mark.parametrize("uneven", [False, True])
@pytest.mark.parametrize("start", Start)
def test_points_of_a_resonance_are_its_modes(start: Start, uneven: bool) -> None:
    """Through changes of the drive that are slow, and quick ones that make it ring."""
    response = SecondOrder(400.0, 6.0, 2e-4)
    period = sweep(0.3, 0.6, 100, 100)[:-1]
    u = np.concatenate([*[period] * 2, *[period + 0.2] * 2, period, [0.3]])
    t = np.arange(len(u)) * 1e-4
    if uneven:
        t = t + 2e-5 * np.random.default_rng(1).uniform(-1.0, 1.0, len(t))
    # Both are linear between samples: the modes for the delay, the points for uneven times.
    by_modes = OperatorInTime(operator(), response=response).position(t, u, start)
    by_points = OperatorInTime(operator(), response=in_points(response)).position(t, u, start)
    ringing = by_modes - OperatorInTime(operator()).position(t, u, start)
    assert np.std(by_points - by_modes) < 6e-3 * np.std(ringing)
    assert np.ptp(ringing) > 20.0  # nm


def test_a_settled_line_behind_points_is_that_of_a_build() -> None:
    response = in_points(SecondOrder(400.0, 6.0, 2e-4))
    u = sweep(0.3, 0.6, 700, 300)
    creep = LogarithmicCreep(0.03, 1e-3, 1.0, 10.0)
    t = np.arange(len(u)) * 1e-4
    loop = operator().loop(0.3, 0.6)
    expected = settled(loop, u[:-1], 10.0, creep, response)
    y = OperatorInTime(operator(creep), response=response).position(t, u)[:-1]
    assert np.max(np.abs(y - expected - np.mean(y - expected))) < 1e-3 * loop.extent_nm


def test_a_line_that_has_lasted_for_ever_goes_on_as_it_is() -> None:
    """Creep and hysteresis are settled from the first sample on, in every phase; and then the drive changes."""
    model = OperatorInTime(operator(LogarithmicCreep(0.03, 1e-3, 1e3, 100.0)))
    line = sweep(0.4, 0.6, 12, 8)[:-1]
    for first in (0, 7, 12):
        u = np.concatenate([*[np.roll(line, -first)] * 5, np.roll(line, -first)[:1]])
        t = 5e-4 * np.arange(len(u))
        y = model.position(t, u, Start.LINE)
        assert y[20:] == pytest.approx(y[:-20], abs=1e-9)
        assert np.ptp(y - model.position(t, u, Start.SETTLED)) < 4e-3 * np.ptp(y)  # branches of a wider loop
        assert np.max(np.abs(np.diff(model.position(t, u, Start.REST)[::20]))) > 0.1
    with pytest.raises(Unphysical, match="does not begin with lines of one size and offset"):
        model.position(t[:22], u[:22], Start.LINE)
    with pytest.raises(Unphysical, match="does not begin with lines of one size and offset"):
        model.position(t, 0.4 + 0.3 * np.cos(0.9 * t / t[1]) * np.exp(-200.0 * t), Start.LINE)


def test_lines_do_not_wander_where_measured_branches_have_a_gap() -> None:
    """As a field of residuals leaves it at the turns; many lines would add it up."""
    gap = operator()
    field = Field(np.array([[0.2, 0.5]]), 1e-3 * np.ones((1, 42)), Lengths(1.0, 1.0, 1.0))
    u = np.tile(sweep(0.4, 0.6, 10, 10)[:-1], 500)
    y = OperatorInTime(replace(gap, residual=field)).hysteresis(u, Start.REST)
    assert np.ptp(y[1010::20]) < 1e-9
    assert np.ptp(y[1000::20]) < 1e-9
