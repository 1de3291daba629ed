"""The least bound that linear maps can be held within: an interior point method in basic operations of a fixed order.

Minimise v over y and v subject to |R y - f| <= h + r v for the rows R of every part. It is the predictor and corrector
of Mehrotra (SIAM J. Optim. 2, 575, 1992) for the upper and the lower side of each row, with slacks s and multipliers l:
a step solves the normal equations of sum R^T (l / s) R. A solution within some percent of the optimum takes 8 to 15.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Protocol

import numpy as np

from tablegen.numerics.arrays import Floats, tree_sum
from tablegen.numerics.linear import Cholesky

_MOST_STEPS = 60
_REGULAR = 1e-14  # of each pivot; keeps the factorisation going where multipliers are 1e14 apart
_NEAR = 0.98  # of the way to the nearest wall
_FEASIBLE = 1e-9  # of a bound: what a row may be outside of it by at the end
_FEASIBLE_DUAL = 1e-3  # the residual of the multipliers, whose sum is 1


class Rows(Protocol):
    """A linear map of unknowns (n,) to (m,)."""

    def times(self, y: Floats) -> Floats:
        """R y."""

    def transposed(self, z: Floats) -> Floats:
        """R^T z."""

    def gram(self, diagonal: Floats) -> Floats:
        """R^T diag R, (n, n)."""


@dataclass(frozen=True, eq=False)
class Within:
    """|R y - target| <= fixed + share v; ``target`` is (m,)."""

    rows: Rows
    target: Floats
    fixed: float
    share: float


@dataclass(frozen=True, eq=False)
class Least:
    """The unknowns, the bound that they keep, and one that none keeps, up to the residual of the last step."""

    y: Floats
    bound: float
    below: float
    steps: int
    settled: bool


def least_bound(
    parts: Sequence[Within], start: Floats, gap: float, reached: Callable[[float], bool] = lambda v: False
) -> Least:
    """Minimise v from y = ``start`` on, until it is within the share ``gap`` of the optimum, or ``reached(v)``."""
    state = _State(parts, start)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # what contradicts itself ends so
        return _least(state, gap, reached)


def _least(state: "_State", gap: float, reached: Callable[[float], bool]) -> Least:
    for step in range(_MOST_STEPS + 1):
        kept, below = state.bounds()
        done = state.inside and (reached(kept) or (state.dual and kept - below <= gap * kept))
        if done or step == _MOST_STEPS or not state.advance():
            return Least(state.y, kept, below, step, done)
    raise AssertionError("the last step returns")  # pragma: no cover


class _State:
    """y, v, and for each part the slacks and multipliers of both sides, (2, m): upper, lower."""

    def __init__(self, parts: Sequence[Within], start: Floats) -> None:
        self._parts, self.y = parts, np.array(start, dtype=np.float64)
        self._far = [part.rows.times(self.y) - part.target for part in parts]
        need = [
            (float(np.max(np.abs(far))) - part.fixed) / part.share
            for part, far in zip(parts, self._far, strict=True)
            if part.share
        ]
        self.v = 1.1 * max(*need, 1e-12)
        room = [np.stack([b - far, b + far]) for b, far in zip(self._widths(), self._far, strict=True)]
        # What is outside its bound gets a slack of its own; the lack is made good on the way.
        self._slack = [np.maximum(one, 1e-3 * b) for b, one in zip(self._widths(), room, strict=True)]
        weight = [1.0 / one for one in self._slack]
        total = sum(part.share * float(tree_sum(one.reshape(-1))) for part, one in zip(parts, weight, strict=True))
        self._multiplier = [one / total for one in weight]

    def _widths(self) -> list[float]:
        return [part.fixed + part.share * self.v for part in self._parts]

    @property
    def _sides(self) -> int:
        return sum(one.size for one in self._slack)

    def _lack(self) -> list[Floats]:
        return [
            np.stack([b - far, b + far]) - slack
            for b, far, slack in zip(self._widths(), self._far, self._slack, strict=True)
        ]

    @property
    def inside(self) -> bool:
        """Whether every row keeps its bound."""
        lacks = zip(self._widths(), self._lack(), strict=True)
        return all(float(np.max(np.abs(lack))) <= _FEASIBLE * b for b, lack in lacks)

    @property
    def dual(self) -> bool:
        """Whether the multipliers prove that there is no lower bound than ``bounds`` says."""
        y, v = self._residual()
        return max(float(np.max(np.abs(y))), abs(v)) < _FEASIBLE_DUAL

    def _residual(self) -> tuple[Floats, float]:
        y, v = np.zeros_like(self.y), -1.0
        for part, one in zip(self._parts, self._multiplier, strict=True):
            y = y - part.rows.transposed(one[0] - one[1])
            v += part.share * float(tree_sum(one.reshape(-1)))
        return y, v

    def bounds(self) -> tuple[float, float]:
        """v, and v less the gap."""
        gap = sum(
            float(tree_sum((slack * one).reshape(-1))) for slack, one in zip(self._slack, self._multiplier, strict=True)
        )
        return self.v, self.v - gap

    def advance(self) -> bool:
        """One predictor and corrector; False where the matrix is singular to working precision."""
        weights = [one / slack for slack, one in zip(self._slack, self._multiplier, strict=True)]
        size = len(self.y)
        matrix = np.zeros((size + 1, size + 1))
        for part, weight in zip(self._parts, weights, strict=True):
            both = weight[0] + weight[1]
            matrix[:size, :size] += part.rows.gram(both)
            if part.share:
                across = -part.share * part.rows.transposed(weight[0] - weight[1])
                matrix[:size, size] += across
                matrix[size, :size] += across
                matrix[size, size] += part.share * part.share * float(tree_sum(both))
        diagonal = np.arange(size + 1)
        matrix[diagonal, diagonal] *= 1.0 + _REGULAR
        try:
            factor = Cholesky(matrix)
        except ArithmeticError:
            return False
        lack, residual = self._lack(), self._residual()

        def step(complement: list[Floats]) -> tuple[Floats, float, list[Floats], list[Floats], list[Floats]]:
            right = np.append(residual[0], residual[1])
            pulls = [
                (c - one * short) / slack
                for c, one, short, slack in zip(complement, self._multiplier, lack, self._slack, strict=True)
            ]
            for part, pull in zip(self._parts, pulls, strict=True):
                right[:size] -= part.rows.transposed(pull[0] - pull[1])
                right[size] += part.share * float(tree_sum(pull.reshape(-1)))
            solution = factor.solve(right)
            y, v = solution[:size], float(solution[size])
            moved = [part.rows.times(y) for part in self._parts]
            slacks = [
                np.stack([part.share * v - far, part.share * v + far]) + short
                for part, far, short in zip(self._parts, moved, lack, strict=True)
            ]
            multipliers = [
                (c - one * by) / slack
                for c, one, by, slack in zip(complement, self._multiplier, slacks, self._slack, strict=True)
            ]
            return y, v, moved, slacks, multipliers

        products = [slack * one for slack, one in zip(self._slack, self._multiplier, strict=True)]
        mean = sum(float(tree_sum(one.reshape(-1))) for one in products) / self._sides
        _, _, _, slacks, multipliers = step([-one for one in products])
        ahead, up = _reach(self._slack, slacks), _reach(self._multiplier, multipliers)
        after = sum(
            float(tree_sum(((slack + ahead * by) * (one + up * change)).reshape(-1)))
            for slack, by, one, change in zip(self._slack, slacks, self._multiplier, multipliers, strict=True)
        )
        if not (mean > 0.0 and isfinite(after)):  # what contradicts itself has no other end
            return False
        ratio = after / self._sides / mean
        centred = ratio * ratio * ratio * mean
        y, v, moved, slacks, multipliers = step(
            [centred - one - by * change for one, by, change in zip(products, slacks, multipliers, strict=True)]
        )
        ahead, up = _NEAR * _reach(self._slack, slacks), _NEAR * _reach(self._multiplier, multipliers)
        self.y = self.y + ahead * y
        self.v += ahead * v
        self._far = [far + ahead * by for far, by in zip(self._far, moved, strict=True)]
        self._slack = [slack + ahead * by for slack, by in zip(self._slack, slacks, strict=True)]
        self._multiplier = [one + up * by for one, by in zip(self._multiplier, multipliers, strict=True)]
        return True


def _reach(values: list[Floats], steps: list[Floats]) -> float:
    """How much of the steps can be taken until a value is 0; at most 1."""
    reach = 1.0
    for value, step in zip(values, steps, strict=True):
        shrinking = step < 0.0
        if bool(np.any(shrinking)):
            reach = min(reach, float(np.min(value[shrinking] / -step[shrinking])))
    return reach
