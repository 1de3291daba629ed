"""The hysteresis family of an operator: plays over a polynomial, and Bouc and Wen's equation, each with its weight."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from tablegen.compensation.operator.bouc_wen import BoucWen
from tablegen.compensation.operator.plays import Plays, stretch
from tablegen.numerics.arrays import Floats


@dataclass(frozen=True, eq=False)
class Family:
    """The sum of the plays and of Bouc and Wen's equation."""

    plays: Plays
    bouc_wen: BoucWen | None = None

    @property
    def has_hysteresis(self) -> bool:
        """False for the family ``none``, which is a straight line."""
        return self.bouc_wen is not None or len(self.plays.thresholds) > 0

    def branch(self, u: Floats, low: float, high: float, rising: bool) -> Floats:
        """Return the displacement on one branch of a settled line, up to a constant.

        Parameters
        ----------
        u
            Normalised drives, any shape.
        low, high
            Normalised drives at the ends of the line, low < high.
        rising
            True for the branch on which the drive rises.

        Returns
        -------
        Floats
            In units of the displacement, shape of ``u``.
        """
        displacement = self.plays.branch(u, low, high, rising)
        return displacement if self.bouc_wen is None else displacement + self.bouc_wen.branch(u, low, high, rising)

    def branches(self, u: Floats, low: float, high: float) -> tuple[Floats, Floats]:
        """Return ``branch`` of both ways, rising and falling."""
        rising, falling = self.plays.branches(u, low, high)
        if self.bouc_wen is None:
            return rising, falling
        loop = self.bouc_wen
        return rising + loop.branch(u, low, high, True), falling + loop.branch(u, low, high, False)

    def branch_of_loops(self, u: Floats, low: Floats, high: Floats, rising: bool) -> Floats:
        """Return ``branch`` of several loops, a row of drives for each: shapes (loops, n) and (loops,)."""
        displacement = self.plays.branch_of_loops(u, low, high, rising)
        if self.bouc_wen is not None:
            ends = zip(low.tolist(), high.tolist(), strict=True)
            for row, drives, (least, most) in zip(displacement, u, ends, strict=True):
                row += self.bouc_wen.branch(drives, least, most, rising)
        return displacement

    def at_decades(self, decades: float) -> "Family":
        """Return the family at a rate so many decades above that of its thresholds."""
        return _at_decades(self, decades) if self.plays.growth else self

    def extent(self, stroke: float, centre: float) -> float:
        """Return the nm between the turns of a settled line."""
        return _extent(self, stroke, centre)

    def over(self, reversible: Floats) -> "Family":
        """Return the family over another polynomial.

        Parameters
        ----------
        reversible
            Coefficients of u, u^2, ..., shape (k,).

        Returns
        -------
        Family
            Its hysteresis is the same.
        """
        return replace(self, plays=replace(self.plays, reversible=reversible))

    def weighted(self, share: float, other: "Family") -> "Family":
        """Return a share of this family and the rest of another one, of which at most one has plays."""
        mine, theirs = self.plays, other.plays
        reversible = np.zeros(max(len(mine.reversible), len(theirs.reversible)))
        reversible[: len(mine.reversible)] += share * mine.reversible
        reversible[: len(theirs.reversible)] += (1.0 - share) * theirs.reversible
        with_plays, part = (mine, share) if len(mine.thresholds) else (theirs, 1.0 - share)
        plays = replace(with_plays, weights=part * with_plays.weights, reversible=reversible)
        loops = [(one, by) for one, by in ((self.bouc_wen, share), (other.bouc_wen, 1.0 - share)) if one is not None]
        ((loop, by),) = loops or ((None, 0.0),)
        return Family(plays, None if loop is None else replace(loop, depth=by * loop.depth))


@lru_cache(maxsize=256)  # of small strokes it is asked for again and again
def _extent(family: Family, stroke: float, centre: float) -> float:
    low, high = centre - 0.5 * stroke, centre + 0.5 * stroke
    ends = family.branch(np.array([low, high]), low, high, True)
    return float(ends[1] - ends[0])


@lru_cache(maxsize=64)
def _at_decades(family: Family, decades: float) -> Family:
    plays = family.plays
    return replace(family, plays=replace(plays, stretch=stretch(plays.growth, decades)))
