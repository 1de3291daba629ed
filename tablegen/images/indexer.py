"""Find the lattice of an image: the smallest cell that explains all significant spots of its spectrum.

Candidates come from the autocorrelation, whose maxima do not depend on which spots are strong; the spectrum decides
between them. What remains ambiguous is refused.
"""

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.images.image_cell import ImageCell, cell_of_part
from tablegen.images.image_views import image_views
from tablegen.images.large_image_cell import cell_of_many_pixels
from tablegen.images.missing import valid_pixels
from tablegen.images.pair_checks import MIN_PIXELS
from tablegen.images.searched_part import complete_part
from tablegen.numerics.arrays import Floats

_LEAST_VALID = 0.25  # share of the pixels


def find_cell(heights: Floats, other: Floats | None = None, expected_area: float | None = None) -> ImageCell:
    """Find the cell of a two-dimensional lattice.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns); NaN where a pixel is missing.
    other
        The image of the other direction, with its left end on the left: it tells hum from the sample.
    expected_area
        Area of the sample's cell in square pixels by the size in the file: it decides between cells of which one is a
        multiple of the other.

    Returns
    -------
    ImageCell
        The reduced cell with its errors. More than 2^20 pixels are searched in blocks, or in their centre.

    Raises
    ------
    Unphysical
        If the image has no significant lattice, one direction only, too few periods, spots that no cell explains, or
        several cells that explain them as well.
    """
    _check(heights)
    part = complete_part(heights)
    if part.large:
        return cell_of_many_pixels(heights, part, other, expected_area)
    return cell_of_part(heights, part, image_views(part.of(heights)), other, expected_area)


def _size(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))


def _check(heights: Floats) -> None:
    if heights.ndim != 2 or min(heights.shape) < MIN_PIXELS:
        size = _size(heights.shape)
        raise Unphysical(f"{size} pixels are too few for a lattice; {MIN_PIXELS} rows and columns do")
    share = float(np.mean(valid_pixels(heights)))
    if share < _LEAST_VALID:
        raise Unphysical(f"{100.0 * share:.2g} % of the pixels have heights; crop the image to what was scanned")
