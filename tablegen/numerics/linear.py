"""Solution of symmetric positive definite systems, in one order for all machines."""

from math import sqrt

import numpy as np

from tablegen.numerics.arrays import Floats

_BLOCK = 1 << 16  # products that are worked out together, in the cache


class Cholesky:
    """The factor L of A = L L^T for a symmetric positive definite A of shape (n, n).

    An element of a column is that of A, less the products of all columns before it, one after the other, over the root
    of the pivot. Raises ``ArithmeticError`` where a pivot is not positive, that is where A is singular to working
    precision.
    """

    def __init__(self, matrix: Floats) -> None:
        columns = np.array(matrix, dtype=np.float64).T.copy()  # a row is a column of L, from its diagonal on
        size = len(columns)
        terms = np.empty(max(_BLOCK, size + 1))
        for j, column in enumerate(columns):
            width = len(terms) // (j + 1)
            for begin in range(j, size, width):
                end = min(begin + width, size)
                block = terms[: (j + 1) * (end - begin)].reshape(j + 1, end - begin)
                block[0] = column[begin:end]
                np.multiply(columns[:j, begin:end], columns[:j, j, None], out=block[1:])
                np.subtract.reduce(block, axis=0, out=column[begin:end])
            pivot = float(column[j])
            if not pivot > 0.0:
                raise ArithmeticError(f"pivot {j} of {size} is {pivot:g}")
            column[j:] /= sqrt(pivot)
        self._columns = columns
        self._diagonal: list[float] = columns.diagonal().tolist()

    def solve(self, right: Floats) -> Floats:
        """x with A x = right; right has shape (n,)."""
        x = np.array(right, dtype=np.float64)
        columns = self._columns
        for j, pivot in enumerate(self._diagonal):
            x[j] = value = float(x[j]) / pivot
            x[j + 1 :] -= value * columns[j, j + 1 :]
        for j, pivot in reversed(list(enumerate(self._diagonal))):
            x[j] = value = float(x[j]) / pivot
            x[:j] -= value * columns[:j, j]
        return x
