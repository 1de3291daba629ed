"""The residual at the measured strokes and centres, interpolated over both without a formula: a Gaussian process.

The covariance of two points is Matern's of order 5/2 in the distance of their strokes, times the same in that of their
centres, each over its own length; at the points themselves the field is what was measured, but for the noise. Far from
all of them it returns to 0, that is to the parametric hysteresis family.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import sqrt

import numpy as np

from tablegen.numerics.arrays import Floats
from tablegen.numerics.elementary import exp
from tablegen.numerics.linear import Cholesky

_STRAIGHT = 0.9  # share of the covariance that vanishes at a stroke of 0; creep bends even the smallest lines
SAME_CENTRE = 0.02  # of v_max: lines whose centres differ by less have one centre


@dataclass(frozen=True, slots=True)
class Lengths:
    """The lengths of stroke and of centre, as shares of v_max, over which the field changes; and the noise.

    ``noise`` is its variance relative to that of the field.
    """

    stroke: float
    centre: float
    noise: float


def covariance(points: Floats, others: Floats, lengths: Lengths, straight: bool = False) -> Floats:
    """Return the covariance of points in the plane of stroke and centre.

    Without ``straight`` it is 1 where they coincide; with it the value at a stroke of 0 is nearly known to be 0.

    Parameters
    ----------
    points, others
        Rows (stroke, centre), normalised drives, shapes (n, 2) and (m, 2).
    lengths
        Correlation lengths in stroke and centre.

    Returns
    -------
    Floats
        Shape (n, m).
    """
    out = np.empty((len(points), len(others)))
    for i, (stroke, centre) in enumerate(points.tolist()):
        for j, (other_stroke, other_centre) in enumerate(others.tolist()):
            along = _matern((stroke - other_stroke) / lengths.stroke)
            if straight:
                along -= _STRAIGHT * _matern(stroke / lengths.stroke) * _matern(other_stroke / lengths.stroke)
            out[i, j] = along * _matern((centre - other_centre) / lengths.centre)
    return out


@lru_cache(maxsize=1 << 14)  # an exact exp takes its time, and the same distances come again and again
def _matern(distance: float) -> float:
    d = sqrt(5.0) * abs(distance)
    return (1.0 + d + d * d / 3.0) * exp(-d)


@dataclass(frozen=True, eq=False)
class Field:
    """A field of rows known at ``points``, shape (n, 2) of (stroke, centre); ``weights`` has shape (n, columns).

    A ``straight`` one tends to 0 with the stroke, but for what all strokes have in common.
    """

    points: Floats
    weights: Floats
    lengths: Lengths
    straight: bool = False

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
        near = covariance(np.array([[stroke, centre]]), self.points, self.lengths, self.straight)[0]
        total = np.zeros(self.weights.shape[1])
        for weight, row in zip(near.tolist(), self.weights, strict=True):
            total = total + weight * row
        return total


def through(points: Floats, rows: Floats, lengths: Lengths, straight: bool = False) -> Field:
    """Return the field that has these rows at these points, but for the noise.

    Parameters
    ----------
    points, rows
        Shapes (n, 2) of (stroke, centre) and (n, columns).
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
