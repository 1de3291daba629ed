"""Correlation of residuals, by which the standard errors of a fit are widened."""

import numpy as np

from tablegen.numerics.arrays import Floats


def correlation_length(residuals: Floats) -> float:
    """Return over how many samples residuals depend on each other: 1 for white noise.

    The integrated autocorrelation, summed up to five times itself: far enough for correlated residuals, not for noise.

    Parameters
    ----------
    residuals
        Residuals in any unit, shape (n,), or (n, series) for several series of one kind.
    """
    power = float(np.vdot(residuals, residuals))
    total = 1.0
    if power <= 0.0:
        return total
    for lag in range(1, len(residuals) // 4):
        if lag > 5.0 * total:
            break
        total += 2.0 * float(np.vdot(residuals[lag:], residuals[:-lag])) / power
    return max(total, 1.0)
