"""Errors of a line whose pixels have a table of ticks: those of the mean position over the ticks of each pixel."""

import numpy as np

from tablegen.certificate.line_errors import CHORD
from tablegen.device.schedule import Schedule
from tablegen.numerics.arrays import Floats
from tablegen.virtual.line_error import BranchError, LineError


def pixel_line_error(displacement_nm: Floats, schedule: Schedule, window: tuple[float, float]) -> LineError:
    """Compare the pixels of a settled line with a grid of equal steps, about the best line through both directions.

    Parameters
    ----------
    displacement_nm
        One period, the mean position over each tick, or over as many equal parts of the period; shape (n,).
    schedule
        The schedule of the scan, with its table of pixels.
    window
        The imaged part of the line, 0..1.

    Returns
    -------
    LineError
        Arrays of a direction have shape (pixels,), those of the scaling one value a chord.

    Raises
    ------
    ValueError
        If the pixels do not move.
    """
    low, high = window
    pitch = (high - low) / schedule.pixels
    grid = low + pitch * (np.arange(schedule.pixels, dtype=np.float64) + 0.5)
    sides = _means(displacement_nm, schedule)
    size, start = np.polyfit(np.concatenate([grid, grid]), np.concatenate(sides), 1)
    if not size > 0.0:
        raise ValueError("the pixels do not move")
    step = min(max(round(CHORD / pitch), 1), schedule.pixels - 1)

    def branch(nm: Floats) -> BranchError:
        reached = (nm - start) / size
        middle = 0.5 * (grid[step:] + grid[: len(grid) - step])
        slope = (reached[step:] - reached[: len(grid) - step]) / (step * pitch)
        scaling = 100.0 * (1.0 - slope / float(np.interp(0.5, middle, slope)))
        return BranchError(grid, 100.0 * (reached - grid), middle, scaling, window)

    return LineError(float(size), branch(sides[0]), branch(sides[1]))


def _means(displacement_nm: Floats, schedule: Schedule) -> tuple[Floats, Floats]:
    """Return the mean position over each pixel of trace and retrace, in the order of the grid, (pixels,) each."""
    parts = len(displacement_nm)
    sums = np.concatenate([[0.0], np.cumsum(displacement_nm)])
    means = []
    for ticks in schedule.pixel_edges:
        edges = ticks * (parts / schedule.ticks)
        means.append(np.diff(np.interp(edges, np.arange(parts + 1), sums)) / np.diff(edges))
    return means[0], means[1][::-1]
