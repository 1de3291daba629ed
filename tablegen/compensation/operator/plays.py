"""Generalised Prandtl-Ishlinskii hysteresis: plays on bent drives, whose envelopes may differ, and a polynomial.

An envelope is a bent drive: u + l u (1 - u) + s u (1 - u) (u - 1/2). With one rise and one fall a period a settled play
has a closed form. Of the envelopes g <= h and the threshold r, between drives a and b, it is max(g(u) - r, h(a) + r)
where the drive u rises, and min(h(u) + r, g(b) - r) where it falls; it stands still where g(b) - h(a) is below 2 r.
"""

from dataclasses import dataclass, field

import numpy as np

from tablegen.numerics.arrays import Floats, FloatsLike
from tablegen.numerics.elementary import exp

_LN10 = 2.302585092994046
_FEW = 16  # drives for which one array of all plays is faster than a play at a time
BENDS = 4  # numbers that bend both envelopes of a play
# l and s of two envelopes, of which the lower one pushes where the drive rises: u, u^2 and 1 - (1 - u)^2, both alike.
FIXED_BENDS = np.array([[0.0, 0.0, 0.0, 0.0], [-1.0, 0.0, -1.0, 0.0], [1.0, 0.0, 1.0, 0.0]])


def envelopes(u: FloatsLike, bend: Floats) -> tuple[Floats, Floats]:
    """Return the lower and the upper envelope of plays.

    Parameters
    ----------
    u
        Normalised drives, any shape.
    bend
        Linear and cubic bend of one envelope, then of the other, shape (4,).

    Returns
    -------
    lower, upper
        Bent drives, each of the shape of ``u``.
    """
    linear, cubic, other_linear, other_cubic = bend.tolist()
    one = bent(u, linear, cubic)
    if (linear, cubic) == (other_linear, other_cubic):
        return one, one
    two = bent(u, other_linear, other_cubic)
    return np.minimum(one, two), np.maximum(one, two)


def bent(u: FloatsLike, linear: float, cubic: float) -> Floats:
    """Return the bent drive u + l u (1 - u) + s u (1 - u) (u - 1/2).

    Parameters
    ----------
    u
        Normalised drives, any shape.
    linear, cubic
        The bends l and s.

    Returns
    -------
    Floats
        Shape of ``u``.
    """
    u = np.asarray(u, dtype=np.float64)
    bow = u * (1.0 - u)
    return u + linear * bow + cubic * (bow * (u - 0.5))


def _inner_ends(low: float, high: float, bend: Floats) -> tuple[float, float]:
    """Return the upper envelope at ``low`` and the lower one at ``high``, by the arithmetic of ``envelopes``."""
    linear, cubic, other_linear, other_cubic = bend.tolist()

    def both(u: float) -> tuple[float, float]:
        bow = u * (1.0 - u)
        bow_cubic = bow * (u - 0.5)
        return u + linear * bow + cubic * bow_cubic, u + other_linear * bow + other_cubic * bow_cubic

    return max(both(low)), min(both(high))


def stretch(growth: float, decades: float) -> float:
    """Return the factor of thresholds that grow by 10^``growth`` a decade, so many decades from where it is 1."""
    return exp(_LN10 * growth * decades)


def plays(u: Floats, low: float, high: float, rising: bool, thresholds: Floats, bends: Floats) -> Floats:
    """Return settled plays between the drives ``low`` and ``high``, of shape (bends, thresholds, drives).

    Parameters
    ----------
    u, thresholds, bends
        Normalised drives (drives,), thresholds (k,) and rows of bends (n, 4).
    """
    r = thresholds[:, None]
    positions = []
    for bend in bends:
        lower, upper = envelopes(u, bend)
        least, most = float(envelopes(low, bend)[1]), float(envelopes(high, bend)[0])
        moving = np.maximum(lower - r, least + r) if rising else np.minimum(upper + r, most - r)
        positions.append(np.where(2.0 * r < most - least, moving, 0.5 * (least + most)))
    return np.stack(positions)


@dataclass(frozen=True, eq=False)
class Plays:
    """Weighted plays and a polynomial, in units of the displacement, at normalised drives u of 0..1.

    ``thresholds`` has shape (k,) and ascends from above 0, ``weights`` (n, k), ``bends`` (n, 4): of each row of weights
    the envelopes; ``reversible`` are the coefficients of u, u^2, ... Thresholds grow with the rate, by a factor of
    10^``growth`` a decade, and are ``stretch`` times as large at that of the line.
    """

    thresholds: Floats
    weights: Floats
    reversible: Floats
    bends: Floats = field(default_factory=lambda: FIXED_BENDS)
    growth: float = 0.0
    stretch: float = 1.0

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
        return self._along(u, low, high, (rising,))[0]

    def branches(self, u: Floats, low: float, high: float) -> tuple[Floats, Floats]:
        """Return ``branch`` of both ways, rising and falling."""
        rising, falling = self._along(u, low, high, (True, False))
        return rising, falling

    def _along(self, u: Floats, low: float, high: float, ways: tuple[bool, ...]) -> list[Floats]:
        """Return the branches of some ways, each of the shape of ``u``."""
        power = np.ones_like(u)
        total = np.zeros_like(u)
        for coefficient in self.reversible:
            power = power * u
            total = total + float(coefficient) * power
        if u.ndim == 1 and u.size <= _FEW:
            return [self._at_few(total, u, low, high, rising) for rising in ways]
        totals = [total.copy() for _ in ways]
        # Row by row in one buffer: a table of all plays would leave the cache, and take three times as long.
        row = np.empty_like(u)
        thresholds = (self.stretch * self.thresholds).tolist()
        for bend, weights in zip(self.bends, self.weights.tolist(), strict=True):
            if not any(weights):
                continue
            lower, upper = envelopes(u, bend)
            least, most = _inner_ends(low, high, bend)
            for threshold, weight in zip(thresholds, weights, strict=True):
                if not weight:
                    continue
                if not 2.0 * threshold < most - least:
                    still = weight * (0.5 * (least + most))
                    for total in totals:
                        total += still
                    continue
                for rising, total in zip(ways, totals, strict=True):
                    if rising:
                        np.maximum(np.subtract(lower, threshold, out=row), least + threshold, out=row)
                    else:
                        np.minimum(np.add(upper, threshold, out=row), most - threshold, out=row)
                    row *= weight
                    total += row
        return totals

    def _at_few(self, total: Floats, u: Floats, low: float, high: float, rising: bool) -> Floats:
        """Return ``total`` with the plays of a branch: all of them at once, added one after the other."""
        thresholds, sums = self.stretch * self.thresholds, total[None]
        for bend, weights in zip(self.bends, self.weights, strict=True):
            some = np.flatnonzero(weights)
            if not len(some):
                continue
            lower, upper = envelopes(u, bend)
            least, most = _inner_ends(low, high, bend)
            r, weight = thresholds[some, None], weights[some, None]
            moving = np.maximum(lower - r, least + r) if rising else np.minimum(upper + r, most - r)
            positions = np.where(2.0 * r < most - least, moving, 0.5 * (least + most))
            sums = np.add.accumulate(np.concatenate([sums, weight * positions]), axis=0)[-1:]
        return np.asarray(sums[0])

    def branch_of_loops(self, u: Floats, low: Floats, high: Floats, rising: bool) -> Floats:
        """Return ``branch`` of several loops, with every bit of it.

        Parameters
        ----------
        u
            Normalised drives, a row for each loop, shape (loops, n).
        low, high
            Normalised drives at the ends of each loop, shape (loops,).
        rising
            True for the branches on which the drive rises.

        Returns
        -------
        Floats
            In units of the displacement, shape of ``u``.
        """
        power, total, row = np.ones_like(u), np.zeros_like(u), np.empty_like(u)
        for coefficient in self.reversible:
            power = power * u
            total = total + float(coefficient) * power
        thresholds = self.stretch * self.thresholds
        for bend, weights in zip(self.bends, self.weights.tolist(), strict=True):
            if not any(weights):
                continue
            least, most = envelopes(low, bend)[1], envelopes(high, bend)[0]
            # What a play goes on from, and where it stands still: no drive pushes it out of there.
            at = least[:, None] + thresholds if rising else most[:, None] - thresholds
            moving = 2.0 * thresholds < (most - least)[:, None]
            at = np.where(moving, at, (0.5 * (least + most))[:, None])
            edge = envelopes(u, bend)[0 if rising else 1].copy()
            # Thresholds ascend: a play stands still where one of a smaller threshold does.
            stops = np.sum(moving, axis=1).tolist()
            last = max(stops)
            standing: dict[int, list[int]] = {}
            for loop, stop in enumerate(stops):
                standing.setdefault(stop, []).append(loop)
            columns = [at[:, number, None] for number in range(len(thresholds))]
            for number, (threshold, weight) in enumerate(zip(thresholds.tolist(), weights, strict=True)):
                if number in standing:
                    edge[standing[number]] = -np.inf if rising else np.inf
                if not weight:
                    continue
                if number >= last:
                    total += weight * columns[number]
                    continue
                if rising:
                    np.maximum(np.subtract(edge, threshold, out=row), columns[number], out=row)
                else:
                    np.minimum(np.add(edge, threshold, out=row), columns[number], out=row)
                row *= weight
                total += row
        return total


NO_PLAYS = Plays(np.zeros(0), np.zeros((1, 0)), np.ones(1), FIXED_BENDS[:1])
