"""Operators of piezos that the project does not contain: what they predict of lines that were never measured."""

from collections.abc import Callable
from functools import cache
from math import inf

import numpy as np
import pytest
from foreign_plants import SIX, TEN, BoucWen, ForeignPlant, JilesAtherton, ManyPlays, record, triangle
from sets import LONG_TEST

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.advice import check_scans, next_trace
from tablegen.calibration.operator.bouc_wen_fit import BoucWenProblem
from tablegen.calibration.operator.fit import OperatorFit, fit_operator
from tablegen.calibration.operator.loop_errors import compare
from tablegen.calibration.operator.periodic_line import PeriodicLine, periodic_line
from tablegen.calibration.operator.plays_fit import PlaysProblem
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.compensation.operator.plays import envelopes
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver

pytestmark = pytest.mark.common


class Response:
    """The dynamics as `calibrate resonance` would have measured them."""

    resonance_hz = 60e3
    half_width_hz = 2e3
    highest_hz = inf

    def __init__(self, plant: ForeignPlant) -> None:
        self._plant = plant

    def inverse(self, f_hz: Floats) -> tuple[Floats, Floats]:
        response = 1.0 / self._plant.dynamics(f_hz)
        return response.real, response.imag


def factor_of(plant: ForeignPlant) -> Callable[[float], float]:
    """m of (1), from images of 10 V at nine offsets."""
    centres = np.linspace(0.1, 0.9, 9)
    sizes = [float(np.ptp(plant.settled(triangle(200, centre, 0.1), 100.0))) for centre in centres]
    bent = np.polyfit(2.0 * centres - 1.0, 1.0 / np.array(sizes), 2)
    return lambda centre: float(np.polyval(bent, 2.0 * centre - 1.0))


def line(plant: ForeignPlant, centre: float, stroke: float, seed: int, noise: float = 0.001) -> PeriodicLine:
    return periodic_line(
        Trace(f"{stroke:g} at {centre:g}", *record(plant, centre, stroke, seed=seed, noise=noise)), 100.0
    )


@cache
def identified(kind: type, protocol: tuple[tuple[float, float], ...]) -> tuple[ForeignPlant, OperatorFit]:
    plant = ForeignPlant(kind())
    lines = [line(plant, centre, stroke, seed) for seed, (centre, stroke) in enumerate(protocol)]
    return plant, fit_operator(lines, Response(plant), factor_of(plant))


@pytest.mark.parametrize("problem_of", [PlaysProblem, BoucWenProblem])
def test_weights_are_the_best_that_are_not_negative(problem_of: type[PlaysProblem] | type[BoucWenProblem]) -> None:
    """By the conditions of Karush, Kuhn and Tucker: a better weight would have to be negative."""
    plant = ForeignPlant(ManyPlays())
    lines = [line(plant, 0.5, stroke, seed) for seed, stroke in enumerate((0.2, 0.5, 0.9))]
    problem = problem_of(lines, 0.5, lambda loss: LogarithmicCreep(loss, 1e-4, 10.0, 100.0))
    for start in problem.starts:
        best = problem.best_weights(start)
        columns = problem._displacements(tuple(start[:-1].tolist()))
        slopes = np.vstack([*columns, problem.penalty]).T @ best.residual
        assert np.min(best.weights) == 0.0 < np.max(best.weights)
        assert np.min(slopes) > -1e-10
        assert np.max(np.abs(slopes[best.weights > 0.0])) < 1e-10


@pytest.mark.rest
def test_the_family_and_the_creep_are_found() -> None:
    _, plays = identified(ManyPlays, SIX)
    assert plays.family == "plays"
    assert plays.operator.creep.loss_per_decade == pytest.approx(0.026, abs=0.001)
    _, other = identified(BoucWen, SIX)
    assert other.family == "Bouc-Wen"
    assert other.candidates["Bouc-Wen"] < other.candidates["none"] < 0.3 * other.candidates["plays"]
    assert other.operator.creep.loss_per_decade == pytest.approx(0.026, abs=0.001)
    # Its parameters, where h is that of the plant over a.
    core, loop = BoucWen(), other.operator.family.bouc_wen
    assert loop is not None
    by = core.a ** (core.n - 1.0)
    found = [loop.depth, loop.n, loop.beta, loop.gamma, loop.asymmetry]
    assert found == pytest.approx(
        [1250.0 * core.depth * core.a, core.n, core.beta * by, core.gamma * by, 0.5 * core.asymmetry],
        rel=0.06,
        abs=0.03,
    )
    # Sizes hold at the rate of the traces, with creep or without it: (23) counts from there.
    assert [fit.operator.creep.reference_hz for fit in (plays, other)] == pytest.approx([100.0, 100.0], rel=1e-3)


@pytest.mark.rest
@pytest.mark.parametrize(
    ("kind", "protocol", "centre", "strokes", "scaling", "mismatch", "size"),
    [
        pytest.param(*(ManyPlays, SIX, 0.5, (0.15, 0.35, 0.55, 0.75, 0.9), 2.5, 0.5, 0.5), marks=LONG_TEST),
        (ManyPlays, SIX, 0.85, (0.15, 0.28), 2.5, 0.5, 3.0),
        pytest.param(*(ManyPlays, TEN, 0.7, (0.15, 0.35, 0.55), 1.5, 0.25, 0.5), marks=LONG_TEST),
        pytest.param(*(ManyPlays, TEN, 0.85, (0.05, 0.15, 0.28), 1.5, 0.25, 0.5), marks=LONG_TEST),
        pytest.param(*(BoucWen, SIX, 0.5, (0.15, 0.35, 0.55, 0.75, 0.9), 3.0, 0.4, 0.5), marks=LONG_TEST),
        (BoucWen, SIX, 0.85, (0.05, 0.15, 0.28), 3.0, 0.4, 1.0),
        pytest.param(*(BoucWen, TEN, 0.7, (0.15, 0.35, 0.55), 3.0, 0.4, 0.5), marks=LONG_TEST),
        pytest.param(*(JilesAtherton, SIX, 0.5, (0.15, 0.55, 0.9), 3.0, 0.4, 0.5), marks=LONG_TEST),
        (JilesAtherton, TEN, 0.7, (0.15, 0.35, 0.55), 3.0, 0.4, 0.5),
    ],
)
def test_lines_that_were_not_measured(
    kind: type,
    protocol: tuple[tuple[float, float], ...],
    centre: float,
    strokes: tuple[float, ...],
    scaling: float,
    mismatch: float,
    size: float,
) -> None:
    plant, fit = identified(kind, protocol)
    factor, main = factor_of(plant), fit.operator.centre
    for stroke in strokes:
        noiseless = line(plant, centre, stroke, 0, noise=0.0).without(Response(plant), fit.operator.creep)
        loop = fit.operator.loop(noiseless.low, noiseless.high, factor(centre) / factor(main))
        found = compare(noiseless, loop)
        assert found.scaling < scaling, stroke
        assert found.mismatch < mismatch, stroke
        assert abs(found.size) < size, stroke


def test_what_was_measured_is_met_within_its_noise() -> None:
    for kind in (ManyPlays, BoucWen):
        _, fit = identified(kind, SIX)
        assert max(errors.rms for errors in fit.in_fit) < 0.03


@pytest.mark.rest
def test_what_is_left_out_is_larger_than_what_is_left() -> None:
    _, fit = identified(ManyPlays, TEN)
    assert np.median([e.rms for e in fit.left_out]) > np.median([e.rms for e in fit.in_fit])
    assert len(fit.operator.lines) == len(TEN)


def test_too_few_and_too_similar_traces_are_refused() -> None:
    plant = ForeignPlant(ManyPlays())
    two = [line(plant, 0.5, stroke, 0) for stroke in (0.3, 0.9)]
    with pytest.raises(Unphysical, match="2 traces are not enough"):
        fit_operator(two, None, lambda _: 1.0)
    alike = [line(plant, 0.5, stroke, 0) for stroke in (0.5, 0.55, 0.6)]
    with pytest.raises(Unphysical, match=r"strokes of 50 to 60 % of v_max are too similar"):
        fit_operator(alike, None, lambda _: 1.0)


def test_a_noisy_trace_is_refused_by_its_name() -> None:
    plant = ForeignPlant(ManyPlays())
    lines = [line(plant, 0.5, stroke, 0, noise) for stroke, noise in ((0.2, 0.001), (0.5, 0.2), (0.9, 0.001))]
    with pytest.raises(Unphysical, match=r"0\.5 at 0\.5: [\d.]+ % of the line differ from period to period"):
        fit_operator(lines, None, lambda _: 1.0)


def test_a_drive_with_inner_loops_is_refused() -> None:
    t = np.arange(5000) / 1000.0
    drive = 50.0 + 20.0 * np.sin(2 * np.pi * t) + 12.0 * np.sin(6 * np.pi * t)
    with pytest.raises(Unphysical, match="the drive goes back by"):
        periodic_line(Trace("", t, drive, 10.0 * drive), 100.0)


def test_a_record_without_a_period_is_refused() -> None:
    t = np.linspace(0.0, 1.0, 500)
    with pytest.raises(Unphysical, match="no whole period"):
        periodic_line(Trace("", t, 10.0 + 50.0 * t, 100.0 * t), 100.0)


@pytest.mark.parametrize(("periods", "samples", "turn"), [(2, 333, 0.5), (5, 800, 0.8), (7, 190, 0.3)])
def test_a_line_is_averaged_from_any_record(periods: int, samples: int, turn: float) -> None:
    plant = ForeignPlant(ManyPlays(count=40))
    trace = Trace("", *record(plant, 0.5, 0.6, 37.0, turn=turn, periods=periods, samples=samples))
    found = periodic_line(trace, 100.0)
    assert found.rate_hz == pytest.approx(37.0, rel=1e-3)
    assert found.stroke == pytest.approx(0.6, rel=0.01)
    assert found.centre == pytest.approx(0.5, abs=0.005)
    exact = plant.settled(triangle(4096, 0.5, 0.6, turn), 37.0)
    phase = np.arange(len(found.displacement_nm)) / len(found.displacement_nm)
    expected = np.interp(phase, np.arange(4096) / 4096, exact, period=1.0)
    difference = found.displacement_nm - expected
    assert float(np.std(difference)) < 0.004 * float(np.ptp(exact))


def test_traces_of_every_kind_together() -> None:
    """Few periods, noise, early and late turns, few samples and two rates."""
    plant = ForeignPlant(ManyPlays())
    kinds: list[dict[str, float]] = [
        {"periods": 2},
        {"turn": 0.3},
        {"rate_hz": 3.0},
        {"samples": 90},
        {"noise": 0.005, "turn": 0.7},
        {"turn": 0.95},
    ]
    lines = []
    for seed, ((centre, stroke), kind) in enumerate(zip(SIX, kinds, strict=True)):
        trace = Trace(str(seed), *record(plant, centre, stroke, seed=seed, **kind))  # type: ignore[arg-type]
        lines.append(periodic_line(trace, 100.0))
    fit = fit_operator(lines, Response(plant), factor_of(plant))
    assert fit.family == "plays"
    assert fit.operator.creep.loss_per_decade == pytest.approx(0.026, abs=0.002)
    for stroke in (0.15, 0.35, 0.55, 0.75, 0.9):
        noiseless = line(plant, 0.5, stroke, 0, noise=0.0).without(Response(plant), fit.operator.creep)
        found = compare(noiseless, fit.operator.loop(noiseless.low, noiseless.high))
        assert found.rms < 0.12
        assert found.mismatch < 0.25


@pytest.mark.rest
def test_fitted_envelopes_are_those_of_the_plant() -> None:
    plant, fit = identified(ManyPlays, TEN)
    assert isinstance(plant.core, ManyPlays)
    u = np.linspace(0.0, 1.0, 101)
    bow = u * (1.0 - u)
    true = np.sort([u + linear * bow + skew * bow * (u - 0.5) for linear, skew in plant.core.bends], axis=0)
    (bend,) = fit.operator.family.plays.bends
    assert np.stack(envelopes(u, bend)) == pytest.approx(true, abs=0.01)


def test_the_next_trace_is_that_of_the_scans_and_says_what_it_brings() -> None:
    plant, fit = identified(BoucWen, SIX)
    lines = [line(plant, centre, stroke, seed) for seed, (centre, stroke) in enumerate(SIX)]
    near = next_trace(fit, lines, 100.0, [(45.0, 50.0), (20.0, 85.0)])
    assert (near.size_v, near.offset_v) == pytest.approx((20.0, 85.0))
    assert near.left < 0.1
    assert 0.3 < next_trace(fit, lines, 100.0).left < 0.99
    with pytest.raises(Unphysical, match=r"a scan of 40 V at 85 V is not within 0\.\.100 V"):
        check_scans([(45.0, 50.0), (40.0, 85.0)], Driver(100.0))


@pytest.mark.rest
@pytest.mark.parametrize("kind", [ManyPlays, pytest.param(BoucWen, marks=LONG_TEST)])
def test_the_only_trace_of_an_offset_may_be_left_out(kind: type) -> None:
    """Its gain goes with it, and the other offset's stays at its place."""
    plant = ForeignPlant(kind())
    at = ((0.5, 0.2), (0.5, 0.5), (0.5, 0.8), (0.3, 0.25), (0.8, 0.25), (0.8, 0.1))
    lines = [line(plant, centre, stroke, seed) for seed, (centre, stroke) in enumerate(at)]
    fit = fit_operator(lines, Response(plant), factor_of(plant))
    assert max(errors.rms for errors in fit.in_fit) < 0.2
    assert max(errors.rms for errors in fit.left_out) < 5.0
