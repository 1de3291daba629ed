"""From trace and retrace of a nearly straight scan to the waves of the sample and a rough position error."""

from dataclasses import dataclass

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.hysteresis import BranchShape
from tablegen.images.model_start import fit_from_start, row_order
from tablegen.images.periodic_model import BASES, LAG, FitState, Geometry, PeriodicModel
from tablegen.images.spots import Bend, bend_of, column_phase, row_polynomial, strongest
from tablegen.numerics.arrays import Floats, Ints
from tablegen.refinement.free_rows import ColumnModes, FreeRowsState

_MIN_TRACKED_PERIODS = 8.0  # periods in the line; with fewer a straight line is near enough to begin with
START_DEGREE = 6  # of the error in the start, from the phase along the line
_NEAR_BEND = 0.0  # of a branch that is straight


@dataclass(frozen=True, eq=False)
class LatticeStart:
    """The start of the fit; ``spots`` are rows of whole numbers, one per wave.

    ``mismatch`` is the largest distance of trace and retrace, in periods. ``model`` and ``fitted`` are the fit with a
    polynomial in the rows, from which the state comes.
    """

    spots: Ints
    state: FreeRowsState
    mismatch: float
    model: PeriodicModel
    fitted: FitState


def lattice_start(
    geometry: Geometry, heights: list[Floats], modes: ColumnModes, moves: bool, advice: str
) -> LatticeStart:
    """Estimate the waves of a pair of images.

    Trace and retrace are taken to be less than half a period apart, since a compensated scan is nearly straight.

    Parameters
    ----------
    heights
        Levelled images of unit variance, trace then retrace, shape (rows, columns) each.

    Raises
    ------
    Unphysical
        If there is no period, or not the same in both images.
    """
    spot = strongest(geometry, heights[0])
    forward, backward, turned = (
        bend_of(geometry, image, side, spot, _NEAR_BEND)
        for image, side in ((heights[0], True), (heights[1], False), (heights[1][:, ::-1], False))
    )
    if turned.match > 1.5 * max(backward.match, 0.2 * forward.match):
        raise Unphysical(f"the retrace shows the trace's pattern only when it is mirrored; {advice}")
    if backward.match < 0.3 * forward.match:
        raise Unphysical("the retrace does not show the trace's pattern; are they from one scan?")
    straight = Bend(0.5 * (forward.q + backward.q), BranchShape(), forward.match)
    polynomial = row_polynomial(geometry, heights[0], straight, spot, row_order())
    q, error, mismatch = straight.q, np.zeros(len(modes.values)), 0.0
    if q > _MIN_TRACKED_PERIODS:
        q, error, mismatch = _tracked(geometry, heights, modes, straight, polynomial, moves)
    off = np.split(modes.requested + error @ modes.values - np.tile(geometry.place, 2), 2)
    start = np.zeros(BASES + 1 + row_order())
    start[LAG] = 1.0 if moves else 0.0
    start[BASES], start[BASES + 1 :] = q, polynomial
    free = np.ones(len(start), bool)
    free[: LAG + 1] = False
    sides = list(zip((True, False), heights, strict=True))
    model, state, _ = fit_from_start(geometry, sides, start, free, (off[0], off[1]))
    x = state.parameters
    rows = model.q(x) * float(np.mean(modes.requested)) + (model.s(x) @ model.y_powers[1:]).T
    begun = FreeRowsState(error, model.q(x).copy(), state.amplitudes, rows)
    return LatticeStart(model.spots, begun, mismatch, model, state)


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
    first, second = np.split(phase, 2)
    inside = tracks[0][1] & tracks[1][1]
    turns = round(float(np.median((first - second)[inside])))
    second = second + turns
    phase = np.concatenate([first, second])
    columns = np.column_stack([np.ones_like(phase), modes.requested, straight.q * modes.values.T])[whole]
    c = np.linalg.lstsq(columns, phase[whole], rcond=None)[0]
    return float(c[1]), c[2:] * straight.q / float(c[1]), float(np.max(np.abs((first - second)[inside])))
