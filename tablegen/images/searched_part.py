"""The part of an image that is searched for a lattice, so that time and memory do not grow with the pixels.

Images of more than 2^20 pixels are searched in blocks, or in their centre where waves are too fine for blocks.
"""

from dataclasses import dataclass
from math import isqrt

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.images.image_views import together, view_spots
from tablegen.images.lattice_filters import complete_region, filtered_images
from tablegen.images.missing import rows_with_data, without_holes
from tablegen.images.pair_checks import MIN_PIXELS
from tablegen.numerics.arrays import Bools, Complexes, Floats

_MOST_PIXELS = 1 << 20  # that are searched
_LEAST_COMPARED = 0.5  # share of the rows that the other direction has
_FINEST = 0.33  # periods per block: with the slowest wave this fast, a side has the least length of a candidate, 3
_ALIAS = 0.25  # periods over blocks: an alias is off by a whole number


@dataclass(frozen=True)
class SearchedPart:
    """Rows and columns of an image that are searched, in means over blocks of ``block`` x ``block`` pixels.

    ``shape`` is that of the whole image; ``cropped`` tells that the centre alone is searched.
    """

    shape: tuple[int, int]
    rows: tuple[int, int]
    columns: tuple[int, int]
    block: int = 1
    cropped: bool = False

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns in pixels."""
        return self.rows[1] - self.rows[0], self.columns[1] - self.columns[0]

    @property
    def pixels(self) -> int:
        """Pixels of the part, not blocks."""
        return self.size[0] * self.size[1]

    @property
    def large(self) -> bool:
        """True if these are more pixels than are searched."""
        return self.pixels > _MOST_PIXELS

    @property
    def whole(self) -> bool:
        """True if all pixels are searched, each by itself."""
        return self.block == 1 and self.size == self.shape

    def of(self, heights: Floats) -> Floats:
        """Return the part of an image, without holes.

        Parameters
        ----------
        heights
            Heights in any unit, shape ``shape``; NaN where a pixel is missing.
        """
        if self.whole and np.all(np.isfinite(heights)):
            return heights
        part = heights[slice(*self.rows), slice(*self.columns)]
        return without_holes(part if self.block == 1 else _block_means(part, self.block))

    def of_other_direction(self, heights: Floats) -> Floats | None:
        """Return the part of the image of the other direction; None if half of its rows are missing, or more."""
        there = rows_with_data(heights[slice(*self.rows), slice(*self.columns)])
        return self.of(heights) if float(np.mean(there)) > _LEAST_COMPARED else None

    def moved(self, right: int, down: int) -> "SearchedPart":
        """Return the part that many pixels further."""
        (top, bottom), (left, end) = self.rows, self.columns
        return SearchedPart(self.shape, (top + down, bottom + down), (left + right, end + right), self.block)

    def __str__(self) -> str:
        """Return the part in words."""
        blocks = f", blocks of {self.block} x {self.block} pixels" if self.block > 1 else ""
        return f"rows {self.rows[0] + 1} to {self.rows[1]}, columns {self.columns[0] + 1} to {self.columns[1]}{blocks}"


def complete_part(heights: Floats) -> SearchedPart:
    """Return the largest part of an image without missing rows or columns.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns); NaN where a pixel is missing.

    Raises
    ------
    Unphysical
        If it has too few rows or columns.
    """
    rows, columns = complete_region(heights)
    part = SearchedPart((heights.shape[0], heights.shape[1]), (rows.start, rows.stop), (columns.start, columns.stop))
    if min(part.size) < MIN_PIXELS:
        size = " x ".join(map(str, part.size))
        raise Unphysical(
            f"without missing rows and columns the image has {size} pixels; rows and columns that are constant, or "
            f"repeat the one before, are missing: give the image as it was scanned, or crop it to a region without "
            f"missing rows"
        )
    return part


def central_part(part: SearchedPart, block: int) -> SearchedPart:
    """Return the centre of a part, or all of it if it has no more than 2^20 blocks.

    It has room to move by a pixel, if blocks are larger.

    Parameters
    ----------
    block
        Pixels to the side of a block.
    """
    rows, columns = (count if block == 1 else (count - 1) // block for count in part.size)
    if rows * columns > _MOST_PIXELS:
        columns = min(columns, _MOST_PIXELS // min(rows, isqrt(_MOST_PIXELS)))
        rows = min(rows, _MOST_PIXELS // columns)
    top, left = (
        first + (count - block * blocks) // 2
        for first, count, blocks in ((part.rows[0], part.size[0], rows), (part.columns[0], part.size[1], columns))
    )
    cropped = part.size[0] - block * rows > block or part.size[1] - block * columns > block
    return SearchedPart(part.shape, (top, top + block * rows), (left, left + block * columns), block, cropped)


def blocks_of_whole(part: SearchedPart) -> SearchedPart:
    """Return all of a part, in the smallest blocks of which there are no more than 2^20."""
    return central_part(part, _most_block(part))


def _most_block(part: SearchedPart) -> int:
    most = int(np.ceil(np.sqrt(part.pixels / _MOST_PIXELS)))
    return max(1, min(most, min(part.size) // (2 * MIN_PIXELS)))


def largest_block(heights: Floats, part: SearchedPart) -> int:
    """Return the side of the largest blocks that show all significant waves of the centre, in pixels.

    Larger ones than it takes to search all of the part are of no use.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns); NaN where a pixel is missing.
    """
    centre = central_part(part, 1).of(heights)
    views = [view_spots(image) for image in filtered_images(centre)]
    finest = float(np.max(np.hypot(*together(views, 1.0).waves.T), initial=0.0))
    return max(1, min(_most_block(part), int(_FINEST / max(finest, 1e-9))))


def aliased(heights: Floats, part: SearchedPart, waves: list[Floats]) -> Bools:
    """Return True for waves that are faster than they look in blocks; blocks of one pixel show none.

    Blocks that begin a pixel further to the right show a wave of u periods per pixel 2 pi u later, whichever wave it
    looks like.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns); NaN where a pixel is missing.
    part
        The part in blocks.
    waves
        Significant spots of each view of the blocks, in periods per block, shape (n, 2) each.

    Returns
    -------
    Bools
        Shape (sum of n,).
    """
    together = np.concatenate(waves)
    faster = np.zeros(len(together), dtype=np.bool_)
    if part.block == 1 or not len(together):
        return faster
    first, *others = (_coefficients(part.moved(*step).of(heights), waves) for step in ((0, 0), (1, 0), (0, 1)))
    for axis, moved in enumerate(others):
        turned = np.angle(moved * np.conj(first)) / (2.0 * np.pi) - together[:, axis] / part.block
        faster |= np.abs(turned - np.round(turned)) > _ALIAS / part.block
    return faster


def _coefficients(heights: Floats, waves: list[Floats]) -> Complexes:
    """Return the Fourier coefficients of the views of an image at their waves."""
    rows, columns = (np.arange(count) for count in heights.shape)
    parts = []
    for image, spots in zip(filtered_images(heights), waves, strict=True):
        across, along = (
            np.exp(-2j * np.pi * spots[:, axis, None] * place) for axis, place in ((1, rows), (0, columns))
        )
        values = image.values * image.weight
        lines = across.real @ values + 1j * (across.imag @ values)  # complex factors would make the image complex
        parts.append(np.sum(lines * along, axis=1))
    return np.concatenate(parts)


def _block_means(heights: Floats, block: int) -> Floats:
    """Return the mean of each block; NaN where all its pixels are missing."""
    rows, columns = (count // block for count in heights.shape)
    means = np.empty((rows, columns))
    for row in range(rows):
        lines = heights[row * block : (row + 1) * block, : columns * block]
        total = np.sum(lines, axis=0)
        if np.all(np.isfinite(total)):
            means[row] = total.reshape(columns, block).sum(axis=1) / block**2
            continue
        valid = np.isfinite(lines)
        count = valid.sum(axis=0).reshape(columns, block).sum(axis=1)
        total = np.where(valid, lines, 0.0).sum(axis=0).reshape(columns, block).sum(axis=1)
        means[row] = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return means
