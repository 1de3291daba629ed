"""Fit the creep of an axis whose hysteresis is no sum of plays, by the fields of its settled lines.

Sizes determine it, which lose the same share with every decade of rate; at one rate shapes do, since creep gives width
to a line of no size, and hysteresis does not.
"""

from collections.abc import Callable, Sequence

import numpy as np

from tablegen.calibration.operator.branches import branch_residual
from tablegen.calibration.operator.family import CreepOf
from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.compensation.operator.creep import SEVERAL_RATES, LogarithmicCreep
from tablegen.compensation.operator.family import Family
from tablegen.compensation.operator.field import Lengths, covariance
from tablegen.numerics.arrays import Floats

_LOSSES = tuple(0.004 * i for i in range(13))  # of creep, per decade
_SAME_TURN = 0.1  # in periods: largest difference of turns of lines whose shapes determine creep
_STROKE_LENGTHS = (0.4, 0.8, 1.5, 3.0)
_CENTRE_LENGTH = 1.0
_NOISE = 1e-4  # variance of the noise, of the field's

Factor = Callable[[float], float]


def creep_of_fields(
    lines: Sequence[PeriodicLine], family: Family, factor: Factor, creep_of: CreepOf
) -> LogarithmicCreep:
    """Return the loss per decade with which the fields over stroke and centre are the likeliest.

    This holds whatever the hysteresis. Of several rates the sizes decide; of one rate and one turn the shapes, which
    are straight where the stroke vanishes. Other lines leave it open, and it is taken as 0.
    """
    rates = [line.rate_hz for line in lines]
    turns = [float(np.mean(line.rising)) for line in lines]
    several = max(rates) >= SEVERAL_RATES * min(rates)
    if not several and max(turns) - min(turns) > _SAME_TURN:
        return creep_of(0.0)

    def misfit(creep: LogarithmicCreep) -> float:
        residuals = [branch_residual(line.without(None, creep), family) for line in lines]
        if several:
            sizes = [
                one.extent_nm * factor(line.mean) / line.stroke for one, line in zip(residuals, lines, strict=True)
            ]
            values = np.array(sizes)[:, None]
            return _unlikelihood(lines, values / np.mean(values) - 1.0, still=False)
        return _unlikelihood(lines, np.stack([one.coefficients for one in residuals]), still=True)

    return _least(creep_of, misfit)


def _unlikelihood(lines: Sequence[PeriodicLine], rows: Floats, still: bool) -> float:
    """Return -2 log of the likelihood of a field through rows of one variance, of the best length; up to a constant.

    With ``still`` the field is 0 at a stroke of 0.
    """
    points = np.array([(line.stroke, line.centre) for line in lines])
    if still:
        centres = sorted({round(line.centre, 2) for line in lines})
        points = np.concatenate([points, [(0.0, centre) for centre in centres]])
        rows = np.concatenate([rows, np.zeros((len(centres), rows.shape[1]))])
    misfits = []
    for stroke in _STROKE_LENGTHS:
        matrix = covariance(points, points, Lengths(stroke, _CENTRE_LENGTH, _NOISE)) + _NOISE * np.eye(len(points))
        power = float(np.sum(rows * np.linalg.solve(matrix, rows)))
        misfits.append(len(points) * np.log(power) + float(np.linalg.slogdet(matrix)[1]))
    return float(min(misfits))


def _least(creep: CreepOf, misfit: Callable[[LogarithmicCreep], float]) -> LogarithmicCreep:
    """Return the creep of the least misfit: a parabola through the best of some losses."""
    coarse = [misfit(creep(loss)) for loss in _LOSSES[::3]]
    best = 3 * int(np.argmin(coarse))
    fine = {i: misfit(creep(_LOSSES[i])) for i in range(best - 2, best + 3) if 0 <= i < len(_LOSSES)}
    at = min(fine, key=lambda i: fine[i])
    loss = _LOSSES[at]
    if at - 1 in fine and at + 1 in fine:
        before, middle, after = fine[at - 1], fine[at], fine[at + 1]
        bend = before - 2.0 * middle + after
        if bend > 0.0:
            loss += 0.5 * (before - after) / bend * (_LOSSES[1] - _LOSSES[0])
    return creep(loss)
