"""Subtract the steps of terraces from images before a fit, whose parabola along each row cannot follow them.

The first time the steps are those of the heights; once a lattice is fitted, those of what it leaves, which are clear.
"""

import numpy as np

from tablegen.images.lattice_filters import terrace_edges
from tablegen.numerics.arrays import Floats, Ints

_STEPPED_ROWS = 0.15  # share of the rows: fewer with a step may have it from a strong lattice
_FEWEST_ROWS = 0.02  # the same of what the fitted lattice leaves: an edge along the rows has few, and fewer are specks
_BESIDE = 6  # pixels on either side of a step, whose medians tell its height
_LEAST_STEP = 6.0  # times the usual difference of two such medians, by noise or by waves that were not fitted
_LEAST_SHARE = 0.7  # times the rms of the periodic part: a superstructure of that contrast has been indexed
_OUTLIER = 4.0  # standard deviations of the noise
_POOLED_ROWS = 0.25  # of the frame on either side
_ALIKE = 0.4  # of the size of a step: those of one terrace differ by less


def without_terraces(heights: Floats) -> Floats | None:
    """Subtract the steps of terraces; None where few rows have one.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns), all finite.
    """
    level, rows, columns, steps = terrace_edges(heights)
    if len(np.unique(rows)) < _STEPPED_ROWS * len(heights):
        return None
    for row, column, step in zip(rows, columns, _pooled(rows, steps, len(heights)), strict=True):
        level[row, column:] -= step
    return level


def without_steps(heights: Floats, periodic: Floats) -> tuple[Floats, bool]:
    """Subtract the steps of what a lattice leaves, and bound what remains beside the lattice.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns), all finite.
    periodic
        The fitted lattice in the same unit, of the same shape.

    Returns
    -------
    tuple
        Heights without steps and outliers, of the same shape and unit; and True if rows have steps.
    """
    remainder = _less_common_bow(heights - periodic)
    rows, columns, sizes = _steps(remainder, _LEAST_SHARE * float(np.std(periodic)))
    for row, column, size in zip(rows, columns, _pooled(rows, sizes, len(remainder)), strict=True):
        remainder[row, column:] -= size
    place = np.linspace(-1.0, 1.0, remainder.shape[1])
    parabola = np.linalg.qr(np.vander(place, 3))[0]
    remainder -= (remainder @ parabola) @ parabola.T
    spread = 1.4826 * float(np.median(np.abs(remainder)))
    stepped = len(np.unique(rows)) >= _FEWEST_ROWS * len(heights)
    return np.asarray(periodic + np.clip(remainder, -_OUTLIER * spread, _OUTLIER * spread), np.float64), stepped


def _less_common_bow(heights: Floats) -> Floats:
    """Subtract each row's median, and the tilt and bow that all rows share, from slopes that steps do not affect."""
    slopes = np.median(np.diff(heights, axis=1), axis=0)
    middle = float(np.median(slopes))
    spread = 1.4826 * float(np.median(np.abs(slopes - middle)))
    slopes = np.clip(slopes, middle - _OUTLIER * spread, middle + _OUTLIER * spread)
    place = np.linspace(-1.0, 1.0, len(slopes))
    line = np.polynomial.Polynomial.fit(place, slopes, 1, domain=(-1.0, 1.0))(place)
    level = heights - np.concatenate([[0.0], np.cumsum(line)])
    return np.asarray(level - np.median(level, axis=1, keepdims=True), dtype=np.float64)


def _steps(remainder: Floats, least: float) -> tuple[Ints, Ints, Floats]:
    """Return the row and the first column after each step of ``least`` or more along the rows, and its size."""
    windows = np.lib.stride_tricks.sliding_window_view(remainder, _BESIDE, axis=1)
    medians, means = np.median(windows, axis=2), np.mean(windows, axis=2)
    inner = (slice(None), slice(_BESIDE, 1 - _BESIDE))
    sharp, size = np.zeros(remainder.shape), np.zeros(remainder.shape)
    sharp[inner] = np.abs(means[:, _BESIDE:] - means[:, :-_BESIDE])  # their peak is sharper than that of medians
    size[inner] = medians[:, _BESIDE:] - medians[:, :-_BESIDE]
    usual = 1.4826 * float(np.median(np.abs(size[inner])))
    at = np.abs(size) > max(least, _LEAST_STEP * usual)
    for shift in range(1, _BESIDE + 1):  # the largest of its neighbourhood
        at[:, shift:] &= sharp[:, shift:] >= sharp[:, :-shift]
        at[:, :-shift] &= sharp[:, :-shift] > sharp[:, shift:]
    rows, columns = np.nonzero(at)
    return rows, columns, size[at]


def _pooled(rows: Ints, sizes: Floats, count: int) -> Floats:
    """Return the median of the sizes of alike steps in the rows nearby.

    A step by itself would take along what the fitted lattice still lacks in its row.
    """
    pooled = sizes.copy()
    for number, (row, size) in enumerate(zip(rows, sizes, strict=True)):
        near = (np.abs(rows - row) <= _POOLED_ROWS * count) & (np.abs(sizes - size) < _ALIKE * abs(size))
        pooled[number] = np.median(sizes[near])
    return pooled
