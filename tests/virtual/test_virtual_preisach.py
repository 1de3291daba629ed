"""The hysteresis of the virtual scanner: the laws of a Preisach operator, and relays that know no polynomial."""

from itertools import pairwise
from math import factorial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tablegen.numerics.arrays import Floats
from tablegen.virtual.parameters import load_truth
from tablegen.virtual.preisach import Preisach

DRIVE = st.integers(0, 64).map(lambda n: n / 64)  # a coarse grid: extremes meet again
HISTORY = st.lists(DRIVE, min_size=1, max_size=30)
DEFAULT = Preisach(*(lambda h: (tuple(h.reversible_nm), tuple(map(tuple, h.density_nm))))(load_truth().x.hysteresis))
SMALL = Preisach((3.0, 1.0), ((2.0, 0.5, 1.0), (0.0, 4.0), (0.7,)))
OPERATORS = st.sampled_from([DEFAULT, SMALL, Preisach((1.0,), ((2.0,),)), Preisach((0.0,), ((0.0, 1.0), (5.0,)))])
NM = 1e-6  # a femtometre


def last(operator: Preisach, history: list[float]) -> float:
    """Displacement at the end of a history."""
    return float(operator.play(np.array(history))[0][-1])


class Relays:
    """The definition itself: relays that switch up at alpha and down at beta, weighted by the density."""

    def __init__(self, operator: Preisach, count: int) -> None:
        centre = (np.arange(count) + 0.5) / count
        alpha, beta = (a.ravel() for a in np.meshgrid(centre, centre, indexing="ij"))
        share = np.where(alpha > beta, 1.0, np.where(alpha == beta, 0.5, 0.0)) / count**2
        self.alpha, self.beta = alpha, beta
        n = len(operator.density) - 1
        density = np.zeros_like(alpha)
        for i, row in enumerate(operator.density):
            for j, weight in enumerate(row):
                k = n - i - j
                number = factorial(n) / (factorial(i) * factorial(j) * factorial(k))
                density += weight * number * (1 - alpha) ** i * np.maximum(alpha - beta, 0.0) ** j * beta**k
        self.weight = density * share
        m = len(operator.reversible) - 1
        v = np.linspace(0.0, 1.0, 4001)
        slope = sum(
            w * factorial(m) / (factorial(i) * factorial(m - i)) * v**i * (1 - v) ** (m - i)
            for i, w in enumerate(operator.reversible)
        )
        self.v = v
        self.reversible = np.append(0.0, np.cumsum(0.5 * (slope[1:] + slope[:-1]) * np.diff(v)))

    def play(self, drive: list[float]) -> Floats:
        up = np.zeros(len(self.alpha), dtype=bool)
        out = []
        for v in drive:
            up = (up | (self.alpha <= v)) & (self.beta < v)
            out.append(float(self.weight @ up) + float(np.interp(v, self.v, self.reversible)))
        return np.array(out)


def steps(history: list[float]) -> list[float]:
    """The history in steps of 1/64, at which no relay is half switched."""
    return [x for a, b in pairwise([0.0, *history]) for x in np.linspace(a, b, 1 + round(abs(b - a) * 64))[1:]]


@pytest.mark.parametrize("operator", [DEFAULT, SMALL], ids=["default", "small"])
def test_relays_agree(operator: Preisach) -> None:
    generator = np.random.default_rng(5)
    relays = Relays(operator, 64)
    full = float(operator.branch(1.0, 0.0))
    for _ in range(3):
        history = steps([round(x * 64) / 64 for x in generator.random(8)])
        assert operator.play(np.array(history))[0] == pytest.approx(relays.play(history), abs=8e-4 * full)


def test_relays_see_a_memory_that_is_not_wiped_out() -> None:
    """Negative control: an operator that always continues from its last turning point."""

    class Forgetful(Preisach):
        def play(self, drive: Floats, memory: object = None) -> tuple[Floats, object]:  # type: ignore[override]
            out, turned, at, y = [], 0.0, 0.0, 0.0
            for v in drive:
                change = self.branch(max(v, at), min(v, at)) * (1 if v > at else -1)
                turned, y = at, y + float(change)
                at = v
                out.append(y)
            return np.array(out), turned

    history = steps([0.75, 0.25, 0.5, 0.375, 1.0, 0.125])
    wrong = Forgetful(SMALL.reversible, SMALL.density).play(np.array(history))[0]
    assert np.max(np.abs(wrong - Relays(SMALL, 64).play(history))) > 0.05 * float(SMALL.branch(1.0, 0.0))


@pytest.mark.common
@settings(max_examples=60)
@given(OPERATORS, HISTORY, st.integers(1, 5))
def test_the_rate_does_not_matter(operator: Preisach, history: list[float], between: int) -> None:
    slow = [x for a, b in pairwise([0.0, *history]) for x in np.linspace(a, b, between + 1)[1:]]
    fast = operator.play(np.array(history))[0]
    assert operator.play(np.array(slow))[0][between - 1 :: between] == pytest.approx(fast, abs=NM)


@settings(max_examples=60)
@given(OPERATORS, HISTORY, st.integers(0, 30))
def test_a_history_can_be_played_in_pieces(operator: Preisach, history: list[float], cut: int) -> None:
    whole, end = operator.play(np.array(history))
    first, memory = operator.play(np.array(history[:cut]))
    second, again = operator.play(np.array(history[cut:]), memory)
    assert np.concatenate((first, second)) == pytest.approx(whole, abs=NM)
    assert again.drives == end.drives


@settings(max_examples=60)
@given(OPERATORS, HISTORY, DRIVE, st.lists(DRIVE, max_size=10))
def test_an_excursion_that_returns_is_forgotten(
    operator: Preisach, history: list[float], turn: float, inner: list[float]
) -> None:
    """Return-point memory: from a turning point away, about inside, to the far end, and back."""
    here = history[-1]
    inside = [min(max(x, min(here, turn)), max(here, turn)) for x in inner]
    way = [*history, turn]
    assert last(operator, [*way, *inside, here, turn]) == pytest.approx(last(operator, [*way, here, turn]), abs=NM)
    # And what follows is what would have followed without it.
    assert last(operator, [*way, *inside, here, turn, 0.5]) == pytest.approx(
        last(operator, [*way, here, turn, 0.5]), abs=NM
    )


@settings(max_examples=60)
@given(OPERATORS, HISTORY, HISTORY, DRIVE, DRIVE)
def test_loops_between_the_same_drives_are_congruent(
    operator: Preisach, one: list[float], other: list[float], low: float, high: float
) -> None:
    low, high = sorted((low, high))
    loop = [low, *np.linspace(low, high, 6), *np.linspace(high, low, 6)]
    shapes = [operator.play(np.array([*history, high, *loop]))[0][-12:] for history in (one, other)]
    assert shapes[0] - shapes[0][0] == pytest.approx(shapes[1] - shapes[1][0], abs=NM)


@settings(max_examples=60)
@given(OPERATORS, HISTORY)
def test_nothing_moves_against_its_drive(operator: Preisach, history: list[float]) -> None:
    moved = np.diff(operator.play(np.array([0.0, *history]))[0])
    driven = np.diff(np.array([0.0, *history]))
    assert np.all(moved * np.sign(driven) >= -NM)
    assert moved[driven == 0.0] == pytest.approx(0.0, abs=NM)


@pytest.mark.common
@given(HISTORY)
def test_without_density_there_is_no_hysteresis(history: list[float]) -> None:
    operator = Preisach(DEFAULT.reversible, ((0.0, 0.0), (0.0,)))
    single = {v: float(operator.branch(v, 0.0)) for v in history}
    assert operator.play(np.array(history))[0] == pytest.approx([single[v] for v in history], abs=NM)


@pytest.mark.parametrize("operator", [DEFAULT, SMALL], ids=["default", "small"])
@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (0.4, 0.6), (0.0, 0.2), (0.8, 1.0)])
def test_displacement_lags_the_drive(operator: Preisach, low: float, high: float) -> None:
    """Rising it is below, falling above: every loop loses energy."""
    up = np.linspace(low, high, 401)
    drive = np.concatenate((up, up[::-1][1:-1]))
    moved = operator.settled(drive)
    rising, falling = moved[:401], np.concatenate((moved[400:], moved[:1]))[::-1]
    assert np.all(rising[1:-1] < falling[1:-1])
    assert np.sum(0.5 * (drive + np.roll(drive, 1)) * (moved - np.roll(moved, 1))) > 0.0


def test_constant_density_is_the_rayleigh_law() -> None:
    """Closed form: a branch of length h moves by r h + mu h^2 / 2, wherever it starts."""
    operator = Preisach((7.0,), ((4.0,),))
    for low, high in ((0.0, 1.0), (0.2, 0.7), (0.6, 0.61)):
        h = high - low
        assert float(operator.branch(high, low)) == pytest.approx(7.0 * h + 2.0 * h * h, rel=1e-12)
    triangle = np.concatenate((np.linspace(0.2, 0.7, 100), np.linspace(0.7, 0.2, 100)))
    h = triangle[:100] - 0.2
    moved = operator.settled(triangle)
    assert moved[:100] - moved[0] == pytest.approx(7.0 * h + 2.0 * h * h)
    assert moved[100] - moved[100:] == pytest.approx(7.0 * h + 2.0 * h * h)


def test_one_period_settles() -> None:
    drive = np.concatenate((np.linspace(0.3, 0.8, 50), np.linspace(0.8, 0.1, 70), np.linspace(0.1, 0.3, 20)))
    settled = DEFAULT.settled(drive)
    assert DEFAULT.play(np.tile(drive, 4))[0][-140:] == pytest.approx(settled, abs=NM)


@pytest.mark.parametrize(
    ("reversible", "density"),
    [((), ()), ((1.0,), ((1.0,), (1.0,))), ((1.0,), ((-1.0,),)), ((-1.0,), ()), ((1.0,), ((1.0, 1.0),))],
)
def test_coefficients_that_are_none_are_refused(
    reversible: tuple[float, ...], density: tuple[tuple[float, ...], ...]
) -> None:
    with pytest.raises(ValueError, match=r"rows of|run backwards"):
        Preisach(reversible, density)


@pytest.mark.parametrize("drive", [-0.01, 1.01])
def test_drives_outside_are_refused(drive: float) -> None:
    with pytest.raises(ValueError, match=r"leaves 0\.\.1"):
        DEFAULT.play(np.array([0.5, drive]))
