"""The shift of the retrace against the trace, with its error."""

from dataclasses import dataclass

import numpy as np

from tablegen.images.cell_errors import block_sums, parabola_maxima
from tablegen.images.image_cell import ImageCell
from tablegen.images.lattice_filters import filtered_images
from tablegen.numerics.arrays import Floats

_SAMPLES = 100
_BLOCKS = 4  # to a side


@dataclass(frozen=True, eq=False)
class DirectionShift:
    """Shift x, y in pixels of the retrace against the trace, its standard errors, and the correlation there."""

    pixels: Floats
    errors: Floats
    correlation: float


def direction_shift(trace: Floats, retrace: Floats, cell: ImageCell) -> DirectionShift:
    """Return the mean shift between both directions: the nearest maximum of their correlation.

    The part of the image is that in which the cell was found.

    Parameters
    ----------
    trace, retrace
        Heights, shape (rows, columns) each.
    cell
        The cell of the trace: a shift of more than half a side cannot be told from a smaller one.
    """
    block, vectors = cell.part.block, cell.vectors / cell.part.block
    one, other = (filtered_images(cell.part.of(heights))[0] for heights in (trace, retrace))
    spectra = [np.fft.rfft2(image.weighted) for image in (one, other)]
    rows, columns = one.values.shape
    match = np.fft.irfft2(np.conj(spectra[0]) * spectra[1], (rows, columns))
    y = (np.arange(rows) + rows // 2) % rows - rows // 2
    x = (np.arange(columns) + columns // 2) % columns - columns // 2
    reach = 0.5 * float(np.max(np.hypot(*vectors.T)))
    far = np.hypot(x[None, :], y[:, None]) > reach
    row, column = np.unravel_index(int(np.argmax(np.where(far, -np.inf, match))), match.shape)
    middle = np.array([[int(x[column]), int(y[row])]])
    step = max(1, round(0.06 * float(np.min(np.hypot(*vectors.T)))))
    patch = [(int(middle[0, 0]) + step * i, int(middle[0, 1]) + step * j) for j in (-1, 0, 1) for i in (-1, 0, 1)]
    sums = np.array([block_sums(one, other, lag, _BLOCKS) for lag in patch])
    blocks = sums.shape[-1]
    draws = np.random.default_rng(26).multinomial(blocks, np.full(blocks, 1.0 / blocks), _SAMPLES)
    draws = np.concatenate([np.ones((1, blocks)), draws])
    product, window = np.moveaxis(np.einsum("kwb,db->dkw", sums, draws), -1, 0)
    places, _ = parabola_maxima((product / np.maximum(window, 1e-300))[:, None], middle, step)
    power = [float(np.sum(image.weighted**2)) for image in (one, other)]
    return DirectionShift(
        block * places[0, 0],
        block * np.std(places[1:, 0], axis=0),
        float(np.max(match[~far]) / np.sqrt(np.prod(power))),
    )
