"""Fit an operator in time to records of any drive: plays, a polynomial and creep, by non-negative least squares.

The displacement is linear in the weights of the plays, each followed in time, in the polynomial, and in the unknown
state of creep at the start; creep's loss per decade and the delay of the sensor are searched for. The last part of each
record, by the travel of the drive, is predicted from a fit to the part before it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from math import comb

import numpy as np
from scipy.optimize import nnls

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.operator.fit import OperatorFit
from tablegen.calibration.operator.loop_errors import LineErrors, sweep_errors
from tablegen.calibration.operator.time_columns import (
    Begin,
    PlayBasis,
    late_sum,
    modal,
    resonance_and_delay,
    transients,
)
from tablegen.calibration.operator.time_record import TimeRecord
from tablegen.calibration.operator.units import check_alike
from tablegen.compensation.dynamics import Response
from tablegen.compensation.identification import MeasuredLine
from tablegen.compensation.operator.creep import NO_CREEP, LogarithmicCreep
from tablegen.compensation.operator.family import Family
from tablegen.compensation.operator.field import Lengths, through
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.plays import FIXED_BENDS, Plays
from tablegen.fitting.estimate import Estimate
from tablegen.numerics.arrays import Bools, Floats

Factor = Callable[[float], float]
_RIDGE = 1e-3  # weight of the penalty on weights, of the sensitivity
_SMOOTH = 1e-2  # weight of the penalty on steps of their density along the threshold
_LEAST_SLOPE = 0.2  # of the static curve, of the sensitivity, so that the smallest loops have a slope
_HELD_OUT = 0.25  # of the travel of a record's drive
_HIGHEST = 0.495  # threshold; above it no play moves
_SPACING = 1.5
_MORE_BENDS = np.array([[-0.3, 0.0, 0.3, 0.0], [-0.5, 0.0, 0.0, 0.0], [0.0, 0.0, 0.5, 0.0], [0.0, 0.6, 0.0, 0.6]])
_ROWS_PER_WEIGHT = 4  # least samples for each weight
_CLEARLY = 1.05  # ratio of the errors of the held-out part, below which the simpler model is taken
_MOST_LOSS = 0.1  # of creep, per decade
_LOSS_STEP, _DELAY_STEP = 0.02, 0.003  # first steps; of a delay in periods
_MOST_DELAY = 0.03  # periods
_SHARPEST = 0.02  # of the steps, at which the search ends
_LEAD_IN, _DEPARTS, _DEPARTS_BY = 0.1, 6.0, 0.02  # of the samples; of the rms of the others; of the stroke
_CONTRADICTS_PERCENT, _CONTRADICTS_RATIO = 1.0, 3.0  # rms of a record beside others, and over that alone
_MOST_LINES = 12
_LEAST_SWEEP = 0.03  # of the driver's range
_ALIKE = 0.1  # of the driver's range: strokes and centres of sweeps that make one line
_ROW = 4  # coefficients of both branches that a line of the file has at least; all are 0
_LENGTHS = Lengths(0.8, 0.5, 1e-4)


@dataclass(frozen=True)
class Complexity:
    """A model by its name, from the fewest weights on."""

    name: str
    thresholds: int
    bends: int
    degree: int

    @property
    def basis(self) -> PlayBasis:
        """The plays and powers of the model."""
        r = _HIGHEST * (np.arange(1, self.thresholds + 1) / self.thresholds) ** _SPACING
        return PlayBasis(r, np.vstack([FIXED_BENDS, _MORE_BENDS])[: self.bends], self.degree)

    @property
    def weights(self) -> int:
        """The number of its weights."""
        return self.thresholds * self.bends + self.degree


COMPLEXITIES = (Complexity("simple", 6, 1, 2), Complexity("medium", 12, 3, 3), Complexity("full", 26, 7, 4))


@dataclass(frozen=True, eq=False)
class RecordErrors:
    """Errors of one record, in percent of its stroke, without their mean.

    ``rms`` and ``worst`` are those in the fit, ``predicted_rms`` and ``predicted_worst`` those of the last part, from
    ``predicted_from_s`` on, of a fit to the part before. ``begin`` is the state before the record, ``skipped_s`` the
    time at its start that is not fitted, ``displacement_nm`` the displacement of the fit at the times of the record.
    """

    record: TimeRecord
    rms: float
    worst: float
    predicted_rms: float
    predicted_worst: float
    predicted_from_s: float
    begin: Begin
    skipped_s: float
    displacement_nm: Floats
    predicted_nm: Floats


@dataclass(frozen=True, eq=False)
class RecordsFit(OperatorFit):
    """The operator, and the errors of each record and of each line that the records have.

    ``family`` is the model, ``candidates`` has the mean rms error of the last parts, in percent, of every model that
    was tried. A delay of ``best_delay_s`` would take the share ``delay_gain`` of the rms away.
    """

    errors: tuple[RecordErrors, ...]
    delay: Estimate
    best_delay_s: float
    delay_gain: float
    samples: int
    weights: int


def fit_records(
    records: Sequence[TimeRecord], response: Response | None, factor: Factor, delay_s: float | None
) -> RecordsFit:
    """Fit an operator to records; ``factor`` is m of (1) at a centre; a ``delay_s`` of None is fitted.

    Raises
    ------
    Unphysical
        If the records contradict each other, or are too short for any operator.
    """
    check_alike(records, "records")
    count = sum(len(record.time_s) for record in records)
    usable = [one for one in COMPLEXITIES if _ROWS_PER_WEIGHT * one.weights <= count] or [COMPLEXITIES[0]]
    begins = [_begin_of(record, usable[0].basis, response) for record in records]
    problems = [_Problem(records, one, begins, response) for one in usable]
    start_s = 0.0 if delay_s is None else delay_s
    first = problems[min(1, len(problems) - 1)]
    first.search(first.whole, start_s, fits_delay=False)
    for problem in problems:
        problem.skip_lead_in(start_s)
    parts = [problem.search(problem.before, start_s, fits_delay=delay_s is None) for problem in problems]
    scores = [problem.predicted(part) for problem, part in zip(problems, parts, strict=True)]
    at = next(i for i, score in enumerate(scores) if score <= _CLEARLY * min(scores))
    problem, part = problems[at], parts[at]
    whole = problem.search(problem.whole, start_s, fits_delay=delay_s is None)
    _check_contradictions(problem, whole)
    free = whole if delay_s is None else problem.search(problem.whole, start_s, fits_delay=True)
    names = {one.name: score for one, score in zip(usable, scores, strict=True)}
    return _assembled(problem, whole, part, free, names, factor, delay_s is None)


@dataclass(frozen=True, eq=False)
class _Solution:
    loss: float
    delay_s: float
    weights: Floats  # of the scale
    cost: float
    used: tuple[Bools, ...]


class _Problem:
    """The least squares of one model, for all records."""

    def __init__(
        self, records: Sequence[TimeRecord], model: Complexity, begins: Sequence[Begin], response: Response | None
    ) -> None:
        self.records, self.model, self.begins = records, model, begins
        self.basis = model.basis
        modes, self.lag_s = resonance_and_delay(response, 0.0)
        self.scale = float(np.median([record.span_nm / record.stroke for record in records]))
        rates = [record.rate_hz for record in records]
        self.reference_hz = float(np.exp(np.mean(np.log(rates))))
        self.period_s = 1.0 / max(rates)
        step_s = min(float(np.median(np.diff(record.time_s))) for record in records)
        longest_s = max(float(record.time_s[-1]) for record in records)
        self.fastest_s, self.slowest_s = max(step_s, 1e-3 * self.period_s), 3.0 * longest_s
        unit = LogarithmicCreep(1.0, self.fastest_s, self.slowest_s, self.reference_hz)
        self.taus_s = np.array([tau_s for _, tau_s in unit.terms()])
        self.columns, self.late, self.free = [], [], []
        for record, begin in zip(records, begins, strict=True):
            columns = modal(record, self.basis.columns(record.drive, begin), modes)
            self.columns.append(columns)
            self.late.append(late_sum(record.time_s, columns, self.taus_s))
            self.free.append(_free_columns(record, self.taus_s, 0))
        margin = _MOST_DELAY * self.period_s
        self.whole = tuple(record.time_s <= record.time_s[-1] - margin for record in records)
        self.before = tuple(use & _before(record) for use, record in zip(self.whole, records, strict=True))
        self.skipped = [0] * len(records)
        self.spans_nm = [record.span_nm for record in records]
        self._grams = lru_cache(maxsize=8)(self._products)
        self._choices: dict[int, tuple[Bools, ...]] = {}

    def measured(self, i: int, delay_s: float) -> Floats:
        """Return the displacement of a record without the delays of sensor and scanner, of the scale."""
        record, ahead = self.records[i], delay_s + self.lag_s
        moved: Floats = np.interp(record.time_s + ahead, record.time_s, record.displacement_nm) / self.scale
        return moved - np.mean(moved)

    def weight(self, i: int, use: Bools) -> float:
        """Return the weight of a record's rows: each record counts alike, relative to its stroke."""
        return self.scale / (self.spans_nm[i] * float(np.sqrt(np.sum(use))))

    def _products(self, key: int) -> list[tuple[Floats, ...]]:
        """Return, for each record, its rows without the free columns, and the products of columns and of late parts."""
        out: list[tuple[Floats, ...]] = []
        for i, use in enumerate(self._choices[key]):
            by = self.weight(i, use)
            q = np.linalg.qr(self.free[i][use])[0]
            a, late = (by * one[i][use] for one in (self.columns, self.late))
            a, late = (one - q @ (q.T @ one) for one in (a, late))
            out.append((a, late, a.T @ a, a.T @ late + late.T @ a, late.T @ late, q))
        return out

    def solve(self, used: tuple[Bools, ...], loss: float, delay_s: float) -> _Solution:
        """Fit the weights for a loss per decade and a delay, on the samples that are used."""
        key = hash(b"".join(use.tobytes() for use in used))
        self._choices[key] = used
        c, plays = loss / 3.0, self.basis.plays
        count = plays + self.basis.degree
        gram, right, power = self.basis.penalty(_RIDGE, _SMOOTH), np.zeros(count), 0.0
        for i, (a, late, aa, al, ll, q) in enumerate(self._grams(key)):
            y = self.weight(i, used[i]) * self.measured(i, delay_s)[used[i]]
            y = y - q @ (q.T @ y)
            gram += aa + c * al + c * c * ll
            right += a.T @ y + c * (late.T @ y)
            power += float(y @ y)
        # The static curve rises everywhere, by a least slope and curves whose derivatives are Bernstein polynomials.
        basis, least = np.eye(count), np.zeros(count)
        basis[plays:, plays:] = _rising_curves(self.basis.degree)
        least[plays] = _LEAST_SLOPE
        whole = basis @ gram @ basis.T + 1e-12 * np.trace(gram) * np.eye(count)
        root = np.linalg.cholesky(whole)
        solution, _ = nnls(root.T, np.linalg.solve(root, basis @ (right - gram @ least)), maxiter=30 * count)
        weights = least + basis.T @ solution
        cost = power - 2.0 * float(right @ weights) + float(weights @ gram @ weights)
        return _Solution(loss, delay_s, weights, cost, used)

    def search(self, used: tuple[Bools, ...], delay_s: float, *, fits_delay: bool) -> _Solution:
        """Find the loss of creep, and the delay, of the least cost: steps along each that halve where none helps."""
        best = self.solve(used, _LOSS_STEP, delay_s)
        steps = {"loss": _LOSS_STEP, "delay": _DELAY_STEP * self.period_s if fits_delay else 0.0}
        size = 1.0
        while size > _SHARPEST:
            trials = []
            for sign in (-1.0, 1.0):
                loss = float(np.clip(best.loss + sign * size * steps["loss"], 0.0, _MOST_LOSS))
                trials.append((loss, best.delay_s))
                if fits_delay:
                    at = best.delay_s + sign * size * steps["delay"]
                    if abs(at - delay_s) <= _MOST_DELAY * self.period_s:
                        trials.append((best.loss, at))
            better = min((self.solve(used, *trial) for trial in trials), key=lambda one: one.cost)
            if better.cost < best.cost:
                best = better
            else:
                size *= 0.5
        return best

    def displacement(self, i: int, solution: _Solution) -> tuple[Floats, Floats]:
        """Return measured and fitted displacement of a record in nm, the free columns fitted to the samples used."""
        by_weights = (self.columns[i] + solution.loss / 3.0 * self.late[i]) @ solution.weights
        measured, use = self.measured(i, solution.delay_s), solution.used[i]
        free = np.linalg.lstsq(self.free[i][use], (measured - by_weights)[use], rcond=None)[0]
        return self.scale * measured, self.scale * (by_weights + self.free[i] @ free)

    def at_the_sensor(self, i: int, solution: _Solution) -> Floats:
        """Return the fitted displacement of a record in nm at its own times, with the delays of sensor and scanner."""
        times = self.records[i].time_s
        fitted: Floats = np.interp(times - solution.delay_s - self.lag_s, times, self.displacement(i, solution)[1])
        return fitted

    def skip_lead_in(self, delay_s: float) -> None:
        """Leave out the beginning of a record where the piezo was in no state of the model, such as after a jump."""
        solution = self.solve(self.whole, _LOSS_STEP, delay_s)
        for i, record in enumerate(self.records):
            measured, fitted = self.displacement(i, solution)
            error = np.abs(measured - fitted) / record.span_nm
            lead = int(_LEAD_IN * len(error))
            usual = float(np.sqrt(np.mean(error[lead:] ** 2)))
            departs = np.flatnonzero(error[:lead] > max(_DEPARTS * usual, _DEPARTS_BY))
            if len(departs):
                self.skipped[i] = int(departs[-1]) + 1
                self.free[i] = _free_columns(record, self.taus_s, self.skipped[i])
                self.spans_nm[i] = float(np.ptp(record.displacement_nm[self.skipped[i] :]))
        later = [np.arange(len(use)) >= first for use, first in zip(self.whole, self.skipped, strict=True)]
        self.whole = tuple(use & one for use, one in zip(self.whole, later, strict=True))
        self.before = tuple(use & one for use, one in zip(self.before, later, strict=True))

    def errors(self, i: int, solution: _Solution, use: Bools) -> tuple[float, float]:
        """Return rms and worst error of a record, in percent of its stroke, without the mean."""
        measured, fitted = self.displacement(i, solution)
        error = (measured - fitted)[use]
        error = 100.0 * (error - np.mean(error)) / self.spans_nm[i]
        return float(np.sqrt(np.mean(error * error))), float(np.max(np.abs(error)))

    def after(self, i: int) -> Bools:
        """Return the samples of a record that are held out."""
        later: Bools = self.whole[i] & ~self.before[i]
        return later

    def predicted(self, part: _Solution) -> float:
        """Return the mean rms error of the held-out parts."""
        return float(np.sqrt(np.mean([self.errors(i, part, self.after(i))[0] ** 2 for i in range(len(self.records))])))


def _rising_curves(degree: int) -> Floats:
    """Return the coefficients of u, u^2, ... of curves whose derivatives are the Bernstein polynomials, a row each."""
    rows = np.zeros((degree, degree))
    for k in range(degree):
        for j in range(k, degree):
            sign = -1.0 if (j - k) % 2 else 1.0
            rows[k, j] = sign * comb(degree - 1, j) * comb(j, k) * degree / (j + 1.0)
    return rows


def _free_columns(record: TimeRecord, taus_s: Floats, first: int) -> Floats:
    """Return the zero of the sensor, and the states of creep at the first sample used, one in a decade of time."""
    least_s, most_s = 3.0 * float(np.median(np.diff(record.time_s))), 0.25 * float(record.time_s[-1])
    taus = [tau_s for tau_s in taus_s[::3].tolist() if least_s < tau_s < most_s]
    since = np.maximum(record.time_s - record.time_s[first], 0.0)
    return np.hstack([np.ones((len(since), 1)), transients(since, np.array(taus))])


def _before(record: TimeRecord) -> Bools:
    """Return the samples before the last part of the drive's travel, or of the record where the drive rests then."""
    travel = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(record.drive)))])
    count = len(travel)
    last = min(int(np.searchsorted(travel, (1.0 - _HELD_OUT) * travel[-1])), round((1.0 - 0.5 * _HELD_OUT) * count))
    out: Bools = np.arange(count) < max(last, count // 2)
    return out


def _begin_of(record: TimeRecord, basis: PlayBasis, response: Response | None) -> Begin:
    """Return the state before a record with which a simple model fits it best."""

    def cost(begin: Begin) -> float:
        problem = _Problem([record], COMPLEXITIES[0], [begin], response)
        return problem.solve(problem.whole, _LOSS_STEP, 0.0).cost

    return min(Begin, key=cost)


def _check_contradictions(problem: _Problem, whole: _Solution) -> None:
    """Refuse records that one operator does not fit, though it fits each alone; name the one that disagrees."""
    records = problem.records
    if len(records) < 2:
        return
    together = [problem.errors(i, whole, problem.whole[i])[0] for i in range(len(records))]
    worst = int(np.argmax(together))
    if together[worst] <= _CONTRADICTS_PERCENT:
        return

    def rms_of(members: Sequence[int]) -> float:
        alone = _some_of(problem, members)
        solution = alone.search(alone.whole, whole.delay_s, fits_delay=False)
        return max(alone.errors(i, solution, alone.whole[i])[0] for i in range(len(members)))

    if together[worst] <= _CONTRADICTS_RATIO * rms_of([worst]):
        return
    others = [[k for k in range(len(records)) if k != i] for i in range(len(records))]
    odd = int(np.argmin([rms_of(members) for members in others])) if len(records) > 2 else worst
    rest = records[others[odd][0]].name if len(records) == 2 else "the others"
    raise Unphysical(
        f"{records[odd].name} contradicts {rest}: one operator leaves {together[odd]:.2g} % of its stroke rms, one of "
        f"its own {rms_of([odd]):.2g} %; are units, axis, sensor and amplifier the same? Leave it out, or record it "
        "again"
    )


def _some_of(problem: _Problem, members: Sequence[int]) -> _Problem:
    """Return the problem of some of the records."""
    out = _Problem.__new__(_Problem)
    out.__dict__.update(problem.__dict__)
    for name in ("records", "begins", "columns", "late", "free", "skipped", "spans_nm"):
        setattr(out, name, [getattr(problem, name)[i] for i in members])
    out.whole = tuple(problem.whole[i] for i in members)
    out.before = tuple(problem.before[i] for i in members)
    out._grams = lru_cache(maxsize=8)(out._products)
    out._choices = {}
    return out


def _assembled(
    problem: _Problem,
    whole: _Solution,
    part: _Solution,
    free: _Solution,
    scores: dict[str, float],
    factor: Factor,
    fits_delay: bool,
) -> RecordsFit:
    """Return the fit as an operator, with its errors."""
    records, basis = problem.records, problem.basis
    creep = _creep_of(problem, whole.loss)
    weights = whole.weights * problem.scale / creep.direct
    rows = weights[: basis.plays].reshape(len(basis.bends), -1)
    family = Family(Plays(basis.thresholds, rows, weights[basis.plays :], basis.bends))
    errors = []
    for i, record in enumerate(records):
        rms, worst = problem.errors(i, whole, problem.whole[i])
        predicted = problem.errors(i, part, problem.after(i))
        since = float(record.time_s[np.flatnonzero(problem.after(i))[0]])
        begin, skipped = problem.begins[i], float(record.time_s[problem.skipped[i]])
        fitted, held_out = (problem.at_the_sensor(i, one) for one in (whole, part))
        errors.append(RecordErrors(record, rms, worst, *predicted, since, begin, skipped, fitted, held_out))
    lines = _lines(problem, whole, part, errors)
    widest = max(lines, key=lambda line: line.stroke)
    points = np.array([(line.stroke, line.centre) for line in lines])
    residual = through(points, np.zeros((len(lines), _ROW)), _LENGTHS, straight=True)
    nothing = through(points, np.zeros((len(lines), 1)), _LENGTHS)
    bare = Operator(family, residual, nothing, creep, widest.centre, tuple(lines))
    # The sensitivity at other offsets is that of the records, not that of the offset law.
    sizes = np.array(
        [
            family.extent(line.stroke, line.centre)
            / bare.expected_extent(line.stroke, line.centre, factor(line.centre) / factor(widest.centre))
            - 1.0
            for line in lines
        ]
    )
    misfit = max(_misfit(problem, i, whole, one) for i, one in enumerate(errors))
    operator = replace(bare, size=through(points, sizes[:, None], _LENGTHS), misfit_percent=misfit)
    gain = 1.0 - float(np.sqrt(max(free.cost, 0.0) / whole.cost)) if whole.cost > 0.0 else 0.0
    delay = (
        Estimate(whole.delay_s, _DELAY_STEP * problem.period_s * _SHARPEST) if fits_delay else Estimate(whole.delay_s)
    )
    in_fit, left_out = (tuple(LineErrors(*getattr(line, name)) for line in lines) for name in ("in_fit", "left_out"))
    return RecordsFit(
        operator,
        f"plays, {problem.model.name}",
        np.zeros((len(lines), _ROW)),
        sizes,
        in_fit,
        left_out,
        scores,
        tuple(errors),
        delay,
        free.delay_s,
        gain,
        int(sum(np.sum(use) for use in problem.whole)),
        int(np.count_nonzero(whole.weights)),
    )


def _misfit(problem: _Problem, i: int, whole: _Solution, errors: RecordErrors) -> float:
    """Return what the fit of a record, or the prediction of its last part, leaves beyond noise, percent of its stroke.

    The noise is that of neighbouring samples. What of it the weights follow is a part of the misfit.
    """
    measured, fitted = problem.displacement(i, whole)
    error = (measured - fitted)[problem.whole[i]]
    # The second differences of white noise have six times its variance.
    noise = float(np.mean(np.diff(error, 2) ** 2)) / 6.0 * (100.0 / problem.spans_nm[i]) ** 2
    followed = noise * np.count_nonzero(whole.weights) / sum(np.sum(use) for use in problem.whole)
    return float(np.sqrt(max(max(errors.rms, errors.predicted_rms) ** 2 - noise, 0.0) + followed))


def _creep_of(problem: _Problem, loss: float) -> LogarithmicCreep:
    """Return the creep of a loss per decade over the times of the records."""
    if loss <= 0.0:
        return LogarithmicCreep(0.0, NO_CREEP.fastest_s, NO_CREEP.slowest_s, problem.reference_hz)
    return LogarithmicCreep(loss, problem.fastest_s, problem.slowest_s, problem.reference_hz)


@dataclass(frozen=True)
class _Sweep:
    record: int
    begin: int
    end: int
    stroke: float
    centre: float
    rising: bool


def _sweeps(problem: _Problem) -> list[_Sweep]:
    out = []
    for i, record in enumerate(problem.records):
        for begin, end in pairwise(record.turns):
            a, b = float(record.drive[begin]), float(record.drive[end])
            if abs(b - a) >= _LEAST_SWEEP and begin >= problem.skipped[i]:
                out.append(_Sweep(i, begin, end, abs(b - a), 0.5 * (a + b), b > a))
    return out


def _lines(problem: _Problem, whole: _Solution, part: _Solution, errors: Sequence[RecordErrors]) -> list[MeasuredLine]:
    """Return a line for each stroke and centre of sweeps that the records have, with the errors there."""
    sweeps = sorted(_sweeps(problem), key=lambda one: -one.stroke)
    groups: list[list[_Sweep]] = []
    for sweep in sweeps:
        for group in groups:
            if abs(sweep.stroke - group[0].stroke) < _ALIKE and abs(sweep.centre - group[0].centre) < _ALIKE:
                group.append(sweep)
                break
        else:
            groups.append([sweep])
    if len(groups) > _MOST_LINES:
        groups = [groups[i] for i in np.unique(np.linspace(0, len(groups) - 1, _MOST_LINES).round().astype(int))]
    if not groups:  # every sweep is short
        record = problem.records[0]
        low, high = float(np.min(record.drive)), float(np.max(record.drive))
        groups = [[_Sweep(0, 0, len(record.drive) - 1, high - low, 0.5 * (low + high), True)]]
    ratio = max(1.0, *(one.predicted_rms / max(one.rms, 1e-9) for one in errors))
    out = []
    for group in groups:
        inside = _errors_of(problem, whole, group) or _overall(errors[group[0].record], group[0].stroke, problem)
        later = [one for one in group if problem.after(one.record)[one.begin : one.end].all()]
        held_out = _errors_of(problem, part, later) if later else None
        figures = held_out.figures if held_out is not None else tuple(ratio * abs(one) for one in inside.figures)
        rms, scaling, mismatch, size = figures
        first = group[0]
        name = f"{problem.records[first.record].name}, {100.0 * first.stroke:.3g} %"
        rate = problem.records[first.record].rate_hz
        out.append(MeasuredLine(name, first.stroke, first.centre, rate, (rms, scaling, mismatch, size), inside.figures))
    return out


def _errors_of(problem: _Problem, solution: _Solution, sweeps: Sequence[_Sweep]) -> LineErrors | None:
    positions, errors, rising = [], [], []
    for sweep in sweeps:
        measured, fitted = problem.displacement(sweep.record, solution)
        part = slice(sweep.begin, sweep.end + 1)
        span = float(fitted[sweep.end] - fitted[sweep.begin])
        if not abs(span) > 0.0:
            continue
        low = min(float(fitted[sweep.end]), float(fitted[sweep.begin]))
        positions.append((fitted[part] - low) / abs(span))
        error = 100.0 * (measured[part] - fitted[part]) / abs(span)
        errors.append(error - np.mean(error))
        rising.append(np.full(sweep.end + 1 - sweep.begin, sweep.rising))
    if not positions:
        return None
    return sweep_errors(np.concatenate(positions), np.concatenate(errors), np.concatenate(rising))


def _overall(errors: RecordErrors, stroke: float, problem: _Problem) -> LineErrors:
    """Return the errors of a line that has too few samples of its own, by those of the whole record."""
    by = errors.record.stroke / stroke
    return LineErrors(by * errors.rms, 10.0 * by * errors.rms, 2.0 * by * errors.worst, by * errors.worst)
