"""Least squares with reliable standard errors, and with the names of the parameters that the data do not determine."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import nan, sqrt

import numpy as np
from scipy.optimize import least_squares
from scipy.special import stdtrit

from tablegen.base.input_errors import Unphysical
from tablegen.fitting.estimate import Estimate
from tablegen.numerics.arrays import Floats

_NORMAL_AT_2_SIGMA = 0.9772498680518208  # of the normal distribution: below two standard errors, one-sided
_SCATTER_STEPS = 20
_SINGULAR_VALUE_LIMIT = 1e-10  # relative to the largest; finite differences turn a zero into less than this


@dataclass(frozen=True)
class Solution:
    """Values, their covariance for a unit variance of the residuals, and the residuals.

    ``undetermined`` names the parameters that can move by their whole scale without an effect on the data.
    With ``absolute_errors`` residuals are in standard errors that hold without their scatter; where they scatter more,
    ``scatter`` is what was added to each error, a share of the value.
    """

    names: tuple[str, ...]
    values: Floats
    unit_covariance: Floats
    residuals: Floats
    jacobian: Floats
    undetermined: tuple[str, ...]
    absolute_errors: bool = False
    scatter: float = 0.0

    @property
    def freedom(self) -> int:
        """Number of points less that of fitted parameters."""
        return len(self.residuals) - len(self.names)

    @property
    def variance(self) -> float:
        """Variance of the residuals; nan if it is unknown and there are no more points than parameters."""
        if self.absolute_errors:
            return 1.0
        return float(self.residuals @ self.residuals) / self.freedom if self.freedom > 0 else nan

    def estimate(self, name: str) -> Estimate:
        """Return one parameter, its error widened for few points."""
        i = self.names.index(name)
        if self.absolute_errors:
            widened = few_points(self.freedom) if self.scatter > 0.0 else 1.0
            return Estimate(float(self.values[i]), sqrt(self.unit_covariance[i, i]) * widened)
        error = sqrt(self.unit_covariance[i, i] * self.variance) if self.freedom > 0 else nan
        return Estimate(float(self.values[i]), error * few_points(self.freedom))


def few_points(freedom: int) -> float:
    """Return the factor by which Student's distribution widens two standard errors; nan without degrees of freedom."""
    return float(stdtrit(freedom, _NORMAL_AT_2_SIGMA)) / 2.0 if freedom > 0 else nan


def solve(
    residuals: Callable[[Floats], Floats],
    start: Sequence[float] | Floats,
    names: Sequence[str],
    scales: Sequence[float] | Floats,
    bounds: tuple[Sequence[float], Sequence[float]] | None = None,
    jacobian: Callable[[Floats], Floats] | None = None,
) -> Solution:
    """Minimise the sum of squares of ``residuals``.

    Parameters
    ----------
    residuals
        Function of parameters, shape (parameters,), to residuals, shape (points,).
    start
        Parameters to begin with, shape (parameters,).
    names
        Name of each parameter.
    scales
        Range of each parameter from scanner to scanner, in its unit, shape (parameters,): one whose standard error is
        larger is undetermined.
    bounds
        Lower and upper limits, shape (parameters,) each.
    jacobian
        Function of parameters to derivatives of the residuals, shape (points, parameters); differences by default.

    Raises
    ------
    Unphysical
        If the minimisation does not converge.
    """
    start = np.asarray(start, dtype=np.float64)
    scales = np.asarray(scales, dtype=np.float64)
    low, high = (np.full(len(start), -np.inf), np.full(len(start), np.inf)) if bounds is None else map(np.array, bounds)
    minimum = least_squares(
        residuals,
        np.clip(start, low + 1e-9 * scales, high - 1e-9 * scales),
        jac="3-point" if jacobian is None else jacobian,
        bounds=(low, high),
        x_scale=scales,
        xtol=1e-13,
        ftol=1e-13,
        gtol=1e-13,
        max_nfev=200,
    )
    if not minimum.success or not np.all(np.isfinite(minimum.x)):
        raise Unphysical("the fit does not converge; check the data for gaps, steps and wrong units")
    values, misfit = minimum.x, minimum.fun
    jac = np.asarray(minimum.jac)
    _, size, directions = np.linalg.svd(jac * scales, full_matrices=False)
    size = np.append(size, np.zeros(len(values) - len(size)))
    weak = size <= _SINGULAR_VALUE_LIMIT * size[0]
    inverse = np.where(weak, 0.0, 1.0 / np.where(weak, 1.0, size)) ** 2
    rows = directions[: len(size)]
    covariance = (rows.T * inverse[: len(rows)]) @ rows * np.outer(scales, scales)
    blind = np.sqrt(np.sum(rows[weak[: len(rows)]] ** 2, axis=0)) > 0.1
    if len(rows) < len(values):  # fewer points than parameters: directions without any point
        blind |= np.sum(rows**2, axis=0) < 0.99
    freedom = len(misfit) - len(values)
    if freedom > 0:
        errors = np.sqrt(np.diag(covariance) * float(misfit @ misfit) / freedom)
        blind |= errors * few_points(freedom) > scales
    undetermined = tuple(name for name, is_blind in zip(names, blind, strict=True) if is_blind)
    return Solution(tuple(names), values, covariance, misfit, jac, undetermined)


def with_errors(fit: Callable[[Floats], Solution], values: Floats, errors: Floats) -> Solution:
    """Fit values whose standard errors are given; ``fit`` solves for some errors, residuals in units of them.

    Where values scatter by more than that, since no law is exact, all get one relative error more: as much as makes
    their scatter the expected one (Paule and Mandel, 1982). Else precise values would bend the law for all others.

    Parameters
    ----------
    fit
        Function of standard errors, shape (points,), to a solution.
    values
        Measured values, shape (points,).
    errors
        Their standard errors, in the unit of the values, shape (points,).
    """

    def at(share: float) -> Solution:
        return replace(fit(np.hypot(errors, share * values)), absolute_errors=True, scatter=share)

    def excess(solution: Solution) -> float:
        return float(solution.residuals @ solution.residuals) - solution.freedom

    best = at(0.0)
    if best.freedom <= 0 or excess(best) <= 0.0:
        return best
    low, high = 0.0, float(np.max(np.abs(best.residuals) * errors / values))
    for _ in range(_SCATTER_STEPS):
        middle = 0.5 * (low + high)
        best = at(middle)
        low, high = (middle, high) if excess(best) > 0.0 else (low, middle)
    return at(high)
