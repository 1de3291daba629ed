"""The positions of a scan of a periodic sample, by a fit to its own images.

The phase of the sample's waves is linear in x. The fit of ``calibrate images`` is the start; then x of each direction
is corrected by a free series for the residual of the branches of (17), and the waves are fitted again. For a lattice
the phases of two waves also separate y from a drift of x. A grating shows neither, and its rows stay.
"""

from dataclasses import dataclass, replace
from math import hypot

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d

from tablegen.base.input_errors import Unphysical
from tablegen.correction.distortion import Distortion, Sweep1D
from tablegen.correction.support import supported
from tablegen.images.cell_start import CellWaves, cell_of, fit_cell_spots, strong_index
from tablegen.images.cell_vectors import reduced
from tablegen.images.missing import completed
from tablegen.images.model_start import begin, fit_spots, prepare_heights
from tablegen.images.pair_fit import check_fit
from tablegen.images.periodic_model import LAG, FitState, PeriodicModel, settle
from tablegen.images.stepless_fit import fit_without_steps, in_unit, stepless_images
from tablegen.numerics.arrays import Bools, Floats, Ints

Complexes = npt.NDArray[np.complex128]
_MOST_BENDS = 20  # terms for the residual of the branches, in each direction
_LEAST_BENDS = 5
_BENDS_A_PERIOD = 1.7  # terms; a bend within a period cannot be distinguished from the shape of the sample
_SAME_WAVE = 2.0  # periods in the line: one line does not separate nearer waves
_AVERAGED = 0.45  # of a period against another wave: the standard deviation of a mean that leaves 2 % of it
_ROW_BENDS = 20  # terms for the residual of the phase polynomial in the rows
_FOLLOWING = 0.5  # share of the change of a phase step that the next guess follows
_ROUNDS = 40
_SETTLED = 1e-4  # of the line and of the frame: the largest change in a round
_STIFFNESS = 1e-6  # of the penalty on n^4, against the mean square of the effect of a term
_MOST_BENT_LATTICE = 0.5  # sum of log aspect and shear that a frame may have
_CLEARLY_SQUARE = 0.15  # the same, of a lattice that is taken for square
_LEAST_ANGLE = 0.2  # sine of the angle between two waves that separate y from x


@dataclass(frozen=True, eq=False)
class PeriodicScan:
    """The result of a fit to images.

    ``distortion`` has x in lines, about 0..1, and y in frames. ``waves`` are the base vectors of the sample, in periods
    per line and per frame, shape (bases, 2). ``explained`` is the share of the contrast that is periodic, ``tells_y``
    true if y is that of the sample and not of the rows. ``indexed`` is true if the cell is that of the indexer, and not
    of the strongest spots. The strong spots alone are those of a cell with the area divided by ``strong_index``.
    ``stepless`` is the first image without the steps of terraces, None where it has none. ``without_gaps``
    are the images with the fitted values in place of missing pixels, None where none is missing. ``several_cells`` is
    the indexer's reason where several cells explain the image. Displacements along ``straight_axes`` are within their
    errors, and left out. ``frame_share`` is the part of the frame that the rows are.
    """

    distortion: Distortion
    waves: Floats
    explained: float
    tells_y: bool
    indexed: bool = False
    strong_index: int = 1
    stepless: Floats | None = None
    without_gaps: tuple[Floats, ...] | None = None
    several_cells: str = ""
    straight_axes: str = ""
    frame_share: float = 1.0

    def of_pitch(self, pitch_nm: float, aspect: float) -> Distortion:
        """Return the distortion in nm for a grating, or densest rows of a lattice, with this pitch.

        ``aspect`` is the height of the frame over the length of the line.
        """
        length = pitch_nm * min(hypot(q, s / aspect) for q, s in self.waves.tolist())
        return _scaled(self.distortion, length, length * aspect, 0.0)

    def of_lattice(self, constant_nm: float, kind: str | None = None) -> Distortion:
        """Return the distortion in nm, where the sample is a hexagonal or a square lattice of this constant.

        The lattice may be turned. This gives the height of the frame too, and the shear of a steady drift. Without a
        ``kind`` the lattice is hexagonal, unless the frame is nearly straight as a square one.

        Raises
        ------
        Unphysical
            If the sample is no such lattice.
        """
        if not self.tells_y:
            raise Unphysical("the images show waves of one direction; for a grating give its pitch, not a lattice")
        kind = kind or self.likely_kind()
        worst, across, along, shear = (float(value) for value in self._frame(kind) * [1.0, *3 * [constant_nm]])
        if worst > _MOST_BENT_LATTICE:
            raise Unphysical(
                f"as a {kind} lattice the frame would be {across:.4g} x {along:.4g} nm and sheared by "
                f"{shear:.4g} nm; is the sample such a lattice (--lattice), and was the frame as high "
                f"as its lines are long?"
            )
        return _scaled(self.distortion, across, along, shear)

    def likely_kind(self) -> str:
        """Return "square" if the frame is nearly straight as that of a square lattice, else "hexagonal"."""
        square, hexagonal = (float(self._frame(kind)[0]) for kind in ("square", "hexagonal"))
        return "square" if square < min(_CLEARLY_SQUARE, 0.5 * hexagonal) else "hexagonal"

    def _frame(self, kind: str) -> Floats:
        """Return how bent the frame is, its width, height and shear in constants of a lattice, shape (4,)."""
        readings = []
        cell: Floats = np.asarray(np.linalg.inv(self.waves).T, dtype=np.float64)
        waves = np.linalg.inv(np.asarray(reduced(cell), dtype=np.float64)).T
        for angle in (60.0, 120.0) if kind == "hexagonal" else (90.0,):
            turned = np.radians(angle)
            ideal = np.array([[1.0, 0.0], [np.cos(turned), np.sin(turned)]]) / np.sin(turned)  # periods a constant
            frame = np.linalg.inv(ideal) @ waves  # from frames to constants, turned
            metric = np.linalg.cholesky(frame.T @ frame).T
            across, shear, along = float(metric[0, 0]), float(metric[0, 1]), float(metric[1, 1])
            bent = abs(np.log(along / across / self.frame_share)) + abs(shear / across)
            readings.append((bent, across, along, shear))
        return np.array(min(readings))


def _scaled(distortion: Distortion, across: float, along: float, shear: float) -> Distortion:
    """Scale lines to a length and frames to a height in nm, the last line further right by ``shear``."""
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
    expected_area: float | None = None,
) -> PeriodicScan:
    """Fit trace and retrace of a periodic sample, or a trace alone.

    Parameters
    ----------
    trace, retrace
        Heights in any unit, shape (rows, columns), rows in the order of time; NaN where a pixel is missing. The result
        is of the rows from the first with data to the last one.
    turn
        Share of the period in which the line rises.
    window
        Part of each sweep that the columns span, 0..1.
    delay_pixels
        Delay of the columns against the position.
    expected_area
        Area of the sample's cell in square pixels by the size in the file.

    Raises
    ------
    Unphysical
        If the images do not show one periodic sample, or too little of it.
    """
    if retrace_mirrored and retrace is not None:
        retrace = np.ascontiguousarray(retrace[:, ::-1])
    geometry, heights = prepare_heights(trace, retrace, turn, window, delay_pixels)
    complete = completed([image for image in (trace, retrace) if image is not None])
    cell, several = cell_of(trace, retrace, expected_area)
    scaled, stepped = list[Floats](), False
    if cell is None:
        level = [np.asarray(geometry.levelled(one), dtype=np.float64) for one in complete.heights]
        scaled = in_unit(complete.heights, [geometry.weighted(one) for one in level])
        try:
            spot, bends = begin(geometry, heights, retrace_mirrored)
            model, state, free = fit_spots(geometry, heights, spot, bends)
        except Unphysical:
            if several is not None:
                raise several from None
            raise
    else:
        waves = CellWaves.of(cell)
        fit = fit_without_steps(
            geometry, complete.heights, lambda level: fit_cell_spots(geometry, level, retrace_mirrored, waves)
        )
        model, state, free, scaled, stepped = fit.model, fit.state, fit.free, fit.scaled, fit.stepped
    try:
        check_fit(model, state, free)
        model, state = _bent(model, state, free)
    except Unphysical:
        if several is not None:
            raise several from None
        raise
    if complete.has_gaps:
        scaled = replace(complete, heights=scaled).with_model(model.periodic_parts(state))
    scan = _scan(model, state)
    distortion, straight = supported(scan.distortion, model, state, scan.tells_y)
    return replace(
        scan,
        distortion=distortion,
        straight_axes=straight,
        indexed=cell is not None,
        several_cells="" if several is None else str(several),
        strong_index=strong_index(model, state),
        stepless=stepless_images(model, state, scaled)[0][0] if stepped else None,
        without_gaps=tuple(scaled) if complete.has_gaps else None,
    )


def _bent(model: PeriodicModel, state: FitState, free: Bools) -> tuple[PeriodicModel, FitState]:
    """Fit a free series to x of each direction, and one to the phases along the rows."""
    free = free.copy()
    free[:4] = False  # the branches stay; the series is added to them
    geometry = model.geometry
    q = float(np.max(np.abs(_strong_spots(model, state) @ model.q(state.parameters))))
    bends = _series(geometry.columns, int(np.clip(round(_BENDS_A_PERIOD * q), _LEAST_BENDS, _MOST_BENDS)))
    row_bends = _series(geometry.rows, _ROW_BENDS)
    strong = _strong_spots(model, state)
    waves = model.row_waves(state, strong)
    followed = [_followed(_without_others(model, state, spot, wave)) for spot, wave in zip(strong, waves, strict=True)]
    phases = np.linalg.solve(strong.astype(np.float64), np.stack(followed))
    along = phases @ np.linalg.pinv(row_bends)  # coefficients of the whole sum, which the penalty smooths
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
        "sample, without hum?"
    )


def _series(count: int, terms: int) -> Floats:
    """Return Chebyshev polynomials, which follow a sweep best where it turns, (terms, count)."""
    place = (2.0 * np.arange(count) + 1.0) / count - 1.0
    series = np.polynomial.chebyshev.chebvander(place, min(terms, count // 3) - 1)
    return np.asarray(series.T, dtype=np.float64)


def _penalty(terms: int, normal: Floats) -> Floats:
    """Return the penalty that keeps the series smooth where nothing else does."""
    n = np.arange(terms, dtype=np.float64)
    penalty: Floats = _STIFFNESS * float(np.mean(np.diag(normal))) * (n**4 + 1e-3)
    return penalty


def _more_x(basis: Floats, residual: Floats, steep: Floats, current: Floats) -> Floats:
    """Return the step of each term of x along the columns from ``current``, by least squares over all rows."""
    weight, aim = np.sum(steep**2, axis=0), np.sum(steep * residual, axis=0)
    normal = (basis * weight) @ basis.T
    penalty = _penalty(len(basis), normal)
    step: Floats = np.linalg.solve(normal + np.diag(penalty), basis @ aim - penalty * current)
    return step


def _without_line(more: list[Floats], places: list[Floats]) -> list[Floats]:
    """Subtract the common line in x, which is the sample's position and period."""
    line = np.polyfit(np.concatenate(places), np.concatenate(more), 1)
    return [np.asarray(one - np.polyval(line, x), np.float64) for one, x in zip(more, places, strict=True)]


def _more_phase(basis: Floats, residuals: tuple[Floats, ...], slopes: list[Floats], current: Floats) -> Floats:
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
    step = np.linalg.solve(normal + np.diag(penalty), aim - penalty * current.ravel())
    return np.asarray(step.reshape(bases, count), dtype=np.float64)


def _strong_spots(model: PeriodicModel, state: FitState) -> Ints:
    """Return the strongest spots that determine the phases of the base vectors, shape (bases, bases)."""
    order = np.argsort(-np.abs(state.amplitudes))
    strong = [model.spots[order[0]]]
    for number in order[1:]:
        if len(strong) < model.bases and np.linalg.matrix_rank([*strong, model.spots[number]]) > len(strong):
            strong.append(model.spots[number])
    return np.stack(strong)


def _without_others(model: PeriodicModel, state: FitState, own: Ints, wave: Complexes) -> Complexes:
    """Return a spot's wave in the rows, averaged so that waves of as many periods in the line vanish."""
    q, s = model.q(state.parameters), model.s(state.parameters)[:, 0]
    nearest = np.inf
    for spot in (*model.spots, *-model.spots):
        beside, ahead = float((spot - own) @ q), float((spot - own) @ s)
        if abs(beside) < _SAME_WAVE and abs(ahead) > _SAME_WAVE:
            nearest = min(nearest, abs(ahead))
    width = _AVERAGED * model.geometry.rows / nearest
    if width < 0.1:
        return wave
    return np.asarray(gaussian_filter1d(wave.real, width) + 1j * gaussian_filter1d(wave.imag, width))


def _followed(wave: Complexes) -> Floats:
    """Unwrap the phase of each row in periods, from the middle outwards: each step is near the one before."""
    wrapped = np.angle(wave) / (2.0 * np.pi)
    out = wrapped.copy()
    middle = len(wrapped) // 2
    for way in (1, -1):
        step = 0.0
        for k in range(middle + way, len(wrapped) if way > 0 else -1, way):
            guess = out[k - way] + step
            out[k] = wrapped[k] + np.round(guess - wrapped[k])
            step += _FOLLOWING * (out[k] - out[k - way] - step)
    return out


def _less_line(phases: Floats) -> Floats:
    """Subtract its best line from each row."""
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
    """Interpolate values at the middles of the rows to their edges."""
    outer = 1.5 * values[[0, -1]] - 0.5 * values[[1, -2]]
    return np.concatenate([outer[:1], 0.5 * (values[1:] + values[:-1]), outer[1:]])


def _from(sweep: Sweep1D | None, edge: float) -> Sweep1D | None:
    """Return the sweep counted from ``edge``."""
    return None if sweep is None else Sweep1D(sweep.x - edge, sweep.time)


def _independent(q: Floats, s: Floats) -> bool:
    """Return true if two waves differ enough in direction."""
    cross = float(q[0] * s[1] - q[1] * s[0])
    return abs(cross) > _LEAST_ANGLE * hypot(q[0], s[0]) * hypot(q[1], s[1])
