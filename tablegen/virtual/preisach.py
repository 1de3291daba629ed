"""Hysteresis: a Preisach operator with a smooth density over the triangle 0 <= beta <= alpha <= 1 of switching drives.

The density and the slope of the reversible part are Bernstein polynomials with coefficients >= 0: no branch runs
backwards, and the Everett function, the change along a branch since its turning point, is a polynomial. A drive is
therefore played exactly, one polynomial for each piece of a branch, without a grid of relays.
"""

from dataclasses import dataclass
from functools import cached_property
from math import factorial

import numpy as np

from tablegen.numerics.arrays import Floats, FloatsLike
from tablegen.virtual.pieces import monotonic, normalised, one_minus, powers_of


@dataclass(frozen=True, slots=True)
class TurningPoints:
    """Turning points that are not wiped out, from 0 on, lows and highs by turns, and the displacement at each, in nm.

    The last one is where the drive is now.
    """

    drives: tuple[float, ...] = (0.0,)
    displacements: tuple[float, ...] = (0.0,)


@dataclass(frozen=True)
class Preisach:
    """The operator; drive normalised to 0..1, displacement in nm above that at drive 0 after rest.

    ``reversible``: Bernstein coefficients of the reversible slope over 0..1, in nm per full drive. ``density[i][j]``:
    of (1 - alpha)^i (alpha - beta)^j beta^(n - i - j), in nm per full drive squared, in n + 1 rows of n + 1, n, ... 1.
    """

    reversible: tuple[float, ...]
    density: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        if not self.reversible or [len(row) for row in self.density] != list(range(len(self.density), 0, -1)):
            raise ValueError("a density of degree n has n + 1 rows of n + 1, n, ..., 1 coefficients")
        if min(min(self.reversible), min(map(min, self.density), default=0.0)) < 0.0:
            raise ValueError("a coefficient below 0 would let a branch run backwards")

    @cached_property
    def everett(self) -> Floats:
        """The coefficients of the Everett function E(alpha, beta).

        Returns
        -------
        e[p, q] of alpha^p beta^q, in nm, shape (size, size).
        """
        n, m = len(self.density) - 1, len(self.reversible)
        size = max(n + 3, m + 1)
        out = np.zeros((size, size))
        integral = powers_of(self.reversible) / np.arange(1, m + 1)
        out[1 : m + 1, 0] += integral
        out[0, 1 : m + 1] -= integral
        for i, row in enumerate(self.density):
            for j, weight in enumerate(row):
                if weight:
                    out[: n + 3, : n + 3] += weight * _twice_integrated(_monomials(n, i, j))
        return out

    def branch(self, high: FloatsLike, low: FloatsLike) -> Floats:
        """Return E(high, low), the displacement between two drives along the branch that turned at one of them.

        Parameters
        ----------
        high, low
            Drives of 0..1, of one shape.

        Returns
        -------
        Displacement in nm, of that shape.
        """
        return np.asarray(np.polynomial.polynomial.polyval2d(high, low, self.everett), dtype=np.float64)

    def middle(self, drive: FloatsLike) -> Floats:
        """Return the displacement between the branches of the largest loop.

        Returns
        -------
        Displacement in nm, of the shape of ``drive`` (0..1).
        """
        full, none = np.ones_like(drive, dtype=np.float64), np.zeros_like(drive, dtype=np.float64)
        return 0.5 * (self.branch(drive, none) + self.branch(full, none) - self.branch(full, drive))

    def play(self, drive: Floats, memory: TurningPoints | None = None) -> tuple[Floats, TurningPoints]:
        """Return the displacement along a sequence of drives, and the turning points after it.

        Parameters
        ----------
        drive
            Drives of 0..1, shape (ticks,).
        memory
            The turning points before; rest at drive 0 if None.

        Returns
        -------
        Displacement in nm, shape (ticks,), and the turning points.

        Raises
        ------
        ValueError
            If a drive is outside 0..1.
        """
        drive = normalised(drive)
        memory = memory or TurningPoints()
        turning, reached = list(memory.drives), list(memory.displacements)
        out = np.empty_like(drive)
        for first, stop in monotonic(np.concatenate(([turning[-1]], drive))):
            self._sweep(drive[first:stop], out[first:stop], turning, reached)
        return out, TurningPoints(tuple(turning), tuple(reached))

    def settled(self, drive: Floats) -> Floats:
        """Return the displacement over one period of a periodic drive: one period has wiped out what it can.

        Parameters
        ----------
        drive
            Drives of 0..1 over one period, shape (ticks,).

        Returns
        -------
        Displacement in nm, shape (ticks,).

        Raises
        ------
        ValueError
            If a drive is outside 0..1.
        """
        _, memory = self.play(drive)
        return self.play(drive, memory)[0]

    def _sweep(self, drive: Floats, out: Floats, turning: list[float], reached: list[float]) -> None:
        """Play one monotonic piece of a drive; the end of the piece before it is the last turning point."""
        end = float(drive[-1])
        if end == drive[0] == turning[-1]:
            out[:] = reached[-1]
            return
        up = end > turning[-1]
        if len(turning) > 1 and (turning[-1] > turning[-2]) == up:  # it continues in the previous direction
            del turning[-1], reached[-1]
        start = 0
        while start < len(drive):
            # One branch holds up to the turning point before its own; from there on both are wiped out.
            limit = turning[-2] if len(turning) > 1 else 1.0
            free = len(turning) == 1 or limit == 0.0
            inside = len(drive) if free else int(np.count_nonzero(drive < limit if up else drive > limit))
            out[start:inside] = reached[-1] + self._from(turning[-1], drive[start:inside], up)
            start = max(start, inside)
            if start < len(drive):
                del turning[-2:], reached[-2:]
        if end == 0.0:
            turning[:], reached[:] = [0.0], [0.0]
        else:
            turning.append(end)
            reached.append(float(out[-1]))

    def _from(self, turned: float, drive: Floats, up: bool) -> Floats:
        """Return the change in nm since the turning point, along the branch that starts there."""
        powers = turned ** np.arange(len(self.everett))
        coefficients = self.everett @ powers if up else -(powers @ self.everett)
        value = np.full_like(drive, coefficients[-1])
        for coefficient in coefficients[-2::-1]:
            value = value * drive + coefficient
        return value


def _monomials(n: int, i: int, j: int) -> Floats:
    """Expand the Bernstein polynomial n!/(i! j! k!) (1 - alpha)^i (alpha - beta)^j beta^k in alpha^p beta^q."""
    k = n - i - j
    out = np.zeros((n + 1, n + 1))
    for s, first in enumerate(one_minus(i)):
        for t, second in enumerate(one_minus(j)):
            out[s + j - t, t + k] += first * second
    return out * (factorial(n) // (factorial(i) * factorial(j) * factorial(k)))


def _twice_integrated(density: Floats) -> Floats:
    """Integrate a density over beta <= b <= a <= alpha."""
    n = len(density) - 1
    out = np.zeros((n + 3, n + 3))
    for p in range(n + 1):
        for q in range(n + 1 - p):
            weight, whole = density[p, q] / (q + 1), p + q + 2
            out[whole, 0] += weight / whole
            out[0, whole] += weight * (1.0 / (p + 1) - 1.0 / whole)
            out[p + 1, q + 1] -= weight / (p + 1)
    return out
