"""From trace and retrace of a nearly straight scan to the waves of the sample and a rough position error."""

from dataclasses import dataclass

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.hysteresis import BranchShape
from tablegen.images.cell_start import CellWaves, are_waves_of, cell_instead, fit_from_spots, other_cell, two_spots
from tablegen.images.model_start import fit_from_start, row_order
from tablegen.images.pair_checks import FinePeriods
from tablegen.images.periodic_model import BASES, LAG, FitState, Geometry, PeriodicModel
from tablegen.images.spots import Bend, Spot, bend_of, column_phase, row_polynomial, strongest
from tablegen.numerics.arrays import Bools, Floats, Ints
from tablegen.refinement.free_rows import ColumnModes, FreeRowsState

_MIN_TRACKED_PERIODS = 8.0  # periods in the line; with fewer a straight line is near enough to begin with
START_DEGREE = 6  # of the error in the start, from the phase along the line
_NEAR_BEND = 0.0  # of a branch that is straight


@dataclass(frozen=True, eq=False)
class LatticeStart:
    """The start of the fit; ``spots`` are rows of whole numbers, one per wave.

    ``mismatch`` is the largest distance of trace and retrace, in periods. ``model`` and ``fitted`` are the fit with a
    polynomial in the rows, from which the state comes. ``cell`` is the indexer's, if the fit began with it.
    """

    spots: Ints
    state: FreeRowsState
    mismatch: float
    model: PeriodicModel
    fitted: FitState
    cell: CellWaves | None


@dataclass(frozen=True, eq=False)
class SampleCell:
    """What decides between cells of the sample.

    ``sizes`` is True if the size of the line follows from the cell. ``area`` of the sample's cell in square pixels, by
    its constant and the scan file; ``cell`` that of an earlier frame of the same scan.
    """

    sizes: bool = False
    area: float | None = None
    cell: CellWaves | None = None


@dataclass(frozen=True, eq=False)
class _FrameImages:
    """Both images of a frame, and what is known of its columns; see ``lattice_start``."""

    geometry: Geometry
    heights: list[Floats]
    modes: ColumnModes
    moves: bool
    advice: str

    @property
    def sides(self) -> list[tuple[bool, Floats]]:
        """True if forward, and the heights, of each image."""
        return list(zip((True, False), self.heights, strict=True))


@dataclass(frozen=True, eq=False)
class _Begun:
    """The parameters of one wave, which of them are free, the offsets of the columns, and the error in the modes."""

    start: Floats
    free: Bools
    off: tuple[Floats, Floats]
    error: Floats
    mismatch: float


def lattice_start(
    geometry: Geometry,
    heights: list[Floats],
    modes: ColumnModes,
    moves: bool,
    advice: str,
    images: tuple[Floats, Floats],
    sample: SampleCell,
) -> LatticeStart:
    """Estimate the waves of a pair of images.

    Trace and retrace are taken to be less than half a period apart, since a compensated scan is nearly straight. The
    fit begins with the strongest spots, and again with the indexer's cell where these are the spots of another cell.

    Parameters
    ----------
    heights
        Levelled images of unit variance, trace then retrace, shape (rows, columns) each.
    images
        The same with their heights as they are, the left end on the left.

    Raises
    ------
    Unphysical
        If there is no period, not the same in both images, or several cells explain them.
    """
    frame = _FrameImages(geometry, heights, modes, moves, advice)
    if sample.cell is not None:
        return _started(frame, *_fit_cell(frame, sample.cell), sample.cell)
    try:
        begun = _begun(frame, strongest(geometry, heights[0]))
        model, state, _ = fit_from_start(geometry, frame.sides, begun.start, begun.free, begun.off)
    except FinePeriods:
        raise
    except Unphysical as reason:
        cell = cell_instead(reason, *images, sample.sizes, sample.area)
        return _started(frame, *_fit_cell(frame, cell), cell)
    other = other_cell(model, state, *images, sample.sizes, sample.area)
    if other is None:
        return _started(frame, begun, model, state)
    is_ruler = not sample.sizes and are_waves_of(model, state, other.vectors)
    try:
        fit = _fit_cell(frame, other)
    except Unphysical:
        if not is_ruler:
            raise
        return _started(frame, begun, model, state)
    if is_ruler and fit[2].cost > state.cost:
        return _started(frame, begun, model, state)
    return _started(frame, *fit, other)


def _fit_cell(frame: _FrameImages, cell: CellWaves) -> tuple[_Begun, PeriodicModel, FitState]:
    """Fit the visible spots of a cell."""
    spots, indices = two_spots(frame.geometry, cell)
    begun = _begun(frame, spots[0])
    fit = fit_from_spots(frame.geometry, frame.sides, begun.start, begun.free, begun.off, spots, indices)
    return begun, fit[0], fit[1]


def _started(
    frame: _FrameImages, begun: _Begun, model: PeriodicModel, state: FitState, cell: CellWaves | None = None
) -> LatticeStart:
    """Return the start of free rows from a fit with a polynomial in them."""
    x = state.parameters
    rows = model.q(x) * float(np.mean(frame.modes.requested)) + (model.s(x) @ model.y_powers[1:]).T
    free_rows = FreeRowsState(begun.error, model.q(x).copy(), state.amplitudes, rows)
    return LatticeStart(model.spots, free_rows, begun.mismatch, model, state, cell)


def _begun(frame: _FrameImages, spot: Spot) -> _Begun:
    """Begin with a spot. Raise ``Unphysical`` if the retrace does not show it as the trace does."""
    geometry, heights, modes = frame.geometry, frame.heights, frame.modes
    forward, backward, turned = (
        bend_of(geometry, image, side, spot, _NEAR_BEND)
        for image, side in ((heights[0], True), (heights[1], False), (heights[1][:, ::-1], False))
    )
    if turned.match > 1.5 * max(backward.match, 0.2 * forward.match):
        raise Unphysical(f"the retrace shows the trace's pattern only when it is mirrored; {frame.advice}")
    if backward.match < 0.3 * forward.match:
        raise Unphysical("the retrace does not show the trace's pattern; are they from one scan?")
    straight = Bend(0.5 * (forward.q + backward.q), BranchShape(), forward.match)
    polynomial = row_polynomial(geometry, heights[0], straight, spot, row_order())
    q, error, mismatch = straight.q, np.zeros(len(modes.values)), 0.0
    if q > _MIN_TRACKED_PERIODS:
        q, error, mismatch = _tracked(geometry, heights, modes, straight, polynomial, frame.moves)
    off = np.split(modes.requested + error @ modes.values - np.tile(geometry.place, 2), 2)
    start = np.zeros(BASES + 1 + row_order())
    start[LAG] = 1.0 if frame.moves else 0.0
    start[BASES], start[BASES + 1 :] = q, polynomial
    free = np.ones(len(start), bool)
    free[: LAG + 1] = False
    return _Begun(start, free, (off[0], off[1]), error, mismatch)


def _tracked(
    geometry: Geometry, heights: list[Floats], modes: ColumnModes, straight: Bend, polynomial: Floats, moves: bool
) -> tuple[float, Floats, float]:
    """Return q, the smoothest modes and the mismatch of trace and retrace, from the phase along each image."""
    tracks = [
        column_phase(geometry, image, side, straight, polynomial)
        for image, side in zip(heights, (True, False), strict=True)
    ]
    phase, whole = (np.concatenate(parts) for parts in zip(*tracks, strict=True))
    if moves:
        phase = phase - polynomial[0] / geometry.rows * modes.time
    first, second = np.split(phase - straight.q * modes.requested, 2)  # columns of late images show other positions
    inside = tracks[0][1] & tracks[1][1]
    apart = (first - second)[inside]
    turns = round(float(np.median(apart)))
    phase = phase + np.repeat([0.0, turns], geometry.columns)
    columns = np.column_stack([np.ones_like(phase), modes.requested, straight.q * modes.values.T])[whole]
    c = np.linalg.lstsq(columns, phase[whole], rcond=None)[0]
    return float(c[1]), c[2:] * straight.q / float(c[1]), float(np.max(np.abs(apart - turns)))
