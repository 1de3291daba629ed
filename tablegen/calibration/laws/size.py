"""Fit k, beta and the threshold to actual and set scan sizes, equations (6)-(12)."""

from dataclasses import dataclass
from math import hypot
from typing import Literal

import numpy as np

from tablegen.base.figures import at_most
from tablegen.base.input_errors import Unphysical
from tablegen.base.warnings import Remark, spoils
from tablegen.fitting.estimate import Curve, Estimate, Fit
from tablegen.fitting.least_squares import Solution, solve, with_errors
from tablegen.fitting.outliers import outliers
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver

TYPICAL_THRESHOLD = 0.5  # as in the paper
_NAMES = ("k_nm_per_v", "beta", "v_threshold")
_MIN_SCATTER = 1e-7
_STEP_SCALES = (0.5, 2.0, 0.25)  # k relative to its start; beta and threshold absolute
_LEAST_DRIVE = 1e-6  # of the driver's range: smaller drives are noise
_LEAST_BETA, _LARGEST_BETA = -0.49, 100.0


@dataclass(frozen=True, kw_only=True)
class SizeFit(Fit):
    """The sensitivity k in nm/V at ``base_nm``; beta; the threshold as a fraction of v_max."""

    k_nm_per_v: Estimate
    beta: Estimate
    v_threshold: Estimate
    base_nm: float


def fit_size(
    drive_v: Floats,
    actual_nm: Floats,
    v_max: Driver | float,
    base_nm: float = 200.0,
    threshold: float | None = None,
    noise: Literal["relative", "absolute"] = "relative",
    errors_nm: Floats | None = None,
    shared: float = 0.0,
) -> SizeFit:
    """Fit the law of (6) and (10) to actual sizes at drives.

    Parameters
    ----------
    drive_v
        V_scan, volts peak to peak at the piezo, shape (points,).
    actual_nm
        Actual sizes in nm, shape (points,).
    threshold
        Share of v_max below which the law is another, kept if given, or if the points cannot show it.
    noise
        Whether errors are in proportion to the sizes, as in images, or the same for all, as of a sensor.
    errors_nm
        Standard errors of the sizes, shape (points,), in place of ``noise``: the fit weighs sizes by them, and by
        one relative error more if sizes miss the law by more than that.
    shared
        Relative error that all sizes have in common; it counts for k.

    Raises
    ------
    Unphysical
        If there are too few sizes, or they make no law.
    """
    driver = Driver.of(v_max)
    span, v = driver.span, drive_v / driver.span
    if float(np.max(v)) > 1.0:
        raise Unphysical(f"a drive of {np.max(drive_v):g} V is above {driver.full_scale}")
    if float(np.min(v)) < _LEAST_DRIVE:
        raise Unphysical(
            f"a drive of {np.min(drive_v):g} V is not a scan; drives are in volts peak to peak, of at least "
            f"{_LEAST_DRIVE * span:g} V here"
        )
    different = len(np.unique(np.round(v, 9)))
    if different < 2:
        raise Unphysical("one size does not determine k and beta; measure a second one, best three times as large")
    if threshold is not None and not 0.0 < threshold <= 1.0:
        raise Unphysical(f"a threshold of {threshold:g} is not above 0 and at most 1; it is a fraction of v_max")
    weight = actual_nm if noise == "relative" else np.full(len(v), float(np.max(actual_nm)))
    fixed = threshold if threshold is not None else TYPICAL_THRESHOLD
    remarks: list[Remark] = []
    fit = _SizeModel(v, actual_nm, weight, span, base_nm)
    free = fit.best_threshold() if threshold is None and different >= 4 else None
    solution = free or fit.solve(fixed)
    if errors_nm is not None:

        def weighed(errors: Floats) -> Solution:
            """Fit with these standard errors.

            Parameters
            ----------
            errors
                Standard errors in nm, shape (points,).
            """
            model = _SizeModel(v, actual_nm, errors, span, base_nm)
            return (model.best_threshold() if free is not None else None) or model.solve(fixed)

        solution = with_errors(weighed, actual_nm, errors_nm)
        free = solution if free is not None and _NAMES[2] in solution.names else None
    if free is None and threshold is None:
        remarks.append(
            Remark(
                f"the threshold is not determined by these points and was set to {fixed:g}; it takes four sizes or "
                f"more, some of them above 0.6 of v_max and some below 0.4",
                code="undetermined-parameter",
            )
        )
    k, beta = (solution.estimate(name) for name in _NAMES[:2])
    k = Estimate(k.value, hypot(k.standard_error, shared * k.value))
    v_threshold = solution.estimate(_NAMES[2]) if free is not None else Estimate(fixed)
    if not _LEAST_BETA * 0.999 < beta.value < _LARGEST_BETA * 0.999:
        raise Unphysical(
            f"beta = {beta.value:.4g} is at the edge of what (6) can be; are the drives peak to peak, and v_max right?"
        )
    if base_nm > k.value * span:
        raise Unphysical(
            f"{base_nm:g} nm needs {base_nm / (k.value * span):.4g} of v_max; take a base size of "
            f"{at_most(k.value * span)} nm or less"
        )
    expected = fit.size(solution.values, v)
    at_base = fit.at_base(solution.values)
    remarks += _remarks(solution, v, at_base, base_nm, actual_nm)
    line = np.linspace(0.0, 1.0, 201)[1:]
    linear = k.value * span
    return SizeFit(
        points=len(v),
        residual_percent=100.0 * (actual_nm / expected - 1.0),
        before_percent=float(np.max(np.abs(100.0 * (actual_nm / (linear * v) - 1.0)))),
        remarks=tuple(remarks),
        outliers=outliers(solution.jacobian, solution.residuals, _MIN_SCATTER),
        curves=(
            Curve(
                "size against that of the linear law",
                "drive [V]",
                "size / that law [ratio]",
                (drive_v, actual_nm / (linear * v)),
                (line * span, fit.size(solution.values, line) / (linear * line)),
            ),
        ),
        k_nm_per_v=k,
        beta=beta,
        v_threshold=v_threshold,
        base_nm=base_nm,
    )


class _SizeModel:
    """R = base u(V) / u(base / k), with u as in (6) and (10): k, beta and threshold are what the file has."""

    def __init__(self, v: Floats, actual_nm: Floats, weight: Floats, v_max: float, base_nm: float) -> None:
        self._v, self._actual, self._weight = v, actual_nm, weight
        self._v_max, self._base = v_max, base_nm
        self._start_k = float(np.sum(v * actual_nm) / np.sum(v * v)) / v_max

    def size(self, x: Floats, v: Floats) -> Floats:
        """Return sizes in nm at normalised voltages.

        Parameters
        ----------
        x
            k in nm/V, beta and threshold, shape (3,).
        v
            V_scan / v_max, any shape.

        Returns
        -------
        Floats
            Sizes in nm, of the shape of ``v``.
        """
        return self._base * _unit(v, x[1], x[2]) / _unit(np.array(self.at_base(x)), x[1], x[2])

    def at_base(self, x: Floats) -> float:
        """Return the normalised voltage of the base size.

        Parameters
        ----------
        x
            k in nm/V, beta and threshold, shape (3,).
        """
        return self._base / (float(x[0]) * self._v_max)

    def solve(self, threshold: float | None, start: tuple[float, float, float] | None = None) -> Solution:
        """Fit k and beta at a threshold, or all three from a start."""
        k, beta, begin = start or (self._start_k, 0.5, threshold or TYPICAL_THRESHOLD)
        fixed = [] if threshold is None else [threshold]
        count = 3 - len(fixed)

        def residuals(x: Floats) -> Floats:
            """Compute the misfit in units of the weights.

            Returns
            -------
            Floats
                Shape (points,).
            """
            return (self.size(np.append(x, fixed), self._v) - self._actual) / self._weight

        scales = [_STEP_SCALES[0] * self._start_k, *_STEP_SCALES[1:]]
        low = [1e-3 * self._start_k, _LEAST_BETA, 0.02]
        high = [1e3 * self._start_k, _LARGEST_BETA, 1.0]
        solution = solve(
            residuals, [k, beta, begin][:count], _NAMES[:count], scales[:count], (low[:count], high[:count])
        )
        if not fixed:
            return solution
        return Solution(
            solution.names,
            np.append(solution.values, fixed),
            solution.unit_covariance,
            solution.residuals,
            solution.jacobian,
            solution.undetermined,
        )

    def best_threshold(self) -> Solution | None:
        """Fit all three, from the best of a grid of thresholds; return None where the threshold is undetermined."""
        inside = np.unique(self._v)
        begin = min(np.linspace(0.1, 0.9, 33).tolist(), key=lambda threshold: self._linear(threshold)[0])
        _, alpha, bend = self._linear(begin)
        beta = min(max(bend / alpha, 0.9 * _LEAST_BETA), 0.9 * _LARGEST_BETA)
        base = float(np.interp(self._base, alpha * _unit(inside, beta, begin), inside))
        solution = self.solve(None, (self._base / (base * self._v_max), beta, begin))
        at = float(solution.values[2])
        # The law differs from a parabola only where there are points beyond, and from a line only where some are below.
        if solution.undetermined or np.sum(inside > at) < 1 or np.sum(inside < at) < 2:
            return None
        return solution

    def _linear(self, threshold: float) -> tuple[float, float, float]:
        """Return sum of squares, alpha and alpha beta at a threshold, for which the law is linear."""
        v = self._v
        basis = np.stack([v, np.where(v <= threshold, v * v, 2.0 * threshold * v - threshold**2)], axis=1)
        basis = basis / self._weight[:, None]
        alpha, bend = np.linalg.lstsq(basis, self._actual / self._weight, rcond=None)[0].tolist()
        residuals = basis @ np.array([alpha, bend]) - self._actual / self._weight
        return float(residuals @ residuals), alpha, bend


def _unit(v: Floats, beta: float, threshold: float) -> Floats:
    below = v * (1.0 + beta * v)
    return np.where(v <= threshold, below, (1.0 + 2.0 * beta * threshold) * v - beta * threshold * threshold)


def _remarks(solution: Solution, v: Floats, at_base: float, base_nm: float, actual_nm: Floats) -> list[Remark]:
    remarks: list[Remark] = []
    if solution.absolute_errors and len(solution.residuals) == len(solution.names):
        remarks.append(
            Remark(
                "as many sizes as parameters: errors are those of the images alone",
                code="few-points",
            )
        )
    elif solution.freedom <= 0 or len(solution.residuals) == len(solution.names):
        remarks.append(
            Remark(
                "as many points as parameters fit exactly, so errors cannot be estimated",
                code="few-points",
            )
        )
    if not float(np.min(v)) * 0.8 <= at_base <= float(np.max(v)) * 1.25:
        low, high = float(np.min(actual_nm)), float(np.max(actual_nm))
        remarks.append(
            spoils(
                f"the base size of {base_nm:g} nm lies outside the {low:.4g}..{high:.4g} nm that were measured; "
                f"k is extrapolated",
                code="extrapolated-parameter",
            )
        )
    for name in solution.undetermined:
        remarks.append(
            spoils(
                f"{name} is not determined by these points; spread the sizes over most of the range",
                code="undetermined-parameter",
            )
        )
    return remarks
