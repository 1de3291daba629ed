"""From trace and retrace of a periodic sample in the running scan to the reached line, with its errors."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.images.model_start import prepare_heights
from tablegen.images.pair_checks import ALIASING_HINT, check_periods
from tablegen.images.periodic_model import FitState, Geometry, PeriodicModel
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import Plan
from tablegen.refinement.departure import requested_position
from tablegen.refinement.free_rows import ColumnModes, FreeRows, FreeRowsFit
from tablegen.refinement.lattice_start import START_DEGREE, LatticeStart, SampleCell, lattice_start
from tablegen.refinement.window_line import WindowLine, error_modes

_DEGREES_A_PERIOD = 1.5  # of a grating, which shows the position only at the edges of its bars
_MOST_DEGREES = 24  # harmonic 16 makes some six periods in a window
_LEAST_DEGREES = 4
_FAR_APART = 0.5  # periods
_STRONG = 0.5  # of the largest amplitude
_LEAST_SIZE = 1e-3  # of the largest singular value: waves that others contain


@dataclass(frozen=True)
class ImageOptions:
    """Storage of the images; see ``docs/refine.md``.

    ``delay_pixels`` is None if the delay of the images is not known; it is then taken to be 0.
    """

    retrace_mirrored: bool = False
    delay_pixels: float | None = None

    @property
    def delay(self) -> float:
        """Columns by which the images are late."""
        return 0.0 if self.delay_pixels is None else self.delay_pixels


@dataclass(frozen=True, eq=False)
class LatticeLine:
    """The line of x from a pair of images, and the fit on which it rests."""

    geometry: Geometry
    rows_model: FreeRows
    fit: FreeRowsFit
    line: WindowLine
    start: LatticeStart

    @property
    def model(self) -> PeriodicModel:
        """The waves of the sample."""
        return self.start.model

    @property
    def state(self) -> FitState:
        """The fit of these waves."""
        return self.start.fitted

    @property
    def indexed(self) -> bool:
        """True if the base waves are those of the indexer's cell, since the strongest spots are another one's."""
        return self.start.cell is not None

    @property
    def periods(self) -> float:
        """Periods in the line from turn to turn of the base wave that has most; of an indexed cell, strong wave."""
        return float(np.max(np.abs(_ruling_waves(self.start, self.fit.state.q))))

    @property
    def amplitudes(self) -> Floats:
        """The amplitudes of the spots.

        Returns
        -------
        Magnitudes, for heights of unit variance, shape (spots,).
        """
        return np.abs(self.fit.state.amplitudes)

    @property
    def unexplained(self) -> tuple[float, float]:
        """Share of each image's variance that has the periods of the spots along the line, and is not explained."""
        geometry = self.geometry
        phase = 2.0 * np.pi * (self.start.spots @ self.fit.state.q)[:, None] * geometry.place
        waves = np.asarray(geometry.levelled(np.concatenate([np.cos(phase), np.sin(phase)])), dtype=np.float64)
        left, sizes, _ = np.linalg.svd(waves.T, full_matrices=False)
        basis = left[:, sizes > _LEAST_SIZE * sizes[0]]
        by_noise = basis.shape[1] / geometry.columns
        shares = []
        for image, residual in zip(np.split(self.rows_model.heights, 2, axis=1), self.fit.residuals, strict=True):
            noise = float(np.sum((residual - (residual @ basis) @ basis.T) ** 2)) / (1.0 - by_noise)
            shares.append((float(np.sum((residual @ basis) ** 2)) - by_noise * noise) / float(np.sum(image**2)))
        return shares[0], shares[1]

    @property
    def waves(self) -> Floats:
        """The base waves of the sample.

        Returns
        -------
        Periods in the line from turn to turn, and in all rows, of each base wave, shape (waves, 2).
        """
        rows = np.polyfit(self.geometry.y, self.fit.phases.phase, 1)[0]
        return np.stack([self.fit.state.q, rows], axis=1)

    @property
    def waves_covariance(self) -> Floats:
        """The covariance of q_1, s_1, q_2, s_2, in squared periods.

        That of rows comes from their scatter about a line, which includes drift.

        Returns
        -------
        Matrix, shape (2 waves, 2 waves).
        """
        count = len(self.fit.state.q)
        phases, y = self.fit.phases.phase, self.geometry.y
        residuals = phases - np.column_stack([y, np.ones_like(y)]) @ np.polyfit(y, phases, 1)
        matrix = np.zeros((2 * count, 2 * count))
        matrix[::2, ::2] = self.fit.covariance[-count:, -count:]
        matrix[1::2, 1::2] = np.diag(np.mean(residuals**2, axis=0) / float(y @ y))
        return matrix


def lattice_line(
    plan: Plan, trace: Floats, retrace: Floats, options: ImageOptions, sample: SampleCell | None = None
) -> LatticeLine:
    """Fit x to a pair of images.

    Parameters
    ----------
    trace, retrace
        Heights in any unit, shape (rows, columns), rows in the order of time, the left end first.
    sample
        What is known of the sample's cell.

    Raises
    ------
    Unphysical
        If the images show no lattice or grating, or not the same one.
    """
    line = plan.x
    turn, window = line.drive.turn, line.band_limit.window
    if options.retrace_mirrored:
        retrace = np.ascontiguousarray(retrace[:, ::-1])
    geometry, heights = prepare_heights(trace, retrace, turn, window, options.delay)
    moves = plan.y.program.hold == 1
    modes = column_modes(plan, geometry, START_DEGREE)
    advice = "leave --retrace-mirrored out" if options.retrace_mirrored else "it needs --retrace-mirrored"
    start = lattice_start(geometry, heights, modes, moves, advice, (trace, retrace), sample or SampleCell())
    waves = len(start.state.q)
    most = float(np.max(np.abs(_ruling_waves(start, start.state.q))))
    check_periods(most, window[1] - window[0], geometry.columns)
    if start.mismatch > _FAR_APART:
        raise Unphysical(
            f"trace and retrace are {start.mismatch:.2g} periods of the sample apart, and beyond half a period it is "
            f"not known which belong together; if one was cropped, do not; else calibrate first, or take a sample of a "
            f"longer period{ALIASING_HINT}"
        )
    span = (window[1] - window[0]) * most
    degree = _MOST_DEGREES if waves > 1 else int(np.clip(_DEGREES_A_PERIOD * span, _LEAST_DEGREES, _MOST_DEGREES))
    finer = column_modes(plan, geometry, degree)
    error = np.asarray(np.linalg.lstsq(finer.values.T, modes.values.T @ start.state.modes, rcond=None)[0], np.float64)
    model = FreeRows(geometry, heights, start.spots, finer, moves)
    fit = model.fit(replace(start.state, modes=error))
    count = len(finer.values)
    requested = partial(requested_position, line)
    window_line = WindowLine(
        requested, line.drive.size_nm, turn, window, degree, "both", fit.state.modes, fit.covariance[:count, :count]
    )
    return LatticeLine(geometry, model, fit, window_line, start)


def _ruling_waves(start: LatticeStart, q: Floats) -> Floats:
    """Return the periods in the line of the base waves, or of the strong waves of an indexed cell."""
    if start.cell is None:
        return q
    amplitudes = np.abs(start.state.amplitudes)
    return np.asarray(start.spots[amplitudes > _STRONG * np.max(amplitudes)] @ q, dtype=np.float64)


def column_modes(plan: Plan, geometry: Geometry, degree: int) -> ColumnModes:
    """Return the modes at the middle of every column, trace then retrace."""
    line = plan.x
    turn = line.drive.turn
    forward = np.repeat([True, False], geometry.columns)
    sweep = np.concatenate([geometry.sweep(True), geometry.sweep(False)])
    times = np.where(forward, turn * sweep, turn + (1.0 - turn) * sweep)
    place = np.where(forward, sweep, 1.0 - sweep)
    values = error_modes(place, forward, line.band_limit.window, degree, "both")
    return ColumnModes(values, requested_position(line, times), times - 0.5)
