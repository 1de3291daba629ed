"""Solution of symmetric positive definite systems, in one order for all machines."""

from math import sqrt

import numpy as np

from tablegen.numerics.arrays import Floats

_BLOCK = 1 << 16  # products that are computed at a time, so that they fit the cache
_TOGETHER = 8  # columns that are eliminated at once: fewer and longer steps, each sum in its order


class Cholesky:
    """The factor L of A = L L^T for a symmetric positive definite A of shape (n, n).

    An element of a column is that of A, less the products of all columns before it, one after the other, over the root
    of the pivot.

    Raises
    ------
    ArithmeticError
        If a pivot is not positive, that is if A is singular to working precision.
    """

    def __init__(self, matrix: Floats) -> None:
        columns = np.array(matrix, dtype=np.float64).T.copy()  # a row is a column of L, from its diagonal on
        size = len(columns)
        terms = np.empty(max(_BLOCK, 2 * _TOGETHER * size))
        for begin in range(0, size, _TOGETHER):
            panel = columns[begin : begin + _TOGETHER, begin:]
            most = len(terms) // panel.size - 1
            for first in range(0, begin, most):
                before = columns[first : min(first + most, begin), begin:]
                block = terms[: (len(before) + 1) * panel.size].reshape(-1, *panel.shape)
                block[0] = panel
                np.multiply(before[:, : len(panel), None], before[:, None, :], out=block[1:])
                np.subtract.reduce(block, axis=0, out=panel)
            for j in range(len(panel)):
                column, later = panel[j, j:], panel[j + 1 :, j:]
                pivot = float(column[0])
                if not pivot > 0.0:
                    raise ArithmeticError(f"pivot {begin + j} of {size} is {pivot:g}")
                column /= sqrt(pivot)
                later -= column[1 : len(later) + 1, None] * column
        self._columns = columns

    def solve(self, right: Floats) -> Floats:
        """Return the solution x of A x = right.

        Parameters
        ----------
        right
            Shape (n,); not changed.

        Returns
        -------
        Floats
            Shape (n,).
        """
        x = np.array(right, dtype=np.float64)
        begins = range(0, len(x), _TOGETHER)
        for begin in begins:
            rows = self._columns[begin : begin + _TOGETHER, begin:]
            _eliminate(x[begin:], rows)
        for begin in reversed(begins):
            end = min(begin + _TOGETHER, len(x))
            _eliminate(x[:end][::-1], self._columns[:end, begin:end].T[::-1, ::-1])
        return x


def _eliminate(x: Floats, columns: Floats) -> None:
    """Solve for the first of x in order, and subtract their columns from the rest; columns (some, all of x)."""
    count = len(columns)
    near, solution = columns[:, :count].tolist(), x[:count].tolist()
    for j, column in enumerate(near):
        solution[j] = value = solution[j] / column[j]
        for i in range(j + 1, count):
            solution[i] -= value * column[i]
    x[:count] = solution
    terms = np.empty((count + 1, len(x) - count))
    terms[0] = x[count:]
    np.multiply(columns[:, count:], x[:count, None], out=terms[1:])
    np.subtract.reduce(terms, axis=0, out=x[count:])
