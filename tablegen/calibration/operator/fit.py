"""Settled lines -> the operator: family, creep, residual and size, by what each predicts of a line left out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from tablegen.calibration.operator.branches import Left, left_of
from tablegen.calibration.operator.creep_fit import creep_of_fields, creep_of_plays
from tablegen.calibration.operator.errors import WORST, LineErrors, compare
from tablegen.calibration.operator.family import fit_plays, groups_of
from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.compensation.dynamics import Response
from tablegen.compensation.operator.creep import NO_CREEP, LogarithmicCreep
from tablegen.compensation.operator.field import Field, Lengths, shape_field, through
from tablegen.compensation.operator.operator import MeasuredLine, Operator
from tablegen.compensation.operator.plays import NO_PLAYS, Plays
from tablegen.numerics.arrays import Floats
from tablegen.problems import Unphysical

STROKE_LENGTHS = (0.4, 0.8, 1.5, 3.0)
CENTRE_LENGTHS = (0.5, 1.0, 2.0)
_NOISE = 1e-5  # variance of the noise, of the field's
_MIN_LINES = 3
_MIN_SPREAD = 2.0  # of the largest stroke over the smallest
_MAX_NOISE_PERCENT = 1.0

Factor = Callable[[float], float]


@dataclass(frozen=True, eq=False)
class OperatorFit:
    """The operator, and what it leaves of each line: in the fit, and when the line is left out; in percent.

    ``rows`` and ``sizes`` are what its fields go through, a row a line; ``candidates`` has the families that were
    tried, and the median rms of a line left out, in percent.
    """

    operator: Operator
    family: str
    rows: Floats
    sizes: Floats
    left: tuple[LineErrors, ...]
    left_out: tuple[LineErrors, ...]
    candidates: dict[str, float]


def fit_operator(lines: Sequence[PeriodicLine], response: Response | None, factor: Factor) -> OperatorFit:
    """The operator of some lines; ``factor`` is m of (1) at a centre, in shares of v_max.

    Raises ``Unphysical`` for too few lines, for such as are alike, and for noisy ones.
    """
    _check(lines)
    still = [line.without(response, None) for line in lines]
    main = _main_centre(still)
    found: list[OperatorFit] = []
    creeps = {"plays": creep_of_plays(still, main), "none": creep_of_fields(still, _straight(still), factor)}
    for name, late in creeps.items():
        settled = [line.without(None, late) for line in still]
        found.append(_fit_family(name, settled, late, main, factor))
    best = min(found, key=lambda one: one.candidates[one.family])
    candidates = {name: value for one in found for name, value in one.candidates.items()}
    return replace(best, candidates=candidates)


def _check(lines: Sequence[PeriodicLine]) -> None:
    if len(lines) < _MIN_LINES:
        raise Unphysical(f"{len(lines)} traces are not enough for an operator; at least {_MIN_LINES} are needed")
    strokes = [line.stroke for line in lines]
    if max(strokes) < _MIN_SPREAD * min(strokes):
        low, high = (100.0 * share for share in (min(strokes), max(strokes)))
        raise Unphysical(
            f"strokes of {low:.3g} to {high:.3g} % of v_max are too much alike; the largest has to be at least "
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
    """The centre at which most strokes were measured."""
    groups = groups_of([line.centre for line in lines])
    most = max(set(groups), key=groups.count)
    return float(np.mean([line.centre for line, group in zip(lines, groups, strict=True) if group == most]))


def _fit_family(
    name: str, lines: Sequence[PeriodicLine], creep: LogarithmicCreep, main: float, factor: Factor
) -> OperatorFit:
    """The best lengths for one family, and the operator with them."""

    def family_of(some: Sequence[PeriodicLine]) -> Plays:
        return fit_plays(some, main) if name == "plays" else _straight(some)

    everything = range(len(lines))
    whole = family_of(lines)
    left = [left_of(line, whole) for line in lines]
    others = [[j for j in everything if j != i] for i in everything]
    without = [family_of([lines[j] for j in other]) for other in others]
    left_without = [[left_of(lines[j], family) for j in other] for other, family in zip(others, without, strict=True)]
    several = max(groups_of([line.centre for line in lines])) > 0
    results = []
    for stroke, centre in product(STROKE_LENGTHS, CENTRE_LENGTHS if several else CENTRE_LENGTHS[-1:]):
        lengths = Lengths(stroke, centre, _NOISE)
        out = tuple(
            _left_out(
                lines[i],
                _operator(without[i], [lines[j] for j in others[i]], left_without[i], lengths, creep, main, factor),
                factor,
                main,
            )
            for i in everything
        )
        results.append((float(np.median([errors.rms for errors in out])), lengths, out))
    score, lengths, out = min(results, key=lambda result: result[0])
    operator = _operator(whole, lines, left, lengths, creep, main, factor)
    measured = tuple(
        MeasuredLine(
            line.name,
            line.stroke,
            line.centre,
            line.rate_hz,
            (errors.rms, errors.scaling, errors.mismatch, errors.size),
        )
        for line, errors in zip(lines, out, strict=True)
    )
    operator = replace(operator, lines=measured)
    inside = tuple(_left_out(line, operator, factor, main) for line in lines)
    rows = np.stack([one.coefficients for one in left])
    sizes = _sizes(whole, lines, left, main, factor)
    return OperatorFit(operator, name, rows, sizes, inside, out, {name: score})


def _straight(lines: Sequence[PeriodicLine]) -> Plays:
    """No family: a straight line with the mean gain."""
    gain = float(np.mean([np.ptp(line.displacement_nm) / line.stroke for line in lines]))
    return replace(NO_PLAYS, reversible=np.array([gain]))


def _operator(
    family: Plays,
    lines: Sequence[PeriodicLine],
    left: Sequence[Left],
    lengths: Lengths,
    creep: LogarithmicCreep,
    main: float,
    factor: Factor,
) -> Operator:
    """Both fields through what the family leaves of the lines."""
    points = np.array([(line.stroke, line.centre) for line in lines])
    residual = shape_field(points, np.stack([one.coefficients for one in left]), lengths)
    size = through(points, _sizes(family, lines, left, main, factor)[:, None], lengths)
    return Operator(family, residual, size, creep, main, ())


def _sizes(family: Plays, lines: Sequence[PeriodicLine], left: Sequence[Left], main: float, factor: Factor) -> Floats:
    """Measured extents over expected ones, less 1."""
    nothing = Field(np.zeros((0, 2)), np.zeros((0, 1)), Lengths(1.0, 1.0, 1.0))
    bare = Operator(family, nothing, nothing, NO_CREEP, main, ())
    extents = [bare.expected_extent(line.stroke, line.centre, factor(line.centre) / factor(main)) for line in lines]
    return np.array([one.extent_nm / extent - 1.0 for one, extent in zip(left, extents, strict=True)])


def _left_out(line: PeriodicLine, operator: Operator, factor: Factor, main: float) -> LineErrors:
    try:
        return compare(line, operator.loop(line.low, line.high, factor(line.centre) / factor(main)))
    except Unphysical:
        return WORST
