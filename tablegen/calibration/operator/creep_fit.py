"""How much an axis creeps, from settled lines: by what plays leave of them, or by their sizes at several rates.

Plays need but one rate, since they have no width where the stroke vanishes and creep has. On a piezo that is no sum of
plays they would take hysteresis for creep; there the sizes tell, which lose the same share with every decade of rate.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from tablegen.calibration.operator.branches import left_of
from tablegen.calibration.operator.family import fit_plays
from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.compensation.operator.creep import NO_CREEP, LogarithmicCreep
from tablegen.compensation.operator.field import Lengths, covariance
from tablegen.compensation.operator.plays import Plays
from tablegen.numerics.arrays import Floats

_LOSSES = tuple(0.004 * i for i in range(13))  # of creep, per decade
_DECADES = 1.0  # by which creep is taken to go on beyond the frequencies that were measured
_SEVERAL_RATES = 2.0  # of the highest over the lowest, from which sizes tell creep
_SAME_TURN = 0.1  # in periods: by which the turns of lines may differ whose shapes tell creep
_STROKE_LENGTHS = (0.4, 0.8, 1.5, 3.0)
_CENTRE_LENGTH = 1.0
_NOISE = 1e-4  # variance of the noise, of the field's

Factor = Callable[[float], float]


def creep_of_plays(lines: Sequence[PeriodicLine], main: float) -> LogarithmicCreep:
    """The loss per decade with which plays describe the lines best; ``main`` is the centre of ``fit_plays``."""

    def misfit(creep: LogarithmicCreep) -> float:
        settled = [line.without(None, creep) for line in lines]
        family = fit_plays(settled, main)
        return float(np.mean([_misfit(line, family) ** 2 for line in settled]))

    return _least(lines, misfit)


def creep_of_fields(lines: Sequence[PeriodicLine], family: Plays, factor: Factor) -> LogarithmicCreep:
    """The loss per decade with which the fields over stroke and centre are the likeliest, whatever the hysteresis.

    Of several rates the sizes decide; of one rate and one turn the shapes, which are straight where the stroke
    vanishes. Other lines leave it open, and it is taken as 0.
    """
    rates = [line.rate_hz for line in lines]
    turns = [float(np.mean(line.rising)) for line in lines]
    several = max(rates) >= _SEVERAL_RATES * min(rates)
    if not several and max(turns) - min(turns) > _SAME_TURN:
        return replace(NO_CREEP, reference_hz=_reference(lines))

    def misfit(creep: LogarithmicCreep) -> float:
        left = [left_of(line.without(None, creep), family) for line in lines]
        if several:
            sizes = [one.extent_nm * factor(line.centre) / line.stroke for one, line in zip(left, lines, strict=True)]
            values = np.array(sizes)[:, None]
            return _unlikelihood(lines, values / np.mean(values) - 1.0, still=False)
        return _unlikelihood(lines, np.stack([one.coefficients for one in left]), still=True)

    return _least(lines, misfit)


def _unlikelihood(lines: Sequence[PeriodicLine], rows: Floats, still: bool) -> float:
    """-2 log of the likelihood of a field through rows of one variance, of the best length; up to a constant.

    With ``still`` the field is 0 at a stroke of 0.
    """
    points = np.array([(line.stroke, line.centre) for line in lines])
    if still:
        centres = sorted({round(line.centre, 2) for line in lines})
        points = np.concatenate([points, [(0.0, centre) for centre in centres]])
        rows = np.concatenate([rows, np.zeros((len(centres), rows.shape[1]))])
    found = []
    for stroke in _STROKE_LENGTHS:
        matrix = covariance(points, points, Lengths(stroke, _CENTRE_LENGTH, _NOISE)) + _NOISE * np.eye(len(points))
        power = float(np.sum(rows * np.linalg.solve(matrix, rows)))
        found.append(len(points) * np.log(power) + float(np.linalg.slogdet(matrix)[1]))
    return float(min(found))


def _least(lines: Sequence[PeriodicLine], misfit: Callable[[LogarithmicCreep], float]) -> LogarithmicCreep:
    """The creep of the least misfit: a parabola through the best of some losses."""
    low = min(line.rate_hz for line in lines)
    high = max(line.rate_hz for line in lines)
    reference = _reference(lines)
    fastest, slowest = 10.0 ** (-2.0 - _DECADES) / high, 10.0**_DECADES / low

    def creep(loss: float) -> LogarithmicCreep:
        return LogarithmicCreep(loss, fastest, slowest, reference)

    coarse = [misfit(creep(loss)) for loss in _LOSSES[::3]]
    best = 3 * int(np.argmin(coarse))
    fine = {i: misfit(creep(_LOSSES[i])) for i in range(best - 2, best + 3) if 0 <= i < len(_LOSSES)}
    at = min(fine, key=lambda i: fine[i])
    loss = _LOSSES[at]
    if at - 1 in fine and at + 1 in fine:
        left, middle, right = fine[at - 1], fine[at], fine[at + 1]
        bend = left - 2.0 * middle + right
        if bend > 0.0:
            loss += 0.5 * (left - right) / bend * (_LOSSES[1] - _LOSSES[0])
    return creep(round(loss, 6)) if loss > 0.0 else replace(NO_CREEP, reference_hz=reference)


def _reference(lines: Sequence[PeriodicLine]) -> float:
    return float(np.exp(np.mean([np.log(line.rate_hz) for line in lines])))


def _misfit(line: PeriodicLine, family: Plays) -> float:
    """What a family leaves of a line, of its stroke in nm, with a gain and an offset of its own."""
    u = line.drive
    both = (family.branch(u, line.low, line.high, going) for going in (True, False))
    modelled = np.where(line.rising, *both)
    gain, offset = np.polyfit(modelled, line.displacement_nm, 1)
    return float(np.std(line.displacement_nm - gain * modelled - offset)) / float(np.ptp(line.displacement_nm))
