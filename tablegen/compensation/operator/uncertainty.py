"""The possible errors of an operator: from the errors of its traces when they are left out, and the distance to them.

A piezo departs from its operator in two ways, each a Gaussian process over stroke and centre. The first departs
everywhere alike. Its strength is the error of a trace that was left out, less its noise, over the standard deviation
that the process has there without it. The second is 0 at the offset of most traces, and grows away from it as a share
of the loop: traces at one offset do not show how a loop changes with the offset, whatever they say of each other. How
fast it changes is not known either, so two lengths compete. Errors of traces that were left out at other offsets decide
between them, and raise or lower the share.

Shares and levels were chosen on simulated piezos of plays, of Preisach's densities and of Jiles and Atherton's
equation; ``benchmarks/expected_coverage.py`` checks them on others.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import log, sqrt
from typing import NamedTuple

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.identification import MeasuredLine
from tablegen.compensation.operator.field import SAME_CENTRE, Lengths, covariance, points_of
from tablegen.compensation.operator.loop import POINTS, Loop
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.record_uncertainty import possible_record_errors
from tablegen.numerics.arrays import Floats, tree_sum
from tablegen.numerics.elementary import exp
from tablegen.numerics.linear import Cholesky

Figures = tuple[float, float, float, float]  # of rms, scaling error, mismatch and size, percent

_ALIKE = Lengths(0.6, 2.5, 1e-3)  # departures of lines; the noise is what rates and turns change
_FEW = 3  # traces, below which all count
_WINDOW = (0.1, 0.9)  # of the stroke, where the shape of a loop counts
_CHORD = 0.05  # of the stroke
_FORMULAS = 0.15  # share of the factor (23) between the nearest trace and the scan that may be wrong
_NORMAL = 1.645  # bound of 90 % of a normal distribution
_FIGURES = range(4)


class _Change(NamedTuple):
    """How loops may change with the offset: correlation length, of v_max, and the median share in each figure."""

    length: float
    shares: Figures


_CHANGES = (_Change(1.0, (0.40, 0.58, 0.36, 0.28)), _Change(0.25, (0.08, 0.16, 0.07, 0.06)))
_CHANGE_STROKE = 0.8  # correlation length of a change in stroke, of v_max
_CHANGE_NOISE = 1e-2  # relative variance that a trace at another offset leaves
_SIZE_UNIT = 10.0  # percent, of which the share of a size is; sizes do not follow the loop's shape
_POWERS = tuple(0.5 * k for k in range(-10, 11))  # logarithms of the variance over that of the median share
_POWER_SPREAD = 2.0  # their standard deviation before traces at other offsets were left out

_NOISE_LEVEL = (1.0, 1.0, 1.0, 1.0)  # of what remains in the fit: a field takes out a part of a trace's noise
_DEPARTURE_LEVEL = (1.1, 0.7, 1.0, 0.55)
_LEAST = (0.0, 0.0, 0.0, 0.13)  # percent: sizes are those of laws that were fitted to noisy sizes


class LoopShape(NamedTuple):
    """The deviation of a loop from its best common line: rms, scaling error and mismatch, percent of the loop."""

    rms: float
    scaling: float
    mismatch: float

    @property
    def units(self) -> Figures:
        """What a change of the loop with the offset is a share of, in each figure."""
        return self.rms, self.scaling, self.mismatch, _SIZE_UNIT


class ErrorParts(NamedTuple):
    """The possible errors in percent, by their cause: noise, departures, and the change of loops with the offset.

    Departures and changes are at the level of 90 %.
    """

    noise: Figures
    departure: Figures
    change: Figures

    @property
    def together(self) -> Figures:
        """All of them, each with its level."""
        rms, scaling, mismatch, size = (
            sqrt(
                (_NOISE_LEVEL[k] * self.noise[k]) ** 2
                + (_DEPARTURE_LEVEL[k] * self.departure[k]) ** 2
                + self.change[k] ** 2
                + _LEAST[k] ** 2
            )
            for k in _FIGURES
        )
        return rms, scaling, mismatch, size


class _Hypothesis(NamedTuple):
    """One of the changes at one strength: its probability, the variance of departures, and that of the change.

    ``change`` is an index of ``_CHANGES``.
    """

    probability: float
    departure: float
    change: int
    square: float


@dataclass(frozen=True, eq=False)
class PossibleErrors:
    """The possible errors at any stroke and centre, from the lines of an operator and the shape of each one's loop.

    ``main`` is the centre of most lines, of v_max, ``rate_share`` the share of departures that depends on the rate.
    """

    lines: tuple[MeasuredLine, ...]
    shapes: tuple[LoopShape, ...]
    main: float
    rate_share: float = 0.0

    def at(self, stroke: float, centre: float, shape: LoopShape, decade: float = 0.0) -> ErrorParts:
        """Return by how much a line may be off, whose loop has a shape; ``decade`` is that of its rate."""
        near = covariance(np.array([[stroke, centre, decade]]), self._points, self._alike)[0]
        solution = self._factor.solve(near)
        here = max(1.0 - _dot(near, solution), 0.0)
        weights = [value * value for value in solution.tolist()]
        total = sum(weights)
        changes = [one.variance(stroke, centre) for one in self._fields]
        units = shape.units
        noise, departure, change = [], [], []
        for k in _FIGURES:
            squares = [line.in_fit[k] ** 2 for line in self.lines]
            noise.append(sqrt(sum(w * n for w, n in zip(weights, squares, strict=True)) / total))
            hypotheses = self._hypotheses[k]
            departure.append(self._level * sqrt(here * sum(one.probability * one.departure for one in hypotheses)))
            strength = sum(one.probability * one.square * changes[one.change] for one in hypotheses)
            change.append(_NORMAL * units[k] * sqrt(strength))
        return ErrorParts(_figures(noise), _figures(departure), _figures(change))

    @cached_property
    def _points(self) -> Floats:
        return points_of(self.lines)

    @property
    def _alike(self) -> Lengths:
        return replace(_ALIKE, rate_share=self.rate_share)

    @cached_property
    def _factor(self) -> Cholesky:
        known = covariance(self._points, self._points, self._alike)
        return Cholesky(known + _ALIKE.noise * np.diag(np.diag(known)))

    @cached_property
    def _level(self) -> float:
        return _deviations(0.5 * len(self.lines))  # errors of neighbours are correlated: half of them are independent

    @cached_property
    def _fields(self) -> "tuple[_ChangeField, ...]":
        return tuple(_ChangeField(self._points, self.main, change.length) for change in _CHANGES)

    @cached_property
    def _hypotheses(self) -> tuple[tuple[_Hypothesis, ...], ...]:
        """The hypotheses for each figure, by the errors of the lines that were left out."""
        without = _without_each(self._factor, len(self.lines))
        changed = [field.variances_left_out for field in self._fields]
        return tuple(self._weighed(k, without, changed) for k in _FIGURES)

    def _weighed(self, k: int, without: list[float], changed: Sequence[Sequence[float]]) -> tuple[_Hypothesis, ...]:
        squares, noise = ([getattr(line, name)[k] ** 2 for line in self.lines] for name in ("left_out", "in_fit"))
        units = [shape.units[k] ** 2 for shape in self.shapes]
        trials = []
        for number, change in enumerate(_CHANGES):
            for power in _POWERS:
                square = change.shares[k] ** 2 * exp(power)
                moved = [square * unit * variance for unit, variance in zip(units, changed[number], strict=True)]
                rest = zip(squares, noise, moved, without, strict=True)
                departure = _variance([max(e - n - m, 0.0) / v for e, n, m, v in rest])
                likelihood = -0.5 * (power / _POWER_SPREAD) ** 2
                for e, n, m, v in zip(squares, noise, moved, without, strict=True):
                    whole = n + m + departure * v + 1e-10
                    likelihood -= 0.5 * (log(whole) + e / whole)
                trials.append((likelihood, departure, number, square))
        best = max(trial[0] for trial in trials)
        weights = [exp(max(trial[0] - best, -700.0)) for trial in trials]
        total = sum(weights)
        return tuple(_Hypothesis(w / total, *trial[1:]) for w, trial in zip(weights, trials, strict=True))


class _ChangeField:
    """The change of a loop with the offset, a Gaussian process that is 0 at the centre of most lines."""

    def __init__(self, points: Floats, main: float, length: float) -> None:
        """Of lines at ``points``, (stroke, centre) each, shape (n, 2)."""
        self._main, self._lengths = main, Lengths(_CHANGE_STROKE, length, _CHANGE_NOISE)
        self._elsewhere = np.abs(points[:, 1] - main) >= SAME_CENTRE
        self._points = points[self._elsewhere]
        self._factor: Cholesky | None = None
        if len(self._points):
            known = self._covariance(self._points, self._points)
            self._factor = Cholesky(known + _CHANGE_NOISE * np.diag(np.diag(known)))

    def variance(self, stroke: float, centre: float) -> float:
        """Return the variance at a stroke and a centre, relative to that far from all lines."""
        at = np.array([[stroke, centre]])
        own = float(self._covariance(at, at)[0, 0])
        if self._factor is not None:
            near = self._covariance(at, self._points)[0]
            own -= _dot(near, self._factor.solve(near))
        return max(own, 0.0)

    @property
    def variances_left_out(self) -> list[float]:
        """The relative variance at each line without it; 0 at the centre of most lines."""
        if self._factor is None:
            return [0.0] * len(self._elsewhere)
        others = iter(_without_each(self._factor, len(self._points)))
        return [next(others) if elsewhere else 0.0 for elsewhere in self._elsewhere.tolist()]

    def _covariance(self, points: Floats, others: Floats) -> Floats:
        def at_main(rows: Floats) -> Floats:
            return np.stack([rows[:, 0], np.full(len(rows), self._main)], axis=1)

        stroke_only = covariance(at_main(points), at_main(others), self._lengths)
        to_main = [covariance(rows, at_main(rows), self._lengths).diagonal() for rows in (points, others)]
        out: Floats = covariance(points, others, self._lengths) - stroke_only * np.outer(*to_main)
        return out


@lru_cache(maxsize=8)
def _possible_errors_of(operator: Operator) -> PossibleErrors:
    shapes = tuple(loop_shape(operator, line.stroke, line.centre) for line in operator.lines)
    return PossibleErrors(operator.lines, shapes, operator.centre, operator.residual.lengths.rate_share)


def possible_errors(operator: Operator, stroke: float, centre: float) -> Figures:
    """Return by how much rms, scaling error, mismatch and size may be off at a stroke and a centre, in percent."""
    if operator.misfit_percent is not None:
        units = loop_shape(operator, stroke, centre).units
        return possible_record_errors(operator.family, operator.lines, operator.misfit_percent, (stroke, centre), units)
    shape = loop_shape(operator, stroke, centre)
    return _possible_errors_of(operator).at(stroke, centre, shape, operator.residual.decade).together


def loop_shape(operator: Operator, stroke: float, centre: float) -> LoopShape:
    """Return the shape of the operator's loop; that of its family's where the operator has none there."""
    low, high = centre - 0.5 * stroke, centre + 0.5 * stroke
    try:
        return shape_of(operator.loop(low, high))
    except Unphysical:
        return _WILD


_WILD = LoopShape(5.0, 50.0, 12.0)  # of an operator whose branches run backwards there; no piezo's is much larger


def shape_of(loop: Loop) -> LoopShape:
    """Return the shape of a loop about its best common line."""
    begin, end = (round(share * (POINTS - 1)) for share in _WINDOW)
    x = np.arange(begin, end + 1) / (POINTS - 1)
    x = x - float(tree_sum(x)) / len(x)
    branches = [branch[begin : end + 1] for branch in (loop.rising, loop.falling)]
    middle = 0.5 * (branches[0] + branches[1])
    level, slope = float(tree_sum(middle)) / len(x), float(tree_sum(middle * x)) / float(tree_sum(x * x))
    sides = [branch - level - slope * x for branch in branches]
    step = round(_CHORD * (POINTS - 1))
    chords = [(side[step:] - side[:-step]) * ((POINTS - 1) / step) for side in sides]
    square = sum(float(tree_sum(side * side)) for side in sides) / (2.0 * len(x))
    scaling = max(float(np.max(one) - np.min(one)) for one in chords)
    return LoopShape(100.0 * sqrt(square), 100.0 * scaling, 100.0 * float(np.max(np.abs(sides[0] - sides[1]))))


def size_uncertainty(steps: Sequence[float]) -> float:
    """Return by how much the size may be off, in percent, for the shares by which formulas change it."""
    return 100.0 * _FORMULAS * sqrt(sum(step * step for step in steps))


def _without_each(factor: Cholesky, count: int) -> list[float]:
    """Return the variance at each point, given all others."""
    return [1.0 / float(factor.solve(row)[i]) for i, row in enumerate(np.eye(count))]


def _deviations(freedom: float) -> float:
    """Return the bound of 90 % of Student's t, to second order in the inverse of the degrees of freedom.

    The 90 % are ``expectation.LEVEL_PERCENT``.
    """
    return _NORMAL + (1.524 + 1.42 / freedom) / freedom


def _variance(squares: Sequence[float]) -> float:
    """Return the variance from squares of deviations without the largest: families often fail at the largest stroke."""
    count = len(squares)
    if count < _FEW:
        return sum(squares) / count
    # About the share that remains of a normal distribution's, or less.
    return sum(sorted(squares)[:-1]) / (count - 1) / (1.0 - 1.15 / sqrt(count))


def _figures(values: Sequence[float]) -> Figures:
    rms, scaling, mismatch, size = values
    return rms, scaling, mismatch, size


def _dot(one: Floats, other: Floats) -> float:
    return float(sum(a * b for a, b in zip(one.tolist(), other.tolist(), strict=True)))
