"""The position of each pixel of a scan, and the same scan on a straight grid, resampled once.

x depends on the column alone, since a line is settled, except for a drift that depends on the row; y depends on the
time in the frame, which continues within a row. The source of a point of the straight grid therefore takes two
inversions in one dimension each. Where creep lets an axis move back for a moment after a turn, the pixels of that
stretch are left out: the axis passes it again.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.ndimage import map_coordinates

from tablegen.base.input_errors import Unphysical
from tablegen.images.missing import without_holes
from tablegen.numerics.arrays import Bools, Floats

_ORDER = 3  # of the splines
_MARGIN = 12  # pixels beyond which values do not matter to a spline
_HALF = 0.5  # of a pixel: from its middle to its edge
_ROUNDING = 1e-6  # of a pixel
_OUTER = 0.25  # of a sweep at either end, where an axis may still go back
_MISSING_SHARE = 0.1  # of missing pixels among those from which a pixel is interpolated
_FINEST = 0.02  # of the mean step: closer pixels are at one position


@dataclass(frozen=True, eq=False)
class Sweep1D:
    """The columns of one direction, the left one first: their x, and their time in the line, 0..1; (columns,) each."""

    x: Floats
    time: Floats


@dataclass(frozen=True, eq=False)
class Distortion:
    """The positions of the pixels of a scan of rows x columns, in any unit of length, the same for x and y or not.

    ``forward`` and ``backward`` are the directions that were imaged. ``y`` and ``drift`` (of x) stand at ``rows`` + 1
    times of the frame, from the beginning of the first row to the end of the last one; ``lag`` is 1 where y moves
    within a row, 0 where it steps.
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
        sweep = self.forward if forward else self.backward
        if sweep is None:
            raise KeyError(forward)
        return sweep

    @property
    def sides(self) -> list[tuple[bool, Sweep1D]]:
        """The directions that were imaged."""
        return [(way, one) for way, one in ((True, self.forward), (False, self.backward)) if one is not None]

    @cached_property
    def x_range(self) -> tuple[float, float]:
        """Left and right edge of the imaged area without drift, half a pixel beyond the outer pixels."""
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
        """The positions of the straight image.

        Returns
        -------
        x of the columns, shape (columns,), and y of the rows, shape (rows,), in the unit of the distortion.
        """
        low, high = self.x_range
        first, last = self.y_range
        x = low + (high - low) * (np.arange(self.columns) + _HALF) / self.columns
        return x, first + (last - first) * (np.arange(self.rows) + _HALF) / self.rows

    def mirrored(self) -> "Distortion":
        """Return the distortion of the mirror image: left and right, and forward and backward, are exchanged."""
        low, high = self.x_range
        turned = [
            None if one is None else Sweep1D(low + high - one.x[::-1], one.time[::-1])
            for one in (self.backward, self.forward)
        ]
        return replace(self, forward=turned[0], backward=turned[1], drift=-self.drift)

    def check(self) -> None:
        """Check that the pixels follow each other.

        Raises
        ------
        Unphysical
            If an axis stands still or goes back, as with branches that run backwards.
        """
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
        """Return the source of each pixel of the straight image.

        No source lies beyond the middles of the outer pixels.

        Returns
        -------
        Row and column in the recorded image, and whether it is inside, shape (rows, columns) each.

        Raises
        ------
        KeyError
            If the direction was not imaged.
        """
        side = self.side(forward)
        x, y = self.grid
        times = np.arange(self.rows + 1.0)
        ascent = ascending(self.y)
        at = np.interp(y, self.y[ascent], times[ascent])  # the time at which y is reached, in rows
        drift = np.interp(at, times, self.drift)
        column = _inverted(side.x, x[None, :] - drift[:, None])
        time = np.interp(column, np.arange(self.columns), side.time)
        row = at[:, None] - _HALF - self.lag * (time - _HALF)
        last_row, last_column = self.rows - 1.0, self.columns - 1.0
        inside = (row >= -_ROUNDING) & (row <= last_row + _ROUNDING)
        inside &= (column >= -_ROUNDING) & (column <= last_column + _ROUNDING)
        return np.clip(row, 0.0, last_row), np.clip(column, 0.0, last_column), inside

    def displacement(self, forward: bool) -> tuple[Floats, Floats]:
        """Return by how many pixels the recorded image is displaced against the straight one.

        Returns
        -------
        Displacement along x and y, shape (rows, columns) each; NaN outside the imaged area.

        Raises
        ------
        KeyError
            If the direction was not imaged.
        """
        row, column, inside = self.sources(forward)
        own_row, own_column = np.mgrid[: self.rows, : self.columns].astype(np.float64)
        nowhere = np.where(inside, 0.0, np.nan)
        return column - own_column + nowhere, row - own_row + nowhere


@dataclass(frozen=True, eq=False)
class Resampler:
    """One direction of a distortion, to be applied to any number of channels; arrays of shape (rows, columns)."""

    row: Floats
    column: Floats
    inside: Bools

    @classmethod
    def of(cls, distortion: Distortion, forward: bool) -> "Resampler":
        """Return the resampler of one direction of a distortion.

        Raises
        ------
        KeyError
            If the direction was not imaged.
        """
        return cls(*distortion.sources(forward))

    def __call__(self, image: Floats) -> Floats:
        """Resample an image by cubic splines.

        Beyond its edges an image is continued point-symmetrically about its outer pixels, so that a slope is no edge.
        What comes from a missing pixel, or from between it and others, is missing.

        Parameters
        ----------
        image
            Heights, shape (rows, columns); NaN where a pixel is missing.

        Returns
        -------
        Heights of the same shape and unit; NaN where nothing was imaged.
        """
        missing = ~np.isfinite(image)
        inside = self.inside
        if missing.any():
            share = map_coordinates(missing.astype(np.float64), [self.row, self.column], order=1, mode="nearest")
            inside = inside & (share <= _MISSING_SHARE)
            image = np.nan_to_num(without_holes(image), nan=float(np.nanmean(image)))
        wide = np.pad(image, _MARGIN, mode="reflect", reflect_type="odd")
        at = np.stack([self.row, self.column]) + _MARGIN
        heights: Floats = map_coordinates(wide, at, order=_ORDER, mode="mirror")
        return np.where(inside, heights, np.nan)


def _edges(x: Floats) -> tuple[float, float]:
    """Return the positions half a pixel beyond the first and the last."""
    return float(1.5 * x[0] - 0.5 * x[1]), float(1.5 * x[-1] - 0.5 * x[-2])


def ascending(values: Floats) -> slice:
    """Return the part from the lowest value near the beginning to the highest one near the end.

    Parameters
    ----------
    values
        Positions, shape (n,).
    """
    outer = max(round(_OUTER * len(values)), 1)
    first = int(np.argmin(values[:outer]))
    last = len(values) - 1 - int(np.argmax(values[: -outer - 1 : -1]))
    return slice(first, last + 1)


def _standing(values: Floats) -> int | None:
    """Return where the ascending part stands still or goes back; None if nowhere."""
    filled = ascending(values)
    step = np.diff(values[filled])
    at = int(np.argmin(step))
    return (
        filled.start + at if not float(step[at]) > _FINEST * float(np.mean(step)) * (0 < at < len(step) - 1) else None
    )


def _inverted(x: Floats, at: Floats) -> Floats:
    """Invert x: the columns at which x is ``at``, extrapolated by half a pixel at either end."""
    ascent = ascending(x)
    part = x[ascent]
    low, high = _edges(part)
    count = len(part)
    places = np.concatenate([[-_HALF], np.arange(count), [count - _HALF]]) + ascent.start
    columns: Floats = np.interp(at, np.concatenate([[low], part, [high]]), places, left=-1.0, right=len(x))
    return columns
