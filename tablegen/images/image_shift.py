"""The shift of one image against another of the same place, with its errors and whatever else it could be."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.ndimage import label

from tablegen.images.lattice_filters import filtered_images
from tablegen.images.missing import valid_pixels
from tablegen.numerics.arrays import Bools, Floats

_LEAST_OVERLAP = 0.3  # of the pixels: lags with less are not searched
_RIVAL = 0.7  # of the largest correlation: a separate maximum with more is as likely
_MOST_RIVALS = 12
_SEARCHED_PIXELS = 2**18  # of an image: a larger one is searched as means over blocks
_ROUNDS = 30
_SMALLEST_STEP = 1e-5  # pixels
_WORST_CONDITION = 1e6  # of the normal equations: with more they determine one direction only
_CLIPPED = 4.0  # standard deviations of the difference
_TAPS = range(-2, 4)
_MARGIN = 2  # pixels at the edge of the overlap and twice the smoothing, which these spoil
_BANDS = 24  # bands of rows, whose scatter gives the errors: rows that jump err together
_GRID = 8  # blocks to a side, which scatter too
_WIDTHS = (1, 2, 4)  # pixels: standard deviations of the smoothing, of which the one with the least errors counts
_ALIKE = 2.0  # times the least error: the results of other widths that count for what the smoothing changes
_KERNEL = (0.25, 0.5, 0.25)  # twice: a Gaussian with a standard deviation of one step


class ImagePair(NamedTuple):
    """Heights of one direction in both images, shape (rows, columns) each; NaN where a pixel is missing."""

    first: Floats
    second: Floats


@dataclass(frozen=True, eq=False)
class ImageShift:
    """Shift x, y of the second image against the first, in pixels.

    ``errors`` are standard errors, ``correlation`` is that at the shift, from 0 to 1, and ``significance`` its ratio to
    the standard deviation that images of other places with the same features would have. ``directions`` has the shift
    of each direction alone, shape (directions, 2), and ``rivals`` the other shifts that are as likely, shape
    (rivals, 2), the nearest first. ``open_ended`` is true if the correlation does not fall off in every direction.
    """

    pixels: Floats
    errors: Floats
    correlation: float
    significance: float
    directions: Floats
    rivals: Floats
    open_ended: bool


def image_shift(pairs: Sequence[ImagePair], reach: Floats | None = None) -> ImageShift:
    """Register two images of one place: whole pixels by correlation, the rest by least squares.

    The errors are those of blocks, or of bands of rows, whichever scatter more, and what the smoothing changes.

    Parameters
    ----------
    pairs
        The images in each of their directions, all of one shape.
    reach
        Semi-axes x, y in pixels of the ellipse in which the shift is; by default the images overlap by 30 % at least.
    """
    levelled = [_Prepared(*(_smoothed(_levelled(heights), _WIDTHS[0]) for heights in pair)) for pair in pairs]
    search = _search(levelled, reach)
    filled = [_Prepared(*(_filled(heights) for heights in pair)) for pair in pairs]
    smooth = {width: [_Prepared(*(_smoothed(one, width) for one in pair)) for pair in filled] for width in _WIDTHS}
    fits = [(*_least_squares(images, search.places[0], width), width) for width, images in smooth.items()]
    pixels, errors, width = min(fits, key=lambda fit: float(np.sum(fit[1] ** 2)))
    alike = [fit[0] for fit in fits if float(np.sum(fit[1] ** 2)) <= _ALIKE**2 * float(np.sum(errors**2))]
    errors = np.hypot(errors, np.ptp(alike, axis=0))
    alone = [pixels] if len(pairs) == 1 else [_least_squares([one], pixels, width)[0] for one in smooth[width]]
    rivals = search.places[1:]
    near = np.argsort(np.hypot(*rivals.T), kind="stable")
    significance = search.correlation / min(_chance_correlation(one) for one in levelled)
    return ImageShift(
        pixels, errors, search.correlation, significance, np.array(alone), rivals[near], search.open_ended
    )


class _Filtered(NamedTuple):
    """Levelled and smoothed heights, and where they are valid."""

    values: Floats
    valid: Bools


class _Prepared(NamedTuple):
    first: _Filtered
    second: _Filtered


class _Maxima(NamedTuple):
    """Maxima of the correlation, the largest first, shape (maxima, 2) in pixels."""

    places: Floats
    correlation: float
    open_ended: bool


def _levelled(heights: Floats) -> _Filtered:
    image = filtered_images(heights)[0]
    return _Filtered(image.values, image.weight > 0.0)


def _filled(heights: Floats) -> _Filtered:
    """Replace missing pixels by the median of their row; rows differ by offsets that the comparison takes out."""
    valid = valid_pixels(heights)
    values = np.zeros(heights.shape)
    for row in np.flatnonzero(valid.any(axis=1)):
        middle = np.median(heights[row][valid[row]])
        values[row] = np.where(valid[row], heights[row] - middle, 0.0)
    return _Filtered(values, valid)


def _smoothed(image: _Filtered, width: int) -> _Filtered:
    """Smooth by a Gaussian with this standard deviation in pixels."""
    values = image.values
    for step in range(width * width):
        del step
        for axis in (0, 1, 0, 1):
            padded = np.pad(values, [(1, 1) if axis == one else (0, 0) for one in (0, 1)], mode="edge")
            line = np.moveaxis(padded, axis, 0)
            values = np.moveaxis(_KERNEL[0] * line[:-2] + _KERNEL[1] * line[1:-1] + _KERNEL[2] * line[2:], 0, axis)
    return _Filtered(np.where(image.valid, values, 0.0), image.valid)


def _search(pairs: list[_Prepared], reach: Floats | None) -> _Maxima:
    """Find the maxima of the correlation over whole lags, of means over blocks if the image is large."""
    rows, columns = pairs[0].first.values.shape
    block = max(1, int(np.ceil(np.sqrt(rows * columns / _SEARCHED_PIXELS))))
    match = np.mean([_correlation(_blocks(one.first, block), _blocks(one.second, block)) for one in pairs], axis=0)
    y = block * (np.arange(match.shape[0]) - match.shape[0] // 2)
    x = block * (np.arange(match.shape[1]) - match.shape[1] // 2)
    inside = np.isfinite(match)
    if reach is not None:
        inside = inside & (np.hypot(x[None, :] / max(reach[0], block), y[:, None] / max(reach[1], block)) <= 1.0)
    filled = np.where(np.isfinite(match), match, -1.0)
    peaks = inside & _local_maxima(filled)
    if not peaks.any():
        return _Maxima(np.zeros((1, 2)), 0.0, True)
    best = float(np.max(filled[peaks]))
    level = np.isfinite(match) & (filled >= _RIVAL * best) & (best > 0.0)
    places: list[tuple[float, float]] = []
    open_ended = False
    lobes, _ = label(level)
    remaining = np.where(peaks & level, filled, -np.inf)
    while len(places) <= _MOST_RIVALS and np.max(remaining) > -np.inf:
        at = np.unravel_index(int(np.argmax(remaining)), match.shape)
        lobe = lobes == lobes[at]
        open_ended = open_ended or (reach is None and not places and _at_edge(lobe, np.isfinite(match)))
        if filled[at] >= np.max(filled[lobe]):  # one side of a lobe is no maximum of its own
            places.append((float(x[at[1]]), float(y[at[0]])))
        remaining[lobe] = -np.inf
        remaining[at] = -np.inf
    if not places:
        return _Maxima(np.zeros((1, 2)), 0.0, True)
    return _Maxima(np.array(places), best, open_ended)


def _blocks(image: _Filtered, block: int) -> _Filtered:
    if block == 1:
        return image
    rows, columns = (side // block for side in image.values.shape)
    part = slice(0, rows * block), slice(0, columns * block)
    shape = (rows, block, columns, block)
    values = image.values[part].reshape(shape).mean(axis=(1, 3))
    return _Filtered(values, np.asarray(image.valid[part].reshape(shape).all(axis=(1, 3))))


def _correlation(first: _Filtered, second: _Filtered) -> Floats:
    """Return the correlation of the overlap at each lag, the lag 0 in the middle; NaN where the overlap is small."""
    rows, columns = first.values.shape
    shape = (2 * rows, 2 * columns)
    one, other = (
        [np.fft.rfft2(part, shape) for part in (image.values, image.values**2, image.valid.astype(np.float64))]
        for image in (first, second)
    )

    def product(a: int, b: int) -> Floats:
        return np.asarray(np.fft.fftshift(np.fft.irfft2(np.conj(one[a]) * other[b], shape)), dtype=np.float64)

    count = product(2, 2)
    power = np.maximum(product(1, 2), 0.0) * np.maximum(product(2, 1), 0.0)
    size = float(np.sum(first.values**2) * np.sum(second.values**2))
    enough = (count >= _LEAST_OVERLAP * rows * columns) & (power > 1e-6 * size)
    return np.where(enough, product(0, 0) / np.sqrt(np.where(enough, power, 1.0)), np.nan)


def _chance_correlation(pair: _Prepared) -> float:
    """Return the standard deviation of the correlation of two images with nothing in common, by Bartlett's formula."""
    rows, columns = pair.first.values.shape
    shape = (2 * rows, 2 * columns)
    powers = [np.abs(np.fft.rfft2(image.values, shape)) ** 2 for image in pair]
    both = [np.fft.irfft2(power, shape) for power in powers]
    product = float(np.sum(both[0] * both[1]) / max(both[0][0, 0] * both[1][0, 0], 1e-300))
    return float(np.sqrt(max(product, 1.0) / (rows * columns)))


def _local_maxima(values: Floats) -> Bools:
    peaks = np.ones(values.shape, dtype=np.bool_)
    for dy in (-1, 0, 1):
        for dx in (-1, 0, 1):
            if dy or dx:
                peaks &= values >= np.roll(values, (dy, dx), axis=(0, 1))
    return peaks


def _at_edge(lobe: Bools, searched: Bools) -> bool:
    """Return True if a lobe reaches the last lags that were searched."""
    inner = searched.copy()
    for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
        inner &= np.roll(searched, step, axis=axis)
    return bool(np.any(lobe & ~inner))


class _Normal(NamedTuple):
    """Normal equations of a shift: matrices, shape (bands, blocks, 2, 2), and right sides, shape (bands, blocks, 2)."""

    matrices: Floats
    scores: Floats


def _least_squares(pairs: list[_Prepared], start: Floats, width: int) -> tuple[Floats, Floats]:
    """Return the shift x, y at which the images differ least, and its standard errors, in pixels.

    The errors are infinite where the images do not determine it.
    """
    shift = start.astype(np.float64)
    for _ in range(_ROUNDS):
        parts = [_normal_equations(one, shift, _MARGIN + 2 * width) for one in pairs]
        matrices = np.sum([part.matrices for part in parts], axis=0)
        scores = np.sum([part.scores for part in parts], axis=0)
        matrix = matrices.sum(axis=(0, 1))
        if not np.linalg.cond(matrix) < _WORST_CONDITION:
            return start, np.full(2, np.inf)
        step = np.clip(np.linalg.solve(matrix, -scores.sum(axis=(0, 1))), -1.0, 1.0)
        shift = shift + step
        if float(np.max(np.abs(step))) < _SMALLEST_STEP:
            break
    bands = matrices.sum(axis=1), scores.sum(axis=1)
    blocks = (_block_sums(matrices), _block_sums(scores))
    return shift, np.maximum(*(_jackknife(*parts) for parts in (bands, blocks)))


def _block_sums(parts: Floats) -> Floats:
    """Add bands of rows, shape (bands, blocks, ...), to as many as there are blocks side by side."""
    rest = parts.shape[2:]
    return np.asarray(parts.reshape(_GRID, -1, _GRID, *rest).sum(axis=1).reshape(-1, *rest))


def _jackknife(matrices: Floats, scores: Floats) -> Floats:
    """Return standard errors x, y by the shifts that result without each part: matrices (n, 2, 2), scores (n, 2)."""
    rest = matrices.sum(axis=0) - matrices
    determinant = np.linalg.det(rest)
    if not np.all(determinant > np.linalg.det(matrices.sum(axis=0)) / _WORST_CONDITION):
        return np.full(2, np.inf)
    without = np.linalg.solve(rest, scores[..., None])[..., 0]
    return np.asarray(np.sqrt((1.0 - 1.0 / len(scores)) * np.sum(without**2, axis=0)))


def _normal_equations(pair: _Prepared, shift: Floats, margin: int) -> _Normal:
    """Compare both images, each moved by half of the shift towards the other, so that their noise is smoothed alike.

    Rows lose their best straight line: neither the offset of a row nor a bow of the scanner has an effect, of which the
    difference of shifted images is the slope. The matrix is that of the slopes of one image with those of
    the other, whose noise has nothing in common.
    """
    whole = np.round(shift)
    first, second = _overlap(pair, whole)
    inside = first.valid & second.valid
    inside[:margin], inside[-margin:], inside[:, :margin], inside[:, -margin:] = False, False, False, False
    half = 0.5 * (shift - whole)
    one, other = _moved(first.values, -half), _moved(second.values, half)
    slopes = [
        np.stack(
            [
                _without_lines(0.5 * (np.roll(image, -1, axis=axis) - np.roll(image, 1, axis=axis)), inside)
                for axis in (1, 0)
            ],
            axis=-1,
        )
        for image in (one, other)
    ]
    products = np.einsum("ija,ijb->ijab", *slopes)
    products = 0.5 * (products + np.swapaxes(products, 2, 3))
    difference = _without_lines(other - one, inside)
    limit = _CLIPPED * 1.4826 * float(np.median(np.abs(difference[inside]))) if inside.any() else 0.0
    scores = 0.5 * (slopes[0] + slopes[1]) * np.clip(difference, -limit, limit)[..., None]
    return _Normal(_part_sums(products), _part_sums(scores))


def _part_sums(values: Floats) -> Floats:
    """Add the pixels, shape (rows, columns, ...), of bands of rows and of blocks of columns."""
    for axis, count in ((0, _BANDS), (1, _GRID)):
        values = np.add.reduceat(values, np.arange(count) * values.shape[axis] // count, axis=axis)
    return values


def _overlap(pair: _Prepared, whole: Floats) -> tuple[_Filtered, _Filtered]:
    """Return what both images have of the same place, by a shift of whole pixels."""
    parts: tuple[list[slice], list[slice]] = ([], [])
    for size, by in zip(pair.first.values.shape, (int(whole[1]), int(whole[0])), strict=True):
        parts[0].append(slice(max(-by, 0), size - max(by, 0)))
        parts[1].append(slice(max(by, 0), size - max(-by, 0)))
    one, other = (
        _Filtered(image.values[tuple(part)], image.valid[tuple(part)]) for image, part in zip(pair, parts, strict=True)
    )
    return one, other


def _moved(values: Floats, shift: Floats) -> Floats:
    """Return values at places that are further by a shift x, y of a part of a pixel: by polynomials of degree 5."""
    for axis, part in ((1, float(shift[0])), (0, float(shift[1]))):
        moved = np.zeros(values.shape)
        for tap in _TAPS:
            weight = np.prod([(part - other) / (tap - other) for other in _TAPS if other != tap])
            moved += weight * np.roll(values, -tap, axis=axis)
        values = moved
    return values


def _without_lines(values: Floats, inside: Bools) -> Floats:
    """Subtract the best straight line of each row."""
    weight = inside.astype(np.float64)
    count = np.maximum(weight.sum(axis=1, keepdims=True), 1.0)
    place = np.arange(values.shape[1])[None, :] * weight
    place = weight * (place - place.sum(axis=1, keepdims=True) / count)
    size = np.maximum(np.sum(place**2, axis=1, keepdims=True), 1.0)
    level = weight * (values - np.sum(weight * values, axis=1, keepdims=True) / count)
    return np.asarray(level - place * np.sum(place * level, axis=1, keepdims=True) / size)
