"""Find outliers, to name them; they stay in the fit."""

import numpy as np
from scipy.special import stdtrit

from tablegen.numerics.arrays import Floats

_FALSE_ALARM_RATE = 0.01  # per set of points, whatever their number


def outliers(jacobian: Floats, residuals: Floats, least: float) -> tuple[int, ...]:
    """Return the indices of points that the fit to all others would not have left there, the worst first.

    Each residual is compared with the scatter of the fit without it (an externally studentised residual), at a level
    that is divided by the number of points. The worst is set aside and the rest is tested again, while
    at least three quarters of the points and two degrees of freedom remain.

    Parameters
    ----------
    jacobian
        Derivatives of the residuals, shape (points, parameters).
    residuals
        Shape (points,).
    least
        Scatter that counts as none, in the unit of the residuals.
    """
    count, parameters = jacobian.shape
    remaining = np.arange(count)
    outlying: list[int] = []
    while len(remaining) - parameters >= 3 and 4 * (len(outlying) + 1) <= count:
        scores = _studentised(jacobian[remaining], residuals[remaining], least)
        worst = int(np.argmax(scores))
        if scores[worst] <= stdtrit(len(remaining) - parameters - 1, 1.0 - _FALSE_ALARM_RATE / (2 * len(remaining))):
            break
        outlying.append(int(remaining[worst]))
        remaining = np.delete(remaining, worst)
    return tuple(outlying)


def _studentised(jacobian: Floats, residuals: Floats, least: float) -> Floats:
    orthogonal, _ = np.linalg.qr(jacobian)
    deviation = residuals - orthogonal @ (orthogonal.T @ residuals)
    share = np.clip(1.0 - np.sum(orthogonal**2, axis=1), 1e-9, 1.0)  # share of an error that stays in the residual
    freedom = len(deviation) - jacobian.shape[1]
    without = (float(deviation @ deviation) - deviation**2 / share) / (freedom - 1)
    spread = np.sqrt(np.maximum(without, least**2))
    # A point that alone determines a parameter has no residual by which to test it.
    return np.where(share > 1e-6, np.abs(deviation) / (spread * np.sqrt(share)), 0.0)
