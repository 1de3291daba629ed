"""Begin the fit of a lattice with the cell of the indexer, whichever of its spots are strong."""

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.images.indexer import AmbiguousCell, ImageCell, find_cell
from tablegen.images.model_start import begin, first_wave, fit_spots, row_order, with_spots
from tablegen.images.pair_checks import MAX_PERIODS_PER_COLUMN, MIN_PERIODS
from tablegen.images.periodic_model import BASES, LAG, FitState, Geometry, PeriodicModel, settle
from tablegen.images.spots import Bend, Spot, row_polynomial
from tablegen.numerics.arrays import Bools, Floats, Ints

_LEAST_SINE = 0.3  # of the angle between the waves that begin the fit
_SECOND_SMOOTHED = 0.12  # share of the frame over which the phase of the second wave is averaged
_HIGHEST = 5  # index of a spot that is fitted
_SAME_AREA = 0.75, 1.35  # ratios of the areas of one cell in two fits: hysteresis and drift change them less
_STRONG = 0.7  # of the largest amplitude


def cell_of(
    trace: Floats, retrace: Floats | None, expected_area: float | None = None
) -> tuple[ImageCell | None, AmbiguousCell | None]:
    """Return the cell of the trace, None where the indexer finds none; and the reason where it finds several.

    Parameters
    ----------
    trace, retrace
        Heights in any unit, shape (rows, columns).
    expected_area
        Area of the sample's cell in square pixels by the size in the file.
    """
    try:
        return find_cell(trace, retrace, expected_area), None
    except AmbiguousCell as reason:
        return None, reason
    except Unphysical:
        return None, None


def fit_sample_spots(
    geometry: Geometry, heights: list[Floats], mirrored: bool, trace: Floats, retrace: Floats | None
) -> tuple[PeriodicModel, FitState, Bools, bool]:
    """Fit from the strongest spots, and from the indexer's cell where these are the spots of another cell.

    Parameters
    ----------
    heights
        Levelled heights, shape (rows, columns) each.
    mirrored
        True if the retrace was mirrored before.
    trace, retrace
        Heights in any unit, both with the left end on the left, shape (rows, columns) each.

    Returns
    -------
    tuple
        The model, its state at the fitted parameters, the parameters that are free, shape (parameters,), and True if
        the fit began with the indexer's cell.

    Raises
    ------
    Unphysical
        If several cells explain the image, or no fit does.
    """
    spot, bends = begin(geometry, heights, mirrored)
    fit = fit_spots(geometry, heights, spot, bends)
    if fit[0].bases < 2:
        return *fit, False
    try:
        cell = find_cell(trace, retrace)
    except AmbiguousCell as reason:
        cells = str(reason).partition("; ")[0]
        raise Unphysical(
            f"{cells}, and the size of the line would be another with each; image more periods with less noise, or "
            f"choose another --channel"
        ) from None
    except Unphysical:
        return *fit, False
    if _SAME_AREA[0] < _area_ratio(*fit[:2], cell) < _SAME_AREA[1]:
        return *fit, False
    return *fit_cell_spots(geometry, heights, mirrored, cell), True


def _area_ratio(model: PeriodicModel, state: FitState, cell: ImageCell) -> float:
    """Return the area of a cell over that of the fitted base waves."""
    geometry = model.geometry
    (first, second), (first_s, second_s) = model.q(state.parameters), model.s(state.parameters)[:, 0]
    span = geometry.window[1] - geometry.window[0]
    return abs(float(first * second_s - second * first_s)) * span / cell.cells


def fit_cell_spots(
    geometry: Geometry, heights: list[Floats], mirrored: bool, cell: ImageCell
) -> tuple[PeriodicModel, FitState, Bools]:
    """Fit two strong spots of a cell, then all visible ones. The bases of the model are those of the cell.

    Parameters
    ----------
    heights
        Levelled heights, shape (rows, columns) each.
    mirrored
        True if the retrace was mirrored before.

    Returns
    -------
    tuple
        The model, its state at the fitted parameters, and the parameters that are free, shape (parameters,).

    Raises
    ------
    Unphysical
        If no wave of the cell runs across the lines, or the images do not belong together.
    """
    waves, indices = _two_spots(geometry, cell)
    span = geometry.window[1] - geometry.window[0]
    spots = [Spot(float(q) / span, float(s), 0.0) for q, s in waves]
    _, bends = begin(geometry, heights, mirrored, spots[0])
    images, one, free, off = first_wave(geometry, heights, spots[0], bends)
    model = PeriodicModel(geometry, images, [(1,)], row_order(), off)
    state = settle(model, one, free)
    shape = state.parameters[:2]
    bend = Bend(spots[1].q * float(model.q(state.parameters)[0]) / spots[0].q, bends[0].shape.at(shape), 0.0)
    second = row_polynomial(geometry, heights[0], bend, spots[1], row_order(), _SECOND_SMOOTHED)
    strong = np.stack([state.parameters[BASES:], np.concatenate([[bend.q], second])])
    change, bases = _bases(indices, strong)
    start = np.concatenate([state.parameters[:BASES], bases.ravel()])
    free = np.append(free, np.ones(1 + row_order(), bool))
    model = PeriodicModel(geometry, images, [tuple(row) for row in change.tolist()], row_order(), off)
    state = settle(model, start, free)
    free = free.copy()
    free[LAG] = len(images) == 2 or free[LAG]
    for _ in range(2):
        model = with_spots(model, state, _HIGHEST)
        state = settle(model, state.parameters, free)
    return model, state, free


def _two_spots(geometry: Geometry, cell: ImageCell) -> tuple[Floats, Ints]:
    """Return two strong waves of a cell in periods along the line and the frame, and their indices."""
    extent = np.array([geometry.columns, geometry.rows])
    waves = cell.spots.waves[cell.explained] * extent
    power = cell.spots.power[cell.explained]
    waves = np.where(waves[:, :1] < 0.0, -waves, waves)
    index = np.round(waves / extent @ cell.vectors.T).astype(np.int64)
    along = waves[:, 0]
    fine = along <= MAX_PERIODS_PER_COLUMN * geometry.columns
    score = power * along * (fine & (along >= MIN_PERIODS) & np.any(index != 0, axis=1))
    if not len(score) or not np.max(score) > 0.0:
        raise Unphysical(
            f"the lattice has no visible wave of {MIN_PERIODS:g} periods or more along the line; scan more periods"
        )
    first = int(np.argmax(score))
    sine = np.abs(waves[first, 0] * waves[:, 1] - waves[first, 1] * waves[:, 0]) / (
        np.hypot(*waves[first]) * np.hypot(*waves.T)
    )
    other = power * (sine > _LEAST_SINE) * (np.abs(index @ [index[first, 1], -index[first, 0]]) > 0) * fine
    if not np.max(other) > 0.0:
        raise Unphysical("the lattice has one visible wave alone; image more periods with less noise")
    both = [first, int(np.argmax(other))]
    return waves[both], index[both]


def _bases(indices: Ints, strong: Floats) -> tuple[Ints, Floats]:
    """Return the indices of two waves in a basis, and its parameters: the base of most periods a line comes first."""
    bases = np.linalg.solve(indices.astype(np.float64), strong)
    change = indices.copy()
    if abs(bases[1, 0]) > abs(bases[0, 0]):
        bases, change = bases[::-1], change[:, ::-1]
    signs = np.where(bases[:, :1] < 0.0, -1, 1)
    return change * signs.T, np.asarray(bases * signs, dtype=np.float64)


def strong_index(model: PeriodicModel, state: FitState) -> int:
    """Return the index of the lattice of the strong spots in that of all spots; 1 where they have one direction."""
    amplitudes = np.abs(state.amplitudes)
    strong = model.spots[amplitudes > _STRONG * np.max(amplitudes)]
    if model.bases < 2 or np.linalg.matrix_rank(strong) < 2:
        return 1
    minors = strong[:, :1] * strong[:, 1] - strong[:, 1:] * strong[:, 0]
    return int(np.gcd.reduce(np.abs(minors), axis=None))
