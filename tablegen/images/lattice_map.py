"""The cell of an image by the phases of its waves over blocks: finer than the maxima of its autocorrelation.

Each block shows by how much the sample is displaced there. An affine map, and a bow along x and along y that hysteresis
and creep make, are fitted to all blocks; what they leave gives the errors.
"""

import numpy as np
from numpy.polynomial.legendre import legval

from tablegen.base.input_errors import Unphysical
from tablegen.images.image_cell import ImageCell
from tablegen.images.missing import valid_pixels
from tablegen.numerics.arrays import Complexes, Floats, Ints

_MOST_BLOCKS, _LEAST_BLOCKS = 6, 3  # to a side
_CUBIC_BLOCKS = 5  # to a side
_MOST_SPOTS = 6
_ROUNDS = 3
_FLOOR = 2e-4  # of a side: standard error of what all blocks share, such as what a row without waves hides
_MOST_PHASE = 0.25  # periods: a displacement between blocks beyond it may be a period more
_PERIODS = 1.3  # of the longer side of the cell across a block: with less, waves are hardly told apart


def mapped_cell(heights: Floats, cell: ImageCell) -> tuple[Floats, Floats]:
    """Return the sides of a cell in pixels, shape (2, 2), and the covariance of a_x, a_y, b_x, b_y.

    Parameters
    ----------
    heights
        Heights in any unit, shape (rows, columns).
    cell
        The cell that was found in them; its own sides and errors return where blocks have too few periods.

    Raises
    ------
    Unphysical
        If the image is not one lattice throughout.
    """
    indices = _indices(cell)
    rows, columns = heights.shape
    count = min(int(min(rows, columns) / (_PERIODS * float(np.max(np.hypot(*cell.vectors.T))))), _MOST_BLOCKS)
    if len(indices) < 2 or count < _LEAST_BLOCKS:
        return cell.vectors, cell.covariance
    vectors = cell.vectors
    for _ in range(_ROUNDS):
        waves = indices @ np.linalg.inv(vectors).T
        places, moved, weight = _displacements(heights, waves, count)
        x, y = (places - 0.5 * np.array([columns, rows])).T
        bows = [legval(2.0 * one / size, degree) for one, size in ((x, columns), (y, rows)) for degree in _bows(count)]
        design = np.stack([x, y, np.ones(len(x)), *bows], axis=1)
        root = np.sqrt(weight)[:, None]
        solution = np.linalg.lstsq(design * root, moved * root, rcond=None)[0]
        vectors = vectors @ (np.eye(2) + solution[:2])
    rest = (moved - design @ solution) * root
    scatter = rest.T @ rest / (len(rest) - design.shape[1])
    spread = np.linalg.inv((design * root).T @ (design * root))[:2, :2]
    floor = _FLOOR**2 * np.kron(np.diag(np.sum(vectors**2, axis=1)), np.eye(2))
    return vectors, np.kron(vectors @ spread @ vectors.T, scatter) + floor


def _bows(count: int) -> list[list[float]]:
    """Return Legendre's polynomials, without slope on the whole: of degree 2, and 3 where blocks tell it from 1."""
    return [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]] if count >= _CUBIC_BLOCKS else [[0.0, 0.0, 1.0]]


def _indices(cell: ImageCell) -> Ints:
    """Return the strongest waves of the cell as whole numbers of its base waves, shape (waves, 2)."""
    order = np.argsort(cell.spots.power)[::-1]
    strong = [at for at in order.tolist() if cell.explained[at]]
    waves: list[tuple[int, int]] = []
    for at in strong:
        i, j = (int(one) for one in np.round(cell.spots.waves[at] @ cell.vectors.T))
        if (i, j) != (0, 0) and (i, j) not in waves and (-i, -j) not in waves:
            waves.append((i, j))
    chosen = np.array(waves[:_MOST_SPOTS], dtype=np.int64).reshape(-1, 2)
    return chosen if np.linalg.matrix_rank(chosen) == 2 else chosen[:0]


def _displacements(heights: Floats, waves: Floats, count: int) -> tuple[Floats, Floats, Floats]:
    """Return centres x, y of blocks and their displacements in pixels, shape (blocks, 2) each, and their weights.

    All waves of a block are fitted together: across a few periods each has a share of the others.
    """
    rows, columns = heights.shape
    places, sums = [], []
    for y in np.array_split(np.arange(rows), count):
        for x in np.array_split(np.arange(columns), count):
            places.append((float(np.mean(x)), float(np.mean(y))))
            sums.append(_amplitudes(heights, waves, x, y))
    value = np.array(sums).T
    phase = np.angle(value * np.conj(np.sum(value, axis=1))[:, None]) / (2.0 * np.pi)
    power = np.abs(value) ** 2
    if float(np.sqrt(np.sum(power * phase**2) / np.sum(power))) > _MOST_PHASE:
        raise Unphysical("the lattice does not go on through the image; is the sample one lattice? Crop to one")
    normal = np.einsum("wb,wi,wj->bij", power, waves, waves)
    scores = -np.einsum("wb,wi,wb->bi", power, waves, phase)
    normal += 1e-9 * np.trace(normal.mean(axis=0)) * np.eye(2)
    weight = np.sum(power, axis=0)
    return np.array(places), np.linalg.solve(normal, scores[..., None])[..., 0], weight / float(np.mean(weight))


def _amplitudes(heights: Floats, waves: Floats, x: Ints, y: Ints) -> Complexes:
    """Return the amplitudes of the waves in a block, their phases those of the image's corner, shape (waves,).

    Rows lose their mean, and so do the waves: neither a row that jumps nor levelling has an effect.
    """
    values = heights[np.ix_(y, x)]
    valid = valid_pixels(values)
    values = np.where(valid, values, 0.0)
    phases = 2.0 * np.pi * (waves[:, 0, None, None] * x + waves[:, 1, None, None] * y[:, None])
    slope = np.broadcast_to(x - np.mean(x), values.shape)[None]
    basis = np.concatenate([np.cos(phases), np.sin(phases), slope, values[None]]) * valid
    count = np.maximum(np.sum(valid, axis=1), 1)
    basis = ((basis - np.sum(basis, axis=2, keepdims=True) / count[:, None]) * valid).reshape(len(basis), -1)
    normal = basis[:-1] @ basis[:-1].T
    normal += 1e-9 * np.trace(normal[:-1, :-1]) / (2 * len(waves)) * np.eye(len(normal))
    solution = np.linalg.solve(normal, basis[:-1] @ basis[-1])
    return np.asarray(solution[: len(waves)] - 1j * solution[len(waves) : -1])
