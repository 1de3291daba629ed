"""How far an operator may be off: against piezos that depart by a known process, and the laws that it has to obey."""

from itertools import pairwise
from math import hypot

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from replacing import replace

from tablegen.compensation.expectation import LEVEL_PERCENT
from tablegen.compensation.identification import MeasuredLine
from tablegen.compensation.operator.loop import POINTS, Loop
from tablegen.compensation.operator.uncertainty import (
    ErrorParts,
    Figures,
    LoopShape,
    PossibleErrors,
    shape_of,
    size_uncertainty,
)
from tablegen.numerics.arrays import Floats

pytestmark = pytest.mark.common

SIX = tuple((stroke, 0.5) for stroke in (0.1, 0.25, 0.45, 0.65, 0.82, 0.97))
TEN = (*SIX, (0.25, 0.7), (0.58, 0.7), (0.12, 0.85), (0.28, 0.85))
NOTHING = (0.0, 0.0, 0.0, 0.0)
STRAIGHT = LoopShape(0.0, 0.0, 0.0)  # without hysteresis, which does not change with the offset
BENT = LoopShape(3.0, 30.0, 8.0)
errors = st.tuples(*(st.floats(0.01, 5.0) for _ in range(4)))


def lines(
    places: tuple[tuple[float, float], ...], missed: list[tuple[float, ...]], noise: tuple[float, ...] = NOTHING
) -> list[MeasuredLine]:
    return [
        MeasuredLine(
            "", stroke, centre, 100.0, (one[0], one[1], one[2], one[3]), (noise[0], noise[1], noise[2], noise[3])
        )
        for (stroke, centre), one in zip(places, missed, strict=True)
    ]


def parts(measured: list[MeasuredLine], stroke: float, centre: float, shape: LoopShape = STRAIGHT) -> ErrorParts:
    """Of a line, where all loops have one shape."""
    return PossibleErrors(tuple(measured), (shape,) * len(measured), 0.5).at(stroke, centre, shape)


def departures(measured: list[MeasuredLine], stroke: float, centre: float) -> Figures:
    """Of piezos whose loops do not change with the offset, noise included."""
    found = parts(measured, stroke, centre)
    rms, scaling, mismatch, size = (hypot(a, b) for a, b in zip(found.noise, found.departure, strict=True))
    return rms, scaling, mismatch, size


def alike(points: Floats, others: Floats) -> Floats:
    """Matern's covariance of order 5/2, over 0.6 of stroke and 2.5 of centre, written once more."""
    out = np.ones((len(points), len(others)))
    for i, length in enumerate((0.6, 2.5)):
        d = np.sqrt(5.0) * np.abs(points[:, None, i] - others[None, :, i]) / length
        out *= (1.0 + d + d * d / 3.0) * np.exp(-d)
    return out


def covered(places: tuple[tuple[float, float], ...], at: list[tuple[float, float]], seed: int) -> tuple[float, float]:
    """How often the departure of random piezos is within the uncertainty, and how often within the median left out."""
    random = np.random.default_rng(seed)
    points = np.array([*places, *at])
    root = np.linalg.cholesky(alike(points, points) + 1e-9 * np.eye(len(points)))
    n, within, old = len(places), [], []
    for _ in range(100):
        value = root @ random.standard_normal((len(points), 4)) * 3.0
        missed = []
        for i in range(n):  # each from the others, by the plain formula
            other = [j for j in range(n) if j != i]
            weights = np.linalg.solve(
                alike(points[other], points[other]) + 1e-3 * np.eye(n - 1), alike(points[other], points[[i]])
            )
            missed.append(tuple(np.abs(value[i] - weights[:, 0] @ value[other]).tolist()))
        weights = np.linalg.solve(alike(points[:n], points[:n]) + 1e-3 * np.eye(n), alike(points[:n], points[n:]))
        off = np.abs(value[n:] - weights.T @ value[:n])
        measured = lines(places, missed)
        for k, (stroke, centre) in enumerate(at):
            within += (off[k] <= np.array(departures(measured, stroke, centre))).tolist()
            old += (off[k] <= np.median(np.array(missed), axis=0)).tolist()
    return 100.0 * float(np.mean(within)), 100.0 * float(np.mean(old))


@pytest.mark.rest
@pytest.mark.parametrize("places", [SIX, TEN])
def test_piezos_that_depart_at_random_stay_within_it_as_often_as_it_says(
    places: tuple[tuple[float, float], ...],
) -> None:
    far, without = covered(places, [(0.3, 0.85), (0.1, 0.75), (0.5, 0.3)], 1)
    assert LEVEL_PERCENT - 6.0 < far < 99.0
    if places == SIX:
        assert without < 60.0, "the median of all traces, wherever the scan is, would do as well"
    near, _ = covered(places, [(0.35, 0.5), (0.75, 0.5)], 2)
    assert LEVEL_PERCENT - 6.0 < near <= 100.0


@given(st.lists(errors, min_size=6, max_size=6), st.floats(0.1, 0.9), st.floats(0.5, 0.85), st.floats(0.01, 0.3))
def test_it_grows_with_the_way_from_the_traces(
    missed: list[tuple[float, ...]], stroke: float, centre: float, further: float
) -> None:
    found = lines(SIX, missed)
    near, far = departures(found, stroke, centre), departures(found, stroke, centre + further)
    assert all(a <= b * (1.0 + 1e-12) for a, b in zip(near, far, strict=True))
    assert far[0] > near[0]


@given(st.lists(errors, min_size=6, max_size=6), st.floats(0.1, 10.0), st.floats(0.1, 0.9), st.floats(0.3, 0.9))
def test_it_has_the_unit_of_what_is_left_out(
    missed: list[tuple[float, ...]], times: float, stroke: float, centre: float
) -> None:
    one = departures(lines(SIX, missed), stroke, centre)
    other = departures(lines(SIX, [tuple(times * by for by in row) for row in missed]), stroke, centre)
    assert other == pytest.approx(np.array(one) * times, rel=1e-9)


@given(errors, st.floats(0.1, 0.9), st.floats(0.3, 0.9))
def test_what_is_noise_does_not_grow(noise: tuple[float, ...], stroke: float, centre: float) -> None:
    assert departures(lines(SIX, [noise] * 6, noise), stroke, centre) == pytest.approx(noise, rel=1e-12)


def test_a_trace_at_the_scan_makes_it_small_and_signs_do_not_matter() -> None:
    missed: list[tuple[float, ...]] = [(0.05, 1.0, 0.1, -0.2)] * 7
    without = departures(lines(SIX, missed[:6]), 0.3, 0.8)
    there = departures(lines((*SIX, (0.3, 0.8)), missed), 0.3, 0.8)
    assert np.all(np.array(there) < 0.3 * np.array(without))
    turned = [replace(line, left_out=(0.05, 1.0, 0.1, 0.2)) for line in lines(SIX, missed[:6])]
    assert departures(turned, 0.3, 0.8) == without


def test_two_traces_at_one_place_are_no_reason_for_alarm() -> None:
    """They contradict each other a bit, as traces of two rates do; that is no departure of the whole range."""
    missed: list[tuple[float, ...]] = [(0.05, 1.0, 0.1, 0.1)] * 7
    one = departures(lines(SIX, missed[:6]), 0.3, 0.8)
    twins = departures(lines((*SIX, (0.451, 0.5)), missed), 0.3, 0.8)
    assert np.all(np.array(twins) < 4.0 * np.array(one))


def test_formulas_may_be_wrong_by_a_share_of_what_they_say() -> None:
    assert size_uncertainty((0.03, -0.04)) == pytest.approx(0.75)
    assert size_uncertainty(()) == 0.0


def test_a_loop_that_no_trace_showed_at_this_offset_may_be_another_one() -> None:
    """However well traces at one offset predict each other: the error grows with the loop, and with the way there."""
    measured = lines(SIX, [(0.01, 0.3, 0.02, 0.05)] * 6)
    at = [parts(measured, 0.3, centre, BENT).change for centre in (0.5, 0.55, 0.7, 0.85)]
    assert at[0] == NOTHING
    assert all(np.all(np.array(far) > np.array(near)) for near, far in pairwise(at))
    assert at[2][0] > 0.05 * BENT.rms
    twice = LoopShape(*(2.0 * value for value in BENT))
    found = parts(measured, 0.3, 0.7, twice).change
    assert found[:3] == pytest.approx(2.0 * np.array(at[2][:3]), rel=1e-12)
    assert parts(measured, 0.3, 0.7, STRAIGHT).change[:3] == NOTHING[:3]


def test_traces_at_other_offsets_decide_how_much_a_loop_changes() -> None:
    """They are predicted well, or badly, without themselves; the lines between them follow."""
    small, large = (0.01, 0.3, 0.02, 0.05), (0.5, 8.0, 1.5, 2.0)
    one_offset = parts(lines(SIX, [small] * 6), 0.3, 0.78, BENT).together
    alike_there = parts(lines(TEN, [small] * 10), 0.3, 0.78, BENT).together
    unlike_there = parts(lines(TEN, [small] * 6 + [large] * 4), 0.3, 0.78, BENT).together
    assert np.all(3.0 * np.array(alike_there)[:3] < np.array(one_offset)[:3])
    assert np.all(np.array(unlike_there) > 3.0 * np.array(alike_there))


def test_errors_of_other_offsets_do_not_count_where_most_traces_are() -> None:
    """A trace that is the only one of its kind is predicted badly; that says little of scans at the main offset."""
    small, large = (0.01, 0.3, 0.02, 0.05), (0.3, 5.0, 1.0, 1.0)
    ten = parts(lines(TEN, [small] * 6 + [large] * 4), 0.55, 0.5, BENT).together
    assert np.all(np.array(ten) < 0.3 * np.array(large))


def test_the_shape_of_a_loop_is_that_about_its_line() -> None:
    """Of a loop of which both branches are bent by 2 % of T_2, one up and one down, over 0.1..0.9 of the stroke."""
    u = np.linspace(0.0, 1.0, POINTS)
    bend = 0.02 * (2.0 * (2.0 * u - 1.0) ** 2 - 1.0)
    shape = shape_of(Loop(0.2, 0.6, u + bend, u - bend, 100.0))
    x = np.linspace(0.1, 0.9, 801)
    bent = 0.02 * (2.0 * (2.0 * x - 1.0) ** 2 - 1.0)
    assert shape.rms == pytest.approx(100.0 * float(np.sqrt(np.mean(bent**2))), rel=1e-2)
    assert shape.mismatch == pytest.approx(200.0 * float(np.max(np.abs(bent))), rel=1e-2)
    assert shape.scaling == pytest.approx(100.0 * float(np.ptp(np.gradient(bent, x))), rel=0.1)
    assert shape_of(Loop(0.2, 0.6, u, u, 100.0)) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
