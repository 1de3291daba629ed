"""The pitch and the direction of a grating in an image, with errors over its blocks."""

from dataclasses import dataclass

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.images.autocorrelation import autocorrelation, significant_spots
from tablegen.images.lattice_filters import FilteredImage, filtered_images
from tablegen.images.searched_part import (
    SearchedPart,
    aliased,
    central_part,
    complete_part,
    largest_block,
)
from tablegen.numerics.arrays import Floats

_CERTAINTY = 5.0  # exponent of e
_CLEAR = 3.0  # times the contrast of a significant spot
_NEAR = 0.1  # of an index
_LEAST_PERIODS = 3.0
_LEAST_CORRELATION = 0.15  # at one and at two periods
_BLOCKS = 4  # to a side


NO_GRATING = (
    "no grating stands out of the noise; its bars have to cross the rows. Choose another --channel, or image more "
    "periods"
)


@dataclass(frozen=True, eq=False)
class ImageGrating:
    """The wave of a grating in periods per pixel along x and y, its covariance, and the correlation after a period.

    ``part`` is what of the image was searched.
    """

    wave: Floats
    covariance: Floats
    level: float
    part: SearchedPart


def find_grating(heights: Floats) -> ImageGrating:
    """Find the one wave, with harmonics, of which an image consists.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns); NaN where a pixel is missing.

    Raises
    ------
    Unphysical
        If no wave stands out, others are no harmonics, or there are fewer than three periods.
    """
    part = complete_part(heights)
    if part.large:
        centre = central_part(part, largest_block(heights, part))
        waves = [significant_spots(image, _least(image)).waves for image in filtered_images(centre.of(heights))]
        part = central_part(part, 1) if np.any(aliased(heights, centre, waves)) else centre
    wave, covariance, level = _grating_of(part.of(heights))
    return ImageGrating(wave / part.block, covariance / part.block**2, level, part)


def _least(image: FilteredImage) -> float:
    return float(np.log(image.values.size) + _CERTAINTY)


def _grating_of(heights: Floats) -> tuple[Floats, Floats, float]:
    """Return wave, covariance and correlation of a part of an image. Raise ``Unphysical`` if it is no grating."""
    image = filtered_images(heights)[0]
    least = _least(image)
    spots = significant_spots(image, least)
    if not len(spots.waves) or spots.contrast[0] < _CLEAR * least:
        raise Unphysical(NO_GRATING)
    strong = spots.waves[spots.power >= 0.02 * np.max(spots.power)]
    wave = strong[np.argmin(np.hypot(*strong.T))]
    index = strong @ wave / float(wave @ wave)
    beside = np.hypot(*(strong - np.round(index)[:, None] * wave).T) / np.hypot(*wave)
    if np.any(beside > _NEAR * np.maximum(np.abs(index), 1.0)):
        raise Unphysical(
            "the spots are not those of one grating; is the sample a lattice? Leave out --lattice grating, or choose "
            "another --channel"
        )
    periods = float(np.hypot(*(wave * np.array([heights.shape[1], heights.shape[0]]))))
    if periods < _LEAST_PERIODS:
        raise Unphysical(f"the image has {periods:.2g} periods of its grating; at least {_LEAST_PERIODS:g} are needed")
    step = wave / float(wave @ wave)
    level = autocorrelation(image).at(np.array([step, 2.0 * step, 0.5 * step]))
    if not level[0] > _LEAST_CORRELATION or level[1] < _LEAST_CORRELATION:
        raise Unphysical("the image does not repeat after a period of its strongest wave; is the sample a grating?")
    refined, covariance = _refined(image, wave)
    return refined, covariance, float(level[0])


def _refined(image: FilteredImage, wave: Floats) -> tuple[Floats, Floats]:
    """Return the wave with which the phase is constant over blocks, and its covariance from what remains."""
    rows, columns = image.values.shape
    y, x = np.mgrid[:rows, :columns].astype(np.float64)
    turned = image.values * image.weight * np.exp(-2j * np.pi * (wave[0] * x + wave[1] * y))
    places, phases, weights = [], [], []
    for row in np.array_split(np.arange(rows), _BLOCKS):
        for column in np.array_split(np.arange(columns), _BLOCKS):
            part = np.ix_(row, column)
            places.append(tuple(float(np.average(axis[part], weights=image.weight[part])) for axis in (x, y)))
            phases.append(complex(np.sum(turned[part])))
            weights.append(float(np.sum(image.weight[part])))
    value = np.array(phases)
    mean = np.angle(np.sum(value))
    phase = np.angle(value * np.exp(-1j * mean)) / (2.0 * np.pi)
    weight = np.sqrt(np.abs(value))
    design = np.concatenate([np.ones((len(places), 1)), np.array(places)], axis=1)
    solution, *_ = np.linalg.lstsq(design * weight[:, None], phase * weight, rcond=None)
    remaining = (phase - design @ solution) * weight
    scale = float(remaining @ remaining) / (len(places) - 3)
    covariance = scale * np.linalg.inv((design * weight[:, None]).T @ (design * weight[:, None]))
    return wave + solution[1:], covariance[1:, 1:]
