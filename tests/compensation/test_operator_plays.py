"""Plays in closed form against plays that are stepped, and the loops that they make."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from replacing import replace

from tablegen.compensation.operator.loop import POINTS, Loop
from tablegen.compensation.operator.operator import chebyshev
from tablegen.compensation.operator.plays import Plays, envelopes, plays
from tablegen.numerics.arrays import Floats

THRESHOLDS = np.array([0.01, 0.07, 0.2, 0.45])


BENDS = np.array([[0.0, 0.0, 0.0, 0.0], [-1.0, 0.0, -1.0, 0.0], [-0.2, 0.3, 0.25, -0.1]])


def stepped(u: Floats, bend: Floats, threshold: float) -> Floats:
    """A play by its definition, sample by sample, over the third of three periods."""
    lower, upper = envelopes(u, bend)
    state, out = 0.0, np.empty(len(u))
    for _ in range(3):
        for k in range(len(u)):
            state = min(max(state, lower[k] - threshold), upper[k] + threshold)
            out[k] = state
    return out


@pytest.mark.common
@given(st.floats(0.0, 0.6), st.floats(0.05, 0.4))
def test_settled_plays_are_those_that_are_stepped(low: float, stroke: float) -> None:
    up = np.linspace(low, low + stroke, 60)
    u = np.concatenate([up, up[-2:0:-1]])
    rising, falling = (plays(u, low, low + stroke, going, THRESHOLDS, BENDS) for going in (True, False))
    for number, bend in enumerate(BENDS):
        least, most = envelopes(low, bend)[1], envelopes(low + stroke, bend)[0]
        for i, threshold in enumerate(THRESHOLDS.tolist()):
            expected = stepped(u, bend, threshold)
            moving = 2.0 * threshold < most - least
            found = np.where(np.arange(len(u)) < len(up), rising[number, i], falling[number, i])
            # One that stands still may stand anywhere that its history left it.
            assert np.ptp(expected) < 1e-12 if not moving else np.allclose(found, expected, atol=1e-12)


def test_envelopes_rise_and_do_not_cross() -> None:
    u = np.linspace(0.0, 1.0, 201)
    for bend in np.random.default_rng(2).uniform(-0.6, 0.6, (50, 4)):
        lower, upper = envelopes(u, bend)
        assert np.all(lower <= upper)
        assert min(np.diff(lower).min(), np.diff(upper).min()) > 0.0
        assert [lower[0], upper[0], lower[-1], upper[-1]] == [0.0, 0.0, 1.0, 1.0]


@pytest.mark.common
@given(st.floats(0.0, 0.6), st.floats(0.02, 0.4))
def test_branches_are_sums_of_settled_plays(low: float, stroke: float) -> None:
    """To the last bit, added in the order of the rows; one that is missing is seen."""
    weights = np.array([[3.0, 0.0, 2.0, 1.0], [0.0, 1.0, 0.0, 0.0], [0.5, 0.25, 0.0, 0.7]])
    family, u = Plays(THRESHOLDS, weights, np.array([1.0, 0.3]), BENDS), low + stroke * np.linspace(0.0, 1.0, 40)
    for going, branch in zip((True, False), family.branches(u, low, low + stroke), strict=True):
        total = u + 0.3 * (u * u)
        for weighted, row in zip(plays(u, low, low + stroke, going, THRESHOLDS, BENDS), weights, strict=True):
            for play, weight in zip(weighted, row.tolist(), strict=True):
                total = total + weight * play
        assert branch.tolist() == total.tolist() == family.branch(u, low, low + stroke, going).tolist()
        fewer = replace(family, weights=np.where(weights == 0.25, 0.0, weights))
        assert fewer.branch(u, low, low + stroke, going).tolist() != branch.tolist()


def test_branches_meet_where_the_drive_turns() -> None:
    family = Plays(THRESHOLDS, np.array([[3.0, 0.0, 2.0, 1.0], [0.0, 1.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0]]), np.ones(2))
    ends = np.array([0.2, 0.9])
    rising, falling = (family.branch(ends, 0.2, 0.9, going) for going in (True, False))
    assert rising == pytest.approx(falling, abs=1e-12)


@given(st.floats(0.0, 1.0), st.booleans())
def test_a_loop_and_its_inverse(position: float, rising: bool) -> None:
    grid = np.linspace(0.0, 1.0, POINTS)
    loop = Loop(0.2, 0.9, grid + 0.1 * np.sin(np.pi * grid), grid - 0.08 * np.sin(np.pi * grid), 700.0)
    drive = loop.drive(np.array([position]), rising)
    assert loop.position(drive, rising)[0] == pytest.approx(position, abs=1e-12)


def test_clenshaw_is_the_sum_of_chebyshev_polynomials() -> None:
    x = np.linspace(-1.0, 1.0, 41)
    coefficients = np.random.default_rng(3).normal(size=21)
    assert chebyshev(coefficients, x) == pytest.approx(np.polynomial.chebyshev.chebval(x, coefficients), abs=1e-12)
