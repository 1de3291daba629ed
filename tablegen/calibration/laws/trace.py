"""Fit both branches of the model to one trace: displacement against a triangular drive over one or more periods."""

from dataclasses import dataclass

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.triangle import Triangle, find_triangle
from tablegen.calibration.spans import check_spans
from tablegen.compensation.hysteresis import BranchShape
from tablegen.fitting.correlation import correlation_length
from tablegen.fitting.estimate import Curve, Estimate
from tablegen.fitting.least_squares import Solution, solve
from tablegen.fitting.measured_branch import BINS, WINDOW, AmplitudeFit, measured_branch
from tablegen.numerics.arrays import Bools, Floats

_MIN_SAMPLES_PER_PERIOD = 40  # samples per period
_REVERSED_BRANCH_RESIDUAL = 1e3  # the residual of a branch that runs backwards


@dataclass(frozen=True, kw_only=True)
class TraceFit(AmplitudeFit):
    """Fit of one trace over ``periods``, without the ``settling_samples`` samples before them.

    ``correlated`` is over how many samples residuals depend on each other; ``strays`` are samples far off the curve,
    counted from 0.
    """

    triangle: Triangle
    periods: float
    settling_samples: int
    delay_s: Estimate
    correlated: float
    inverted: bool
    strays: tuple[int, ...]


def fit_trace(
    time_s: Floats,
    drive_v: Floats,
    displacement_nm: Floats,
    settle_periods: int | None = None,
    drift_order: int | None = None,
    delay_s: float | None = 0.0,
) -> TraceFit:
    """Fit both branches of one trace.

    Every sample is fitted at its own phase, so that periods are aligned to a fraction of a sample and averaged,
    whatever the sampling rate.

    Parameters
    ----------
    time_s
        Ascending times in s, shape (samples,).
    drive_v
        Drive at the piezo in V, shape (samples,).
    displacement_nm
        Displacement in any unit, shape (samples,).
    settle_periods
        Periods at the start that are not fitted; by default one of three periods or more.
    drift_order
        Order of the polynomial that takes the drift, and creep as far as it follows it; by default a line, a parabola
        from two periods on, a cubic from four.
    delay_s
        Delay of the sensor after the drive; None fits it.

    Raises
    ------
    Unphysical
        If the trace does not support the fit.
    """
    if len(time_s) < _MIN_SAMPLES_PER_PERIOD:
        raise Unphysical(
            f"{len(time_s)} samples are not enough for a trace; at least {_MIN_SAMPLES_PER_PERIOD} a period are needed"
        )
    if not np.all(np.diff(time_s) > 0.0):
        at = int(np.argmin(np.diff(time_s) > 0.0))
        raise Unphysical(f"time does not ascend after {time_s[at]:g} s; give every trace its own file or trace number")
    check_spans(time_s, displacement_nm, drive_v)
    triangle = find_triangle(time_s, drive_v)
    periods = float(time_s[-1] - time_s[0]) * (1.0 + 1.0 / (len(time_s) - 1)) / triangle.period_s
    per_period = len(time_s) / periods
    if per_period < _MIN_SAMPLES_PER_PERIOD:
        raise Unphysical(
            f"{per_period:.3g} samples a period are too few; at least {_MIN_SAMPLES_PER_PERIOD} are needed"
        )
    if periods < 0.99:
        raise Unphysical(f"{periods:.3g} of a period are recorded; at least one whole period is needed")
    settle = settle_periods if settle_periods is not None else (1 if periods >= 2.99 else 0)
    if periods - settle < 0.99:
        raise Unphysical(f"{periods:.3g} periods are recorded, which leaves no whole period after {settle} to settle")
    used = (
        time_s >= time_s[0] + (settle - 0.5 / per_period) * triangle.period_s if settle else np.ones(len(time_s), bool)
    )
    periods -= settle
    order = drift_order if drift_order is not None else (1 if periods < 1.99 else 2 if periods < 3.99 else 3)
    model = _TraceModel(triangle, time_s[used], displacement_nm[used], order, delay_s)
    solution = model.solve()
    return _result(model, solution, triangle, periods, int(np.sum(~used)))


class _TraceModel:
    """Model of a trace: displacement = low + height tau(t - delay) + drift.

    It fits the branches by their coordinates, in which (17) is linear, and not by their peaks, which have poles.
    """

    def __init__(self, triangle: Triangle, time_s: Floats, measured: Floats, order: int, delay_s: float | None) -> None:
        self.triangle, self.time_s = triangle, time_s
        self.low, self.height = float(np.min(measured)), float(np.ptp(measured))
        if not self.height > 0.0:
            raise Unphysical("the displacement does not move")
        self.measured = (measured - self.low) / self.height
        self.fits_delay = delay_s is None
        self.fixed_delay = (delay_s or 0.0) / triangle.period_s  # in periods from here on
        s = 2.0 * (time_s - time_s[0]) / (time_s[-1] - time_s[0]) - 1.0
        self.drift = np.stack([s**n for n in range(1, order + 1)], axis=1) if order else np.zeros((len(s), 0))
        shape = [f"{name}_{side}" for side in "fb" for name in BranchShape.COORDINATES]
        drifts = [f"drift_{n}" for n in range(1, order + 1)]
        self._last: tuple[Floats, tuple[Floats, Floats, Bools, Floats]] | None = None
        self.names = (*shape, "low", "height", *drifts, *(["delay"] if self.fits_delay else []))

    def delay(self, x: Floats) -> float:
        """Return the delay in periods.

        Parameters
        ----------
        x
            Parameters, shape (parameters,).
        """
        return float(x[-1]) if self.fits_delay else self.fixed_delay

    def position(self, x: Floats) -> tuple[Floats, Floats, Bools, Floats]:
        """Return u and tau along the sweep, True where it rises, and the normalised displacement.

        Parameters
        ----------
        x
            Parameters, shape (parameters,).

        Returns
        -------
        tuple
            Four arrays of shape (samples,), dimensionless.
        """
        if self._last is None or not np.array_equal(self._last[0], x):  # residuals and jacobian share it
            self._last = x.copy(), self._position(x)
        return self._last[1]

    def _position(self, x: Floats) -> tuple[Floats, Floats, Bools, Floats]:
        delayed = self.time_s - self.delay(x) * self.triangle.period_s
        rising = self.triangle.phase(delayed) < self.triangle.turn
        drive = self.triangle.value(delayed)
        u = np.where(rising, drive, 1.0 - drive)
        forward, backward = _branches(x)
        tau = np.empty_like(u)
        tau[rising], tau[~rising] = forward.inverse(u[rising]), backward.inverse(u[~rising])
        return u, tau, rising, np.where(rising, tau, 1.0 - tau)

    def expected(self, x: Floats) -> Floats:
        """Return the modelled normalised displacement, with drift.

        Parameters
        ----------
        x
            Parameters, shape (parameters,).

        Returns
        -------
        Floats
            Share of the measured range, shape (samples,).
        """
        _, _, _, position = self.position(x)
        return float(x[4]) + float(x[5]) * position + self.drift @ x[6 : 6 + self.drift.shape[1]]

    def residuals(self, x: Floats) -> Floats:
        """Compute the model less the measurement; far off where a branch would run backwards.

        Parameters
        ----------
        x
            Parameters, shape (parameters,).

        Returns
        -------
        Floats
            Share of the measured range, shape (samples,).
        """
        if min(branch.least_slope() for branch in _branches(x)) < 0.02:
            return np.full(len(self.measured), _REVERSED_BRANCH_RESIDUAL)
        return self.expected(x) - self.measured

    def jacobian(self, x: Floats) -> Floats:
        """Return the derivatives of ``residuals``: tau moves by -(du/dparameter) / (du/dtau).

        Parameters
        ----------
        x
            Parameters, shape (parameters,).

        Returns
        -------
        Floats
            Shape (samples, parameters).
        """
        columns, steep = self._shape_columns(x)
        if self.fits_delay:
            columns.append(-steep * self._by_delay(x))
        return np.column_stack(columns)

    def timing_jacobian(self, x: Floats) -> Floats:
        """Return the derivatives of the displacement by the period, start and turn of the drive.

        Parameters
        ----------
        x
            Parameters, shape (parameters,).

        Returns
        -------
        Floats
            Shares of the measured range per s, per s and per unit of the turn, shape (samples, 3).
        """
        _, steep = self._shape_columns(x)
        delayed = self.time_s - self.delay(x) * self.triangle.period_s
        return self.triangle.timing_slopes(delayed) * steep[:, None]

    def _by_delay(self, x: Floats) -> Floats:
        rising = self.position(x)[2]
        return np.where(rising, 1.0 / self.triangle.turn, -1.0 / (1.0 - self.triangle.turn))

    def _shape_columns(self, x: Floats) -> tuple[list[Floats], Floats]:
        _, tau, rising, position = self.position(x)
        basis = BranchShape.basis(tau)
        columns = []
        steep = np.empty_like(tau)
        for branch, side, way in zip(_branches(x), (rising, ~rising), (1.0, -1.0), strict=True):
            slope = branch.slope(tau)
            sign = np.where(side, float(x[5]) / slope, 0.0) * way
            columns += [-sign * one for one in basis]
            steep = np.where(side, float(x[5]) / slope, steep)
        return [*columns, np.ones_like(tau), position, *self.drift.T], steep

    def solve(self) -> Solution:
        """Fit from a linear first guess: for a small residual the displacement itself is near enough to tau."""
        start = np.zeros(len(self.names))
        start[5] = 1.0
        u, _, rising, _ = self.position(start)
        upright = float(np.corrcoef(np.where(rising, u, 1.0 - u), self.measured)[0, 1]) > 0.0
        if not upright:
            start[4], start[5] = 1.0, -1.0
        position = self.measured if upright else 1.0 - self.measured
        tau = np.clip(np.where(rising, position, 1.0 - position), 0.0, 1.0)
        basis = np.stack(BranchShape.basis(tau), axis=1)
        for i, side in ((0, rising), (2, ~rising)):
            guess = np.linalg.lstsq(basis[side], (u - tau)[side], rcond=None)[0]
            while BranchShape.at(guess).least_slope() < 0.1:
                guess = 0.7 * guess
            start[i : i + 2] = guess
        scales = np.full(len(start), 0.3)
        if self.fits_delay:
            scales[-1] = 0.05
        return solve(self.residuals, start, self.names, scales, jacobian=self.jacobian)


def _result(
    model: _TraceModel, solution: Solution, triangle: Triangle, periods: float, settling_samples: int
) -> TraceFit:
    x, residuals = solution.values, solution.residuals
    correlated = correlation_length(residuals)
    freedom = max(len(residuals) / correlated - len(x), 1.0)
    covariance = solution.unit_covariance * float(residuals @ residuals) / freedom
    # Errors of the drive's timing change the branches too.
    timing_effect = solution.unit_covariance @ solution.jacobian.T @ model.timing_jacobian(x)
    covariance = covariance + timing_effect @ triangle.timing_covariance @ timing_effect.T
    forward, backward = (measured_branch(x[i : i + 2], covariance[i : i + 2, i : i + 2]) for i in (0, 2))
    delay = Estimate(model.fixed_delay * triangle.period_s)
    if model.fits_delay:
        delay = Estimate(float(x[-1]) * triangle.period_s, float(covariance[-1, -1]) ** 0.5 * triangle.period_s)
    residual, scaling, curve = _averaged(model, x, residuals)
    drift = model.drift @ x[6 : 6 + model.drift.shape[1]]
    spread = 1.4826 * float(np.median(np.abs(residuals - np.median(residuals))))
    return TraceFit(
        triangle=triangle,
        turn=Estimate(triangle.turn, float(triangle.timing_covariance[2, 2]) ** 0.5),
        v_scan=triangle.v_high - triangle.v_low,
        v_offset=0.5 * (triangle.v_low + triangle.v_high),
        periods=periods,
        samples=len(residuals),
        settling_samples=settling_samples,
        forward=forward,
        backward=backward,
        delay_s=delay,
        drift_percent=100.0 * float(np.ptp(drift)) / abs(float(x[5])) if drift.size else 0.0,
        noise_percent=100.0 * float(np.sqrt(np.mean(np.diff(residuals) ** 2) / 2.0)) / abs(float(x[5])),
        residual_percent=residual,
        scaling_percent=scaling,
        correlated=correlated,
        inverted=bool(x[5] < 0.0),
        strays=tuple((settling_samples + np.flatnonzero(np.abs(residuals) > max(7.0 * spread, 1e-6))).tolist()),
        curves=(curve,),
    )


def _branches(x: Floats) -> tuple[BranchShape, BranchShape]:
    return BranchShape.at(x[:2]), BranchShape.at(x[2:4])


def _averaged(model: _TraceModel, x: Floats, rest: Floats) -> tuple[Floats, tuple[float, float], Curve]:
    """Average the residual over the periods; return it, its noise, and the measured residual as a curve."""
    u, tau, rising, _ = model.position(x)
    height = float(x[5])
    residuals, scaling, branches = [], [], []
    for side, sign, shape in ((rising, 1.0, x[:2]), (~rising, -1.0, x[2:4])):
        errors = -rest[side] / height * sign  # along the sweep, measured less model
        place = np.minimum((tau[side] * BINS).astype(np.int64), BINS - 1)
        count = np.maximum(np.bincount(place, minlength=BINS), 1)
        mean = np.bincount(place, errors, minlength=BINS) / count
        residuals.append(100.0 * mean)
        scaling.append(100.0 * float(np.ptp(np.diff(mean)[WINDOW]) * BINS))
        at = np.bincount(place, u[side], minlength=BINS) / count
        fitted = BranchShape.at(shape).inverse(at)
        branches.append((at, 100.0 * (mean + fitted - at), 100.0 * (fitted - at)))
    # As figure 5a has it: against the drive, the backward branch mirrored.
    (f_at, f_measured, f_fitted), (b_at, b_measured, b_fitted) = branches
    along = np.concatenate([f_at, 1.0 - b_at])
    curve = Curve(
        "residual against the drive",
        "drive [share of the sweep]",
        "position less a straight line [% of the scan]",
        (along, np.concatenate([f_measured, -b_measured])),
        (along, np.concatenate([f_fitted, -b_fitted])),
        (len(f_at), len(f_at)),
    )
    return np.concatenate(residuals), (scaling[0], scaling[1]), curve
