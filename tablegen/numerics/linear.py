"""Solution of symmetric positive definite systems, column by column, in one order for all machines."""

import numpy as np

from tablegen.numerics.arrays import Floats

_PANEL = 32  # columns that are worked out together
_SMALL = 112  # up to this size all columns are one panel: the whole fits the cache
_ROWS, _COLUMNS = 32, 256  # of a tile, which then has 64 KiB


def _subtract(work: Floats, j: int, top: int, begin: int, end: int) -> None:
    """Take column j's part out of rows ``top`` on of columns ``begin`` to ``end``."""
    work[top:, begin:end] -= work[top:, j, None] * work[None, begin:end, j]


class Cholesky:
    """The factor L of A = L L^T for a symmetric positive definite A of shape (n, n).

    Raises ``ArithmeticError`` where a pivot is not positive, that is where A is singular to working precision.
    """

    def __init__(self, matrix: Floats) -> None:
        work = np.array(matrix, dtype=np.float64)
        size = len(work)
        panel = size if size <= _SMALL else _PANEL
        for first in range(0, size, panel):
            last = min(first + panel, size)
            for j in range(first, last):
                pivot = work[j, j]
                if not pivot > 0.0:
                    raise ArithmeticError(f"pivot {j} of {size} is {pivot:g}")
                work[j:, j] /= np.sqrt(pivot)
                _subtract(work, j, j + 1, j + 1, last)
            # The same products leave the same elements in the same order as column by column, and stay in the cache.
            columns = np.ascontiguousarray(work[:, first:last].T)
            for begin in range(last, size, _COLUMNS):
                end = min(begin + _COLUMNS, size)
                for top in range(begin, size, _ROWS):
                    stop = min(end, top + _ROWS)  # what is right of the diagonal is not used
                    tile = work[top : top + _ROWS, begin:stop]
                    block = np.ascontiguousarray(tile)
                    product = np.empty_like(block)
                    for column in columns:
                        np.multiply(column[top : top + _ROWS, None], column[None, begin:stop], out=product)
                        np.subtract(block, product, out=block)
                    tile[...] = block
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
