"""The optimum of an axis: the least peak acceleration of any waveform, by a linear programme (HiGHS of scipy).

It shares nothing with the fit of the build but the line: other times, other sums, another method. Only the scaling
error and the range are constrained, and not the place of the line, so that the optimum is a little below what a build
can reach.
"""

from math import ceil, tau

import numpy as np
from msgspec.structs import replace

from tablegen.certificate.certificate import Certificate
from tablegen.numerics.arrays import Floats
from tablegen.planning.enough_harmonics import straightness
from tablegen.planning.line_plan import LinePlan
from tablegen.waveform.minimum_acceleration import Straightness

_SLOPES_PER_HARMONIC, _MORE_SLOPES = 8, 33  # over a window, denser towards its edges
_PER_WAVE = 16  # of the highest harmonic: accelerations outside the windows, and values


def with_optimum(line: LinePlan, certificate: Certificate) -> Certificate:
    """Add the peak acceleration, and its optimum at the error that the axis keeps or has, to a certificate.

    The optimum is None where the waveform is the operator's own, which leaves no error to trade for acceleration. It
    needs scipy.
    """
    shape, whole = line.drive.shape, line.drive.shape.whole
    straight = straightness(shape if whole is None else whole.straight, line.band_limit, line.layer)
    beside_percent = None if whole is None or whole.trade is None else whole.trade.beside_percent
    percent = beside_percent or line.kept_percent or straight.error_percent(line.target)
    least = least_acceleration(straight, line.target.harmonics, percent) if percent > 1e-9 else None
    return replace(certificate, peak_acceleration=line.target.peak_acceleration(), optimum=least)


def least_acceleration(straight: Straightness, harmonics: int, percent: float) -> float | None:
    """Return max |w''| per period squared of the line; None where no waveform of so many harmonics keeps the error."""
    from scipy.optimize import linprog

    shape, turn, (low, high) = straight.shape, straight.shape.turn, straight.window
    n = np.arange(1, harmonics + 1)
    scale = np.concatenate([[1.0], (tau * n) ** -2.0, (tau * n) ** -2.0])

    def rows(t: Floats, derivative: int) -> Floats:
        """Return the rows of a derivative of the waveform, by its scaled coefficients.

        Parameters
        ----------
        t
            Times in periods, shape (m,).
        derivative
            Order, 0 to 2.

        Returns
        -------
        Floats
            Shape (m, 2 H + 1).
        """
        angle, rate = tau * np.outer(t, n), (tau * n) ** derivative
        c, s = np.cos(angle), np.sin(angle)
        columns = {0: (c, s), 1: (-s, c), 2: (-c, -s)}[derivative]
        mean = np.full((len(t), 1), 1.0 if derivative == 0 else 0.0)
        out: Floats = np.hstack([mean, rate * columns[0], rate * columns[1]]) * scale
        return out

    count = _SLOPES_PER_HARMONIC * harmonics + _MORE_SLOPES
    t = np.concatenate(straight.times(0.5 - 0.5 * np.cos(np.pi * np.arange(count) / (count - 1))))
    slopes, target = rows(t, 1) / shape.slope(t)[:, None], straight.target.slope(t) / shape.slope(t)
    grid = np.arange(ceil(_PER_WAVE * harmonics)) / ceil(_PER_WAVE * harmonics)
    place = np.where(grid <= turn, grid / turn, (1.0 - grid) / (1.0 - turn))
    free = (place <= low) | (place >= high) | ((grid > turn) & (not straight.both))
    bends, values = rows(grid[free], 2), rows(grid, 0)
    half = percent / 200.0
    blocks = [(bends, 1.0, 0.0, 0.0), (slopes, 0.0, target, half), (values, 0.0, 0.5, 0.5)]
    coefficients, bounds = [], []
    for block, share, middle, width in blocks:
        for sign in (1.0, -1.0):
            coefficients.append(np.hstack([sign * block, np.full((len(block), 1), -share)]))
            bounds.append(np.broadcast_to(width + sign * np.asarray(middle), len(block)))
    objective = np.zeros(2 * harmonics + 2)
    objective[-1] = 1.0
    solution = linprog(objective, np.vstack(coefficients), np.concatenate(bounds), bounds=(None, None), method="highs")
    return float(solution.fun) if solution.status == 0 else None
