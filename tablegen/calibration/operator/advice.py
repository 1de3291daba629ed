"""Advise the next trace: the stroke and centre at which the fields are most uncertain, and the rate."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tablegen.calibration.operator.fit import OperatorFit
from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.compensation.identification import MeasuredLine
from tablegen.compensation.models.operator import CENTRE_REACH
from tablegen.compensation.operator.field import covariance
from tablegen.compensation.operator.operator import STROKE_REACH
from tablegen.numerics.arrays import Bools, Floats
from tablegen.numerics.driver import Driver

_STROKES = np.arange(0.1, 1.0, 0.05)
_CENTRES = np.arange(0.1, 0.91, 0.05)
_JITTER = 1e-5  # relative variance that every trace leaves
_LEAST_RMS = 1e-4  # percent
_DECADE = 8.0  # ratio of rates that separates creep from hysteresis


@dataclass(frozen=True, slots=True)
class NextTrace:
    """Where to measure next, in V, and ``unknown``, the relative variance of the fields there.

    It is 1 without data, and 0 without uncertainty.
    """

    size_v: float
    offset_v: float
    unknown: float
    rate_hz: float | None


def next_trace(fit: OperatorFit, lines: Sequence[PeriodicLine | MeasuredLine], driver: Driver | float) -> NextTrace:
    """Return the trace that helps most; ``rate_hz`` is a second rate if all traces have the same."""
    reach = [(s, c) for s in _STROKES for c in _CENTRES if 0.5 * s <= min(c, 1.0 - c) + 1e-9]
    unknown = _unknown(fit, np.array(reach))
    # Of two equal ones, such as those at equal distances to both sides, every machine takes the lower one.
    best = int(np.argmax(np.round(unknown, 9)))
    rates = [line.rate_hz for line in lines]
    other = None if max(rates) > _DECADE * min(rates) else 10.0 * max(rates)
    stroke, centre = reach[best]
    driver = Driver.of(driver)
    return NextTrace(stroke * driver.span, driver.volts(centre), float(max(unknown[best], 0.0)), other)


def beyond_reach(lines: Sequence[PeriodicLine], strokes: Floats, centres: Floats) -> Bools:
    """Return where a build refuses a scan, since nothing was measured near: shape (strokes, centres)."""
    known = np.array([line.centre for line in lines])
    largest = max(line.stroke for line in lines) + STROKE_REACH
    out: Bools = (np.min(np.abs(centres[:, None] - known), axis=1) > CENTRE_REACH) | (strokes[:, None] > largest)
    return out


def expected_rms(fit: OperatorFit, points: Floats) -> Floats:
    """Return the expected rms residual of lines.

    Without uncertainty it is the residual of the fit; it grows with the uncertainty of the fields there, as much
    as it does for the lines that were left out.

    Parameters
    ----------
    points
        Points (stroke, centre), shares of v_max, shape (n, 2).

    Returns
    -------
    Floats
        Residuals in percent of the line, shape (n,).
    """
    inverse = _inverse(fit)
    without = np.sqrt(1.0 / np.diag(inverse))  # of each line, by all others
    scale = np.exp(np.mean([np.log(max(out.rms, _LEAST_RMS)) for out in fit.left_out] - np.log(without)))
    least = float(np.median([errors.rms for errors in fit.in_fit]))
    return np.asarray(np.sqrt(least**2 + scale**2 * np.maximum(_unknown(fit, points), 0.0)), dtype=np.float64)


def _inverse(fit: OperatorFit) -> Floats:
    points = fit.operator.residual.points
    prior = covariance(points, points, fit.operator.residual.lengths)
    return np.asarray(np.linalg.inv(prior + _JITTER * np.eye(len(points))), dtype=np.float64)


def _unknown(fit: OperatorFit, points: Floats) -> Floats:
    """Return the relative variance of the fields at points: 1 without data, 0 without uncertainty."""
    near = covariance(points, fit.operator.residual.points, fit.operator.residual.lengths)
    return np.asarray(1.0 - np.einsum("ij,jk,ik->i", near, _inverse(fit), near), dtype=np.float64)
