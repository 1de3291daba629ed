"""Coupling of the axes from sensors of both, while one axis moves and the other is at rest."""

from collections.abc import Sequence

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.base.warnings import Remark
from tablegen.calibration.laws.coupling import MOST_COUPLING, CouplingFit, loose_remarks
from tablegen.fitting.estimate import Estimate
from tablegen.numerics.arrays import Floats

_MOST_AT_REST = 0.5  # of the range of the axis that moves: the other one has less
_TURNS = 0.9  # correlation of position and time: a record of one sweep has more
_BLOCKS = 16


def fit_coupling_records(records: Sequence[tuple[str, Floats, Floats, Floats | None]]) -> CouplingFit:
    """Fit the coupling to positions of both axes, of records in each of which one axis moves and the other rests.

    Parameters
    ----------
    records
        Name, x and y in nm, and time in s where it is known, shape (n,) each.

    Raises
    ------
    Unphysical
        If both axes move, none does, or two records are of one axis.
    """
    values: dict[str, Estimate] = {}
    remarks: list[Remark] = []
    for name, x, y, time_s in records:
        key, one, notes = _slope(name, x, y, np.arange(float(len(x))) if time_s is None else time_s)
        if key in values:
            raise Unphysical(f"{name}: moves the axis of an earlier record; give one of each axis")
        if abs(one.value) > MOST_COUPLING:
            raise Unphysical(f"{name}: {key} would be {one.value:.3g}; no scanner has more than 0.5")
        values[key] = one
        remarks += notes
    if missing := [key for key in ("x_per_y", "y_per_x") if key not in values]:
        moves = missing[0][-1]
        text = f"{missing[0]} is not measured, and stays as it is: record both sensors while {moves} moves"
        remarks.append(Remark(text, code="undetermined-parameter"))
    remarks.append(Remark("an error of the sensors' own directions is taken for coupling", code="assumed-value"))
    remarks += loose_remarks(*values.values())
    return CouplingFit(values.get("x_per_y"), values.get("y_per_x"), tuple(remarks))


def _slope(name: str, x: Floats, y: Floats, time: Floats) -> tuple[str, Estimate, list[Remark]]:
    """Return the key of a record, the slope of the axis at rest over the one that moves, and remarks."""
    if len(x) < 4 * _BLOCKS:
        raise Unphysical(f"{name}: {len(x)} samples are too few; {4 * _BLOCKS} do")
    x_moves = np.ptp(x) > np.ptp(y)
    moves, rests = (x, y) if x_moves else (y, x)
    if not np.ptp(moves) > 0.0:
        raise Unphysical(f"{name}: neither axis moves")
    if np.ptp(rests) > _MOST_AT_REST * np.ptp(moves):
        raise Unphysical(f"{name}: both axes move; record both sensors while one axis moves and the other is at rest")
    key = "y_per_x" if x_moves else "x_per_y"
    place = (moves - np.mean(moves)) / np.ptp(moves)
    elapsed = (time - time[0]) / max(float(time[-1] - time[0]), 1e-300) - 0.5
    design, remarks = np.stack([place, np.ones(len(place)), elapsed, elapsed**2], axis=1), []
    if abs(np.corrcoef(place, elapsed)[0, 1]) > _TURNS:
        design = design[:, :2]
        text = f"{name}: one sweep does not tell drift of a sensor from coupling; record several, there and back"
        remarks.append(Remark(text, code="assumed-value"))
    parts = np.array_split(np.arange(len(place)), _BLOCKS)
    squares = np.array([design[part].T @ design[part] for part in parts])
    scores = np.array([design[part].T @ rests[part] for part in parts])
    slope = float(np.linalg.solve(squares.sum(axis=0), scores.sum(axis=0))[0])
    rest = np.linalg.solve(squares.sum(axis=0) - squares, (scores.sum(axis=0) - scores)[..., None])[:, 0, 0]
    error = float(np.sqrt((1.0 - 1.0 / _BLOCKS) * np.sum((rest - np.mean(rest)) ** 2)))
    span = float(np.ptp(moves))
    return key, Estimate(slope / span, error / span), remarks
