"""Name the cells that explain an image, each with its likelihood, where they are several."""

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.images.autocorrelation import Spots
from tablegen.images.cell_spots import SAME_CELL
from tablegen.images.cell_vectors import area, reduced, sides_and_angle
from tablegen.images.image_views import STRAIN
from tablegen.numerics.arrays import Floats

_SPOT_WIDTH, _STRAY = 0.4, 0.02  # periods in the image; chance that a spot belongs to no lattice


class AmbiguousCell(Unphysical):
    """Several cells explain an image.

    Parameters
    ----------
    cells
        Cells in pixels, shape (2, 2) each.
    spots
        The significant spots, by which the cells have their likelihoods.
    extent
        Columns and rows of the image.
    reason
        Why they are possible.
    """

    def __init__(self, cells: list[Floats], spots: Spots, extent: Floats, reason: str) -> None:
        """Name the cells, each with its likelihood."""
        super().__init__(ambiguous(cells, likelihoods(cells, spots, extent), reason))
        self.cells, self.spots, self._context = cells, spots, (extent, reason)

    def in_pixels(self, block: int) -> "AmbiguousCell":
        """Return the same reason in pixels, where cells and spots are in blocks."""
        extent, reason = self._context
        spots = Spots(self.spots.waves / block, self.spots.contrast, self.spots.power)
        return AmbiguousCell([block * cell for cell in self.cells], spots, block * extent, reason)

    def common_cell(self) -> Floats | None:
        """Return the cell that has the waves of all the others; None if there is none."""
        largest = max(self.cells, key=area)
        for cell in self.cells:
            change = largest @ np.linalg.inv(cell)
            if np.max(np.abs(change - np.round(change))) > SAME_CELL:
                return None
        return largest


def ambiguous(cells: list[Floats], shares: Floats, reason: str) -> str:
    """Return the text that refuses several cells.

    Parameters
    ----------
    cells
        Cells in pixels, shape (2, 2) each.
    shares
        The likelihood of each.
    reason
        Why they are possible.
    """
    order = np.argsort(-shares, kind="stable")
    names = []
    for number in order.tolist():
        one, other, angle = sides_and_angle(reduced(cells[number]))
        share = _percent(float(shares[number]))
        names.append(f"{one:.4g} x {other:.4g} pixels at {angle:.3g} degrees ({share})")
    sizes = " or ".join(names)
    return (
        f"the lattice is ambiguous: the cell may be {sizes}, as {reason}; give the sample's --lattice-nm, or image "
        f"more periods with less noise"
    )


def _percent(share: float) -> str:
    return "below 1 %" if share < 0.01 else "above 99 %" if share > 0.99 else f"{100.0 * share:.0f} %"


def likelihoods(cells: list[Floats], spots: Spots, extent: Floats) -> Floats:
    """Return the likelihood of each cell by the places of the spots; they add to 1.

    A spot is with a chance of ``_STRAY`` anywhere, else near one of the waves of the cell. A large cell has many waves,
    so that each is less likely to be the place of a spot by itself.

    Parameters
    ----------
    cells
        Cells in pixels, shape (2, 2) each.
    spots
        Spots of both views: each counts half.
    extent
        Columns and rows of the image.
    """
    pixels = float(np.prod(extent))
    logarithms = []
    for cell in cells:
        index = spots.waves @ cell.T
        distance = np.hypot(*(((index - np.round(index)) @ np.linalg.inv(cell).T) * extent).T)
        width = _SPOT_WIDTH + 0.5 * STRAIN * np.hypot(*(spots.waves * extent).T)
        near = np.exp(-0.5 * (distance / width) ** 2) / (2.0 * np.pi * width**2) / max(area(cell), 1.0)
        logarithms.append(0.5 * float(np.sum(np.log((1.0 - _STRAY) * near + _STRAY / pixels))))
    shares = np.exp(np.array(logarithms) - max(logarithms))
    return np.asarray(shares / np.sum(shares))
