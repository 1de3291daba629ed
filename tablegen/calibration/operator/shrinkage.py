"""Reduce the noise of the lines' residuals: each Chebyshev order is as strong as the lines together show it to be.

The result is the mean of a Gaussian process at the measured points, with a variance for each order, and the noise of
each coefficient. The variances are those of the largest likelihood.
"""

from collections.abc import Sequence

import numpy as np

from tablegen.calibration.operator.branches import DEGREE, BranchResidual
from tablegen.compensation.operator.field import Lengths, covariance
from tablegen.numerics.arrays import Floats

_POWERS = np.geomspace(1e-4, 1e12, 65)  # variance of an order over that of its noise
_FLOOR = 1e-14  # least variance of a coefficient


def shrink(points: Floats, residuals: Sequence[BranchResidual], lengths: Lengths) -> Floats:
    """Return the coefficients of the lines with less noise.

    Parameters
    ----------
    points
        Strokes and centres, shares of v_max, shape (lines, 2).

    Returns
    -------
    Floats
        Dimensionless, shape (lines, 2 DEGREE + 2).
    """
    prior = covariance(points, points, lengths, straight=True)
    rows = np.stack([one.coefficients for one in residuals])
    noise = np.maximum(np.stack([one.variance for one in residuals]), _FLOOR)
    # The noise is that of a line times that of an order, since nearly all lines have their samples at the same phases.
    of_line = np.sqrt(np.mean(noise, axis=1) / np.mean(noise))
    of_order = np.sqrt(np.mean(noise, axis=0))
    values, vectors = np.linalg.eigh(prior / of_line[:, None] / of_line)
    values = np.maximum(values, 0.0)
    along = vectors.T @ (rows / of_line[:, None] / of_order)
    # The likelihood of every order, of both branches together, at every power.
    spread = 1.0 + _POWERS[:, None] * values
    each = -0.5 * (1.0 / spread) @ (along * along) - 0.5 * np.sum(np.log(spread), axis=1)[:, None]
    count = DEGREE + 1
    best = np.argmax(each[:, :count] + each[:, count:], axis=0)
    power = _POWERS[np.concatenate([best, best])]
    weights = power * values[:, None] / (1.0 + power * values[:, None])
    out: Floats = (vectors @ (weights * along)) * of_line[:, None] * of_order
    return out
