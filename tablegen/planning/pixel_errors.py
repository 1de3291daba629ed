"""Errors of pixels that are taken where the piezo is: what the rounding of their edges to whole ticks leaves."""

from math import pi, sqrt

import numpy as np
from msgspec import Struct

from tablegen.device.schedule import Schedule
from tablegen.numerics.arrays import Floats
from tablegen.waveform.series import FourierSeries

_CHORD = 0.05  # of the line, for scaling errors


class PixelErrors(Struct, frozen=True, eq=False):
    """Errors of the pixels in percent of the line, by the predicted position; by direction, ``mismatch`` of both.

    ``errors`` are those of each pixel, in the order of the position. The place of a pixel is the mean position over its
    ticks, its error the distance from the grid. ``scaling`` is that of chords of 1/20 of the line, peak to peak.
    """

    errors: dict[str, Floats]
    rms: dict[str, float]
    worst: dict[str, float]
    scaling: dict[str, float]
    mismatch: float


def pixel_errors(place: FourierSeries, schedule: Schedule, window: tuple[float, float]) -> PixelErrors:
    """Compute the errors of the pixels of a schedule that has a table of them.

    Parameters
    ----------
    place
        Position over a period, as a share of the line.
    window
        The imaged part of the line, 0..1.
    """
    low, high = window
    pitch = (high - low) / schedule.pixels
    grid = low + pitch * (np.arange(schedule.pixels) + 0.5)
    sides = dict(zip(("forward", "backward"), (one - grid for one in pixel_means(place, schedule)), strict=True))
    step = min(max(round(_CHORD / pitch), 1), schedule.pixels - 1)
    return PixelErrors(
        errors={side: 100.0 * one for side, one in sides.items()},
        rms={side: 100.0 * sqrt(float(np.mean(one * one))) for side, one in sides.items()},
        worst={side: 100.0 * float(np.max(np.abs(one))) for side, one in sides.items()},
        scaling={
            side: 100.0 * float(np.ptp(one[step:] - one[:-step])) / (step * pitch) if step else 0.0
            for side, one in sides.items()
        },
        mismatch=100.0 * float(np.max(np.abs(sides["forward"] - sides["backward"]))),
    )


def pixel_means(place: FourierSeries, schedule: Schedule) -> tuple[Floats, Floats]:
    """Return the mean position over each pixel of trace and retrace, in the order of the grid, (pixels,) each."""
    n = 2.0 * pi * np.arange(1.0, place.harmonics + 1.0)
    integral = FourierSeries(0.0, -place.b / n, place.a / n)  # without that of a0
    means = []
    for ticks in schedule.pixel_edges:
        edges = ticks / schedule.ticks
        means.append(place.a0 + np.diff(integral.value(edges)) / np.diff(edges))
    return means[0], means[1][::-1]
