"""Where each pixel of a scan really was, and the same scan on a straight grid, resampled once.

x depends on the column alone, since a line is settled, but for a drift that depends on the row; y on the time in the
frame, which goes on within a row. So what belongs to a place of the straight grid is found by two inversions in one
dimension each. Where an axis goes back for a moment after a turn, as creep makes it, the pixels until there are left
out: what they show is shown again.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import map_coordinates

from tablegen.base.input_errors import Unphysical
from tablegen.numerics.arrays import Bools, Floats

_ORDER = 3  # of the splines
_MARGIN = 12  # pixels: what is further away does not matter to a spline
_HALF = 0.5  # of a pixel: it is so far from its middle to its edge
_ROUNDING = 1e-6  # of a pixel
_OUTER = 0.25  # of a sweep at either end, where an axis may still go back
_FINEST = 0.02  # of the mean step: below it two pixels are at one place


@dataclass(frozen=True, eq=False)
class Sweep1D:
    """The columns of one direction, the left one first: their x, and when they are in the line, 0..1 of its period."""

    x: Floats
    time: Floats


@dataclass(frozen=True, eq=False)
class Distortion:
    """Where the pixels of a scan of rows x columns were, in any unit of length, the same for x and y or not.

    ``forward`` and ``backward`` are the directions that were imaged. ``y`` and ``drift`` (of x) stand at ``rows`` + 1
    times of the frame, the beginning of the first row to the end of the last one; ``lag`` is 1 where y moves on within
    a row, 0 where it steps.
    """

    rows: int
    columns: int
    forward: Sweep1D | None
    backward: Sweep1D | None
    y: Floats
    drift: Floats
    lag: float = 1.0

    def side(self, forward: bool) -> Sweep1D:
        """Return the sweep of a direction.

        Raises
        ------
        KeyError
            If the direction was not imaged.
        """
        found = self.forward if forward else self.backward
        if found is None:
            raise KeyError(forward)
        return found

    @property
    def sides(self) -> list[tuple[bool, Sweep1D]]:
        """Those that were imaged."""
        return [(way, one) for way, one in ((True, self.forward), (False, self.backward)) if one is not None]

    @cached_property
    def x_range(self) -> tuple[float, float]:
        """Left and right edge of all that was imaged, drift aside, half a pixel beyond the outer pixels."""
        edges = [_edges(one.x[ascending(one.x)]) for _, one in self.sides]
        return min(low for low, _ in edges), max(high for _, high in edges)

    @property
    def y_range(self) -> tuple[float, float]:
        """The edge of the first row and that of the last one."""
        y = self.y[ascending(self.y)]
        return float(y[0]), float(y[-1])

    @property
    def left_out(self) -> tuple[int, int]:
        """The rows at the beginning and at the end that are left out."""
        rows_imaged = ascending(self.y)
        return rows_imaged.start, self.rows + 1 - rows_imaged.stop

    @cached_property
    def grid(self) -> tuple[Floats, Floats]:
        """Return x of the columns and y of the rows of the straight image, which has as many."""
        low, high = self.x_range
        first, last = self.y_range
        x = low + (high - low) * (np.arange(self.columns) + _HALF) / self.columns
        return x, first + (last - first) * (np.arange(self.rows) + _HALF) / self.rows

    def check(self) -> None:
        """Raise ``Unphysical`` where pixels do not follow each other, as of branches that run backwards."""
        for way, one in self.sides:
            if (at := _standing(one.x)) is not None:
                raise Unphysical(
                    f"the {'trace' if way else 'retrace'} stands still or goes back at column {at + 1}; is this the "
                    f"scanner, and are turn and window those of the scan?"
                )
        if (at := _standing(self.y)) is not None:
            raise Unphysical(
                f"the slow axis stands still or goes back at row {at + 1}; are turn, window and lines those "
                "of the scan?"
            )

    def sources(self, forward: bool) -> tuple[Floats, Floats, Bools]:
        """For each pixel of the straight image the row and the column that it comes from, and which are in the image.

        Shapes (rows, columns). Nothing is taken from beyond the middles of the outer pixels.
        """
        side = self.side(forward)
        x, y = self.grid
        times = np.arange(self.rows + 1.0)
        kept = ascending(self.y)
        at = np.interp(y, self.y[kept], times[kept])  # when y is there, in rows of time
        drift = np.interp(at, times, self.drift)
        column = _inverted(side.x, x[None, :] - drift[:, None])
        time = np.interp(column, np.arange(self.columns), side.time)
        row = at[:, None] - _HALF - self.lag * (time - _HALF)
        last_row, last_column = self.rows - 1.0, self.columns - 1.0
        inside = (row >= -_ROUNDING) & (row <= last_row + _ROUNDING)
        inside &= (column >= -_ROUNDING) & (column <= last_column + _ROUNDING)
        return np.clip(row, 0.0, last_row), np.clip(column, 0.0, last_column), inside

    def moved(self, forward: bool) -> tuple[Floats, Floats]:
        """By how many pixels of the straight image its parts were displaced in the taken one, in x and y; NaN outside.

        Shapes (rows, columns).
        """
        row, column, inside = self.sources(forward)
        own_row, own_column = np.mgrid[: self.rows, : self.columns].astype(np.float64)
        nowhere = np.where(inside, 0.0, np.nan)
        return column - own_column + nowhere, row - own_row + nowhere


@dataclass(frozen=True, eq=False)
class Resampler:
    """One direction of a distortion, for any number of channels."""

    row: Floats
    column: Floats
    inside: Bools

    @classmethod
    def of(cls, distortion: Distortion, forward: bool) -> "Resampler":
        """Return the resampler of one direction of an image."""
        return cls(*distortion.sources(forward))

    def __call__(self, image: Floats) -> Floats:
        """Resample an image, rows x columns; NaN where nothing was imaged. Cubic splines, used once.

        They end as the image goes on if it is turned about its outer pixels: a slope is no edge then.
        """
        wide = np.pad(image, _MARGIN, mode="reflect", reflect_type="odd")
        at = np.stack([self.row, self.column]) + _MARGIN
        heights: Floats = map_coordinates(wide, at, order=_ORDER, mode="mirror")
        return np.where(self.inside, heights, np.nan)


def _edges(x: Floats) -> tuple[float, float]:
    """Half a pixel beyond the first and the last."""
    return float(1.5 * x[0] - 0.5 * x[1]), float(1.5 * x[-1] - 0.5 * x[-2])


def ascending(values: Floats) -> slice:
    """Return the part from the lowest value near the beginning to the highest one near the end."""
    outer = max(round(_OUTER * len(values)), 1)
    first = int(np.argmin(values[:outer]))
    last = len(values) - 1 - int(np.argmax(values[: -outer - 1 : -1]))
    return slice(first, last + 1)


def _standing(values: Floats) -> int | None:
    """Where the ascending part stands still or goes back; None where it does nowhere."""
    filled = ascending(values)
    step = np.diff(values[filled])
    at = int(np.argmin(step))
    return (
        filled.start + at if not float(step[at]) > _FINEST * float(np.mean(step)) * (0 < at < len(step) - 1) else None
    )


def _inverted(x: Floats, at: Floats) -> Floats:
    """Invert x: the columns at which x is ``at``; straight on for half a pixel at either end, then beyond it."""
    kept = ascending(x)
    part = x[kept]
    low, high = _edges(part)
    count = len(part)
    places = np.concatenate([[-_HALF], np.arange(count), [count - _HALF]]) + kept.start
    columns: Floats = np.interp(at, np.concatenate([[low], part, [high]]), places, left=-1.0, right=len(x))
    return columns
