"""The possible errors of an operator: from the errors of its traces when they are left out, and the distance to them.

Departures of the piezo are a Gaussian process over stroke and centre. The error of a trace, less what the operator
leaves of it in the fit (that is noise), over the standard deviation that the process has there without it, is the
strength of the departures; times the standard deviation at the scan, it is the possible error there. Noise remains.
"""

from collections.abc import Sequence
from math import sqrt

import numpy as np

from tablegen.compensation.identification import MeasuredLine
from tablegen.compensation.operator.field import Lengths, covariance
from tablegen.compensation.operator.operator import chebyshev
from tablegen.numerics.arrays import Floats, tree_sum
from tablegen.numerics.linear import Cholesky

_ALIKE = Lengths(0.6, 2.5, 1e-3)  # departures of lines; the noise is what rates and turns change
_FEW = 3  # traces, below which all count
_PLACES = 0.5  # share of what the family leaves that may be another one, for an offset that is v_max from all traces
_WINDOW = 0.8  # of -1..1, where it counts; chords of a twentieth of the line
_POINTS, _CHORD = 161, 10
_FORMULAS = 0.15  # share of the factors (1) and (23) between the nearest trace and the scan that may be wrong


def departures(lines: Sequence[MeasuredLine], stroke: float, centre: float) -> tuple[float, float, float, float]:
    """Return by how much rms, scaling error, mismatch and size may be off at a stroke and a centre, in percent."""
    points = np.array([(line.stroke, line.centre) for line in lines])
    left_out, noise = np.array([line.left_out for line in lines]), np.array([line.in_fit for line in lines])
    known = covariance(points, points, _ALIKE)
    factor = Cholesky(known + _ALIKE.noise * np.diag(np.diag(known)))
    without = [1.0 / float(factor.solve(row)[i]) for i, row in enumerate(np.eye(len(points)))]
    near = covariance(np.array([[stroke, centre]]), points, _ALIKE)[0]
    here = max(1.0 - _dot(near, factor.solve(near)), 0.0)
    many = _deviations(0.5 * len(points))  # errors of neighbours are correlated: half of them count as independent
    out = []
    for by, in_fit in zip(left_out.T, noise.T, strict=True):
        square, rest = (by * by).tolist(), (in_fit * in_fit).tolist()
        strength = _variance([max(a - b, 0.0) / v for a, b, v in zip(square, rest, without, strict=True)])
        out.append(sqrt(_mean(rest) + many * many * strength * here))
    return out[0], out[1], out[2], out[3]


def shape_uncertainty(row: Floats, away: float) -> tuple[float, float, float]:
    """Return by how much rms, scaling error and mismatch may be off since the shape was measured at other offsets.

    Parameters
    ----------
    row
        The residual of the family on both branches there, (2 K + 2,), as ``Operator.residual`` has it.
    away
        The distance of the offset to that of the nearest trace, of v_max. Sensitivities change about as much.
    """
    x = _WINDOW * (2.0 * np.arange(_POINTS) / (_POINTS - 1) - 1.0)
    half = len(row) // 2
    there, back = chebyshev(row[:half], x), chebyshev(row[half:], x)
    mean = 0.5 * (there + back)
    level, slope = float(tree_sum(mean)) / _POINTS, float(tree_sum(mean * x)) / float(tree_sum(x * x))
    sides = [one - level - slope * x for one in (there, back)]
    square = sum(float(tree_sum(side * side)) for side in sides) / (2.0 * _POINTS)
    chords = [(side[_CHORD:] - side[:-_CHORD]) / (0.5 * float(x[_CHORD] - x[0])) for side in sides]
    scaling = max(float(np.max(one) - np.min(one)) for one in chords)
    share = 100.0 * _PLACES * away
    return share * sqrt(square), share * scaling, share * float(np.max(np.abs(there - back)))


def size_uncertainty(steps: Sequence[float]) -> float:
    """Return by how much the size may be off, in percent, for the shares by which formulas change it."""
    return 100.0 * _FORMULAS * sqrt(sum(step * step for step in steps))


def _deviations(freedom: float) -> float:
    """Return the bound of 90 % of Student's t, to second order in the inverse of the degrees of freedom.

    The 90 % are ``expectation.LEVEL_PERCENT``.
    """
    return 1.645 + (1.524 + 1.42 / freedom) / freedom


def _variance(squares: Sequence[float]) -> float:
    """Return the variance from squares of deviations without the largest: families often fail at the largest stroke."""
    count = len(squares)
    if count < _FEW:
        return _mean(squares)
    # About the share that remains of a normal distribution's, or less.
    return _mean(sorted(squares)[:-1]) / (1.0 - 1.15 / sqrt(count))


def _mean(values: Sequence[float]) -> float:
    return float(sum(values)) / len(values)


def _dot(one: Floats, other: Floats) -> float:
    return float(sum(a * b for a, b in zip(one.tolist(), other.tolist(), strict=True)))
