"""Fit the growth of one branch's residual with the amplitude: beta_max and rho of equation (22), and one u_peak."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import expm1, sqrt

import numpy as np
from scipy.special import chdtrc

from tablegen.base.input_errors import Unphysical
from tablegen.base.warnings import Remark, spoils
from tablegen.compensation.models import UNCOMPENSATED
from tablegen.fitting.estimate import Estimate
from tablegen.fitting.least_squares import few_points, solve
from tablegen.fitting.measured_branch import MeasuredBranch
from tablegen.numerics.arrays import Floats

_SIGNIFICANCE_LEVEL = 0.01
_STRAIGHT_RHO = 1e-9  # below it (22) is a straight line to the last place
_LARGEST_RHO, _OPEN_RHO = (
    60.0,
    5.0,
)  # above the first (22) is a step; an error above the second leaves rho undetermined
_NOISE_LIMIT_ERRORS = 3.0  # standard errors of a residual that may be noise
_CHI2_LIMIT = 4.0  # in chi squared, two standard errors
_NO_HYSTERESIS = f'no hysteresis above the noise, and hence no u_peak; take model = "{UNCOMPENSATED}", or average more'
_LEAST_BETA_ERROR = 1e-9  # least error of a measured beta: that of the fit's own arithmetic


@dataclass(frozen=True)
class Growth:
    """Growth of one branch: beta_max (of the scan), rho and u_peak, and remarks on how well they are determined.

    ``off_errors`` is by how many of their standard errors (22) misses the measured residuals, rms; ``off_share`` the
    rms of what it misses as a fraction of the largest residual. Both are 0 for one amplitude.
    """

    beta_max: Estimate
    rho: Estimate
    u_peak: Estimate
    remarks: tuple[Remark, ...]
    off_errors: float = 0.0
    off_share: float = 0.0

    def beta(self, v: Floats) -> Floats:
        """Return the peak residual at normalised amplitudes, equation (22).

        Parameters
        ----------
        v
            V_scan / v_max, any shape.

        Returns
        -------
        Floats
            Shares of the scan, of the shape of ``v``.
        """
        return self.beta_max.value * _share(v, self.rho.value)


def fit_growth(v: Floats, branches: Sequence[MeasuredBranch], rho: float) -> Growth:
    """Fit (22) to the residuals of one direction, weighted by their standard errors.

    Parameters
    ----------
    v
        Normalised amplitudes V_scan / v_max, shape (amplitudes,).
    branches
        The measured branch at each amplitude.
    rho
        Decay constant, used where the amplitudes do not determine it.

    Raises
    ------
    Unphysical
        If the residuals have the wrong sign or make no law.
    """
    remarks: list[Remark] = []
    beta = np.array([branch.beta.value for branch in branches])
    error = np.maximum([branch.beta.standard_error for branch in branches], _LEAST_BETA_ERROR)
    fit = None
    if float(np.max(v)) - float(np.min(v)) > 0.05:
        fit = _both(v, beta, error, rho, remarks)
    freedom = max(len(v) - (1 if fit is None else 2), 1)
    if fit is None:
        steep = _steepest(v, beta, error, rho)
        fit = _height(v, beta, error, steep or rho, remarks)
        remarks.append(
            Remark(
                f"the residual hardly grows with the amplitude: rho is only known to be large, and set to {steep:g}",
                code="undetermined-parameter",
            )
            if steep
            else spoils(
                f"rho is not determined by these amplitudes and was set to {rho:g}; it takes two or "
                f"more, best from 0.2 to 1 of v_max",
                code="undetermined-parameter",
            )
        )
    beta_max, estimate = fit
    if beta_max.value <= 0.0 and np.all(beta > -_NOISE_LIMIT_ERRORS * error):
        raise Unphysical(_NO_HYSTERESIS)
    if beta_max.value <= 0.0:
        raise Unphysical(
            f"the residual has the wrong sign (beta_max = {beta_max.value:.3g}): the displacement leads the drive; "
            f"is the delay of the drive's channel larger than the sensor's?"
        )
    top = float(np.max(v))
    if top < 0.6:
        remarks.append(
            spoils(
                f"beta_max is extrapolated from {top:.2g} of v_max; it holds up to about there",
                code="extrapolated-parameter",
            )
        )
    misfit = beta_max.value * _share(v, estimate.value) - beta
    off_errors = sqrt(float(np.sum((misfit / error) ** 2)) / freedom)
    off_share = sqrt(float(np.sum(misfit**2)) / freedom) / float(np.max(np.abs(beta)))
    return Growth(beta_max, estimate, _peak(branches, beta, error, remarks), tuple(remarks), off_errors, off_share)


def _both(
    v: Floats, beta: Floats, error: Floats, rho: float, remarks: list[Remark]
) -> tuple[Estimate, Estimate] | None:
    """Fit beta_max and rho; return None where rho stays undetermined."""

    def residuals(x: Floats) -> Floats:
        """Compute the misfit of (22) in standard errors.

        Returns
        -------
        Floats
            Shape (amplitudes,).
        """
        misfit: Floats = (x[0] * _share(v, float(x[1])) - beta) / error
        return misfit

    start = [float(beta[np.argmax(v)]) / float(_share(np.array(np.max(v)), rho)), rho]
    solution = solve(residuals, start, ("beta_max", "rho"), [0.5, 5.0], ([-1.0, 1e-6], [1.0, 100.0]))
    value, spread = solution.values, np.sqrt(np.diag(solution.unit_covariance))
    if not 2e-6 < value[1] < _LARGEST_RHO or not spread[1] < _OPEN_RHO:
        return None
    what, percent = "(22) misses the measured residuals", _percent(solution.residuals * error)
    spread = spread * sqrt(_variance(solution.residuals, solution.freedom, what, remarks, percent))
    return Estimate(float(value[0]), float(spread[0])), Estimate(float(value[1]), float(spread[1]))


def _steepest(v: Floats, beta: Floats, error: Floats, rho: float) -> float | None:
    """Return the rho that fits best where it is large and open, if the usual one fits far worse; else None."""
    grid = np.geomspace(_OPEN_RHO, _LARGEST_RHO, 60)

    def cost(one: float) -> float:
        share = _share(v, one) / error
        misfit = float(share @ (beta / error)) / float(share @ share) * share - beta / error
        return float(misfit @ misfit)

    costs = [cost(one) for one in grid.tolist()]
    best = int(np.argmin(costs))
    spread = max(costs[best] / max(len(v) - 1, 1), 1.0)  # the misfit itself counts as an error
    return float(f"{grid[best]:.3g}") if cost(rho) - costs[best] > _CHI2_LIMIT * spread else None


def _height(v: Floats, beta: Floats, error: Floats, rho: float, remarks: list[Remark]) -> tuple[Estimate, Estimate]:
    """Fit beta_max alone."""
    share = _share(v, rho) / error
    value = float(share @ (beta / error)) / float(share @ share)
    misfit = value * share - beta / error
    what = f"(22) with rho = {rho:g} misses the measured residuals"
    variance = _variance(misfit, len(v) - 1, what, remarks, _percent(misfit * error))
    return Estimate(value, sqrt(variance / float(share @ share))), Estimate(rho)


def _peak(branches: Sequence[MeasuredBranch], beta: Floats, error: Floats, remarks: list[Remark]) -> Estimate:
    """Return the mean of u_peak over the amplitudes, weighted by its errors: the paper has one u_peak for all."""
    peaks = [branch.u_peak for branch, b, e in zip(branches, beta, error, strict=True) if b > _NOISE_LIMIT_ERRORS * e]
    if not peaks:
        raise Unphysical(_NO_HYSTERESIS)
    value = np.array([estimate.value for estimate in peaks])
    spread = np.maximum([estimate.standard_error for estimate in peaks], _LEAST_BETA_ERROR)
    weight = 1.0 / spread**2
    mean = float(value @ weight) / float(np.sum(weight))
    misfit = (value - mean) / spread
    low, high = float(np.min(value)), float(np.max(value))
    what = f"u_peak differs from amplitude to amplitude, {low:.3g} to {high:.3g}, where the scanner file has one,"
    more = "; --points writes it as measured, or leave out amplitudes that you do not scan with"
    variance = _variance(misfit, len(peaks) - 1, what, remarks, more=more)
    return Estimate(mean, sqrt(variance / float(np.sum(weight))))


def _percent(residuals: Floats) -> float:
    """Return the rms residual in percent of the scan."""
    return 100.0 * sqrt(float(np.mean(residuals**2)))


def _variance(
    residuals: Floats, freedom: int, what: str, remarks: list[Remark], percent: float = 0.0, more: str = ""
) -> float:
    """Return 1 where errors explain the residuals; otherwise the factor that widens the variance, with a remark."""
    total = float(residuals @ residuals)
    if freedom < 1 or chdtrc(freedom, total) > _SIGNIFICANCE_LEVEL:
        return 1.0
    text = f"{what} by {sqrt(total / freedom):.3g} times their standard errors; these were widened{more}"
    remarks.append(spoils(text, percent, code="poor-fit"))
    return total / freedom * few_points(freedom) ** 2


def _share(v: Floats, rho: float) -> Floats:
    """Return (1 - exp(-rho v)) / (1 - exp(-rho)), equation (22) of unit height."""
    if rho < _STRAIGHT_RHO:
        return np.asarray(v, dtype=np.float64)
    share: Floats = np.expm1(-rho * np.asarray(v)) / expm1(-rho)
    return share
