"""Least common bound of linear maps: an interior point method in basic operations of a fixed order.

Minimise v over y and v subject to |R y - f| <= h + r v for the rows R of every part. It is the predictor and corrector
of Mehrotra (SIAM J. Optim. 2, 575, 1992) for the upper and the lower side of each row, with slacks s and multipliers l:
a step solves the normal equations of sum R^T (l / s) R. A solution within some percent of the optimum takes 8 to 15.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Protocol

import numpy as np

from tablegen.numerics.arrays import Floats, tree_sum
from tablegen.numerics.linear import Cholesky

_MOST_STEPS = 60
_REGULAR = 1e-14  # of each pivot; keeps the factorisation going where multipliers are 1e14 apart
_NEAR = 0.98  # share of the way to the nearest bound
_FEASIBLE = 1e-9  # share of a bound by which a row may exceed it at the end
_FEASIBLE_DUAL = 1e-3  # the residual of the multipliers, whose sum is 1


class Rows(Protocol):
    """A linear map of unknowns (n,) to (m,)."""

    def times(self, y: Floats) -> Floats:
        """Return R y.

        Parameters
        ----------
        y
            Unknowns, shape (n,).

        Returns
        -------
        Floats
            Shape (m,).
        """

    def transposed(self, z: Floats) -> Floats:
        """Return R^T z.

        Parameters
        ----------
        z
            One value a row, shape (m,).

        Returns
        -------
        Floats
            Shape (n,).
        """

    def gram(self, diagonal: Floats) -> Floats:
        """Return R^T diag(diagonal) R.

        Parameters
        ----------
        diagonal
            One weight a row, shape (m,).

        Returns
        -------
        Floats
            Shape (n, n), symmetric.
        """


@dataclass(frozen=True, eq=False)
class BoundConstraint:
    """The constraint |R y - target| <= fixed + share v; ``target`` is (m,)."""

    rows: Rows
    target: Floats
    fixed: float
    share: float


@dataclass(frozen=True, eq=False)
class Minimum:
    """The unknowns, the bound that they keep, and a lower bound of all, up to the residual of the last step."""

    y: Floats
    bound: float
    below: float
    steps: int
    settled: bool


def least_bound(
    parts: Sequence[BoundConstraint], start: Floats, gap: float, reached: Callable[[float], bool] = lambda v: False
) -> Minimum:
    """Minimise v from y = ``start`` on, until it is within the share ``gap`` of the optimum, or ``reached(v)``.

    Parameters
    ----------
    parts
        Constraints on the same n unknowns, of any number of rows each.
    start
        First unknowns, shape (n,); they need not satisfy the constraints.
    gap
        Relative distance of v from its lower bound at which the iteration ends.
    reached
        Function that ends the iteration at the first v for which it is true.

    Returns
    -------
    Minimum
        The last iterate; ``settled`` is False if neither condition was met.
    """
    state = _State(parts, start)
    with np.errstate(
        over="ignore", divide="ignore", invalid="ignore"
    ):  # overflow is the end of contradictory constraints
        return _least(state, gap, reached)


def _least(state: "_State", gap: float, reached: Callable[[float], bool]) -> Minimum:
    for step in range(_MOST_STEPS + 1):
        bound, below = state.bounds()
        settled = state.inside and (reached(bound) or (state.dual and bound - below <= gap * bound))
        if settled or step == _MOST_STEPS or not state.advance():
            return Minimum(state.y, bound, below, step, settled)
    raise AssertionError("the last step returns")  # pragma: no cover


class _Stack:
    """The rows of all parts, one above the other."""

    def __init__(self, parts: Sequence[BoundConstraint]) -> None:
        self._rows = [part.rows for part in parts]
        self._ends = [len(part.target) for part in parts]
        self.target = np.concatenate([part.target for part in parts])
        self.fixed, self.share = (
            np.concatenate([np.full(len(part.target), value) for part, value in zip(parts, values, strict=True)])
            for values in ([part.fixed for part in parts], [part.share for part in parts])
        )

    def times(self, y: Floats) -> Floats:
        """Return R y, (n,) to (m,).

        Returns
        -------
        Floats
            Rows of all parts, shape (m,).
        """
        return np.concatenate([rows.times(y) for rows in self._rows])

    def transposed(self, z: Floats) -> Floats:
        """Return R^T z, (m,) to (n,).

        Returns
        -------
        Floats
            Sum over all parts, shape (n,).
        """
        first, *others = [rows.transposed(of) for rows, of in self._split(z)]
        for other in others:
            first = first + other
        return first

    def gram(self, diagonal: Floats) -> Floats:
        """Return R^T diag(diagonal) R, (m,) to (n, n).

        Returns
        -------
        Floats
            Sum over all parts, shape (n, n).
        """
        first, *others = [rows.gram(of) for rows, of in self._split(diagonal)]
        for other in others:
            first += other
        return first

    def _split(self, z: Floats) -> Iterator[tuple[Rows, Floats]]:
        begin = 0
        for rows, count in zip(self._rows, self._ends, strict=True):
            yield rows, z[begin : begin + count]
            begin += count


class _State:
    """The iterate y and v; slacks and multipliers of both sides of each row, upper and lower, (2, m)."""

    def __init__(self, parts: Sequence[BoundConstraint], start: Floats) -> None:
        self._rows, self.y = _Stack(parts), np.array(start, dtype=np.float64)
        self._far = self._rows.times(self.y) - self._rows.target
        moves = self._rows.share > 0.0
        need = (np.abs(self._far[moves]) - self._rows.fixed[moves]) / self._rows.share[moves]
        self.v = 1.1 * max(float(np.max(need)), 1e-12)
        # A row outside its bound gets a slack of its own; the steps remove the difference.
        self._slack = np.maximum(self._room(), 1e-3 * self._widths())
        weight = 1.0 / self._slack
        self._multiplier = weight / _sum(self._rows.share * weight)

    def _widths(self) -> Floats:
        return self._rows.fixed + self._rows.share * self.v

    def _room(self) -> Floats:
        return np.stack([self._widths() - self._far, self._widths() + self._far])

    @property
    def inside(self) -> bool:
        """True if every row keeps its bound."""
        return bool(np.all(np.abs(self._room() - self._slack) <= _FEASIBLE * self._widths()))

    @property
    def dual(self) -> bool:
        """True if the multipliers prove the lower bound of ``bounds``."""
        y, v = self._residual()
        return max(float(np.max(np.abs(y))), abs(v)) < _FEASIBLE_DUAL

    def _residual(self) -> tuple[Floats, float]:
        one = self._multiplier
        return -self._rows.transposed(one[0] - one[1]), _sum(self._rows.share * one) - 1.0

    def bounds(self) -> tuple[float, float]:
        """Return v, and v less the gap."""
        return self.v, self.v - _sum(self._slack * self._multiplier)

    def advance(self) -> bool:
        """Take one step of predictor and corrector; return False where working precision is exhausted."""
        rows, slack, one, size = self._rows, self._slack, self._multiplier, len(self.y)
        weight = one / slack
        matrix = np.zeros((size + 1, size + 1))
        matrix[:size, :size] = rows.gram(weight[0] + weight[1])
        matrix[:size, size] = matrix[size, :size] = -rows.transposed(rows.share * (weight[0] - weight[1]))
        matrix[size, size] = _sum(rows.share * rows.share * weight)
        diagonal = np.arange(size + 1)
        matrix[diagonal, diagonal] *= 1.0 + _REGULAR
        try:
            factor = Cholesky(matrix)
        except ArithmeticError:
            return False
        lack, residual = self._room() - slack, self._residual()

        def step(complement: Floats) -> tuple[Floats, Floats, Floats, Floats]:
            """Return the steps that change the products of slacks and multipliers by ``complement``.

            Parameters
            ----------
            complement
                Shape (2, m).

            Returns
            -------
            solution, moves, slacks, multipliers
                Steps of (y, v), (n + 1,); of the rows, (m,); of slacks and multipliers, (2, m).
            """
            pull = (complement - one * lack) / slack
            right = np.append(residual[0] - rows.transposed(pull[0] - pull[1]), residual[1] + _sum(rows.share * pull))
            solution = factor.solve(right)
            row_steps, wider = rows.times(solution[:size]), rows.share * solution[size]
            slacks = np.stack([wider - row_steps, wider + row_steps]) + lack
            return solution, row_steps, slacks, (complement - one * slacks) / slack

        products = slack * one
        mean = _sum(products) / products.size
        _, _, slacks, ones = step(-products)
        ahead, up = _reach(slack, slacks), _reach(one, ones)
        after = _sum((slack + ahead * slacks) * (one + up * ones)) / products.size
        if not (mean > 0.0 and isfinite(after)):  # contradictory constraints end here
            return False
        ratio = after / mean
        solution, row_steps, slacks, ones = step(ratio * ratio * ratio * mean - products - slacks * ones)
        ahead, up = _NEAR * _reach(slack, slacks), _NEAR * _reach(one, ones)
        self.y = self.y + ahead * solution[:size]
        self.v += ahead * float(solution[size])
        self._far = self._far + ahead * row_steps
        self._slack = slack + ahead * slacks
        self._multiplier = one + up * ones
        return True


def _sum(values: Floats) -> float:
    return float(tree_sum(values.reshape(-1)))


def _reach(values: Floats, steps: Floats) -> float:
    """Return which share of the steps can be taken until a value is 0; at most 1."""
    shrinking = steps < 0.0
    return min(1.0, float(np.min(values[shrinking] / -steps[shrinking], initial=1.0)))
