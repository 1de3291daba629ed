"""One settled loop: the position of the axis on its way up and on its way down, against the drive."""

import numpy as np
from msgspec import Struct

from tablegen.numerics.arrays import Floats, FloatsLike, Ints, freeze, tree_sum

POINTS = 1025  # points of a branch; linear between them


def _bend_weights() -> Floats:
    """Return P_2 at the points of a branch, half of it at its ends, shape (POINTS,)."""
    x = 2.0 * np.arange(POINTS) / (POINTS - 1) - 1.0
    weight = 0.5 * (3.0 * x * x - 1.0)
    weight[[0, -1]] *= 0.5
    freeze(weight)
    return weight


_BEND_WEIGHTS = _bend_weights()


class Loop(Struct, frozen=True, eq=False):
    """A settled loop between the normalised drives ``low`` and ``high``.

    ``rising`` and ``falling`` are positions from 0 to 1 at ``POINTS`` drives, evenly from ``low`` to ``high``; a
    position of 1 is ``extent_nm``. Beyond its ends a branch is extrapolated linearly.
    """

    low: float
    high: float
    rising: Floats
    falling: Floats
    extent_nm: float

    def position(self, u: Floats, rising: bool) -> Floats:
        """Return the positions at normalised drives.

        Parameters
        ----------
        u
            Normalised drives, any shape.
        rising
            True for the branch on which the drive rises.

        Returns
        -------
        Floats
            Positions, 0..1 between the ends of the loop, shape of ``u``.
        """
        values = self.rising if rising else self.falling
        v = (u - self.low) * ((POINTS - 1) / (self.high - self.low))
        left = np.clip(v, 0.0, POINTS - 2).astype(np.int64)
        return values[left] + (v - left) * (values[left + 1] - values[left])

    def drive(self, position: FloatsLike, rising: bool) -> Floats:
        """Return the normalised drives at positions: the inverse of ``position``.

        Parameters
        ----------
        position
            Positions, 0..1 between the ends of the loop, any shape.
        rising
            True for the branch on which the drive rises.

        Returns
        -------
        Floats
            Normalised drives, shape of ``position``.
        """
        values = self.rising if rising else self.falling
        p = np.asarray(position, dtype=np.float64)
        left: Ints = np.clip(np.searchsorted(values, p, side="right") - 1, 0, POINTS - 2)
        v = left + (p - values[left]) / (values[left + 1] - values[left])
        return self.low + (self.high - self.low) / (POINTS - 1) * v

    def grown(self, mean: float) -> float:
        """Return by which share the loop is larger than one of its stroke about ``mean``, to first order, by its bend.

        Halfway between both branches there is little hysteresis. Where that curve is bent, the slope is another one at
        other drives: with b P_2 of the curve, by 12 b over the length of the stroke.
        """
        middle = 0.5 * (self.rising + self.falling) - 0.5
        bend = 2.5 * float(tree_sum(_BEND_WEIGHTS * middle)) * 2.0 / (POINTS - 1)
        return 12.0 * bend * (0.5 * (self.low + self.high) - mean) / (self.high - self.low)

    @property
    def least_slope(self) -> float:
        """The least slope of both branches, relative to a straight line's."""
        steps = min(float(np.min(np.diff(branch))) for branch in (self.rising, self.falling))
        return steps * (POINTS - 1)
