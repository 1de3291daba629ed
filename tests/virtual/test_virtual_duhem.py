"""The Duhem operator: the laws of its family, and scipy's integration of its equation."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from paper.identify import X_TARGETS, Y_TARGETS
from paper.identify_duhem import identify_duhem
from scipy.integrate import solve_ivp
from scipy.interpolate import BPoly

from tablegen.numerics.arrays import Floats
from tablegen.virtual.duhem import POINTS, Duhem, Lag, Lags
from tablegen.virtual.parameters import load_truth

DRIVE = st.integers(0, 64).map(lambda n: n / 64)
HISTORY = st.lists(DRIVE, min_size=1, max_size=30)
BUILT_IN = load_truth("duhem").x.hysteresis.operator()
assert isinstance(BUILT_IN, Duhem)
SMALL = Duhem((3000.0, 2500.0, 2800.0), (Lag(3.0, 5.0, (50.0, 80.0, 20.0), (20.0, 40.0, 120.0)),))
OPERATORS = st.sampled_from([BUILT_IN, SMALL])
NM = 1e-6  # a femtometre


def bernstein(coefficients: tuple[float, ...]) -> BPoly:
    return BPoly(np.array(coefficients)[:, None], [0.0, 1.0])


def branch(lag: Lag, b: BPoly, c: BPoly, up: bool) -> Callable[[float, Floats], Floats]:
    return lambda u, z: lag.rise * (-b(u) - z) if up else -lag.fall * (c(u) - z)


def integrated(operator: Duhem, history: list[float]) -> Floats:
    """The equation of the module's first lines, branch by branch, by scipy alone; from balance at 0."""
    out: list[float] = []
    reversible = bernstein(operator.reversible).antiderivative()
    states = []
    for lag in operator.lags:
        b, c = bernstein(lag.below), bernstein(lag.above)
        states.append((lag, b, c, float((lag.fall * c(0.0) - lag.rise * b(0.0)) / (lag.rise + lag.fall))))
    rest = sum(z for *_, z in states)
    for start, end in pairwise([0.0, *history]):
        after = []
        for lag, b, c, z in states:
            found = solve_ivp(branch(lag, b, c, end > start), (start, end), [z], rtol=1e-10, atol=1e-9).y[0, -1]
            after.append((lag, b, c, z if end == start else float(found)))
        states = after
        out.append(float(reversible(end)) + sum(z for *_, z in states) - rest)
    return np.array(out)


@pytest.mark.common
@pytest.mark.parametrize("operator", [BUILT_IN, SMALL], ids=["built in", "small"])
def test_the_equation_is_solved(operator: Duhem) -> None:
    history = [0.7, 0.2, 0.9, 0.35, 0.36, 1.0, 0.0, 0.5]
    assert operator.play(np.array(history))[0] == pytest.approx(integrated(operator, history), abs=1e-5)
    # Negative control: a lag that does not know its direction.
    lags = tuple(Lag(lag.fall, lag.rise, lag.below, lag.above) for lag in operator.lags)
    swapped = object.__new__(Duhem)
    object.__setattr__(swapped, "reversible", operator.reversible)
    object.__setattr__(swapped, "lags", lags)
    assert np.max(np.abs(swapped.play(np.array(history))[0] - integrated(operator, history))) > 1.0


@settings(max_examples=60)
@given(OPERATORS, HISTORY, st.integers(1, 7))
def test_neither_rate_nor_ticks_matter(operator: Duhem, history: list[float], between: int) -> None:
    slow = [x for a, b in pairwise([0.0, *history]) for x in np.linspace(a, b, between + 1)[1:]]
    fast = operator.play(np.array(history))[0]
    assert operator.play(np.array(slow))[0][between - 1 :: between] == pytest.approx(fast, abs=NM)


@settings(max_examples=40)
@given(OPERATORS, HISTORY, st.integers(0, 30))
def test_a_history_can_be_played_in_pieces(operator: Duhem, history: list[float], cut: int) -> None:
    whole, end = operator.play(np.array(history))
    first, memory = operator.play(np.array(history[:cut]))
    second, again = operator.play(np.array(history[cut:]), memory)
    assert np.concatenate((first, second)) == pytest.approx(whole, abs=NM)
    assert again.nm == pytest.approx(end.nm, abs=NM)


@pytest.mark.common
@settings(max_examples=60)
@given(OPERATORS, st.lists(DRIVE, min_size=2, max_size=12))
def test_a_settled_period_closes(operator: Duhem, period: list[float]) -> None:
    """It is what it becomes when it is repeated, and what it remains."""
    drive = np.array(period)
    settled = operator.settled(drive)
    way = float(np.sum(np.abs(np.diff(np.append(drive[-1], drive)))))
    slowest = min(rate for lag in operator.lags for rate in (lag.rise, lag.fall))
    if way == 0.0:
        assert settled == pytest.approx(operator.play(drive)[0], abs=NM)
        return
    periods = int(np.ceil(30.0 / (slowest * 0.5 * way))) + 1  # e^-30 of what was before
    assert operator.play(np.tile(drive, periods))[0][-len(drive) :] == pytest.approx(settled, abs=NM)


@pytest.mark.common
@settings(max_examples=60)
@given(OPERATORS, HISTORY)
def test_nothing_moves_against_its_drive(operator: Duhem, history: list[float]) -> None:
    """Nor does a lag leave its reach, of which the bound on the slope is made."""
    moved = np.diff(np.append(0.0, operator.play(np.array(history))[0]))
    driven = np.diff(np.array([0.0, *history]))
    assert np.all(moved * np.sign(driven) >= operator.least_slope() * np.abs(driven) - NM)
    assert moved[driven == 0.0] == pytest.approx(0.0, abs=NM)
    at = history[-1]
    for z, lag in zip(operator.play(np.array(history))[1].nm, operator.lags, strict=True):
        low, high = (np.interp(at, POINTS, side) for side in lag.reach)
        assert low - 0.02 * abs(low) - 0.1 <= z <= high + 0.02 * abs(high) + 0.1  # between points of the grid


@settings(max_examples=40)
@given(OPERATORS, HISTORY, HISTORY)
def test_the_past_decays_with_the_way(operator: Duhem, one: list[float], other: list[float]) -> None:
    """No wiping out: the difference of two pasts shrinks by e^-(rate x way) of each lag, and by no more."""
    after = np.array([0.0, 1.0, 0.25])
    ends = [operator.play(np.append(np.array([*past, 0.5]), after))[1].nm for past in (one, other)]
    before = [operator.play(np.array([*past, 0.5]))[1].nm for past in (one, other)]
    for n, lag in enumerate(operator.lags):
        left = np.exp(-lag.fall * 0.5 - lag.rise * 1.0 - lag.fall * 0.75)
        assert ends[0][n] - ends[1][n] == pytest.approx(left * (before[0][n] - before[1][n]), abs=NM)


def test_it_is_another_family() -> None:
    """A Preisach operator forgets an excursion that returned (return-point memory); this one does not."""
    direct, detour = ([1.0, 0.3, 0.8], [1.0, 0.3, 0.6, 0.4, 0.8])
    preisach = load_truth().x.hysteresis.operator()
    apart = [
        abs(float(np.subtract(*(one.play(np.array(way))[0][-1] for way in (direct, detour)))))
        for one in (preisach, BUILT_IN)
    ]
    assert apart[0] < NM
    assert apart[1] > 1.0


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (0.4, 0.6), (0.0, 0.2), (0.8, 1.0)])
def test_displacement_lags_and_rise_differs_from_fall(low: float, high: float) -> None:
    up = np.linspace(low, high, 401)
    moved = BUILT_IN.settled(np.concatenate((up, up[::-1][1:-1])))
    rising, falling = moved[:401], np.concatenate((moved[400:], moved[:1]))[::-1]
    # Where b and c are near 0, at the low end of the drive, the largest loop is closed to 0.1 nm, one way or the other.
    assert np.all(rising[1:-1] < falling[1:-1] + (0.1 if low == 0.0 else 0.0))
    assert np.mean(falling - rising) > 0.02 * np.ptp(moved) * (high - low)
    chord = np.linspace(moved[0], moved[400], 401)
    below, above = np.max(chord - rising), np.max(falling - chord)
    assert above > (2.0 if high - low == 1.0 else 1.0) * below


def test_a_long_way_saturates() -> None:
    """With constant b and c: after a long rise the lag is -b whatever was before, after a long fall +c."""
    operator = Duhem((5000.0,), (Lag(40.0, 50.0, (30.0,), (20.0,)),))
    for past in ([0.0], [0.3, 0.1, 0.2]):
        _, memory = operator.play(np.array([*past, 0.0, 1.0]))
        assert memory.nm == pytest.approx((-30.0,), abs=1e-6)
        assert operator.play(np.array([0.0]), memory)[1].nm == pytest.approx((20.0,), abs=1e-6)
    # A small drive to and fro ends in balance: here where both pull alike.
    stirred = operator.play(np.tile([0.5, 0.501], 3000), Lags(0.5, (20.0,)))[1].nm
    assert stirred == pytest.approx(((50.0 * 20.0 - 40.0 * 30.0) / 90.0,), abs=2.0)


@pytest.mark.parametrize(
    ("reversible", "lags", "why"),
    [
        ((), (), "need coefficients"),
        ((-1.0,), (), "below 0"),
        ((1.0,), (Lag(5.0, 5.0, (-1.0,), (0.0,)),), "below 0"),
        ((1.0,), (Lag(0.1, 5.0, (0.0,), (0.0,)),), "less than 0.5"),
        ((100.0,), (Lag(5.0, 5.0, (50.0,), (50.0,)),), "run backwards"),
    ],
)
def test_operators_that_are_none_are_refused(reversible: tuple[float, ...], lags: tuple[Lag, ...], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        Duhem(reversible, lags)


@pytest.mark.parametrize("drive", [-0.01, 1.01])
def test_drives_outside_are_refused(drive: float) -> None:
    with pytest.raises(ValueError, match=r"leaves 0\.\.1"):
        BUILT_IN.play(np.array([0.5, drive]))


@pytest.mark.common
def test_identification_gives_the_parameters_in_the_package() -> None:
    """Of what they do, not of their digits."""
    up = np.linspace(0.0, 1.0, 51)
    drive = np.concatenate((up, up[::-1], 0.4 * up, 0.4 * up[::-1]))
    packaged = BUILT_IN.play(drive)[0]
    same, other = (identify_duhem(targets).hysteresis.play(drive)[0] for targets in (X_TARGETS, Y_TARGETS))
    assert same == pytest.approx(packaged, abs=1e-3 * np.ptp(packaged))
    assert np.max(np.abs(other - packaged)) > 1e-2 * np.ptp(packaged)  # negative control: other targets
