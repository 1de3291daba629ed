"""Remove from the cell of an image what levelling its rows, and its edges, make of it.

A wave of one or two periods along the rows loses some of its power when they are levelled, so that the maxima of the
autocorrelation move: by 2 % of a side where the image has five periods. The same happens to an image of the fitted
waves, whose cell is known: what it is off is subtracted.
"""

import numpy as np

from tablegen.images.cell_errors import fit_cell
from tablegen.images.cell_spots import same_lattice
from tablegen.images.cell_vectors import lattice_points
from tablegen.images.image_cell import ImageCell
from tablegen.images.lattice_filters import FilteredImage, complete_region, filtered_images
from tablegen.images.missing import without_holes
from tablegen.numerics.arrays import Floats

_ORDERS = 2  # of each base wave
_ROUNDS = 3
_FINEST = 0.45  # periods a pixel
_UNCERTAIN = 0.3  # of the correction, as a standard error


def levelled_cell(heights: Floats, cell: ImageCell) -> tuple[Floats, Floats]:
    """Return the sides of a cell, and their covariance, without the shift by levelled rows.

    Parameters
    ----------
    heights
        The image, shape (rows, columns); NaN where a pixel is missing.
    cell
        Its cell.

    Returns
    -------
    tuple
        Sides in pixels, shape (2, 2), and the covariance of a_x, a_y, b_x, b_y, shape (4, 4).
    """
    image = without_holes(heights[complete_region(heights)])
    view = filtered_images(image)[0]
    vectors = cell.vectors
    for _ in range(_ROUNDS):
        model = next(one for one in filtered_images(_model(view, vectors)) if one.name == cell.filter_name)
        fit = fit_cell(model, vectors)
        if fit is None or not same_lattice(fit.vectors, vectors):
            return cell.vectors, cell.block_covariance
        vectors = np.asarray(cell.vectors - (fit.vectors - vectors), dtype=np.float64)
    shift = _UNCERTAIN * (vectors - cell.vectors).ravel()
    return vectors, np.asarray(cell.block_covariance + np.diag(shift**2), dtype=np.float64)


def _model(view: FilteredImage, vectors: Floats) -> Floats:
    """Return an image of the waves of a cell, fitted to the levelled heights, shape (rows, columns)."""
    rows, columns = view.values.shape
    y, x = np.mgrid[:rows, :columns].astype(np.float64)
    waves = lattice_points(_ORDERS) @ np.linalg.inv(vectors).T
    waves = waves[np.max(np.abs(waves), axis=1) < _FINEST]
    turns = [2.0 * np.pi * (u * x + v * y) for u, v in waves.tolist()]
    basis = np.stack([part for turn in turns for part in (np.cos(turn), np.sin(turn))])
    ramp = np.linspace(-1.0, 1.0, columns)
    level = basis - np.mean(basis, axis=2, keepdims=True)
    level -= (level @ ramp / (ramp @ ramp))[..., None] * ramp
    weighted = (level * view.weight).reshape(len(basis), -1)
    aim = (view.values * view.weight).ravel()
    normal = weighted @ weighted.T
    amplitudes = np.linalg.solve(normal + 1e-6 * np.trace(normal) / len(normal) * np.eye(len(normal)), weighted @ aim)
    return np.asarray(np.tensordot(amplitudes, basis, axes=1), dtype=np.float64)
