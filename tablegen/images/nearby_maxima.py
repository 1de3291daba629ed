"""Find the maxima of an autocorrelation near points without a look at all of them: a large image has 10^5."""

import numpy as np

from tablegen.numerics.arrays import Bools, Floats, Ints

_BUCKET = 8.0  # pixels to a side
_FEW = 2000  # maxima: all of them are looked at, which is faster


class NearbyMaxima:
    """Maxima in square buckets.

    Parameters
    ----------
    lags
        x and y in pixels, shape (n, 2).
    heights
        The correlation at each, shape (n,).
    """

    def __init__(self, lags: Floats, heights: Floats) -> None:
        """Sort the maxima by buckets, row by row."""
        self.lags, self.heights = lags, heights
        self._first = np.min(lags, axis=0)
        column, row = self._bucket(lags)
        self._shape = int(row.max()) + 1, int(column.max()) + 1
        number = row * self._shape[1] + column
        self._order = np.argsort(number, kind="stable")
        self._begin = np.searchsorted(number[self._order], np.arange(self._shape[0] * self._shape[1] + 1))

    def _bucket(self, lags: Floats) -> Ints:
        return np.asarray(np.floor((lags - self._first) / _BUCKET).astype(np.int64).T)

    def around(self, points: Floats, radius: float) -> tuple[Ints, Ints]:
        """Return pairs of a point and a maximum, with all that are in a square of twice ``radius`` and some beyond.

        Parameters
        ----------
        points
            x and y in pixels, shape (m, 2).
        radius
            In pixels.

        Returns
        -------
        tuple
            Number of the point, in ascending order, and of the maximum, shape (pairs,) each.
        """
        rows, columns = self._shape
        (left, top), (right, bottom) = self._bucket(points - radius), self._bucket(points + radius)
        left, right = np.maximum(left, 0), np.minimum(right, columns - 1)
        line = np.maximum(top, 0)[:, None] + np.arange(int(np.max(bottom - top)) + 1)
        inside = (line <= np.minimum(bottom, rows - 1)[:, None]) & (left <= right)[:, None]
        line = np.where(inside, line, 0) * columns
        begin = self._begin[line + np.minimum(left, columns - 1)[:, None]]
        count = np.where(inside, self._begin[line + np.maximum(right, 0)[:, None] + 1] - begin, 0).ravel()
        skipped = np.repeat(begin.ravel() - np.concatenate([[0], np.cumsum(count)[:-1]]), count)
        point = np.repeat(np.repeat(np.arange(len(points)), line.shape[1]), count)
        return point, self._order[skipped + np.arange(len(skipped))]

    def highest(self, point: Floats, radius: float) -> float:
        """Return the highest maximum within a radius of a point, shape (2,); 0 if there is none."""
        lags, heights = self.lags, self.heights
        if len(lags) > _FEW:
            number = self.around(point[None], radius)[1]
            lags, heights = lags[number], heights[number]
        near = np.hypot(*(lags - point).T) <= radius
        return float(np.max(heights[near], initial=0.0))

    def nearest(self, points: Floats, radius: float) -> tuple[Ints, Bools]:
        """Return the number of the maximum that is nearest to each point, and where one is within a radius.

        Parameters
        ----------
        points
            x and y in pixels, shape (m, 2).
        radius
            In pixels.
        """
        if len(self.lags) <= _FEW:
            x, y = (self.lags[None, :, axis] - points[:, None, axis] for axis in (0, 1))
            distances = np.sqrt(x * x + y * y)
            nearest = np.argmin(distances, axis=1)
            return nearest, np.asarray(distances[np.arange(len(points)), nearest] <= radius)
        point, number = self.around(points, radius)
        x, y = (self.lags[number, axis] - points[point, axis] for axis in (0, 1))
        distance = np.sqrt(x * x + y * y)
        order = np.lexsort((number, distance, point))
        order = order[distance[order] <= radius]
        at, first = np.unique(point[order], return_index=True)
        nearest, matched = np.zeros(len(points), dtype=np.int64), np.zeros(len(points), dtype=np.bool_)
        nearest[at], matched[at] = number[order[first]], True
        return nearest, matched
