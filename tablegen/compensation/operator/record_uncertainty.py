"""The possible errors of an operator that was fitted to records in time, for any settled line.

Such an operator has no trace to leave out. Its error has three parts, whose squares add up. The first is that of any
fit: plays of a few thresholds bend a branch in steps. The second follows from the misfit: what the fit, or the
prediction of the last part of a record, leaves beyond the noise, in percent of the widest stroke. Both are about as
large in nm for small lines as for large ones. The third grows with the distance from the sweeps that the records have:
a Gaussian process over stroke and centre that is 0 at these, as a share of the loop's own deviation from a line.

The numbers were chosen on simulated piezos; ``benchmarks/expected_of_records.py`` checks them on others.
"""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np

from tablegen.compensation.identification import MeasuredLine
from tablegen.compensation.operator.family import Family
from tablegen.compensation.operator.field import Lengths, covariance
from tablegen.numerics.arrays import tree_sum
from tablegen.numerics.linear import Cholesky

_LENGTHS = Lengths(0.4, 0.5, 1e-3)  # over which a loop becomes another one
_LEAST_SHARE = 0.01  # extent of a line, of the widest one, below which nothing is known


class _Level(NamedTuple):
    """The bound of 90 % of one figure, in percent of the line.

    ``fit`` and ``misfit`` are factors of the first two parts at the widest line; ``growth`` has the exponents by which
    they grow for smaller ones, in quarters. ``share`` is that of the loop far from all sweeps.
    """

    fit: float
    misfit: float
    growth: tuple[int, int]
    share: float


_LEVELS = (
    _Level(0.045, 1.3, (4, 1), 1.1),  # rms
    _Level(4.5, 32.0, (1, 0), 1.3),  # scaling error
    _Level(0.15, 3.6, (4, 1), 1.15),  # mismatch
    _Level(0.0, 2.2, (4, 4), 1.4),  # size
)


def possible_record_errors(
    family: Family,
    lines: Sequence[MeasuredLine],
    misfit_percent: float,
    place: tuple[float, float],
    units: Sequence[float],
) -> tuple[float, float, float, float]:
    """Return by how much rms, scaling error, mismatch and size may be off, in percent of the line.

    Parameters
    ----------
    misfit_percent
        What the fit leaves beyond the noise, in percent of the widest stroke.
    place
        Stroke and centre of the line, shares of v_max.
    units
        What a change of the loop is a share of, in each figure; see ``LoopShape.units``.
    """
    widest = max(lines, key=lambda line: line.stroke)
    whole = family.extent(widest.stroke, widest.centre)
    size = max(family.extent(*place) / whole if whole > 0.0 else 0.0, _LEAST_SHARE)
    growth = [1.0]
    for _ in range(4):
        growth.append(growth[-1] / sqrt(sqrt(size)))  # a power would not be the same on every machine
    far = _far_from(lines, place)

    def bound(level: _Level, unit: float) -> float:
        in_fit = level.fit * growth[level.growth[0]]
        by_misfit = level.misfit * misfit_percent * growth[level.growth[1]]
        return sqrt(in_fit * in_fit + by_misfit * by_misfit + (level.share * unit) ** 2 * far)

    rms, scaling, mismatch, extent = (bound(*one) for one in zip(_LEVELS, units, strict=True))
    return rms, scaling, mismatch, extent


def _far_from(lines: Sequence[MeasuredLine], place: tuple[float, float]) -> float:
    """Return the variance of the process at a place, given all lines: 0 at a line, and 1 far from every one."""
    points = np.array([(line.stroke, line.centre) for line in lines])
    near = covariance(np.array([place]), points, _LENGTHS)[0]
    known = covariance(points, points, _LENGTHS) + _LENGTHS.noise * np.eye(len(points))
    return max(1.0 - float(tree_sum(near * Cholesky(known).solve(near))), 0.0)
