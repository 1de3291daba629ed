"""Which further trace would help most: the stroke and centre at which the fields are known least, and the rate."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tablegen.calibration.operator.fit import OperatorFit
from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.compensation.operator.field import covariance

_STROKES = np.arange(0.1, 1.0, 0.05)
_CENTRES = np.arange(0.1, 0.91, 0.05)
_JITTER = 1e-5  # what every trace leaves open, of all that there is to know
_DECADE = 8.0  # ratio of rates that tells creep from hysteresis


@dataclass(frozen=True, slots=True)
class NextTrace:
    """Where to measure next, in V, and how little is known there: 1 is nothing, 0 all."""

    size_v: float
    offset_v: float
    unknown: float
    rate_hz: float | None


def next_trace(fit: OperatorFit, lines: Sequence[PeriodicLine], v_max: float) -> NextTrace:
    """The trace that helps most; ``rate_hz`` is another rate than that of all traces, where they have but one."""
    lengths = fit.operator.residual.lengths
    points = fit.operator.residual.points
    known = np.linalg.inv(covariance(points, points, lengths) + _JITTER * np.eye(len(points)))
    reach = [(s, c) for s in _STROKES for c in _CENTRES if 0.5 * s <= min(c, 1.0 - c) + 1e-9]
    near = covariance(np.array(reach), points, lengths)
    unknown = 1.0 - np.einsum("ij,jk,ik->i", near, known, near)
    best = int(np.argmax(unknown))
    rates = [line.rate_hz for line in lines]
    other = None if max(rates) > _DECADE * min(rates) else 10.0 * max(rates)
    stroke, centre = reach[best]
    return NextTrace(stroke * v_max, centre * v_max, float(max(unknown[best], 0.0)), other)
