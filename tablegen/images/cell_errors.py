"""Refine a cell over the maxima of the autocorrelation, with errors by a bootstrap over blocks of the image."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from tablegen.images.cell_vectors import lattice_points
from tablegen.images.lattice_filters import FilteredImage
from tablegen.numerics.arrays import Floats, Ints

_REACH = 2  # cells to either side
_LEAST_LEVEL = 0.3  # of the highest maximum
_STEP = 0.06  # of the shorter side: distance of the values through which a parabola is laid
_SAMPLES = 100
_BLOCKS = 3, 6  # to a side, least and most
_FURTHEST = 0.62  # of the image: the largest lag
_MOST_OFF = 2.0  # steps of the parabola
_PATCH = np.array([(dx, dy) for dy in (-1, 0, 1) for dx in (-1, 0, 1)])
_QUADRATIC = np.linalg.pinv(
    np.stack([np.ones(9), _PATCH[:, 0], _PATCH[:, 1], _PATCH[:, 0] ** 2, _PATCH.prod(axis=1), _PATCH[:, 1] ** 2], 1)
)


@dataclass(frozen=True, eq=False)
class CellFit:
    """A cell in pixels, its covariance in the order a_x, a_y, b_x, b_y, and the mean correlation at its points."""

    vectors: Floats
    covariance: Floats
    level: float


def fit_cell(image: FilteredImage, start: Floats) -> CellFit | None:
    """Fit a cell to the maxima of an autocorrelation; None if it has too few of them.

    Parameters
    ----------
    start
        The cell nearly, in pixels, shape (2, 2).
    """
    rows, columns = image.values.shape
    step = max(1, round(_STEP * float(np.min(np.hypot(*start.T)))))
    points = lattice_points(_REACH)
    lags = np.round(points @ start).astype(np.int64)
    inside = np.all(np.abs(lags) + step <= _FURTHEST * np.array([columns, rows]), axis=1)
    points, lags = points[inside], lags[inside]
    if len(points) < 2:
        return None
    sums = np.array(
        [
            [
                block_sums(image, image, tuple((lag + step * one).tolist()), _blocks(start, rows, columns))
                for one in _PATCH
            ]
            for lag in lags
        ]
    )  # (points, 9, 2, blocks)
    everything = np.ones((1, sums.shape[-1]))
    places, heights = _places(sums, everything, lags, step)
    used = heights[0] >= _LEAST_LEVEL * np.max(heights[0])
    if np.linalg.matrix_rank(points[used]) < 2:
        return None
    sums, points, lags = sums[used], points[used], lags[used]
    weight = heights[0][used]
    generator = np.random.default_rng(26)
    blocks = sums.shape[-1]
    draws = generator.multinomial(blocks, np.full(blocks, 1.0 / blocks), _SAMPLES).astype(np.float64)
    cells = _cells(points, _places(sums, draws, lags, step)[0], weight)
    vectors = _cells(points, places[:, used], weight)[0]
    covariance = np.cov(cells.reshape(_SAMPLES, 4), rowvar=False)
    variance = np.sum(image.weighted**2) / np.sum(image.weight**2)
    return CellFit(vectors, covariance, float(np.mean(weight) / variance))


def block_sums(one: FilteredImage, other: FilteredImage, lag: tuple[int, int], blocks: int) -> Floats:
    """Return the products of two images at a lag, and those of their windows, summed over blocks.

    Parameters
    ----------
    lag
        Distance x, y in pixels of the second factor from the first.
    blocks
        Blocks to a side.

    Returns
    -------
    Floats
        Shape (2, blocks^2).
    """
    rows, columns = one.values.shape
    x, y = lag
    first = (slice(max(-y, 0), rows - max(y, 0)), slice(max(-x, 0), columns - max(x, 0)))
    second = (slice(max(y, 0), rows - max(-y, 0)), slice(max(x, 0), columns - max(-x, 0)))
    product = _summed(one.weighted[first], other.weighted[second], blocks)
    if one.factors is None or other.factors is None:
        return np.stack([product, _summed(one.weight[first], other.weight[second], blocks)])
    window = np.outer(
        *(
            np.add.reduceat(of_one[i] * of_other[j], _edges(i.stop - i.start, blocks)[:-1])
            for of_one, of_other, i, j in zip(one.factors, other.factors, first, second, strict=True)
        )
    )
    return np.stack([product, window.ravel()])


def _summed(one: Floats, other: Floats, blocks: int) -> Floats:
    """Return the products of two arrays, summed over blocks, shape (blocks^2,)."""
    rows, columns = (_edges(count, blocks) for count in one.shape)
    bands = [np.einsum("ij,ij->j", one[i:j], other[i:j]) for i, j in pairwise(rows.tolist())]
    return np.asarray(np.add.reduceat(np.stack(bands), columns[:-1], axis=1).ravel())


def _edges(count: int, blocks: int) -> Ints:
    """Return the first pixel of each block, and the one after the last."""
    return np.linspace(0, count, blocks + 1).astype(np.int64)


def _blocks(vectors: Floats, rows: int, columns: int) -> int:
    cells = min(rows, columns) / float(np.max(np.hypot(*vectors.T)))
    return int(np.clip(cells, *_BLOCKS))


def _places(sums: Floats, draws: Floats, lags: Ints, step: int) -> tuple[Floats, Floats]:
    """Return the maxima of parabolas, shape (draws, points, 2), and their heights, shape (draws, points)."""
    product, window = np.moveaxis(np.einsum("pkwb,db->dpkw", sums, draws), -1, 0)
    values = product / np.where(window > 0.0, window, np.inf)
    return parabola_maxima(values, lags, step)


def parabola_maxima(values: Floats, lags: Ints, step: int) -> tuple[Floats, Floats]:
    """Return the maxima of parabolas through patches of 3 x 3 values.

    Parameters
    ----------
    values
        Shape (..., points, 9), x runs fastest.
    lags
        Middle of each patch, x and y in pixels, shape (points, 2).
    step
        Distance of the values in pixels.

    Returns
    -------
    tuple
        Places in pixels, shape (..., points, 2), and values in the middle of the patches, shape (..., points).
    """
    _, x, y, xx, xy, yy = np.moveaxis(values @ _QUADRATIC.T, -1, 0)
    determinant = 4.0 * xx * yy - xy**2
    peaked = (determinant > 0.0) & (xx < 0.0)
    safe = np.where(peaked, determinant, 1.0)
    offset = np.stack([(xy * y - 2.0 * yy * x) / safe, (xy * x - 2.0 * xx * y) / safe], axis=-1)
    offset = np.where(peaked[..., None], np.clip(offset, -_MOST_OFF, _MOST_OFF), 0.0)
    return lags + step * offset, values[..., 4]


def _cells(points: Floats, places: Floats, weight: Floats) -> Floats:
    """Fit cells to places, shape (draws, points, 2); return shape (draws, 2, 2)."""
    solution = np.linalg.pinv(points * weight[:, None]) * weight
    return np.asarray(np.einsum("ip,dpx->dix", solution, places))
