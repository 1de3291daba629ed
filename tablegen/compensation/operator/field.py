"""The residual at the measured strokes, centres and rates, interpolated without a formula: a Gaussian process.

The covariance of two points is Matern's of order 5/2 in the distance of their strokes, times the same in that of their
centres, each over its own length; a share of it is that of the decades of their rates, too. At the points themselves
the field is what was measured, but for the noise. Far from all of them it returns to 0, that is to the parametric
hysteresis family; at another rate than all of theirs only by that share.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import sqrt
from typing import Protocol

import numpy as np

from tablegen.numerics.arrays import Floats
from tablegen.numerics.elementary import exp, exps, log10
from tablegen.numerics.linear import Cholesky

_STRAIGHT = 0.9  # share of the covariance that vanishes at a stroke of 0; creep bends even the smallest lines
_DECADES = 1.0  # of the rate, over which the share that depends on it changes
SAME_CENTRE = 0.02  # of v_max: lines whose centres differ by less have one centre


@dataclass(frozen=True, slots=True)
class Lengths:
    """The lengths of stroke and of centre, as shares of v_max, over which the field changes; and the noise.

    ``noise`` is its variance relative to that of the field, ``rate_share`` the share of the field that depends on the
    rate.
    """

    stroke: float
    centre: float
    noise: float
    rate_share: float = 0.0


class Line(Protocol):
    """A settled line, as far as a field needs it."""

    @property
    def stroke(self) -> float:
        """Share of v_max."""

    @property
    def centre(self) -> float:
        """Share of v_max."""

    @property
    def rate_hz(self) -> float:
        """Periods per second."""


def points_of(lines: Sequence[Line]) -> Floats:
    """Return stroke, centre and decade of the rate of lines: the decimal logarithm of its Hz; shape (lines, 3)."""
    return np.array([(line.stroke, line.centre, log10(line.rate_hz)) for line in lines])


def covariance(points: Floats, others: Floats, lengths: Lengths, straight: bool = False) -> Floats:
    """Return the covariance of points in stroke, centre and rate.

    Without ``straight`` it is 1 where they coincide; with it the value at a stroke of 0 is nearly known to be 0.

    Parameters
    ----------
    points, others
        Rows (stroke, centre, decade), normalised drives, shapes (n, 3) and (m, 3); decades may be missing where no
        share of the field depends on the rate.
    lengths
        Correlation lengths in stroke and centre, and the share that depends on the rate.

    Returns
    -------
    Floats
        Shape (n, m).
    """
    out = np.empty((len(points), len(others)))
    for i, (stroke, centre) in enumerate(points[:, :2].tolist()):
        for j, (other_stroke, other_centre) in enumerate(others[:, :2].tolist()):
            along = _matern((stroke - other_stroke) / lengths.stroke)
            if straight:
                along -= _STRAIGHT * _matern(stroke / lengths.stroke) * _matern(other_stroke / lengths.stroke)
            out[i, j] = along * _matern((centre - other_centre) / lengths.centre)
            if lengths.rate_share:
                apart = _matern((points[i, 2] - others[j, 2]) / _DECADES)
                out[i, j] *= 1.0 - lengths.rate_share * (1.0 - apart)
    return out


def covariance_of_many(points: Floats, others: Floats, lengths: Lengths, straight: bool = False) -> Floats:
    """Return ``covariance``, with every bit of it: faster for many points that were not asked for before."""
    stroke, other_stroke = points[:, 0, None] / lengths.stroke, others[:, 0] / lengths.stroke
    between = (points[:, 0, None] - others[:, 0]) / lengths.stroke, (points[:, 1, None] - others[:, 1]) / lengths.centre
    along, centres = _matern_of_many(np.stack(between))
    if straight:
        along = along - _STRAIGHT * _matern_of_many(stroke) * _matern_of_many(other_stroke)
    out = along * centres
    if lengths.rate_share:
        apart = _matern_of_many((points[:, 2, None] - others[:, 2]) / _DECADES)
        out = out * (1.0 - lengths.rate_share * (1.0 - apart))
    return np.asarray(out)


@lru_cache(maxsize=1 << 14)  # an exact exp takes its time, and the same distances come again and again
def _matern(distance: float) -> float:
    d = sqrt(5.0) * abs(distance)
    return (1.0 + d + d * d / 3.0) * exp(-d)


def _matern_of_many(distances: Floats) -> Floats:
    different, places = np.unique(distances, return_inverse=True)  # a loop has two branches, and lines share centres
    d = sqrt(5.0) * np.abs(different)
    return np.asarray(((1.0 + d + d * d / 3.0) * exps(-d))[places].reshape(distances.shape))


@dataclass(frozen=True, eq=False)
class Field:
    """A field of rows known at ``points``, those of ``points_of``; ``weights`` has shape (n, columns).

    A ``straight`` one tends to 0 with the stroke, but for what all strokes have in common. ``decade`` is that of the
    rate of the lines for which it is computed.
    """

    points: Floats
    weights: Floats
    lengths: Lengths
    straight: bool = False
    decade: float = 0.0

    def at_rate(self, rate_hz: float) -> "Field":
        """Return the field for lines of a rate."""
        return replace(self, decade=log10(rate_hz)) if self.lengths.rate_share else self

    def at(self, stroke: float, centre: float) -> Floats:
        """Return the row at a stroke and a centre.

        Parameters
        ----------
        stroke, centre
            Normalised drives.

        Returns
        -------
        Floats
            Interpolated values, shape (columns,).
        """
        here = np.array([[stroke, centre, self.decade]])
        near = covariance(here, self.points, self.lengths, self.straight)[0]
        total = np.zeros(self.weights.shape[1])
        for weight, row in zip(near.tolist(), self.weights, strict=True):
            total = total + weight * row
        return total

    def at_many(self, strokes: Floats, centres: Floats) -> Floats:
        """Return ``at`` of many strokes and centres, with every bit of it.

        Parameters
        ----------
        strokes, centres
            Normalised drives, shapes (n,).

        Returns
        -------
        Floats
            Interpolated values, shape (n, columns).
        """
        here = np.stack([strokes, centres, np.full_like(strokes, self.decade)], axis=1)
        near = covariance_of_many(here, self.points, self.lengths, self.straight)
        total = np.zeros((len(strokes), self.weights.shape[1]))
        for weights, row in zip(near.T, self.weights, strict=True):
            total = total + weights[:, None] * row
        return total


def through(points: Floats, rows: Floats, lengths: Lengths, straight: bool = False) -> Field:
    """Return the field that has these rows at these points, but for the noise.

    Parameters
    ----------
    points, rows
        Those of ``points_of``, and shape (n, columns).
    """
    known = covariance(points, points, lengths, straight)
    factor = Cholesky(known + lengths.noise * np.diag(np.diag(known)))
    return Field(points, np.stack([factor.solve(column) for column in rows.T], axis=1), lengths, straight)


def distinct(centres: Sequence[float]) -> list[float]:
    """Return the first of all centres that are the same within ``SAME_CENTRE``."""
    centres_apart: list[float] = []
    for centre in centres:
        if all(abs(centre - other) >= SAME_CENTRE for other in centres_apart):
            centres_apart.append(centre)
    return centres_apart
