"""Least squares with x >= 0, by the active set of Lawson and Hanson, on the normal equations."""

import numpy as np

from tablegen.numerics.arrays import Floats

_TOLERANCE = 1e-11


def nonnegative(normal: Floats, right: Floats) -> Floats:
    """Minimise x N x / 2 - r x over x >= 0.

    Parameters
    ----------
    normal
        N, positive definite, shape (n, n).
    right
        r, shape (n,).

    Returns
    -------
    Floats
        x, shape (n,).
    """
    n = len(right)
    x = np.zeros(n)
    free = np.zeros(n, bool)
    scale = _TOLERANCE * float(np.max(np.abs(right)))
    for _ in range(6 * n):
        slope = right - normal @ x
        slope[free] = -np.inf
        best = int(np.argmax(slope))
        if not slope[best] > scale:
            break
        free[best] = True
        while True:
            at = np.flatnonzero(free)
            trial = np.linalg.solve(normal[np.ix_(at, at)], right[at])
            if np.min(trial) > 0.0:
                x[:] = 0.0
                x[at] = trial
                break
            below = trial <= 0.0
            old = x[at]
            share = float(np.min(old[below] / np.maximum(old[below] - trial[below], 1e-300)))
            x[at] = old + share * (trial - old)
            leaving = at[below & (x[at] <= 1e-14 * float(np.max(np.abs(x))) + 1e-300)]
            leaving = leaving if len(leaving) else at[below][:1]
            x[leaving] = 0.0
            free[leaving] = False
    return x
