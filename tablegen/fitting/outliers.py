"""Points that do not fit to the others: found to be named, never to be dropped."""

import numpy as np
from scipy.special import stdtrit

from tablegen.numerics.arrays import Floats

_FALSE_ALARM_RATE = 0.01  # per set of points, whatever their number


def outliers(jacobian: Floats, residuals: Floats, least: float) -> tuple[int, ...]:
    """Return the indices of points that the fit to all others would not have left there, the worst first.

    Each residual is held against the scatter of the fit without it (an externally studentised residual), at a level
    that is divided by the number of points. The worst is set aside and the rest is looked at again, while
    at least three quarters of the points and two degrees of freedom remain. ``least`` is the scatter that
    counts as none, in the unit of the residuals.

    Parameters
    ----------
    jacobian
        Derivatives of the residuals, shape (points, parameters).
    residuals
        Shape (points,).
    """
    count, parameters = jacobian.shape
    kept = np.arange(count)
    found: list[int] = []
    while len(kept) - parameters >= 3 and 4 * (len(found) + 1) <= count:
        scores = _studentised(jacobian[kept], residuals[kept], least)
        worst = int(np.argmax(scores))
        if scores[worst] <= stdtrit(len(kept) - parameters - 1, 1.0 - _FALSE_ALARM_RATE / (2 * len(kept))):
            break
        found.append(int(kept[worst]))
        kept = np.delete(kept, worst)
    return tuple(found)


def _studentised(jacobian: Floats, residuals: Floats, least: float) -> Floats:
    orthogonal, _ = np.linalg.qr(jacobian)
    left = residuals - orthogonal @ (orthogonal.T @ residuals)
    share = np.clip(1.0 - np.sum(orthogonal**2, axis=1), 1e-9, 1.0)  # share of its own error that a point keeps
    freedom = len(left) - jacobian.shape[1]
    without = (float(left @ left) - left**2 / share) / (freedom - 1)
    spread = np.sqrt(np.maximum(without, least**2))
    # A point that alone decides a parameter has no residual of its own to judge it by.
    return np.where(share > 1e-6, np.abs(left) / (spread * np.sqrt(share)), 0.0)
