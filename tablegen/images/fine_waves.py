"""Significant waves of all pixels of a large image: blocks do not show fine ones, nor does the centre show weak ones.

The spectrum is neither padded nor smoothed, and its background is that of tiles, so that time and memory stay small.
"""

from typing import TypeAlias

import numpy as np

from tablegen.images.autocorrelation import FINEST, WEAKEST, Spots, own_spots
from tablegen.images.image_views import FAINT, FAINTEST, ViewSpots, least_contrast
from tablegen.images.lattice_filters import slope_limit
from tablegen.images.missing import without_holes
from tablegen.images.searched_part import SearchedPart
from tablegen.numerics.arrays import Bools, Floats, Ints, Shape

_Singles: TypeAlias = np.ndarray[Shape, np.dtype[np.float32]]
_SingleComplexes: TypeAlias = np.ndarray[Shape, np.dtype[np.complex64]]

_STRIP = 64  # rows, or columns of the spectrum, at a time
_SAMPLE = 64  # rows that tell the usual heights and slopes
_CLIPPED = 1.0  # percent of the heights at either end
_TILE = 32  # cells of the spectrum to a side
_FLOOR = 1e-5  # of the largest power: what leaks from the strongest spot
_STREAK = 1.5  # periods along the rows: rows that jump have their power below


def whole_spots(heights: Floats, part: SearchedPart) -> list[ViewSpots]:
    """Return the spots of the levelled heights, then those of their slopes along the rows.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns); NaN where a pixel is missing.
    part
        The part without missing rows or columns; each of its pixels counts.
    """
    region = heights[slice(*part.rows), slice(*part.columns)]
    sample = _levelled(region[:: max(1, len(region) // _SAMPLE)])
    low, high = np.percentile(sample, (_CLIPPED, 100.0 - _CLIPPED))
    steps = np.diff(sample, axis=1)
    limit = slope_limit(steps, np.ones(steps.shape, dtype=np.bool_))
    least, extent = least_contrast(part.pixels), np.array(part.size[::-1], dtype=np.float64)
    views = []
    for name, limits in (("heights", (low, high)), ("slopes", (-limit, limit))):
        peaks = _peaks(_power(region, limits, slopes=name == "slopes"), part.size, FAINT * least)
        faint = own_spots(peaks, extent, FAINT * least, FAINTEST * WEAKEST)
        views.append(ViewSpots(name, extent, own_spots(peaks, extent, least), faint, least))
    return views


def _levelled(lines: Floats) -> Floats:
    lines = without_holes(lines)
    return np.asarray(lines - np.median(lines, axis=1, keepdims=True))


def _power(region: Floats, limits: tuple[float, float], *, slopes: bool) -> _Singles:
    """Return the power of one half of the spectrum of clipped heights, or slopes, in single precision."""
    rows, columns = region.shape
    window = np.hanning(columns + 2)[1:-1], np.hanning(rows + 2)[1:-1]
    spectrum: _SingleComplexes = np.empty((rows, int(FINEST * columns) + 1), dtype=np.complex64)
    for top in range(0, rows, _STRIP):
        lines = _levelled(region[top : top + _STRIP])
        if slopes:
            lines = np.diff(lines, axis=1, append=lines[:, -1:])
            lines[np.abs(lines) > 2.0 * limits[1]] = 0.0
        lines = np.clip(lines, *limits) * window[0] * window[1][top : top + _STRIP, None]
        spectrum[top : top + _STRIP] = np.fft.rfft(lines, axis=1)[:, : spectrum.shape[1]]
    power: _Singles = np.empty(spectrum.shape, dtype=np.float32)
    for left in range(0, spectrum.shape[1], _STRIP):
        power[:, left : left + _STRIP] = np.abs(np.fft.fft(spectrum[:, left : left + _STRIP], axis=0)) ** 2
    if slopes:  # as of heights, of which the background is flat
        power[:, 1:] /= 4.0 * np.sin(np.pi * np.arange(1, power.shape[1]) / columns) ** 2
        power[:, 0] = 0.0
    return power


def _peaks(power: _Singles, size: tuple[int, int], least: float) -> Spots:
    """Return the maxima of a spectrum with this contrast."""
    rows, columns = size
    v = np.fft.fftfreq(rows)
    background = np.maximum(_background(power), _FLOOR * float(np.max(power)))
    tiles = np.arange(rows) // _TILE, np.arange(power.shape[1]) // _TILE
    places: list[Ints] = []
    for top in range(0, rows, _STRIP):
        strip = power[top : top + _STRIP]
        row, column = np.nonzero(strip >= least * background[tiles[0][top : top + _STRIP]][:, tiles[1]])
        places.append(np.stack([row + top, column]))
    row, column = np.concatenate(places, axis=1)
    inside = (column >= _STREAK) & (column <= FINEST * columns) & (np.abs(v[row]) <= FINEST)
    row, column = row[inside], column[inside]
    highest = _highest(power, row, column)
    row, column = row[highest], column[highest]
    height = power[row, column].astype(np.float64)
    return Spots(
        np.stack([column / columns, v[row]], axis=1), height / background[tiles[0][row], tiles[1][column]], height
    )


def _background(power: _Singles) -> Floats:
    """Return the mean power of each tile from its median, which spots do not affect."""
    rows, columns = (-(-count // _TILE) for count in power.shape)
    usual = np.empty((rows, columns))
    for row in range(rows):
        line = power[row * _TILE : (row + 1) * _TILE]
        for column in range(columns):
            usual[row, column] = np.median(line[:, column * _TILE : (column + 1) * _TILE])
    return np.asarray(1.4427 * usual)


def _highest(power: _Singles, row: Ints, column: Ints) -> Bools:
    """Return True where no cell beside is higher."""
    highest = np.ones(len(row), dtype=np.bool_)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            beside = power[(row + dy) % power.shape[0], np.minimum(column + dx, power.shape[1] - 1)]
            highest &= power[row, column] >= beside
    return highest
