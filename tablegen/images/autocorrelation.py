"""The autocorrelation of an image, its maxima, and the spectrum that belongs to it.

Divided by that of the window, it does not fall with the lag. Lags reach to half of the image.
"""

from dataclasses import dataclass

import numpy as np

from tablegen.images.lattice_filters import FilteredImage, power_of
from tablegen.numerics.arrays import Bools, Floats, Ints

_LEAST_OVERLAP = 1e-3  # of the window with itself
_PADDING = 2
WEAKEST = 1.5e-3  # of the strongest power: 4 % of its amplitude
_WING, _WING_RADIUS, _WING_FALL = 0.02, 2.2, 4.0  # of the power of a spot; periods; exponent of the distance
_SMEARED = 0.015  # of the wave: what distortion spreads of a spot
_KERNEL = (1.0, 4.0, 6.0, 4.0, 1.0)  # sixteenths: weights of cells in the average of a spectrum
_FLOOR = 1e-5  # of the largest power: what leaks from the strongest spot
_BACKGROUND = 6, 2  # cells of the spectrum: reach of the neighbourhood of a spot, and of the spot itself
_STREAK = 1.5  # periods along the rows: rows that jump have their power below
_SLOWEST = 1.2  # periods in the image
FINEST = 0.45  # of the sampling rate


@dataclass(frozen=True, eq=False)
class Autocorrelation:
    """Correlation over lags: ``values[reach_y + y, reach_x + x]``, 1 at lag 0, shape (2 reach_y + 1, 2 reach_x + 1)."""

    values: Floats
    reach: tuple[int, int]  # x, y in pixels

    def at(self, lags: Floats) -> Floats:
        """Interpolate between the pixels; NaN beyond the reach.

        Parameters
        ----------
        lags
            x and y in pixels, shape (n, 2).

        Returns
        -------
        Floats
            Correlations, shape (n,).
        """
        x, y = lags[:, 0] + self.reach[0], lags[:, 1] + self.reach[1]
        rows, columns = self.values.shape
        inside = (x >= 0) & (y >= 0) & (x <= columns - 1) & (y <= rows - 1)
        left = np.clip(x.astype(np.int64), 0, columns - 2)
        top = np.clip(y.astype(np.int64), 0, rows - 2)
        u, v = x - left, y - top
        grid = self.values
        upper = grid[top, left] * (1 - u) + grid[top, left + 1] * u
        lower = grid[top + 1, left] * (1 - u) + grid[top + 1, left + 1] * u
        return np.where(inside, upper * (1 - v) + lower * v, np.nan)


@dataclass(frozen=True, eq=False)
class Spots:
    """Significant spots of a spectrum: waves per pixel along x and y, shape (n, 2), and power over the background."""

    waves: Floats
    contrast: Floats
    power: Floats


def autocorrelation(image: FilteredImage) -> Autocorrelation:
    """Return the autocorrelation of a filtered image."""
    rows, columns = image.values.shape
    shape = (2 * rows, 2 * columns)
    product, overlap = np.fft.irfft2(image.power, shape), _overlap(image)
    values = np.fft.fftshift(product / np.maximum(overlap, _LEAST_OVERLAP * overlap[0, 0]))
    x, y = columns // 2, rows // 2
    values = values[rows - y : rows + y + 1, columns - x : columns + x + 1]
    return Autocorrelation(values / values[y, x], (x, y))


def _overlap(image: FilteredImage) -> Floats:
    """Return the sum of products of the window with itself at each lag, of twice its shape; lag 0 comes first."""
    if image.factors is None:
        shape = (2 * image.weight.shape[0], 2 * image.weight.shape[1])
        return np.fft.irfft2(power_of(np.fft.rfft2(image.weight, shape)), shape)
    return np.outer(*(np.fft.irfft(power_of(np.fft.rfft(one, 2 * len(one))), 2 * len(one)) for one in image.factors))


def maxima(correlation: Autocorrelation, least: float) -> tuple[Floats, Floats]:
    """Return the maxima of an autocorrelation in one half of the lags, the highest first.

    Parameters
    ----------
    least
        Least distance from lag 0, in pixels.

    Returns
    -------
    tuple
        Lags x and y in pixels, shape (n, 2), and the correlation, shape (n,).
    """
    values = correlation.values
    inner = values[1:-1, 1:-1]
    higher = np.ones(inner.shape, dtype=np.bool_)
    for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
        for sign in (1, -1):
            top, left = 1 + sign * dy, 1 + sign * dx
            other = values[top : top + inner.shape[0], left : left + inner.shape[1]]
            higher &= inner > other
    row, column = np.nonzero(higher)
    x, y = column + 1 - correlation.reach[0], row + 1 - correlation.reach[1]
    half = ((y > 0) | ((y == 0) & (x > 0))) & (np.hypot(x, y) >= least)
    lags = np.stack([x[half], y[half]], axis=1).astype(np.float64)
    height = inner[row[half], column[half]]
    order = np.argsort(-height, kind="stable")
    return lags[order] + _offsets(values, row[half][order] + 1, column[half][order] + 1), height[order]


def _offsets(values: Floats, row: Ints, column: Ints) -> Floats:
    """Return the distance x, y of the maximum of a parabola along each axis from the pixels of maxima."""
    middle = values[row, column]
    offsets = []
    for dy, dx in ((0, 1), (1, 0)):
        before, after = values[row - dy, column - dx], values[row + dy, column + dx]
        bend = np.minimum(before - 2.0 * middle + after, -1e-300)
        offsets.append(np.clip(0.5 * (before - after) / bend, -0.5, 0.5))
    return np.stack(offsets, axis=1)


def power_spectrum(image: FilteredImage) -> tuple[Floats, Floats, Floats]:
    """Return the power of one half of the spectrum, averaged over some cells.

    Parameters
    ----------
    image
        A filtered image; its window is applied.

    Returns
    -------
    tuple
        Power, shape (len(v), len(u)), and the waves per pixel along x, from 0, and along y, from -0.5.
    """
    size = tuple(_PADDING * count for count in image.values.shape)
    power = image.power
    u, v = np.fft.rfftfreq(size[1]), np.fft.fftshift(np.fft.fftfreq(size[0]))
    return _smoothed(np.fft.fftshift(power, axes=0)), u.astype(np.float64), np.asarray(v, dtype=np.float64)


def significant_spots(image: FilteredImage, least: float, weakest: float = WEAKEST) -> Spots:
    """Return the spots of the spectrum that stand out of their neighbourhood.

    Parameters
    ----------
    least
        Least power of a spot over its background.
    weakest
        Least power over that of the strongest spot.
    """
    return own_spots(spectrum_peaks(image, weakest), np.array(image.values.shape[::-1]), least, weakest)


def spectrum_peaks(image: FilteredImage, weakest: float) -> Spots:
    """Return the peaks of the spectrum, whatever their contrast, with the wings of stronger ones.

    Parameters
    ----------
    weakest
        Least power over that of the strongest peak.
    """
    rows, columns = image.values.shape
    power, u, v = power_spectrum(image)
    searched = (u[None, :] * columns >= _STREAK) & (u[None, :] <= FINEST) & (np.abs(v[:, None]) <= FINEST)
    searched = searched & (np.hypot(u[None, :] * columns, v[:, None] * rows) >= _SLOWEST)
    row, column = np.nonzero(_peaks(power) & searched)
    height = power[row, column]
    high = height >= weakest * np.max(height, initial=0.0)
    row, column, height = row[high], column[high], height[high]
    return Spots(np.stack([u[column], v[row]], axis=1), height / _background(power, row, column), height)


def own_spots(peaks: Spots, extent: Floats | Ints, least: float, weakest: float = WEAKEST) -> Spots:
    """Return the peaks that stand out of their neighbourhood and are no wings of stronger ones.

    Parameters
    ----------
    peaks
        Peaks of the spectrum of an image.
    extent
        Columns and rows of the image.
    least
        Least power of a spot over its background.
    weakest
        Least power over that of the strongest peak.
    """
    use = (peaks.contrast >= least) & (peaks.power >= weakest * np.max(peaks.power, initial=0.0))
    waves, contrast, power = peaks.waves[use], peaks.contrast[use], peaks.power[use]
    own = _without_wings(waves * extent, power)
    order = np.flatnonzero(own)[np.argsort(-contrast[own], kind="stable")]
    return Spots(waves[order], contrast[order], power[order])


def _smoothed(power: Floats) -> Floats:
    """Average over some cells: chance makes fewer spots, and no side lobes arise."""
    for axis in (0, 1):
        edge = [(0, 0), (0, 0)]
        edge[axis] = (2, 2)
        padded = np.pad(power, edge, mode="reflect")
        count = power.shape[axis]
        line = np.moveaxis(padded, axis, 0)
        total = _KERNEL[2] * line[2 : 2 + count]
        for at in (0, 1):
            beside = line[at : at + count] + line[4 - at : 4 - at + count]
            beside *= _KERNEL[at]
            total += beside
        total /= sum(_KERNEL)
        power = np.moveaxis(total, 0, axis)
    return power


def _without_wings(periods: Floats, power: Floats) -> Bools:
    """Return True for spots, shape (n, 2) in periods of the image, that are no wings of stronger ones."""
    own = np.zeros(len(power), dtype=np.bool_)
    for number in np.argsort(-power, kind="stable"):
        stronger = np.concatenate([periods[own], -periods[own]])
        distance = np.hypot(*(stronger - periods[number]).T)
        near = _WING_RADIUS + _SMEARED * float(np.hypot(*periods[number]))
        wings = np.tile(power[own], 2) * _WING * (near / np.maximum(distance, near)) ** _WING_FALL
        own[number] = bool(np.all(distance > near) and np.all(power[number] > wings))
    return own


def _peaks(power: Floats) -> Bools:
    """Return True where no cell within two is higher."""
    reach = 2
    highest = power
    for axis in (0, 1):
        line = np.moveaxis(highest, axis, 0)
        along = line.copy()
        for step in range(1, reach + 1):
            np.maximum(along[step:], line[:-step], out=along[step:])
            np.maximum(along[:-step], line[step:], out=along[:-step])
        highest = np.moveaxis(along, 0, axis)
    return np.asarray((power >= highest) & (power > 0.0))


def _background(power: Floats, row: Ints, column: Ints) -> Floats:
    """Return the mean power around cells from the median over a frame, which other spots do not affect."""
    reach, own = (_PADDING * cells for cells in _BACKGROUND)
    mirrored = np.concatenate([power[::-1, reach:0:-1], power], axis=1)  # power(-u, -v) is power(u, v)
    padded = np.pad(mirrored, ((reach, reach), (0, reach)), mode="reflect")
    steps = range(-reach, reach + 1, _PADDING)
    offsets = np.array([(dy, dx) for dy in steps for dx in steps if max(abs(dy), abs(dx)) > own])
    around = padded[row[:, None] + reach + offsets[:, 0], column[:, None] + reach + offsets[:, 1]]
    usual = 1.4427 * np.median(around, axis=1) if len(row) else np.zeros(0)
    return np.maximum(usual, _FLOOR * float(np.max(power)))
