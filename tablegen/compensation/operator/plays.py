"""Generalised Prandtl-Ishlinskii hysteresis: plays on three transforms of the drive, and a reversible polynomial.

With one rise and one fall a period a settled play has a closed form. Of the transform g and the threshold r, between
drives a and b, it is max(g(u) - r, g(a) + r) where the drive u rises, and min(g(u) + r, g(b) - r) where it falls; it
stands still where g(b) - g(a) is below 2 r. Plays on transforms that bend either way have envelopes that differ.
"""

from dataclasses import dataclass

import numpy as np

from tablegen.numerics.arrays import Floats, FloatsLike

TRANSFORMS = ("u", "u^2", "1 - (1 - u)^2")


def transformed(u: FloatsLike) -> tuple[Floats, ...]:
    """The three transforms of a normalised drive, each of its shape."""
    u = np.asarray(u, dtype=np.float64)
    rest = 1.0 - u
    return u, u * u, 1.0 - rest * rest


def plays(u: Floats, low: float, high: float, rising: bool, thresholds: Floats) -> Floats:
    """Settled plays between the drives ``low`` and ``high``, of shape (transforms, thresholds, drives)."""
    r = thresholds[:, None]
    found = []
    for g, least, most in zip(transformed(u), transformed(low), transformed(high), strict=True):
        moving = np.maximum(g - r, least + r) if rising else np.minimum(g + r, most - r)
        found.append(np.where(2.0 * r < most - least, moving, 0.5 * (least + most)))
    return np.stack(found)


@dataclass(frozen=True, eq=False)
class Plays:
    """Weights in units of the displacement, at normalised drives u of 0..1.

    ``thresholds`` has shape (k,) and ascends from above 0, ``weights`` (3, k) in the order of ``TRANSFORMS``;
    ``reversible`` are the coefficients of u, u^2, ...
    """

    thresholds: Floats
    weights: Floats
    reversible: Floats

    def branch(self, u: Floats, low: float, high: float, rising: bool) -> Floats:
        """The displacement at drives ``u`` of a settled line between two drives; up to a constant of the line."""
        power = np.ones_like(u)
        total = np.zeros_like(u)
        for coefficient in self.reversible:
            power = power * u
            total = total + float(coefficient) * power
        moved = plays(u, low, high, rising, self.thresholds)
        for transform, weights in zip(moved, self.weights, strict=True):
            for row, weight in zip(transform, weights, strict=True):
                if weight:
                    total = total + float(weight) * row
        return total


NO_PLAYS = Plays(np.zeros(0), np.zeros((len(TRANSFORMS), 0)), np.ones(1))
