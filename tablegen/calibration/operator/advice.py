"""Advise the next trace: the stroke and centre whose measurement helps the scans most, and the rate."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.operator.fit import OperatorFit
from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.compensation.identification import MeasuredLine
from tablegen.compensation.operator.field import Lengths, covariance
from tablegen.compensation.operator.operator import CENTRE_REACH, STROKE_REACH, Operator
from tablegen.compensation.operator.uncertainty import possible_errors
from tablegen.numerics.arrays import Bools, Floats
from tablegen.numerics.driver import Driver

_STROKES = np.arange(0.1, 1.0, 0.05)
_CENTRES = np.arange(0.1, 0.91, 0.05)
_JITTER = 1e-5  # relative variance that every trace leaves
_NOISE = 1e-4  # relative variance that the next trace leaves: a slope from two near points is not worth much
_COARSE = 31  # points of a map each way, between which the error is interpolated
_DECADE = 8.0  # ratio of rates that separates creep from hysteresis

_Line = PeriodicLine | MeasuredLine


@dataclass(frozen=True, slots=True)
class NextTrace:
    """Where to measure next, in V, and ``left``, the share of the uncertainty of the fields that it leaves.

    It is the rms uncertainty over the scans that the trace is for, after it over before it: 0 to 1.
    """

    size_v: float
    offset_v: float
    left: float
    rate_hz: float | None

    @property
    def record(self) -> dict[str, float | None]:
        """As plain data, for JSON."""
        return {
            "size_v": self.size_v,
            "offset_v": self.offset_v,
            "rate_hz": self.rate_hz,
            "uncertainty_left_share": self.left,
        }


def check_scans(scans: Sequence[tuple[float, float]], driver: Driver) -> None:
    """Refuse scans, as voltage peak to peak and offset in V, that the driver does not reach.

    Raises
    ------
    Unphysical
        If one is refused.
    """
    for volts, offset in scans:
        if not (volts > 0.0 and driver.beyond(offset - 0.5 * volts, offset + 0.5 * volts) <= 1e-9 * driver.span):
            raise Unphysical(
                f"a scan of {volts:g} V at {offset:g} V is not within {driver.v_min:g}..{driver.v_max:g} V; give its "
                "voltage peak to peak, above 0, and its offset, both at the piezo"
            )


def next_trace(
    fit: OperatorFit, lines: Sequence[_Line], driver: Driver | float, scans: Sequence[tuple[float, float]] = ()
) -> NextTrace:
    """Return the trace of one of the scans that helps them all most; ``rate_hz`` is a second rate if all have one.

    A trace lowers the variance of the fields at a point by the square of their covariance over the trace's own
    variance. The best one lowers the mean over the scans most.

    Parameters
    ----------
    scans
        Scan voltages peak to peak and offsets, in V; without any, all that a build serves.
    """
    driver = Driver.of(driver)
    points = np.array([(volts / driver.span, driver.share(offset)) for volts, offset in scans] or _served(lines))
    gain = _gain(fit, points, points)
    # Of two equal ones, such as those at equal distances to both sides, every machine takes the lower one.
    best = int(np.argmax(np.round(np.mean(gain, axis=1), 9)))
    rates = [line.rate_hz for line in lines]
    other = None if max(rates) > _DECADE * min(rates) else 10.0 * max(rates)
    stroke, centre = (float(value) for value in points[best])
    unknown = float(np.mean(np.maximum(_unknown(fit, points), _JITTER)))
    left = sqrt(max(1.0 - float(np.mean(gain[best])) / unknown, 0.0))
    return NextTrace(stroke * driver.span, driver.volts(centre), left, other)


def _served(lines: Sequence[_Line]) -> list[tuple[float, float]]:
    """Return strokes and centres that the driver reaches and that a build does not refuse."""
    refused = beyond_reach(lines, _STROKES, _CENTRES)
    reach = [
        (float(s), float(c), bool(refused[i, j]))
        for i, s in enumerate(_STROKES)
        for j, c in enumerate(_CENTRES)
        if 0.5 * s <= min(c, 1.0 - c) + 1e-9
    ]
    # Of traces that are all small, a build serves only sizes below those of the table.
    none = all(beyond for _, _, beyond in reach)
    return [(s, c) for s, c, beyond in reach if none or not beyond]


def _gain(fit: OperatorFit, traces: Floats, scans: Floats) -> Floats:
    """Return by how much a trace lowers the relative variance at each scan: shape (traces, scans)."""
    points, lengths = fit.operator.residual.points, _lengths(fit)
    inverse = _inverse(fit)
    near = covariance(traces, points, lengths)
    joint = covariance(traces, scans, lengths) - near @ inverse @ covariance(points, scans, lengths)
    own = 1.0 - np.einsum("ij,jk,ik->i", near, inverse, near)
    return np.asarray(joint**2 / (np.maximum(own, 0.0) + _NOISE)[:, None], dtype=np.float64)


def beyond_reach(lines: Sequence[_Line], strokes: Floats, centres: Floats) -> Bools:
    """Return where a build refuses a scan, since nothing was measured near: shape (strokes, centres)."""
    known = np.array([line.centre for line in lines])
    largest = max(line.stroke for line in lines) + STROKE_REACH
    out: Bools = (np.min(np.abs(centres[:, None] - known), axis=1) > CENTRE_REACH) | (strokes[:, None] > largest)
    return out


def possible_rms(operator: Operator, strokes: Floats, centres: Floats) -> Floats:
    """Return the rms residual that nine of ten lines stay below: that of a build, without the converter's part.

    It grows with the distance from the traces, and with that from their offsets.

    Parameters
    ----------
    strokes, centres
        Shares of v_max, ascending, shapes (n,) and (m,).

    Returns
    -------
    Floats
        Residuals in percent of the line, shape (n, m).
    """
    coarse = [np.linspace(float(np.min(axis)), float(np.max(axis)), _COARSE) for axis in (strokes, centres)]

    def at(stroke: float, centre: float) -> float:  # beyond the driver's range, that of its edge
        within = min(max(centre, 0.5 * stroke), 1.0 - 0.5 * stroke)
        return possible_errors(operator, stroke, within)[0]

    rms = np.array([[at(stroke, centre) for centre in coarse[1].tolist()] for stroke in coarse[0].tolist()])
    rows = np.stack([np.interp(centres, coarse[1], row) for row in rms])
    return np.stack([np.interp(strokes, coarse[0], column) for column in rows.T], axis=1)


def _lengths(fit: OperatorFit) -> Lengths:
    """Return the lengths of the fields, for traces and scans of any rate."""
    return replace(fit.operator.residual.lengths, rate_share=0.0)


def _inverse(fit: OperatorFit) -> Floats:
    points = fit.operator.residual.points
    prior = covariance(points, points, _lengths(fit))
    return np.asarray(np.linalg.inv(prior + _JITTER * np.eye(len(points))), dtype=np.float64)


def _unknown(fit: OperatorFit, points: Floats) -> Floats:
    """Return the relative variance of the fields at points: 1 without data, 0 without uncertainty."""
    near = covariance(points, fit.operator.residual.points, _lengths(fit))
    return np.asarray(1.0 - np.einsum("ij,jk,ik->i", near, _inverse(fit), near), dtype=np.float64)
