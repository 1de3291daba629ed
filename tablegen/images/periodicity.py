"""Whether an image shows anything periodic: the first question when a fit to a periodic sample fails."""

from tablegen.base.input_errors import Unphysical
from tablegen.images.cell_choice import NO_LATTICE
from tablegen.images.image_grating import NO_GRATING, find_grating
from tablegen.images.indexer import find_cell
from tablegen.numerics.arrays import Floats

NOTHING_PERIODIC = (
    "no period stands out of the image: a lattice or a grating is needed; image more periods with less noise, choose "
    "another --channel, or correct with --scanner"
)


def shows_nothing_periodic(heights: Floats) -> bool:
    """Return True if neither a lattice nor a grating stands out of the noise.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns); NaN where a pixel is missing.
    """
    try:
        find_cell(heights)
    except Unphysical as reason:
        if str(reason) != NO_LATTICE:
            return False
    else:
        return False
    try:
        find_grating(heights)
    except Unphysical as reason:
        return str(reason) == NO_GRATING
    return False
