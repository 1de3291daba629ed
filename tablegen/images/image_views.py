"""The filtered images of a search with their spots: a spot of the sample is in each of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tablegen.images.autocorrelation import (
    WEAKEST,
    Autocorrelation,
    Spots,
    autocorrelation,
    own_spots,
    spectrum_peaks,
)
from tablegen.images.lattice_candidates import Candidate, candidates
from tablegen.images.lattice_filters import FilteredImage, filtered_images
from tablegen.numerics.arrays import Bools, Floats

STRAIN = 0.02  # share: what distortion may move a spot
NEAR_SPOT = 1.2  # periods in the image: spots of two views this near are one
FAINT, FAINTEST = 0.5, 0.3  # of the contrast of a significant spot, and of its least power
_CERTAINTY = 5.0  # exponent of e
_STEEP = 0.12  # of a wave along the rows


@dataclass(frozen=True, eq=False)
class ViewSpots:
    """The spots of a filtered image."""

    name: str  # of the filter
    extent: Floats  # columns and rows of the image
    spots: Spots
    faint: Spots  # of less contrast and power: they confirm those of another view
    least: float  # contrast of a significant spot


@dataclass(frozen=True, eq=False)
class View(ViewSpots):
    """A filtered image with its autocorrelation and spots."""

    image: FilteredImage
    correlation: Autocorrelation
    cells: list[Candidate]  # of its autocorrelation


def image_views(heights: Floats) -> list[View]:
    """Return the views of an image.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns), without holes.
    """
    views = []
    for image in filtered_images(heights):
        correlation, one = autocorrelation(image), view_spots(image)
        cells = candidates(correlation)
        views.append(View(one.name, one.extent, one.spots, one.faint, one.least, image, correlation, cells))
    return views


def view_spots(image: FilteredImage) -> ViewSpots:
    """Return the spots of a filtered image."""
    least, weakest = least_contrast(float(image.values.size)), FAINTEST * WEAKEST
    peaks = spectrum_peaks(image, weakest)
    extent = np.array(image.values.shape[::-1], dtype=np.float64)
    spots, faint = own_spots(peaks, extent, least), own_spots(peaks, extent, FAINT * least, weakest)
    return ViewSpots(image.name, extent, spots, faint, least)


def least_contrast(pixels: float) -> float:
    """Return the contrast of a significant spot of an image of so many pixels."""
    return float(np.log(pixels) + _CERTAINTY)


def together(views: Sequence[ViewSpots], contrast: float) -> Spots:
    """Return the spots of all views with this share of the contrast of significant ones.

    A spot has to be in every view, or along the columns, to which slopes along the rows are blind: the edge of a
    terrace makes spots in the heights alone.
    """
    parts = []
    for view in views:
        use = view.spots.contrast >= contrast * view.least
        for other in views:
            if other is not view:
                use &= confirmed(view.spots.waves, other)
        parts.append(Spots(view.spots.waves[use], view.spots.contrast[use], view.spots.power[use]))
    return Spots(
        np.concatenate([part.waves for part in parts]),
        np.concatenate([part.contrast for part in parts]),
        np.concatenate([part.power for part in parts]),
    )


def confirmed(waves: Floats, other: ViewSpots) -> Bools:
    """Return True for waves per pixel, shape (n, 2), that another view shows too, or cannot show."""
    extent = other.extent
    steep = np.abs(waves[:, 0]) < _STEEP * np.hypot(*waves.T)
    if not len(other.faint.waves):
        return np.asarray(steep)
    distance = np.hypot(*np.moveaxis((waves[:, None] - other.faint.waves[None]) * extent, -1, 0))
    return np.asarray(steep | (np.min(distance, axis=1) <= NEAR_SPOT + STRAIN * np.hypot(*(waves * extent).T)))
