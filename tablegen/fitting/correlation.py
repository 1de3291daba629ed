"""Correlation of residuals: what the standard errors of a fit have to be widened by."""

import numpy as np

from tablegen.numerics.arrays import Floats


def correlation_length(residuals: Floats) -> float:
    """Over how many samples residuals depend on each other: 1 for white noise. Shape (n,), or (n, series) of one kind.

    The integrated autocorrelation, summed up to five times itself: far enough for what it finds, not for noise.
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
