"""Begin the fit of a lattice with the cell of the indexer, whichever of its spots are strong."""

from dataclasses import dataclass

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.hysteresis import BranchShape
from tablegen.images.ambiguous_cell import AmbiguousCell
from tablegen.images.cell_spots import explained_spots
from tablegen.images.image_cell import ImageCell
from tablegen.images.indexer import find_cell
from tablegen.images.model_start import begin, first_wave, fit_spots, row_order, with_spots
from tablegen.images.pair_checks import MAX_PERIODS_PER_COLUMN, MIN_PERIODS, FinePeriods
from tablegen.images.periodic_model import BASES, LAG, FitState, Geometry, PeriodicModel, settle
from tablegen.images.spots import Bend, Spot, row_polynomial
from tablegen.numerics.arrays import Bools, Floats, Ints

_LEAST_SINE = 0.3  # of the angle between the waves that begin the fit
_SECOND_SMOOTHED = 0.12  # share of the frame over which the phase of the second wave is averaged
_HIGHEST = 5  # index of a spot that is fitted
_OFF = 0.25  # of a whole number: what hysteresis and drift change of the waves of one cell in two fits
_LATTICE_EXPLAINS, _GRATING_EXPLAINS = 0.95, 0.5  # of the variance: no other cell is searched above
_STRONG = 0.7  # of the largest amplitude


@dataclass(frozen=True, eq=False)
class CellWaves:
    """A cell in pixels, shape (2, 2), and its spots: waves in periods a pixel, shape (n, 2), and power, shape (n,)."""

    vectors: Floats
    waves: Floats
    power: Floats

    @classmethod
    def of(cls, cell: ImageCell) -> "CellWaves":
        """Return the waves of an indexed cell."""
        return cls(cell.vectors, cell.spots.waves[cell.explained], cell.spots.power[cell.explained])


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


class SeveralCells(Unphysical):
    """Several cells without common waves explain the image."""


def fit_sample_spots(
    geometry: Geometry,
    heights: list[Floats],
    mirrored: bool,
    trace: Floats,
    retrace: Floats | None,
    sizes: bool = True,
) -> tuple[PeriodicModel, FitState, Bools, bool]:
    """Fit from the strongest spots, and from the indexer's cell where these are the spots of another cell, or of none.

    Parameters
    ----------
    heights
        Levelled heights, shape (rows, columns) each.
    mirrored
        True if the retrace was mirrored before.
    trace, retrace
        Heights in any unit, both with the left end on the left, shape (rows, columns) each.
    sizes
        True if the size of the line follows from the cell; False if the waves are a ruler of unknown constant.

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
    try:
        spot, bends = begin(geometry, heights, mirrored)
        fit = fit_spots(geometry, heights, spot, bends)
    except FinePeriods:
        raise
    except Unphysical as reason:
        return *fit_cell_spots(geometry, heights, mirrored, cell_instead(reason, trace, retrace, sizes)), True
    cell = other_cell(*fit[:2], trace, retrace, sizes)
    if cell is None:
        return *fit, False
    try:
        other = fit_cell_spots(geometry, heights, mirrored, cell)
    except Unphysical:
        if sizes or not are_waves_of(*fit[:2], cell.vectors):
            raise
        return *fit, False
    if not sizes and other[1].cost > fit[1].cost and are_waves_of(*fit[:2], cell.vectors):
        return *fit, False
    return *other, True


def cell_instead(
    reason: Unphysical,
    trace: Floats,
    retrace: Floats | None,
    sizes: bool = True,
    expected_area: float | None = None,
) -> CellWaves:
    """Return the indexer's cell where no fit begins with the strongest spot, as that of a terrace.

    Parameters
    ----------
    reason
        Why that fit failed; raised where the indexer finds no cell.
    sizes
        True if the size of the line follows from the cell.
    trace, retrace, expected_area
        As of ``find_cell``.

    Raises
    ------
    Unphysical
        If the indexer finds no cell, or several.
    """
    try:
        return CellWaves.of(_find(trace, retrace, expected_area))
    except AmbiguousCell as several:
        return _common(several, sizes)
    except Unphysical:
        raise reason from None


def other_cell(
    model: PeriodicModel,
    state: FitState,
    trace: Floats,
    retrace: Floats | None,
    sizes: bool = True,
    expected_area: float | None = None,
) -> CellWaves | None:
    """Return the indexer's cell where the base waves of a fit are those of another one; else None.

    Parameters
    ----------
    model, state
        A fit that began with the strongest spots.
    sizes
        True if the size of the line follows from the cell. Otherwise the indexer is not asked where the fit explains
        the images, and cells that share waves are not told apart: positions are the same with each.
    trace, retrace, expected_area
        As of ``find_cell``.

    Raises
    ------
    Unphysical
        If several cells explain the image, and it matters which.
    """
    explained = 1.0 - 2.0 * state.cost / sum(float(np.vdot(image, image)) for _, image in model.images)
    if model.bases < 2 and (sizes or explained > _GRATING_EXPLAINS):
        return None
    if not sizes and explained > _LATTICE_EXPLAINS:
        return None
    try:
        cell = CellWaves.of(_find(trace, retrace, expected_area))
    except AmbiguousCell as several:
        if not sizes and all(are_waves_of(model, state, one) for one in several.cells):
            return None
        return _common(several, sizes)
    except Unphysical:
        return None
    return None if are_waves_of(model, state, cell.vectors, 1) else cell


def _find(trace: Floats, retrace: Floats | None, expected_area: float | None) -> ImageCell:
    """Find the cell, if need be without the area: where that contradicts the image, the size of the line says so."""
    try:
        return find_cell(trace, retrace, expected_area)
    except AmbiguousCell as several:
        if expected_area is None:
            raise
        try:
            return find_cell(trace, retrace)
        except Unphysical:
            raise several from None


def _common(several: AmbiguousCell, sizes: bool) -> CellWaves:
    """Return the cell that has the waves of all cells that explain an image.

    Raises
    ------
    Unphysical
        If there is none, or the size of the line would be another with each.
    """
    vectors = several.common_cell()
    if vectors is None or sizes:
        size = ", and the size of the line would be another with each" if sizes else ""
        raise SeveralCells(
            f"{str(several).partition('; ')[0]}{size}; image more periods with less noise, or choose another --channel"
        ) from None
    explained = explained_spots(vectors, several.spots)[0]
    return CellWaves(vectors, several.spots.waves[explained], several.spots.power[explained])


def are_waves_of(model: PeriodicModel, state: FitState, vectors: Floats, index: int | None = None) -> bool:
    """Return True if the base waves of a fit are waves of a cell.

    Parameters
    ----------
    vectors
        Sides of the cell in pixels, shape (2, 2).
    index
        The area of the cell over that of the base waves' cell; any if None.
    """
    geometry, x = model.geometry, state.parameters
    span = geometry.window[1] - geometry.window[0]
    waves = np.stack([model.q(x) * span / geometry.columns, model.s(x)[:, 0] / geometry.rows], axis=1)
    numbers = waves @ vectors.T
    whole = np.round(numbers)
    if np.max(np.abs(numbers - whole)) > _OFF or not np.all(np.any(whole != 0.0, axis=1)):
        return False
    return index is None or (len(whole) == 2 and abs(abs(float(np.linalg.det(whole))) - index) < 0.5)


def fit_cell_spots(
    geometry: Geometry, heights: list[Floats], mirrored: bool, cell: CellWaves
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
    spots, indices = two_spots(geometry, cell)
    _, bends = begin(geometry, heights, mirrored, spots[0])
    images, one, free, off = first_wave(geometry, heights, spots[0], bends)
    return fit_from_spots(geometry, images, one, free, off, spots, indices)


def fit_from_spots(
    geometry: Geometry,
    images: list[tuple[bool, Floats]],
    start: Floats,
    free: Bools,
    off: tuple[Floats, Floats],
    spots: tuple[Spot, Spot],
    indices: Ints,
) -> tuple[PeriodicModel, FitState, Bools]:
    """Fit two spots of a cell, from the parameters of the first one, then all visible spots.

    Parameters
    ----------
    images, start, free, off
        As of ``fit_from_start``.
    indices
        Whole numbers of the cell's waves, shape (2 spots, 2).

    Returns
    -------
    tuple
        The model with the bases of the cell, its state at the fitted parameters, and the parameters that are free.
    """
    model = PeriodicModel(geometry, images, [(1,)], row_order(), off)
    state = settle(model, start, free)
    q = spots[1].q * float(model.q(state.parameters)[0]) / spots[0].q
    bend = Bend(q, BranchShape.at(state.parameters[:2]), 0.0)
    second = row_polynomial(geometry, images[0][1], bend, spots[1], row_order(), _SECOND_SMOOTHED)
    strong = np.stack([state.parameters[BASES:], np.concatenate([[bend.q], second])])
    change, bases = _bases(indices, strong)
    start = np.concatenate([state.parameters[:BASES], bases.ravel()])
    free = np.append(free, np.ones(1 + row_order(), bool))
    model = PeriodicModel(geometry, images, [tuple(row) for row in change.tolist()], row_order(), off)
    state = settle(model, start, free)
    free = free.copy()
    free[LAG] = len(images) == 2 or free[LAG]  # two directions tell a shift in y from one in x
    for _ in range(2):
        model = with_spots(model, state, _HIGHEST)
        state = settle(model, state.parameters, free)
    return model, state, free


def two_spots(geometry: Geometry, cell: CellWaves) -> tuple[tuple[Spot, Spot], Ints]:
    """Return two strong spots of a cell, and their whole numbers of its waves, shape (2, 2).

    Raises
    ------
    Unphysical
        If no wave of the cell runs across the lines, or one is visible alone.
    """
    extent = np.array([geometry.columns, geometry.rows])
    waves, power = cell.waves * extent, cell.power
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
    span = geometry.window[1] - geometry.window[0]
    one, two = (Spot(float(q) / span, float(s), 0.0) for q, s in waves[both])
    return (one, two), index[both]


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
