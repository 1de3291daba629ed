"""Where a scan of a periodic sample really was, by a fit to its own images.

The phase of the sample's waves is straight in x. The fit of ``calibrate images`` begins; then x of each direction is
bent freely, by a series that follows what the branches of (17) leave, and the waves are fitted again. Of a lattice the
phases of two waves also tell y from a drift of x. A grating tells neither, and its rows stay.
"""

from dataclasses import dataclass
from math import hypot

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d

from tablegen.base.input_errors import Unphysical
from tablegen.correction.distortion import Distortion, Sweep1D
from tablegen.images.model_start import begin, fit_spots, prepare_heights
from tablegen.images.pair_fit import check_fit
from tablegen.images.periodic_model import LAG, FitState, PeriodicModel, settle
from tablegen.numerics.arrays import Bools, Floats

Complexes = npt.NDArray[np.complex128]
_MOST_BENDS = 20  # terms of what the branches leave, in each direction
_LEAST_BENDS = 5
_BENDS_A_PERIOD = 1.7  # terms; what is finer than a period passes for the shape of the sample
_SAME_WAVE = 2.0  # periods in the line: nearer waves are not told apart by a line
_AVERAGED = 0.45  # of a period against another wave: the standard deviation of a mean that leaves 2 % of it
_ROW_BENDS = 20  # terms of what the polynomial in the rows leaves of a phase
_FOLLOWING = 0.5  # of what a step of a phase differs from the one before
_ROUNDS = 40
_SETTLED = 1e-4  # of the line and of the frame: the largest change in a round
_STIFFNESS = 1e-6  # of the penalty on n^4, against the mean square of what a term does
_MOST_BENT_LATTICE = 0.5  # by how much a frame may be higher than wide, or sheared, in all
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

    def of_pitch(self, pitch_nm: float, aspect: float) -> Distortion:
        """Return the distortion in nm, where bars of a grating, or densest rows of a lattice, are ``pitch_nm`` apart.

        ``aspect`` is the height of the frame over the length of the line.
        """
        length = pitch_nm * min(hypot(q, s / aspect) for q, s in self.waves.tolist())
        return _scaled(self.distortion, length, length * aspect, 0.0)

    def of_lattice(self, constant_nm: float) -> Distortion:
        """Return the distortion in nm, where the sample is a hexagonal or a square lattice of this constant.

        The lattice may be turned. This gives the height of the frame too, and the shear of a steady drift.

        Raises
        ------
        Unphysical
            If the sample is no such lattice.
        """
        if not self.tells_y:
            raise Unphysical("the images show waves of one direction; for a grating give its pitch, not a lattice")
        readings = []
        for angle in (60.0, 90.0, 120.0):
            k = constant_nm * np.sin(np.radians(angle))
            turned = np.radians(angle)
            ideal = np.array([[1.0, 0.0], [np.cos(turned), np.sin(turned)]]) / k  # waves, periods a nm
            apart = np.linalg.inv(ideal)
            frame = apart @ self.waves  # from frames to nm, turned
            metric = np.linalg.cholesky(frame.T @ frame).T
            across, shear, along = float(metric[0, 0]), float(metric[0, 1]), float(metric[1, 1])
            readings.append((abs(np.log(along / across)) + abs(shear / across), across, along, shear))
        worst, across, along, shear = min(readings)
        if worst > _MOST_BENT_LATTICE:
            raise Unphysical(
                f"as a hexagonal or square lattice the frame would be {across:.4g} x {along:.4g} nm and sheared by "
                f"{shear:.4g} nm; is the sample such a lattice, and was the frame as high as its lines are long?"
            )
        return _scaled(self.distortion, across, along, shear)


def _scaled(distortion: Distortion, across: float, along: float, shear: float) -> Distortion:
    """Lines of a length and frames of a height in nm, the last line further right by ``shear``."""
    drift = across * distortion.drift + shear * (distortion.y - 0.5 * (distortion.y[0] + distortion.y[-1]))
    sides = [
        None if one is None else Sweep1D(across * one.x, one.time) for one in (distortion.forward, distortion.backward)
    ]
    return Distortion(
        distortion.rows, distortion.columns, sides[0], sides[1], along * distortion.y, drift, distortion.lag
    )


def periodic_scan(
    trace: Floats,
    retrace: Floats | None = None,
    turn: float = 0.5,
    window: tuple[float, float] = (0.0, 1.0),
    retrace_mirrored: bool = False,
    delay_pixels: float = 0.0,
) -> PeriodicScan:
    """Fit images, rows x columns of heights in any unit, rows in the order of time; or a trace alone.

    Raises
    ------
    Unphysical
        If the images do not show one periodic sample, or too little of it.
    """
    if retrace_mirrored and retrace is not None:
        retrace = np.ascontiguousarray(retrace[:, ::-1])
    geometry, heights = prepare_heights(trace, retrace, turn, window, delay_pixels)
    spot, bends = begin(geometry, heights, retrace_mirrored)
    model, state, free = fit_spots(geometry, heights, spot, bends)
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
    waves = model.row_waves(state)
    phases = np.stack([_followed(_without_others(model, state, base, wave)) for base, wave in enumerate(waves)])
    along = phases @ np.linalg.pinv(row_bends)  # coefficients of all that is added, for what keeps it smooth
    across = [np.zeros(len(bends)) for _ in model.images]
    model = model.with_offsets(model.off, _less_line(along @ row_bends))
    state = settle(model, state.parameters, free)
    change = np.inf
    for _ in range(_ROUNDS):
        by = [_more_x(bends, *one) for one in zip(state.residuals, state.steepness, across, strict=True)]
        across = [one + step for one, step in zip(across, by, strict=True)]
        more = _without_line(
            [step @ bends for step in by], [model.columns(state.parameters, way).x for way, _ in model.images]
        )
        off = [one + step for one, step in zip(model.off, [*more, np.zeros_like(more[0])], strict=False)]
        ahead = _more_phase(row_bends, state.residuals, model.phase_slopes(state), along)
        along = along + ahead
        rows = _less_line(ahead @ row_bends)
        change = max(float(np.max(np.abs(one))) for one in (*more, rows / q))
        model = model.with_offsets((off[0], off[1]), model.row_off + rows)
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
    series = np.polynomial.chebyshev.chebvander(place, min(terms, count // 3) - 1)
    return np.asarray(series.T, dtype=np.float64)


def _penalty(terms: int, normal: Floats) -> Floats:
    """Return the penalty that keeps the series smooth where nothing else does."""
    n = np.arange(terms, dtype=np.float64)
    penalty: Floats = _STIFFNESS * float(np.mean(np.diag(normal))) * (n**4 + 1e-3)
    return penalty


def _more_x(basis: Floats, residual: Floats, steep: Floats, known: Floats) -> Floats:
    """By how much more of each term x of the columns is to have than ``known``, by least squares over all rows."""
    weight, aim = np.sum(steep**2, axis=0), np.sum(steep * residual, axis=0)
    normal = (basis * weight) @ basis.T
    penalty = _penalty(len(basis), normal)
    step: Floats = np.linalg.solve(normal + np.diag(penalty), basis @ aim - penalty * known)
    return step


def _without_line(more: list[Floats], places: list[Floats]) -> list[Floats]:
    """Less what all have in common as a line in x: that is the sample's place and its period."""
    line = np.polyfit(np.concatenate(places), np.concatenate(more), 1)
    return [np.asarray(one - np.polyval(line, x), np.float64) for one, x in zip(more, places, strict=True)]


def _more_phase(basis: Floats, residuals: tuple[Floats, ...], slopes: list[Floats], known: Floats) -> Floats:
    """Return the step of the phase of each base vector along the rows: (bases, terms)."""
    count, bases = len(basis), len(slopes[0])
    normal, aim = np.zeros((bases * count, bases * count)), np.zeros(bases * count)
    for image, slope in zip(residuals, slopes, strict=True):
        for i in range(bases):
            part = slice(i * count, (i + 1) * count)
            aim[part] += basis @ np.sum(slope[i] * image, axis=1)
            for j in range(bases):
                weight = np.sum(slope[i] * slope[j], axis=1)
                normal[part, j * count : (j + 1) * count] += (basis * weight) @ basis.T
    penalty = np.tile(_penalty(count, normal), bases)
    step = np.linalg.solve(normal + np.diag(penalty), aim - penalty * known.ravel())
    return np.asarray(step.reshape(bases, count), dtype=np.float64)


def _without_others(model: PeriodicModel, state: FitState, base: int, wave: Complexes) -> Complexes:
    """Return a base vector's wave in the rows, averaged so that waves of as many periods in the line vanish."""
    q, s = model.q(state.parameters), model.s(state.parameters)[:, 0]
    nearest = np.inf
    for spot in (*model.spots, *-model.spots):
        beside, ahead = float(spot @ q - q[base]), float(spot @ s - s[base])
        if abs(beside) < _SAME_WAVE and abs(ahead) > _SAME_WAVE:
            nearest = min(nearest, abs(ahead))
    width = _AVERAGED * model.geometry.rows / nearest
    if width < 0.1:
        return wave
    return np.asarray(gaussian_filter1d(wave.real, width) + 1j * gaussian_filter1d(wave.imag, width))


def _followed(wave: Complexes) -> Floats:
    """Unwrap the phase of each row in periods, from the middle outwards: each step is near the one before."""
    seen = np.angle(wave) / (2.0 * np.pi)
    out = seen.copy()
    middle = len(seen) // 2
    for way in (1, -1):
        step = 0.0
        for k in range(middle + way, len(seen) if way > 0 else -1, way):
            guess = out[k - way] + step
            out[k] = seen[k] + np.round(guess - seen[k])
            step += _FOLLOWING * (out[k] - out[k - way] - step)
    return out


def _less_line(phases: Floats) -> Floats:
    """Each row less its best line."""
    rows = np.arange(phases.shape[1], dtype=np.float64)
    return np.stack([one - np.polyval(np.polyfit(rows, one, 1), rows) for one in phases])


def _scan(model: PeriodicModel, state: FitState) -> PeriodicScan:
    geometry, parameters = model.geometry, state.parameters
    rows = geometry.rows
    q = model.q(parameters)
    times = np.arange(rows + 1) / rows - 0.5
    powers = times ** np.arange(1, model.order + 1)[:, None]
    phases = model.s(parameters) @ powers  # (bases, rows + 1)
    phases = phases + np.stack([_at_edges(one) for one in model.row_off])
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
    edge = min(float(np.min(one.x)) for one in sweeps.values())
    distortion = Distortion(
        rows,
        geometry.columns,
        _from(sweeps.get(True), edge),
        _from(sweeps.get(False), edge),
        y - y[0],
        drift,
        float(parameters[LAG]),
    )
    distortion.check()
    total = sum(float(np.vdot(image, image)) for _, image in model.images)
    return PeriodicScan(distortion, np.stack([q, slopes], axis=1), 1.0 - 2.0 * state.cost / total, tells_y)


def _at_edges(values: Floats) -> Floats:
    """At the edges of the rows what is known at their middles."""
    outer = 1.5 * values[[0, -1]] - 0.5 * values[[1, -2]]
    return np.concatenate([outer[:1], 0.5 * (values[1:] + values[:-1]), outer[1:]])


def _from(sweep: Sweep1D | None, edge: float) -> Sweep1D | None:
    """Return the sweep counted from ``edge``."""
    return None if sweep is None else Sweep1D(sweep.x - edge, sweep.time)


def _independent(q: Floats, s: Floats) -> bool:
    """Whether two waves differ enough in direction."""
    cross = float(q[0] * s[1] - q[1] * s[0])
    return abs(cross) > _LEAST_ANGLE * hypot(q[0], s[0]) * hypot(q[1], s[1])
