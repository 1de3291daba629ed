"""The cell of a part of an image: chosen by the spots of its views, and fitted to the maxima of one."""

from dataclasses import dataclass

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.images.ambiguous_cell import AmbiguousCell
from tablegen.images.autocorrelation import WEAKEST, Spots, significant_spots
from tablegen.images.cell_choice import NO_LATTICE, chosen_cell
from tablegen.images.cell_errors import CellFit, fit_cell
from tablegen.images.cell_spots import explained_spots, same_lattice
from tablegen.images.cell_vectors import area, sides_and_angle
from tablegen.images.hum import hum_waves
from tablegen.images.image_views import FAINT, FAINTEST, View, least_contrast, together
from tablegen.images.lattice_filters import filtered_images
from tablegen.images.searched_part import SearchedPart
from tablegen.numerics.arrays import Bools, Floats

_CLEAR = 1.3  # times that of a significant spot: the strongest one has to have it
_LEAST_CELLS = 4.0  # in the image
_LEAST_PERIODS = 2.2  # of each side's rows in the image
_LEAST_PERIODS_OF_CENTRE = 8.0  # in the centre of an image, which is searched alone because of its fine waves
_MOST_ERROR = 0.05  # of a side
_FAST = 0.38  # periods a pixel along x or y: waves beyond half a period look like slower ones
_FAST_POWER = 0.06  # of the strongest spot: a quarter of its amplitude
_MOST_FAST = 2  # spots of this power, and not of the lowest order: hum may have some
_LEAST_LEVEL = 0.04  # of the variance, at the lattice points
TOO_LARGE = "crop the image to a quarter, or save it with fewer pixels"


@dataclass(frozen=True, eq=False)
class ImageCell:
    """The cell of an image in pixels.

    ``vectors`` are its reduced sides, shape (2, 2), x and y; ``covariance`` that of a_x, a_y, b_x, b_y, and
    ``block_covariance`` without what levelling makes of them; ``spots`` the significant ones of the spectrum,
    ``explained`` those that the cell explains; ``filter_name`` how it was found, ``part`` where.
    """

    vectors: Floats
    covariance: Floats
    block_covariance: Floats
    spots: Spots
    explained: Bools
    level: float
    part: SearchedPart
    filter_name: str

    @property
    def cells(self) -> float:
        """Cells in the part of the image that was searched."""
        return self.part.pixels / area(self.vectors)


_ViewCell = tuple[CellFit, Floats, Spots, Bools, str]  # with the scatter of the views, and the name of the filter


def cell_of_part(
    heights: Floats, part: SearchedPart, views: list[View], other: Floats | None, expected_area: float | None
) -> ImageCell:
    """Return the cell of the views of a part, in pixels of the image."""
    block = part.block
    expected = None if expected_area is None else expected_area / block**2
    try:
        cell = _cell_of_views(views, None if other is None else part.of_other_direction(other), expected)
        if part.cropped:
            _check_periods(cell[0].vectors, views[0].extent, _LEAST_PERIODS_OF_CENTRE, TOO_LARGE)
    except AmbiguousCell as reason:
        raise reason.in_pixels(block) from None
    except Unphysical as reason:
        if not part.cropped:
            raise
        raise Unphysical(f"{reason}; so large an image is searched in its centre, {part}") from None
    fit, scatter, spots, explained, name = cell
    spots = Spots(spots.waves / block, spots.contrast, spots.power)
    blocks = block**2 * fit.covariance
    return ImageCell(block * fit.vectors, blocks + block**2 * scatter, blocks, spots, explained, fit.level, part, name)


def _cell_of_views(views: list[View], other: Floats | None, expected_area: float | None) -> _ViewCell:
    """Return the cell of the views of an image. Raise ``Unphysical`` if there is none, or more than one."""
    shape = views[0].image.values.shape
    hum = np.zeros((0, 2))
    if other is not None:
        beside = np.concatenate(
            [
                significant_spots(image, FAINT * least_contrast(float(image.values.size)), FAINTEST * WEAKEST).waves
                for image in filtered_images(other)
            ]
        )
        hum = hum_waves(together(views, 1.0).waves, beside, (shape[0], shape[1]))
    if not any(len(view.spots.contrast) and view.spots.contrast[0] >= _CLEAR * view.least for view in views):
        raise Unphysical(NO_LATTICE)
    vectors = chosen_cell(views, hum, expected_area)
    _check_periods(vectors, np.array([shape[1], shape[0]]), _LEAST_PERIODS, "scan more of them")
    _check_sampling(vectors, views[0].spots)
    reasons: list[Unphysical] = []
    # A view whose own maxima gave the cell comes first.
    for view in sorted(views, key=lambda view: not any(same_lattice(cell.vectors, vectors) for cell in view.cells)):
        try:
            return _fitted(view, vectors, [one for one in views if one is not view])
        except Unphysical as reason:
            reasons.append(reason)
    raise reasons[-1]


def _scatter(views: list[View], vectors: Floats) -> Floats:
    """Return the covariance that other views add to that of the blocks, shape (4, 4).

    Levelling, and the edges of terraces, move the maxima of the autocorrelation of heights and of slopes differently,
    and those of all blocks of a view alike.
    """
    fits = [fit_cell(view.image, vectors) for view in views]
    off = [(fit.vectors - vectors).ravel() for fit in fits if fit is not None and same_lattice(fit.vectors, vectors)]
    return np.diag(np.sum(np.square(off), axis=0)) if off else np.zeros((4, 4))


def _fitted(view: View, vectors: Floats, others: list[View]) -> _ViewCell:
    """Fit a cell to the maxima of a view's autocorrelation. Raise ``Unphysical`` if it is none of them."""
    spots = view.spots
    fit = fit_cell(view.image, vectors)
    if fit is None or fit.level < _LEAST_LEVEL or not same_lattice(fit.vectors, vectors):
        raise Unphysical(
            "the maxima of the autocorrelation are no lattice; is the sample one lattice? Crop to a region with "
            "one, or choose another --channel"
        )
    errors = np.sqrt(np.array([np.trace(fit.covariance[:2, :2]), np.trace(fit.covariance[2:, 2:])]))
    share = float(np.max(errors / np.array(sides_and_angle(vectors)[:2])))
    if not share <= _MOST_ERROR:
        raise Unphysical(
            f"the cell differs between parts of the image by {100.0 * share:.2g} % of a side; is the sample one "
            f"lattice? Crop to a region with one, or scan with less drift"
        )
    explained = explained_spots(fit.vectors, spots)[0]
    return fit, _scatter(others, fit.vectors), spots, explained, view.image.name


def _check_sampling(vectors: Floats, spots: Spots) -> None:
    """Check that the waves of a lattice end before half a period a pixel: faster ones would look like other waves."""
    fast = np.max(np.abs(spots.waves), axis=1, initial=0.0) > _FAST
    fast &= spots.power > _FAST_POWER * np.max(spots.power, initial=0.0)
    fast &= np.max(np.abs(np.round(spots.waves @ vectors.T)), axis=1, initial=0.0) > 1.0
    if np.sum(fast) > _MOST_FAST:
        raise Unphysical(
            "the lattice has strong waves as fast as the pixels show, as of sites narrower than a pixel: still faster "
            "ones would look like those of another cell; scan a smaller area, or with more pixels"
        )


def _check_periods(vectors: Floats, extent: Floats, least: float, advice: str) -> None:
    cells = float(np.prod(extent)) / area(vectors)
    waves = np.linalg.inv(vectors).T * extent  # periods of each base wave along x and y, summed over the image
    periods = float(np.min(np.hypot(*waves.T)))
    if cells < _LEAST_CELLS or periods < least:
        raise Unphysical(
            f"the image has {periods:.2g} periods of its lattice; at least {least:g} in each direction are needed: "
            f"{advice}"
        )
