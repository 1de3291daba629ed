"""Where a waveform turns: between its extremes it is monotonic, so that what follows it in steps errs most there."""

from collections.abc import Callable, Sequence

import numpy as np

from tablegen.numerics.arrays import Floats, Ints, merged
from tablegen.waveform.series import FourierSeries


def extreme_points(series: FourierSeries) -> int:
    """Points of a grid that is fine enough to see every extreme."""
    return 64 * series.harmonics


def extreme_ticks(w: Floats, slope_and_bend: Callable[[Floats], Sequence[Floats]], ticks: int) -> Ints:
    """The ticks before and behind each extreme, ascending, of a period of ``ticks``.

    ``w`` is the waveform on a grid of ``extreme_points``, ``slope_and_bend`` its first two derivatives at times.
    """
    points = len(w)
    turning = (w - np.roll(w, 1)) * (np.roll(w, -1) - w) <= 0.0
    t = np.flatnonzero(turning) / points
    for _ in range(3):  # Newton on the slope; where it is flat any tick is as good
        slope, bend = slope_and_bend(t)
        step = slope / np.where(bend == 0.0, np.inf, bend)
        t = t - np.clip(step, -1.0 / points, 1.0 / points)
    before = np.floor(t * ticks).astype(np.int64)
    return merged(before % ticks, (before + 1) % ticks)
