"""Bouc and Wen's hysteresis, settled: an internal h that follows the drive, and saturates.

dh/dv = 1 - |h|^n (gamma + beta d (asymmetry + sign h)), with d = 1 where the drive rises and -1 where it falls, and v
the bent drive u + l u (1 - u) + s u (1 - u) (u - 1/2). The right hand side does not contain v: every rising branch is
a part of the one curve through h = 0, and so is every falling one. Of a settled line only where it begins on them has
to be found.
"""

from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from typing import TypeVar

import numpy as np

from tablegen.compensation.operator.plays import bent
from tablegen.numerics.arrays import Floats

POWER_BITS = 12  # n is a multiple of 1/4096, whose powers are square roots: the same on every machine
_STEPS = 64  # of a curve for all of v_max
_REACH = 74  # steps that a curve goes to either side; strokes reach 1.1
_STEEPEST = 50.0  # slope of h; no settled line comes near it
_ROUNDS = 60
_CLOSED = 1e-13  # of h at the ends
_NEWTON = 4  # steps to where a curve has a height

_Number = TypeVar("_Number", float, Floats)


@dataclass(frozen=True, eq=False)
class BoucWen:
    """The equation with ``depth`` in units of the displacement for h = 1; ``bend`` are l and s."""

    depth: float
    n: float
    beta: float
    gamma: float
    asymmetry: float
    bend: tuple[float, float]

    def branch(self, u: Floats, low: float, high: float, rising: bool) -> Floats:
        """Return the part of the displacement on one branch of a settled line.

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
        first, last = (float(bent(at, *self.bend)) for at in (low, high))
        rise, fall = self._ends(last - first)
        v = bent(u, *self.bend)
        h = self._rising.along(v - first + rise) if rising else self._falling.along(v - last + fall)
        return -self.depth * h

    def _ends(self, stroke: float) -> tuple[float, float]:
        """Return where a settled line begins on the rising curve, and where its top is on the falling one."""
        up, down = self._rising, self._falling

        def gap(begin: float) -> tuple[float, float]:
            top = down.where(up.at(begin + stroke))
            return down.at(top - stroke) - up.at(begin), top

        # Loops lie about h = 0: at one end of this the line moves up from period to period, at the other down.
        left, right = -stroke, 0.0
        at_left, at_right = gap(left)[0], gap(right)[0]
        begin, top = left, gap(left)[1]
        side = 0
        for _ in range(_ROUNDS):
            begin = (left * at_right - right * at_left) / (at_right - at_left) if at_right != at_left else left
            here, top = gap(begin)
            if abs(here) < _CLOSED:
                break
            if here > 0.0:  # Illinois: the end that stays counts half
                left, at_left = begin, here
                at_right *= 0.5 if side == 1 else 1.0
                side = 1
            else:
                right, at_right = begin, here
                at_left *= 0.5 if side == -1 else 1.0
                side = -1
        return begin, top

    @cached_property
    def _rising(self) -> "_Curve":
        return self._curve(1.0)

    @cached_property
    def _falling(self) -> "_Curve":
        return self._curve(-1.0)

    def _curve(self, direction: float) -> "_Curve":
        """Return the curve of h in both directions from 0."""
        against, more = self.gamma, direction * self.beta
        parts = [
            _integrated(against + more * (self.asymmetry + side), self.n)
            for side in (1.0, -1.0)  # of h
        ]
        (up, up_slope), (down, down_slope) = parts
        return _Curve([-h for h in down[:0:-1]] + up, down_slope[:0:-1] + up_slope)


NO_BOUC_WEN = BoucWen(0.0, 1.0, 0.0, 0.0, 0.0, (0.0, 0.0))


class _Curve:
    """A rising curve h(t), t = 0 in its middle: cubic between its points."""

    def __init__(self, heights: list[float], slopes: list[float]) -> None:
        self._heights, self._slopes = heights, slopes
        self._arrays = np.array(heights), np.array(slopes) / _STEPS

    def at(self, t: float) -> float:
        """Return the height at t."""
        x = t * _STEPS + _REACH
        i = min(max(int(x), 0), 2 * _REACH - 1)
        return self._cubic(i, x - i)[0]

    def where(self, height: float) -> float:
        """Return the t of a height."""
        i = min(max(bisect_right(self._heights, height) - 1, 0), 2 * _REACH - 1)
        x = (height - self._heights[i]) / (self._heights[i + 1] - self._heights[i])
        for _ in range(_NEWTON):
            value, slope = self._cubic(i, x)
            x -= (value - height) / slope
        return (i + x - _REACH) / _STEPS

    def along(self, t: Floats) -> Floats:
        """Return the heights of the curve.

        Parameters
        ----------
        t
            Arguments, any shape.

        Returns
        -------
        Floats
            Shape of ``t``.
        """
        x = t * _STEPS + _REACH
        i = np.clip(x, 0.0, 2 * _REACH - 1).astype(np.int64)
        x = x - i
        heights, slopes = self._arrays
        low, high, begin, end = heights[i], heights[i + 1], slopes[i], slopes[i + 1]
        square, cubic = _bends(high - low, begin, end)
        heights_along: Floats = low + x * (begin + x * (square + x * cubic))
        return heights_along

    def _cubic(self, i: int, x: float) -> tuple[float, float]:
        """Return value and slope between the points i and i + 1."""
        begin, end = self._slopes[i] / _STEPS, self._slopes[i + 1] / _STEPS
        square, cubic = _bends(self._heights[i + 1] - self._heights[i], begin, end)
        value = self._heights[i] + x * (begin + x * (square + x * cubic))
        return value, begin + x * (2.0 * square + 3.0 * x * cubic)


def _bends(rise: _Number, begin: _Number, end: _Number) -> tuple[_Number, _Number]:
    """Return the coefficients of x^2 and x^3 of the cubic over 0..1 with this rise and these slopes at its ends."""
    return 3.0 * rise - 2.0 * begin - end, begin + end - 2.0 * rise


def _integrated(against: float, n: float) -> tuple[list[float], list[float]]:
    """Return h from 0 on with the slope 1 - against h^n, and that slope, by the Runge-Kutta method."""
    whole, bits = int(n), round((n - int(n)) * (1 << POWER_BITS))

    def slope(h: float) -> float:
        power = 1.0
        for _ in range(whole):
            power *= h
        root, remaining = h, bits
        for i in range(POWER_BITS - 1, -1, -1):
            if not remaining:
                break
            root = sqrt(root)
            if remaining >> i & 1:
                power *= root
                remaining &= (1 << i) - 1
        return min(1.0 - against * power, _STEEPEST)

    h, dt = 0.0, 1.0 / _STEPS
    heights, slopes = [h], [1.0]
    for _ in range(_REACH):
        one = slopes[-1]
        two = slope(h + 0.5 * dt * one)
        three = slope(h + 0.5 * dt * two)
        four = slope(h + dt * three)
        h += dt / 6.0 * (one + 2.0 * (two + three) + four)
        heights.append(h)
        slopes.append(slope(h))
    return heights, slopes
