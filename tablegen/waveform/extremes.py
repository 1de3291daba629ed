"""The extremes of a waveform: it is monotonic between them, so that what follows it in steps errs most there."""

from collections.abc import Callable, Sequence

import numpy as np

from tablegen.numerics.arrays import Floats, Ints, union_sorted
from tablegen.waveform.series import FourierSeries


def extreme_points(series: FourierSeries) -> int:
    """Return how many points a grid needs to resolve every extreme."""
    return 64 * series.harmonics


def extreme_ticks(w: Floats, slope_and_bend: Callable[[Floats], Sequence[Floats]], ticks: int) -> Ints:
    """Return the ticks before and behind each extreme of a period of ``ticks``, ascending.

    Parameters
    ----------
    w
        The waveform on a grid of ``extreme_points``, shape (points,).
    slope_and_bend
        Returns the first two derivatives at times in periods.
    """
    points = len(w)
    turning = (w - np.roll(w, 1)) * (np.roll(w, -1) - w) <= 0.0
    t = np.flatnonzero(turning) / points
    for _ in range(3):  # Newton on the slope; where it is flat any tick is as good
        slope, bend = slope_and_bend(t)
        step = slope / np.where(bend == 0.0, np.inf, bend)
        t = t - np.clip(step, -1.0 / points, 1.0 / points)
    before = np.floor(t * ticks).astype(np.int64)
    return union_sorted(before % ticks, (before + 1) % ticks)
