"""Solution of symmetric positive definite systems, column by column, in one order for all machines."""

import numpy as np

from tablegen.numerics.arrays import Floats


class Cholesky:
    """The factor L of A = L L^T for a symmetric positive definite A of shape (n, n).

    Raises ``ArithmeticError`` where a pivot is not positive, that is where A is singular to working precision.
    """

    def __init__(self, matrix: Floats) -> None:
        work = np.array(matrix, dtype=np.float64)
        size = len(work)
        for j in range(size):
            pivot = work[j, j]
            if not pivot > 0.0:
                raise ArithmeticError(f"pivot {j} of {size} is {pivot:g}")
            work[j:, j] /= np.sqrt(pivot)
            column = work[j + 1 :, j]
            work[j + 1 :, j + 1 :] -= column[:, None] * column[None, :]
        self._factor = work
        self._size = size

    def solve(self, right: Floats) -> Floats:
        """x with A x = right; right has shape (n,)."""
        x = np.array(right, dtype=np.float64)
        factor = self._factor
        for j in range(self._size):
            x[j] /= factor[j, j]
            x[j + 1 :] -= x[j] * factor[j + 1 :, j]
        for j in reversed(range(self._size)):
            x[j] /= factor[j, j]
            x[:j] -= x[j] * factor[j, :j]
        return x
