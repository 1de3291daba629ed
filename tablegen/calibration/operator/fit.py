"""Fit the operator to settled lines: family, creep, residual and size, chosen by leave-one-out prediction."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np
from msgspec import structs

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.operator.bouc_wen_fit import BoucWenProblem
from tablegen.calibration.operator.branches import BranchResidual, branch_residual
from tablegen.calibration.operator.creep_fit import creep_of_fields
from tablegen.calibration.operator.family import CreepOf, FamilyFit, FamilyProblem, groups_of
from tablegen.calibration.operator.loop_errors import WORST, LineErrors, compare
from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.calibration.operator.plausible import Unsettled
from tablegen.calibration.operator.plays_fit import PlaysProblem
from tablegen.calibration.operator.shrinkage import shrink
from tablegen.calibration.operator.sweep_loss_fit import fit_sweep_loss
from tablegen.calibration.operator.turns import with_turns
from tablegen.calibration.operator.units import check_units
from tablegen.compensation.dynamics import Measured, Response
from tablegen.compensation.identification import MeasuredLine
from tablegen.compensation.operator.creep import NO_CREEP, SEVERAL_RATES, LogarithmicCreep
from tablegen.compensation.operator.family import Family
from tablegen.compensation.operator.field import Field, Lengths, points_of, through
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.plays import NO_PLAYS
from tablegen.compensation.operator.sweep_loss import SweepLoss
from tablegen.numerics.arrays import Floats
from tablegen.numerics.elementary import log10

STROKE_LENGTHS = (0.4, 0.8, 1.5, 3.0)
CENTRE_LENGTHS = (0.5, 1.0, 2.0)
_RATE_SHARE = 0.1  # of the fields, which depends on the rate, if rates differ; chosen on three piezos whose loops do
_NOISE = 1e-9  # variance of the noise in the fields, whose rows have none
_NOISE_OF_TWINS = 1e-4  # where two lines of one point differ slightly by their rates or turns
_TWINS = 0.03  # of v_max: largest difference of strokes and centres of such lines
_ROUNDS = 8  # most steps of the family's numbers; the second where a line is left out
_ROUNDS_WITHOUT = 2
LEAST_LINES = 3
_MIN_SPREAD = 2.0  # of the largest stroke over the smallest
_MAX_NOISE_PERCENT = 1.0
_SHARES = (0.25, 0.5, 0.75)  # of the first family, where two are mixed
_WORTH_MIXING = 3.0  # ratio of the scores of two families, up to which a mixture may be better than both
_CLEARLY = 1.25  # ratio by which a mixture has to be better than each family alone, which has its own creep
NONE = "none"
FAMILIES: dict[str, type[FamilyProblem]] = {"plays": PlaysProblem, "Bouc-Wen": BoucWenProblem}
_DECADES = 1.0  # range of creep beyond the measured frequencies

Factor = Callable[[float], float]


@dataclass(frozen=True, eq=False)
class OperatorFit:
    """The operator, and its errors of each line: in the fit, and when the line is left out; in percent.

    Its fields go through ``rows`` and ``sizes``, a row a line; ``candidates`` has the families and their score, the
    geometric mean of the rms of the lines left out, in percent.
    """

    operator: Operator
    family: str
    rows: Floats
    sizes: Floats
    in_fit: tuple[LineErrors, ...]
    left_out: tuple[LineErrors, ...]
    candidates: dict[str, float]


def fit_operator(lines: Sequence[PeriodicLine], response: Response | None, factor: Factor) -> OperatorFit:
    """Fit an operator to lines; ``factor`` is m of (1) at a centre, in shares of v_max.

    A measured response that contains creep gives the creep of the operator, and counts without it.

    Raises
    ------
    Unphysical
        If the lines are too few, too similar, or too noisy.
    """
    _check(lines)
    sweep, dynamics = sweep_loss_of(lines, response)
    still = [_still(line, dynamics) for line in lines]
    main = _main_centre(still)
    names = (*FAMILIES, NONE)
    creep_of = _creep_of(lines, None if sweep is None else sweep.creep)
    alone = [_candidate(name, still, main, factor, creep_of) for name in names]
    fits = [_with_best_lengths(one, still, factor) for one in alone]
    scores = [one.candidates[one.family] for one in fits[: len(FAMILIES)]]
    if max(scores) < _WORTH_MIXING * min(scores):
        fits += [_with_best_lengths(alone[0].weighted(share, alone[1]), still, factor) for share in _SHARES]
    best = min(fits, key=lambda one: one.candidates[one.family] * (1.0 if one.family in names else _CLEARLY))
    candidates = {name: value for one in fits for name, value in one.candidates.items()}
    return replace(best, candidates=candidates, operator=replace(best.operator, sweep=sweep))


def sweep_loss_of(lines: Sequence[PeriodicLine], response: Response | None) -> tuple[SweepLoss | None, Response | None]:
    """Return the creep and the loss angle that a response contains, or None, and the dynamics without both."""
    if not lines or not isinstance(response, Measured):
        return None, response
    sweep = fit_sweep_loss(response, _creep_of(lines))
    return sweep, response if sweep is None else sweep.without(response)


def _still(line: PeriodicLine, dynamics: Response | None) -> PeriodicLine:
    """Return a line without dynamics."""
    if dynamics is None:
        return line
    return with_turns(line.without(dynamics, None), line.highest_corrected_hz(dynamics))


def _check(lines: Sequence[PeriodicLine]) -> None:
    if len(lines) < LEAST_LINES:
        raise Unsettled(f"{len(lines)} traces are not enough for an operator; at least {LEAST_LINES} are needed")
    check_units(lines)
    strokes = [line.stroke for line in lines]
    if max(strokes) < _MIN_SPREAD * min(strokes):
        low, high = (100.0 * share for share in (min(strokes), max(strokes)))
        raise Unsettled(
            f"strokes of {low:.3g} to {high:.3g} % of v_max are too similar; the largest has to be at least "
            f"{_MIN_SPREAD:g} times the smallest"
        )
    for line in lines:
        noise = 100.0 * line.noise_nm / float(np.ptp(line.displacement_nm))
        if noise > _MAX_NOISE_PERCENT:
            raise Unphysical(
                f"{line.name}: {noise:.2g} % of the line differ from period to period; at most "
                f"{_MAX_NOISE_PERCENT:g} % serve; record more periods, or a settled scan"
            )


def _main_centre(lines: Sequence[PeriodicLine]) -> float:
    """Return the centre at which most strokes were measured."""
    groups = groups_of([line.centre for line in lines])
    most = max(set(groups), key=groups.count)
    return float(np.mean([line.centre for line, group in zip(lines, groups, strict=True) if group == most]))


def _creep_of(lines: Sequence[PeriodicLine], known: LogarithmicCreep | None = None) -> CreepOf:
    """Return a function from a loss per decade to creep over the decades of the lines; ``known`` for any loss."""
    if known is not None:
        return lambda _: known
    low = min(line.rate_hz for line in lines)
    high = max(line.rate_hz for line in lines)
    reference = float(np.exp(np.mean([np.log(line.rate_hz) for line in lines])))
    fastest, slowest = 10.0 ** (-2.0 - _DECADES) / high, 10.0**_DECADES / low

    def creep(loss: float) -> LogarithmicCreep:
        if loss <= 0.0:
            return structs.replace(NO_CREEP, reference_hz=reference)
        return LogarithmicCreep(round(loss, 6), fastest, slowest, reference)

    return creep


def _any_twins(lines: Sequence[PeriodicLine]) -> bool:
    """Return True if two lines have the same stroke and centre, or nearly."""
    return any(
        abs(one.stroke - other.stroke) < _TWINS and abs(one.centre - other.centre) < _TWINS
        for one, other in combinations(lines, 2)
    )


class _Fitted:
    """A family and its creep; the lines before that creep, and their residuals beside the family."""

    def __init__(
        self,
        lines: Sequence[PeriodicLine],
        main: float,
        family: Family,
        creep: LogarithmicCreep,
        solution: FamilyFit | None = None,
    ) -> None:
        """Of lines that still have their creep; ``solution`` is the fit of the family, where there was one."""
        self.lines, self.main = lines, main
        self.family, self.creep, self.solution = family, creep, solution
        self.settled = [line.without(None, creep) for line in lines]
        self.residuals = [
            branch_residual(line, family.at_decades(log10(line.rate_hz / creep.reference_hz))) for line in self.settled
        ]

    def operator(self, lengths: Lengths, factor: Factor) -> tuple[Operator, Floats, Floats]:
        """Fit both fields to the residuals.

        Returns
        -------
        tuple
            The operator; the rows of its residual field, shape (lines, 2 DEGREE + 2); its relative sizes, (lines,).
        """
        points = points_of(self.settled)
        rows = shrink(points, self.residuals, lengths)
        residual = through(points, rows, lengths, straight=True)
        sizes = _sizes(self.family, residual, self.creep, self.settled, self.residuals, self.main, factor)
        size = through(points, sizes[:, None], lengths)
        operator = Operator(self.family, residual, size, self.creep, self.main, ())
        return operator.at_rate(self.creep.reference_hz), rows, sizes

    def weighted(self, share: float, other: "_Fitted") -> "_Fitted":
        """Mix a share of this family with the rest of another one, for the same lines."""
        loss = share * self.creep.loss_per_decade + (1.0 - share) * other.creep.loss_per_decade
        creep = structs.replace(self.creep, loss_per_decade=round(loss, 6))
        return _Fitted(self.lines, self.main, self.family.weighted(share, other.family), creep)


@dataclass(frozen=True, eq=False)
class _Candidate:
    """A family of all lines, and of all but one: its prediction of that one is its score."""

    name: str
    whole: _Fitted
    without: list[_Fitted]

    def weighted(self, share: float, other: "_Candidate") -> "_Candidate":
        """Mix a share of this candidate with the rest of another one."""
        name = f"{100.0 * share:.0f} % {self.name}, {100.0 * (1.0 - share):.0f} % {other.name}"
        both = zip(self.without, other.without, strict=True)
        return _Candidate(name, self.whole.weighted(share, other.whole), [a.weighted(share, b) for a, b in both])


def _candidate(name: str, lines: Sequence[PeriodicLine], main: float, factor: Factor, creep_of: CreepOf) -> _Candidate:
    """Fit one family, with the creep that goes with it."""

    def fitted(some: Sequence[PeriodicLine], near: _Fitted | None) -> _Fitted:
        if name == NONE:
            family = _straight(some)
            return _Fitted(some, main, family, near.creep if near else creep_of_fields(some, family, factor, creep_of))
        problem = FAMILIES[name](some, main, creep_of)
        solution = problem.fit(near.solution, _ROUNDS_WITHOUT) if near else problem.fit(None, _ROUNDS)
        return _Fitted(some, main, solution.family, creep_of(solution.loss_per_decade), solution)

    whole = fitted(lines, None)
    return _Candidate(name, whole, [fitted([*lines[:i], *lines[i + 1 :]], whole) for i in range(len(lines))])


def _with_best_lengths(candidate: _Candidate, lines: Sequence[PeriodicLine], factor: Factor) -> OperatorFit:
    """Choose the best lengths for a family, and return the operator with them."""
    whole, without = candidate.whole, candidate.without
    alone = [line.without(None, one.creep) for line, one in zip(lines, without, strict=True)]
    several = max(groups_of([line.centre for line in lines])) > 0
    noise = _NOISE_OF_TWINS if _any_twins(lines) else _NOISE
    rates = [line.rate_hz for line in lines]
    centres = CENTRE_LENGTHS if several else CENTRE_LENGTHS[-1:]
    rate_share = _RATE_SHARE if max(rates) >= SEVERAL_RATES * min(rates) else 0.0
    trials = []
    for stroke, centre in product(STROKE_LENGTHS, centres):
        lengths = Lengths(stroke, centre, noise, rate_share)
        out = [
            _errors(line, one.operator(lengths, factor)[0], factor) for line, one in zip(alone, without, strict=True)
        ]
        trials.append((float(np.exp(np.mean([np.log(errors.rms) for errors in out]))), lengths, out))
    score, lengths, out = min(trials, key=lambda one: one[0])
    operator, rows, sizes = whole.operator(lengths, factor)
    inside = tuple(_errors(line, operator, factor) for line in whole.settled)
    measured = tuple(
        MeasuredLine(line.name, line.stroke, line.centre, line.rate_hz, errors.figures, inner.figures)
        for line, errors, inner in zip(lines, out, inside, strict=True)
    )
    operator = replace(operator, lines=measured)
    return OperatorFit(operator, candidate.name, rows, sizes, inside, tuple(out), {candidate.name: score})


def _straight(lines: Sequence[PeriodicLine]) -> Family:
    """Return a family without hysteresis: a straight line with the mean gain."""
    gain = float(np.mean([np.ptp(line.displacement_nm) / line.stroke for line in lines]))
    return Family(NO_PLAYS).over(np.array([gain]))


def _sizes(
    family: Family,
    residual: Field,
    creep: LogarithmicCreep,
    lines: Sequence[PeriodicLine],
    residuals: Sequence[BranchResidual],
    main: float,
    factor: Factor,
) -> Floats:
    """Return measured extents over expected ones, less 1."""
    nothing = Field(np.zeros((0, 3)), np.zeros((0, 1)), Lengths(1.0, 1.0, 1.0))
    bare = Operator(family, residual, nothing, creep, main, ())

    def extent(line: PeriodicLine) -> float:
        here = factor(line.mean) / factor(main)
        try:
            return bare.at_rate(line.rate_hz).loop(line.low, line.high, here, line.mean).extent_nm
        except Unphysical:  # possible where a line is left out; its errors are the worst then
            return bare.expected_extent(line.stroke, line.mean, here)

    return np.array([one.extent_nm / extent(line) - 1.0 for one, line in zip(residuals, lines, strict=True)])


def _errors(line: PeriodicLine, operator: Operator, factor: Factor) -> LineErrors:
    here = factor(line.mean) / factor(operator.centre)
    try:
        return compare(line, operator.at_rate(line.rate_hz).loop(line.low, line.high, here, line.mean))
    except Unphysical:
        return WORST
