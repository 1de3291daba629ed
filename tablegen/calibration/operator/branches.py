"""Residual of a line beside a family: both branches as Chebyshev series of the position along the drive."""

from dataclasses import dataclass

import numpy as np

from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.compensation.operator.family import Family
from tablegen.numerics.arrays import Floats

DEGREE = 20  # of each branch
_CLOSURE = 1e3  # weight of the two places at which the branches meet
_LAGS = 4  # phases


@dataclass(frozen=True, eq=False)
class BranchResidual:
    """Chebyshev ``coefficients`` of both branches, 2 ``DEGREE`` + 2 of them; ``extent_nm`` between the turns.

    ``variance`` is that of each coefficient by the noise of the trace.
    """

    coefficients: Floats
    extent_nm: float
    variance: Floats


def branch_residual(line: PeriodicLine, family: Family) -> BranchResidual:
    """Fit the measured line less the family, both about from 0 to 1 between the turns; ``Operator.loop`` adds both."""
    u, rising = line.drive, line.rising
    low, high = line.low, line.high
    x = 2.0 * (u - low) / (high - low) - 1.0
    modelled = np.where(rising, *(family.branch(u, low, high, going) for going in (True, False)))
    ends = [family.branch(np.array([at]), low, high, True)[0] for at in (low, high)]
    modelled = (modelled - ends[0]) / (ends[1] - ends[0])
    measured = line.displacement_nm
    # A first extent by least squares, then the ends that the smooth branches have.
    scale, offset = np.polyfit(modelled, measured, 1)
    count = DEGREE + 1
    basis = np.polynomial.chebyshev.chebvander(np.clip(x, -1.0, 1.0), DEGREE)
    matrix = np.zeros((len(u) + 2, 2 * count))
    matrix[: len(u)][rising, :count] = basis[rising]
    matrix[: len(u)][~rising, count:] = basis[~rising]
    edges = np.polynomial.chebyshev.chebvander(np.array([-1.0, 1.0]), DEGREE)
    matrix[len(u) :] = _CLOSURE * np.hstack([edges, -edges])
    right = np.append((measured - offset) / scale - modelled, [0.0, 0.0])
    coefficients = np.linalg.lstsq(matrix, right, rcond=None)[0]
    remain = right[: len(u)] - matrix[: len(u)] @ coefficients
    spread = np.diag(np.linalg.inv(matrix.T @ matrix)) * float(np.mean(remain * remain)) * _correlation(remain)
    begin, end = (float(edge @ (coefficients[:count] + coefficients[count:])) / 2.0 for edge in edges)
    return BranchResidual(coefficients, float(scale) * (1.0 + end - begin), spread)


def _correlation(noise: Floats) -> float:
    """Return the factor on the variance from the correlation of neighbouring phases: 1 where there is none."""
    power = float(noise @ noise)
    if power <= 0.0:
        return 1.0
    return max(1.0 + 2.0 * sum(float(noise[lag:] @ noise[:-lag]) / power for lag in range(1, _LAGS + 1)), 1.0)
