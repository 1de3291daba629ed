"""Prepare an image for the search of a lattice: rows that jump, terraces and outliers lose their weight.

The plain filter keeps all that is periodic. The slopes along the rows are the second one: a row that jumps or a terrace
leaves a few extreme slopes there, which are clipped.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from tablegen.images.missing import COMPLETE, longest_run, valid_pixels
from tablegen.numerics.arrays import Bools, Complexes, Floats, Ints

_CLIPPED = 1.0  # percent of the heights at either end
_SLOPE_LIMIT = 3.0  # times the usual slope: the edge of a terrace has more
_EDGE = 2.0  # times the limit: a slope that is the edge of a terrace or a speck, and none of the lattice
_BESIDE = 10  # pixels on either side of an edge, whose medians tell a terrace from a speck
_STEP_SHARE = 0.5  # of the slope at an edge that remains as a step between these medians
_LEAST_TERRACE = 6  # pixels of a row: a shorter part is not levelled by itself
_FILLED_GAP = 0.02  # of the rows: a longer gap would make spots of its own if it were interpolated
_MOST_REGULAR = 0.04  # amplitude of a wave of missing rows: filled, they make spots beside those of the lattice
_SEPARABLE = 1e-12  # of the weight
_BOW_DEGREE = 2
_WIDTH = 1.0  # pixels: standard deviation of the Gaussian that smooths slopes


@dataclass(frozen=True, eq=False)
class FilteredImage:
    """Values without offset, and their weight, which is 0 where a pixel is missing; shape (rows, columns) each."""

    name: str
    values: Floats
    weight: Floats

    @cached_property
    def weighted(self) -> Floats:
        """The values times their weight."""
        return self.values * self.weight

    @cached_property
    def factors(self) -> tuple[Floats, Floats] | None:
        """The weight as a function of the row times one of the column, if it is such a product."""
        rows, columns = np.max(self.weight, axis=1), np.max(self.weight, axis=0) / np.max(self.weight)
        off = np.max(np.abs(np.outer(rows, columns) - self.weight))
        return (rows, columns) if off <= _SEPARABLE * np.max(rows) else None

    @cached_property
    def power(self) -> Floats:
        """One half of the power of the weighted values, padded to twice the rows and columns."""
        rows, columns = self.values.shape
        return power_of(np.fft.rfft2(self.weighted, (2 * rows, 2 * columns)))


def power_of(spectrum: Complexes) -> Floats:
    """Return the squares of the absolute values."""
    return np.asarray(spectrum.real**2 + spectrum.imag**2, dtype=np.float64)


def filtered_images(heights: Floats) -> list[FilteredImage]:
    """Filter an image in each of the ways in which its lattice is searched.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns); NaN where a pixel is missing.

    Returns
    -------
    list
        The levelled heights, then their slopes along the rows.
    """
    valid = valid_pixels(heights)
    rows = np.where(valid, heights, 0.0)
    level = _terraces_levelled(_rows_levelled(rows, valid), valid)
    images = [_windowed("heights", _clipped(level, valid), valid)]
    slopes, inside = _slopes(level, valid)
    images.append(_windowed("slopes", slopes, inside))
    return images


def complete_region(heights: Floats) -> tuple[slice, slice]:
    """Return the rows and columns of the largest part of an image without gaps of more than a few rows.

    The edges of missing rows would make spots beside those of the lattice.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns); NaN where a pixel is missing.
    """
    valid = valid_pixels(heights)
    there = valid[:, valid.any(axis=0)]
    complete = np.mean(there, axis=1) >= COMPLETE if there.size else np.zeros(len(valid), dtype=np.bool_)
    rows = longest_run(complete, int(_FILLED_GAP * len(valid)))
    if _regular(~complete[rows]) > _MOST_REGULAR:
        rows = longest_run(complete)
    part = valid[rows][complete[rows]]
    columns = longest_run(np.mean(part, axis=0) >= COMPLETE) if part.size else slice(0, 0)
    return rows, columns


def _regular(gaps: Bools) -> float:
    """Return the largest amplitude of a wave in which rows are missing: their share, if they are at equal distances."""
    return float(np.max(np.abs(np.fft.rfft(gaps)[1:]), initial=0.0)) / max(len(gaps), 1)


def terrace_edges(heights: Floats) -> tuple[Floats, Ints, Ints, Floats]:
    """Find the edges of terraces along the rows of an image.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns); NaN where a pixel is missing.

    Returns
    -------
    tuple
        Levelled heights, shape (rows, columns); then of each edge its row, the first column after it, and the step
        there, shape (edges,) each.
    """
    valid = valid_pixels(heights)
    level = _rows_levelled(np.where(valid, heights, 0.0), valid)
    edges = [(row, end, step) for row, ends in _parts(level, valid) for end, step in ends]
    rows, columns, steps = zip(*edges, strict=True) if edges else ((), (), ())
    return level, np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64), np.array(steps, dtype=np.float64)


def _rows_levelled(heights: Floats, valid: Bools) -> Floats:
    """Subtract each row's median, and the bow that all rows share."""
    level = np.where(valid, heights - _medians(heights, valid)[:, None], 0.0)
    place = np.linspace(-1.0, 1.0, heights.shape[1])
    usual = _medians(level.T, valid.T)
    bow = np.polynomial.Polynomial.fit(place, usual, _BOW_DEGREE, domain=(-1.0, 1.0))(place)
    return np.where(valid, level - bow, 0.0)


def _medians(heights: Floats, valid: Bools) -> Floats:
    """Return the median of the valid pixels of each row, 0 where there are none."""
    if valid.all():
        return np.asarray(np.median(np.ascontiguousarray(heights), axis=1))
    return np.array([np.median(row[use]) if use.any() else 0.0 for row, use in zip(heights, valid, strict=True)])


def _terraces_levelled(level: Floats, valid: Bools) -> Floats:
    """Subtract the median of each part of a row between the edges of terraces."""
    result = level.copy()
    for row, edges in _parts(level, valid):
        ends = [0, *(end for end, _ in edges), level.shape[1]]
        for first, stop in pairwise(ends):
            there = valid[row, first:stop]
            if there.any():
                part = level[row, first:stop]
                result[row, first:stop] = np.where(there, part - np.median(part[there]), 0.0)
    return result


def _parts(level: Floats, valid: Bools) -> Iterator[tuple[int, list[tuple[int, float]]]]:
    """Yield each row with edges of terraces: the first pixel after each edge, and the step there."""
    steps, inside = _steps(level, valid)
    edges = inside & (np.abs(steps) > _EDGE * slope_limit(steps, inside))
    for row in np.flatnonzero(edges.any(axis=1)).tolist():
        ends: list[tuple[int, float]] = []
        for end in (np.flatnonzero(edges[row]) + 1).tolist():
            before, after = level[row, max(end - _BESIDE, 0) : end], level[row, end : end + _BESIDE]
            step = float(np.median(after) - np.median(before))
            last = ends[-1][0] if ends else 0
            if abs(step) > _STEP_SHARE * abs(steps[row, end - 1]) and end - last >= _LEAST_TERRACE:
                ends.append((end, step))
        if ends:
            yield row, ends


def _steps(level: Floats, valid: Bools) -> tuple[Floats, Bools]:
    """Return the differences to the next pixel of each row, and where both are valid."""
    steps = np.diff(level, axis=1, append=level[:, -1:])
    inside = valid & np.roll(valid, -1, axis=1)
    inside[:, -1] = False
    return steps, inside


def slope_limit(steps: Floats, inside: Bools) -> float:
    """Return the largest slope of a lattice: the edge of a terrace has more.

    Parameters
    ----------
    steps
        Differences to the next pixel of each row, shape (rows, columns).
    inside
        True where both pixels are valid, of the same shape.
    """
    usual = 1.4826 * float(np.median(np.abs(steps[inside])))
    return _SLOPE_LIMIT * (usual or float(np.std(steps[inside])))


def _clipped(values: Floats, valid: Bools) -> Floats:
    low, high = np.percentile(values[valid], (_CLIPPED, 100.0 - _CLIPPED))
    return np.where(valid, np.clip(values, low, high), 0.0)


def _slopes(level: Floats, valid: Bools) -> tuple[Floats, Bools]:
    """Return clipped slopes along the rows, smoothed by a Gaussian, and where all pixels that they need are valid."""
    steps, inside = _steps(level, valid)
    limit = slope_limit(steps, inside)
    use = inside & (np.abs(steps) <= _EDGE * limit)
    steps = np.where(use, np.clip(steps, -limit, limit), 0.0)
    return np.where(inside, _smoothed(steps, _WIDTH), 0.0), inside


def _smoothed(values: Floats, width: float) -> Floats:
    """Convolve with a Gaussian of this standard deviation in pixels, in both directions."""
    reach = int(np.ceil(3.0 * width))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    kernel /= kernel.sum()
    for axis in (0, 1):
        edge = [(0, 0), (0, 0)]
        edge[axis] = (reach, reach)
        padded = np.pad(values, edge, mode="reflect")
        count = values.shape[axis]
        line = np.moveaxis(padded, axis, 0)
        parts = (share * line[at : at + count] for at, share in enumerate(kernel.tolist()))
        values = np.moveaxis(sum(parts, start=np.zeros(line[:count].shape)), 0, axis)
    return values


def _windowed(name: str, values: Floats, valid: Bools) -> FilteredImage:
    rows, columns = values.shape
    weight = np.hanning(rows + 2)[1:-1, None] * np.hanning(columns + 2)[1:-1] * valid
    values = values - np.sum(values * weight) / np.sum(weight)
    return FilteredImage(name, np.where(valid, values, 0.0), weight)
