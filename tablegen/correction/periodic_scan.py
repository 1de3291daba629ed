"""Where a scan of a periodic sample really was, by a fit to its own images.

The phase of the sample's waves is straight in x. The fit of ``calibrate images`` begins; then x of each direction is
bent freely, by a series that follows what the branches of (17) leave, and the waves are fitted again. Of a lattice the
phases of two waves also tell y from a drift of x. A grating tells neither, and its rows stay.
"""

from dataclasses import dataclass
from math import hypot

import numpy as np

from tablegen.calibration.image_fit import check_fit
from tablegen.calibration.image_model import begin, grown, prepared
from tablegen.calibration.periodic import BASES, LAG, FitState, PeriodicModel, settle
from tablegen.correction.distortion import Distortion, Sweep1D
from tablegen.numerics.arrays import Bools, Floats
from tablegen.problems import Unphysical

_MOST_BENDS = 20  # terms of what the branches leave, in each direction
_LEAST_BENDS = 5
_BENDS_A_PERIOD = 1.2  # terms; what is finer than a period passes for the shape of the sample
_ROW_BENDS = 20  # terms of what the polynomial in the rows leaves of a phase
_ROUNDS = 40
_SETTLED = 1e-4  # of the line and of the frame: the largest change in a round
_STIFFNESS = 1e-9  # of the penalty on n^4, against the mean square of what a term does
_LEAST_ANGLE = 0.2  # sine of the angle between two waves that tell y from x


@dataclass(frozen=True, eq=False)
class PeriodicScan:
    """What a fit to images says of their scan.

    ``distortion`` has x in lines, 0..1 about, and y in frames. ``waves`` are the base vectors of the sample, in periods
    a line and a frame, shape (bases, 2). ``explained`` is the share of the contrast that is periodic, ``tells_y``
    whether y is that of the sample and not of the rows.
    """

    distortion: Distortion
    waves: Floats
    explained: float
    tells_y: bool

    def size_of(self, pitch: float, aspect: float) -> float:
        """The length of the line where the longest period of the sample is ``pitch``, of the same unit.

        ``aspect`` is the height of the frame over the length of the line. Raises ``Unphysical`` without a frame.
        """
        least = min(hypot(q, s / aspect) for q, s in self.waves.tolist())
        return pitch * least


def periodic_scan(
    trace: Floats,
    retrace: Floats,
    turn: float = 0.5,
    window: tuple[float, float] = (0.0, 1.0),
    retrace_mirrored: bool = False,
    delay_pixels: float = 0.0,
) -> PeriodicScan:
    """Both images rows x columns of heights in any unit, rows in the order of time; as for ``fit_pair``.

    Raises ``Unphysical`` where the images do not show one periodic sample, or too little of it.
    """
    if retrace_mirrored:
        retrace = np.ascontiguousarray(retrace[:, ::-1])
    geometry, heights = prepared(trace, retrace, turn, window, delay_pixels)
    spot, bends = begin(geometry, heights, retrace_mirrored)
    model, state, free = grown(geometry, heights, spot, bends)
    check_fit(model, state, free)
    model, state = _bent(model, state, free)
    return _scan(model, state)


def _bent(model: PeriodicModel, state: FitState, free: Bools) -> tuple[PeriodicModel, FitState]:
    """With x bent freely, both directions by themselves, and the phases along the rows too."""
    free = free.copy()
    free[:4] = False  # the branches stay; what bends more is added to them
    geometry = model.geometry
    q = float(model.q(state.parameters)[0])
    bends = _series(geometry.columns, int(np.clip(round(_BENDS_A_PERIOD * q), _LEAST_BENDS, _MOST_BENDS)))
    row_bends = _series(geometry.rows, _ROW_BENDS)
    change = np.inf
    for _ in range(_ROUNDS):
        bent = [_more_x(bends, left, steep) for left, steep in zip(state.left, state.steepness, strict=True)]
        more = _without_line(bent, [model.columns(state.parameters, way).x for way, _ in model.images])
        rows = _more_phase(row_bends, state.left, model.phase_slopes(state))
        change = max(float(np.max(np.abs(one))) for one in (*more, rows / q))
        model = model.with_offsets((model.off[0] + more[0], model.off[1] + more[1]), model.row_off + rows)
        state = settle(model, state.parameters, free)
        if change < _SETTLED:
            return model, state
    raise Unphysical(
        f"the fit does not settle, up to {100.0 * change:.2g} % of the line is left; is it one scan of a periodic "
        "sample?"
    )


def _series(count: int, terms: int) -> Floats:
    """(terms, count): Chebyshev polynomials, which follow a sweep best where it turns."""
    place = (2.0 * np.arange(count) + 1.0) / count - 1.0
    found: Floats = np.polynomial.chebyshev.chebvander(place, min(terms, count // 3) - 1).T
    return found


def _penalty(terms: int, normal: Floats) -> Floats:
    """What keeps the series smooth where nothing else does."""
    n = np.arange(terms, dtype=np.float64)
    found: Floats = _STIFFNESS * float(np.mean(np.diag(normal))) * (n**4 + 1e-3)
    return found


def _more_x(basis: Floats, left: Floats, steep: Floats) -> Floats:
    """By how much x of each column is to be more, by least squares over all rows."""
    weight, aim = np.sum(steep**2, axis=0), np.sum(steep * left, axis=0)
    normal = (basis * weight) @ basis.T
    normal += np.diag(_penalty(len(basis), normal))
    found: Floats = np.linalg.solve(normal, basis @ aim) @ basis
    return found


def _without_line(more: list[Floats], places: list[Floats]) -> list[Floats]:
    """Less what all have in common as a line in x: that is the sample's place and its period."""
    line = np.polyfit(np.concatenate(places), np.concatenate(more), 1)
    return [np.asarray(one - np.polyval(line, x)) for one, x in zip(more, places, strict=True)]


def _more_phase(basis: Floats, left: tuple[Floats, ...], slopes: list[Floats]) -> Floats:
    """By how much the phase of each base vector is to be more in each row, less a line: (bases, rows)."""
    count, bases = len(basis), len(slopes[0])
    normal, aim = np.zeros((bases * count, bases * count)), np.zeros(bases * count)
    for image, slope in zip(left, slopes, strict=True):
        for i in range(bases):
            part = slice(i * count, (i + 1) * count)
            aim[part] += basis @ np.sum(slope[i] * image, axis=1)
            for j in range(bases):
                weight = np.sum(slope[i] * slope[j], axis=1)
                normal[part, j * count : (j + 1) * count] += (basis * weight) @ basis.T
    normal += np.diag(np.tile(_penalty(count, normal), bases))
    found = np.linalg.solve(normal, aim).reshape(bases, count) @ basis
    rows = np.arange(found.shape[1], dtype=np.float64)
    return np.stack([one - np.polyval(np.polyfit(rows, one, 1), rows) for one in found])


def _scan(model: PeriodicModel, state: FitState) -> PeriodicScan:
    geometry, parameters = model.geometry, state.parameters
    rows = geometry.rows
    q = model.q(parameters)
    times = np.arange(rows + 1) / rows - 0.5
    powers = times ** np.arange(1, model.order + 1)[:, None]
    phases = model.s(parameters) @ powers  # (bases, rows + 1)
    phases += np.stack([_at_edges(one) for one in model.row_off])
    slopes = np.array([np.polynomial.polynomial.polyfit(times, phase, 1)[1] for phase in phases])
    tells_y = model.bases == 2 and _independent(q, slopes)
    if tells_y:
        drift, y = np.linalg.solve(np.stack([q, slopes], axis=1), phases)
        drift = drift - np.polynomial.polynomial.polyval(times, np.polynomial.polynomial.polyfit(times, drift, 1))
    else:
        y, drift = times, np.zeros(rows + 1)
    sweeps = {}
    for forward, _ in model.images:
        column = model.columns(parameters, forward)
        sweeps[forward] = Sweep1D(column.x, column.time + 0.5)
    left = min(float(np.min(one.x)) for one in sweeps.values())
    found = Distortion(
        rows,
        geometry.columns,
        _from(sweeps.get(True), left),
        _from(sweeps.get(False), left),
        y - y[0],
        drift,
        float(parameters[LAG]),
    )
    found.check()
    total = sum(float(np.vdot(image, image)) for _, image in model.images)
    return PeriodicScan(found, np.stack([q, slopes], axis=1), 1.0 - 2.0 * state.cost / total, tells_y)


def _at_edges(values: Floats) -> Floats:
    """At the edges of the rows what is known at their middles."""
    outer = 1.5 * values[[0, -1]] - 0.5 * values[[1, -2]]
    return np.concatenate([outer[:1], 0.5 * (values[1:] + values[:-1]), outer[1:]])


def _from(sweep: Sweep1D | None, left: float) -> Sweep1D | None:
    """The same counted from ``left``."""
    return None if sweep is None else Sweep1D(sweep.x - left, sweep.time)


def _independent(q: Floats, s: Floats) -> bool:
    """Whether two waves differ enough in direction."""
    cross = float(q[0] * s[1] - q[1] * s[0])
    return abs(cross) > _LEAST_ANGLE * hypot(q[0], s[0]) * hypot(q[1], s[1])
