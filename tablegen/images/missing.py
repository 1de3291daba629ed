"""Rows and pixels of images without data: which they are, and images without gaps for fits and spectra.

A pixel is missing where it is NaN. A row is missing where a fifth of it is, where it is constant, as what a stopped
scan leaves, or where a fifth of it is at the end of the range, as of a clipped row. A column is missing where it is
constant; so are rows and columns that repeat the one before, as in an image that was enlarged. Gaps are filled by
interpolation; a missing row has no weight in a fit. An image without gaps is returned as it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from tablegen.base.input_errors import Unphysical
from tablegen.numerics.arrays import Bools, Floats, Ints

Number = TypeVar("Number", bound=np.inexact)  # real or complex

COMPLETE = 0.8  # share of valid pixels: a row or column with fewer is missing
_LEAST_ROWS = 32
_LEAST_SHARE = 0.7  # of the rows from the first with data to the last: gaps beyond that make spots of their own
_MOST_CLIPPED = 0.3  # share of the rows: where more are clipped, the image is saturated, or has a few levels
_REPEATED = 0.05, 0.9  # share of the rows or columns that repeat: beyond, the image is without noise, and symmetric
_PROBES = 8  # pixels of a row or column that are compared first
_PADDED = 3  # pixels with the value of the rows that were never scanned: a row with as many ends there


@dataclass(frozen=True)
class MissingCount:
    """Rows without data, and missing pixels of the other rows."""

    rows: int
    pixels: int

    def __bool__(self) -> bool:
        return bool(self.rows or self.pixels)

    def __str__(self) -> str:
        parts = [(self.rows, "row"), (self.pixels, "pixel")]
        return " and ".join(f"{count} {one}{'s' * (count != 1)}" for count, one in parts if count)

    @property
    def record(self) -> dict[str, int]:
        """Both numbers as plain data."""
        return {"rows": self.rows, "pixels": self.pixels}


@dataclass(frozen=True, eq=False)
class CompleteImages:
    """Images without gaps of the ``rows`` from the first with data to the last one.

    ``weight`` has 1 for a row with data and 0 for a missing one, shape (rows,); None if none is missing. ``gaps`` are
    True for missing pixels of each image.
    """

    heights: list[Floats]
    rows: slice
    weight: Floats | None
    gaps: list[Bools]

    @property
    def has_gaps(self) -> bool:
        """True if a pixel is missing."""
        return any(bool(gaps.any()) for gaps in self.gaps)

    def with_model(self, parts: Sequence[Floats]) -> list[Floats]:
        """Return the images with a model's values in their gaps, on the interpolated rest of the images.

        The rest of a missing row is a parabola: the noise of its neighbours would repeat itself over several rows.

        Parameters
        ----------
        parts
            The periodic part of each image, in its unit, shape (rows, columns).
        """
        images = []
        parabola = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, parts[0].shape[1]), 3))[0]
        for heights, gaps, part in zip(self.heights, self.gaps, parts, strict=True):
            rest = interpolated(heights - part, ~gaps)
            if self.weight is not None:
                smooth = (rest @ parabola) @ parabola.T
                rest = np.where(self.weight[:, None] > 0.0, rest, smooth)
            images.append(np.where(gaps, part + rest, heights))
        return images


def valid_pixels(heights: Floats) -> Bools:
    """Return True for pixels with data.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns); NaN where a pixel is missing.
    """
    valid = np.isfinite(heights)
    whole = bool(valid.all())
    low = np.min(heights if whole else np.where(valid, heights, np.inf), axis=1)
    high = np.max(heights if whole else np.where(valid, heights, -np.inf), axis=1)
    flat = ~(high > low)
    constants = np.unique(low[flat & np.isfinite(low)])
    cut = np.zeros(len(heights), dtype=np.bool_)
    if len(constants) == 1:  # the row in which the scan was stopped
        cut = np.sum(heights == constants[0], axis=1) >= _PADDED
    there = ~(flat | cut)
    valid &= there[:, None]
    if there.any():
        limits = float(np.min(low[there])), float(np.max(high[there]))
        counts = np.max([np.count_nonzero(heights == limit, axis=1) for limit in limits], axis=0)
        clipped = counts / heights.shape[1] > 1.0 - COMPLETE
        if np.mean(clipped) <= _MOST_CLIPPED:
            valid &= ~clipped[:, None]
    valid[:, _empty_columns(heights, valid)] = False
    valid[_empty_columns(heights.T, valid.T)] = False
    return np.asarray(valid, dtype=np.bool_)


def _empty_columns(heights: Floats, valid: Bools) -> Bools:
    """Return True for columns that are constant, or repeat the one before, shape (columns,).

    Where nearly all are, the sample does not change along one axis: then none is.
    """
    known = np.flatnonzero(valid.any(axis=1))
    probe = heights[known[:: max(1, len(known) // _PROBES)]]
    constant, repeated = (_equal(probe, one) for one in (probe[:1], np.roll(probe, 1, axis=1)))
    repeated[0] = False
    for column in np.flatnonzero(constant | repeated).tolist():
        own, use = heights[known, column], valid[known, column]
        constant[column] &= bool(np.all(own[use] == own[use][:1]))
        repeated[column] &= bool(np.all(own[use] == heights[known, column - 1][use]))
    if np.mean(constant) > _REPEATED[1]:
        constant[:] = False
    if not _REPEATED[0] < np.mean(repeated & ~constant) <= _REPEATED[1]:
        repeated[:] = False
    return constant | repeated


def _equal(probe: Floats, other: Floats) -> Bools:
    """Return True for columns that are equal but for missing pixels."""
    return np.asarray(np.all((probe == other) | np.isnan(probe) | np.isnan(other), axis=0), dtype=np.bool_)


def rows_with_data(heights: Floats) -> Bools:
    """Return True for rows of which four fifths have data, shape (rows,).

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns); NaN where a pixel is missing.
    """
    return np.asarray(np.mean(valid_pixels(heights), axis=1) >= COMPLETE, dtype=np.bool_)


def count_missing(heights: Floats) -> MissingCount:
    """Count the missing rows, and the missing pixels of the others.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns); NaN where a pixel is missing.
    """
    valid = valid_pixels(heights)
    rows = np.mean(valid, axis=1) >= COMPLETE
    return MissingCount(int(np.sum(~rows)), int(np.sum(~valid[rows])))


def missing_text(images: Sequence[Floats]) -> str:
    """Return what a trace, and a retrace, lack, in words; empty if nothing is missing.

    Parameters
    ----------
    images
        Heights in any unit, shape (rows, columns) each; NaN where a pixel is missing.
    """
    counts = zip(("trace", "retrace"), map(count_missing, images), strict=False)
    parts = [f"{count} of the {side}" for side, count in counts if count]
    return f"{', '.join(parts)} have no data; they have no weight" if parts else ""


def imaged_rows(images: Sequence[Floats]) -> slice:
    """Return the rows from the first that has data in all images of a scan to the last one.

    Parameters
    ----------
    images
        Heights in any unit, shape (rows, columns) each; NaN where a pixel is missing.

    Raises
    ------
    Unphysical
        If they are too few, or too many between them are missing.
    """
    return _imaged(_common_rows(images))


def completed(images: Sequence[Floats]) -> CompleteImages:
    """Leave out missing rows at either end of a frame, and fill the gaps between.

    Parameters
    ----------
    images
        Trace and retrace, or one of them: heights in any unit, shape (rows, columns) each; NaN where a pixel is
        missing. A row that one of them lacks is missing in both.

    Raises
    ------
    Unphysical
        If the images have too little data.
    """
    there = _common_rows(images)
    rows = _imaged(there)
    weight = None if np.all(there[rows]) else there[rows].astype(np.float64)
    gaps = [~valid_pixels(image)[rows] | ~there[rows, None] for image in images]
    return CompleteImages([without_holes(image)[rows] for image in images], rows, weight, gaps)


def without_holes(heights: Floats) -> Floats:
    """Interpolate missing pixels along the rows, and missing rows between their neighbours.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns), some of them NaN.

    Returns
    -------
    Floats
        Heights without gaps, of the same shape and unit; the same array if it has none.
    """
    valid = valid_pixels(heights)
    return interpolated(heights, valid) if np.any(np.mean(valid, axis=1) >= COMPLETE) else heights


def interpolated(heights: Floats, valid: Bools) -> Floats:
    """Interpolate along the rows, and rows with too little data between their neighbours.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns).
    valid
        True for pixels with data, of the same shape; one row or more has enough.
    """
    there = np.mean(valid, axis=1) >= COMPLETE
    if valid.all():
        return heights
    whole = heights.copy()
    for row in np.flatnonzero(there & ~valid.all(axis=1)):
        own = valid[row]
        whole[row, ~own] = np.interp(np.flatnonzero(~own), np.flatnonzero(own), heights[row, own])
    return interpolated_rows(whole, there)


def interpolated_rows(values: npt.NDArray[Number], there: Bools) -> npt.NDArray[Number]:
    """Interpolate rows between their neighbours that are there.

    Parameters
    ----------
    values
        Real or complex values, shape (rows, columns).
    there
        True for rows that have values, shape (rows,).
    """
    known, gaps = np.flatnonzero(there), np.flatnonzero(~there)
    if not len(gaps):
        return values
    after = np.clip(np.searchsorted(known, gaps), 0, len(known) - 1)
    before = np.maximum(after - (known[after] > gaps), 0)
    distance = np.maximum(known[after] - known[before], 1)
    share = np.clip((gaps - known[before]) / distance, 0.0, 1.0)[:, None]
    whole = values.copy()
    whole[gaps] = values[known[before]] * (1.0 - share) + values[known[after]] * share
    return whole


def longest_run(there: Bools, most_gap: int = 0) -> slice:
    """Return the longest run of True, over gaps of at most ``most_gap``.

    Parameters
    ----------
    there
        Shape (n,).
    """
    closed = there.copy()
    for first, stop in _runs(~there):
        if first > 0 and stop < len(there) and stop - first <= most_gap:
            closed[first:stop] = True
    runs = _runs(closed)
    if not len(runs):
        return slice(0, 0)
    first, stop = runs[int(np.argmax(runs[:, 1] - runs[:, 0]))].tolist()
    return slice(first, stop)


def _runs(there: Bools) -> Ints:
    """Return the first index of each run of True and the one after its last, shape (runs, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(np.int8)))
    return np.stack([edges[::2], edges[1::2]], axis=1)


def _common_rows(images: Sequence[Floats]) -> Bools:
    return np.asarray(np.all([rows_with_data(image) for image in images], axis=0), dtype=np.bool_)


def _imaged(there: Bools) -> slice:
    numbers = np.flatnonzero(there)
    count = len(numbers)
    span = int(numbers[-1] - numbers[0] + 1) if count else 0
    if count < _LEAST_ROWS or count < _LEAST_SHARE * span:
        among = "" if count < _LEAST_ROWS else f" among rows {numbers[0] + 1} to {numbers[-1] + 1}"
        raise Unphysical(
            f"{count} of {len(there)} rows have data{among}, in {100.0 * COMPLETE:.0f} % of their columns or more; "
            f"{_LEAST_ROWS} such rows, with few gaps between, are needed: scan again, or crop the image to what was "
            f"scanned"
        )
    return slice(int(numbers[0]), int(numbers[-1]) + 1)
