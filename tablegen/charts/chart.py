"""The contents of a chart, independent of how it is drawn: curves, bands, marks, and the ticks of its axes."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, floor, isfinite, log10
from typing import Literal

import numpy as np

from tablegen.numerics.arrays import Floats

Role = Literal["forward", "backward", "before", "other", "limit"]
_BINS = 400  # of a curve with more than twice as many points: the least and the largest of each are drawn
POSITION = "position on the line [share]"
_ROOM = 0.06  # above and below the curves, of their range


@dataclass(frozen=True, eq=False)
class DrawnCurve:
    """Values over a coordinate, (n,) each; NaN breaks the line. ``role`` determines colour and line style.

    A curve without a name is not in the legend. A ``faint`` one has the same direction and less weight.
    """

    name: str
    role: Role
    x: Floats
    y: Floats
    kind: Literal["line", "points", "stems", "area"] = "line"
    faint: bool = False


@dataclass(frozen=True)
class Band:
    """A shaded range of x."""

    low: float
    high: float
    name: str


@dataclass(frozen=True)
class Mark:
    """A straight line at a value of x or y, with a label."""

    at: float
    name: str
    of: Literal["x", "y"] = "x"


@dataclass(frozen=True, eq=False)
class Raster:
    """An image: values of shape (rows, columns), the first row on top, NaN left out; shades span ``low`` to ``high``.

    It spans ``x``, from left to right, and ``y``, from bottom to top. ``label`` is that of the scale of its shades,
    with the unit; without one there is no scale.
    """

    values: Floats
    x: tuple[float, float]
    y: tuple[float, float]
    low: float
    high: float
    shades: Literal["grey", "heat", "signed"] = "grey"
    label: str = ""


@dataclass(frozen=True, eq=False)
class Arrows:
    """Arrows from (x, y) by (dx, dy), (n,) each, in the units of the axes."""

    x: Floats
    y: Floats
    dx: Floats
    dy: Floats


@dataclass(frozen=True, eq=False)
class Chart:
    """One chart. ``key`` is its id in the page and its name as a file; labels contain the unit.

    ``equal`` is true if x and y have the same scale.
    """

    key: str
    title: str
    x_label: str
    y_label: str
    curves: tuple[DrawnCurve, ...]
    bands: tuple[Band, ...] = ()
    marks: tuple[Mark, ...] = ()
    log_x: bool = False
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    caption: str = ""
    raster: Raster | None = None
    arrows: Arrows | None = None
    equal: bool = False

    @property
    def x_limits(self) -> tuple[float, float]:
        """The range of the horizontal axis."""
        if self.raster is not None and self.x_range is None:
            return self.raster.x
        return self.x_range or _range([curve.x for curve in self.curves], [], 0.0)

    @property
    def y_limits(self) -> tuple[float, float]:
        """The range of the vertical axis, from bottom to top."""
        if self.raster is not None and self.y_range is None:
            return self.raster.y
        marks = [mark.at for mark in self.marks if mark.of == "y"]
        return self.y_range or _range([curve.y for curve in self.curves], marks, _ROOM)

    @property
    def legend(self) -> list[DrawnCurve]:
        """The curves that have a name, each name once."""
        return list({curve.name: curve for curve in self.curves if curve.name}.values())

    @property
    def needed_legend(self) -> list[DrawnCurve]:
        """The same, but empty for a single curve without a direction, which the title describes."""
        entries = self.legend
        return entries if len(entries) > 1 or any(curve.role in ("forward", "backward") for curve in entries) else []


def _range(values: list[Floats], more: list[float], room: float) -> tuple[float, float]:
    values_in_range = np.concatenate([*values, np.array(more)])
    values_in_range = values_in_range[np.isfinite(values_in_range)]
    if not len(values_in_range):
        return 0.0, 1.0
    low, high = float(np.min(values_in_range)), float(np.max(values_in_range))
    span = high - low
    if span <= 1e-9 * max(abs(low), abs(high)):
        span = max(abs(low), 1.0) * 0.1
        return low - span, high + span
    return low - room * span, high + room * span


def runs(curve: DrawnCurve) -> Iterator[tuple[Floats, Floats]]:
    """Yield the stretches of a curve without NaN, thinned to the visible resolution; extremes stay.

    Yields
    ------
    x and y of a stretch, shape (points,) each.
    """
    good = np.isfinite(curve.x) & np.isfinite(curve.y)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(np.int8)))
    for first, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        yield _thinned(curve.x[first:stop], curve.y[first:stop])


def _thinned(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    count = len(x)
    if count <= 2 * _BINS:
        return x, y
    edges = np.linspace(0, count, _BINS + 1).astype(np.int64)
    indices = {0, count - 1}
    for first, stop in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        indices |= {first + int(np.argmin(y[first:stop])), first + int(np.argmax(y[first:stop]))}
    at = np.array(sorted(indices))
    return x[at], y[at]


def ticks(low: float, high: float, log: bool = False, count: int = 5) -> list[tuple[float, str]]:
    """Return round values within a range, and their text: 1, 2 or 5 times a power of ten, or powers of ten."""
    if log:
        powers = range(ceil(log10(low) - 1e-9), floor(log10(high) + 1e-9) + 1)
        return [(10.0**power, _power(power)) for power in powers]
    if not (isfinite(low) and isfinite(high)) or high <= low:
        return []
    raw = (high - low) / count
    power = floor(log10(raw))
    step = next(size for size in (1.0, 2.0, 5.0, 10.0) if size * 10.0**power >= raw * 0.999) * 10.0**power
    digits = max(0, -floor(log10(step) + 1e-9))
    first, last = ceil(low / step - 1e-9), floor(high / step + 1e-9)
    return [(i * step, f"{i * step:.{digits}f}" if digits < 5 else f"{i * step:.3g}") for i in range(first, last + 1)]


def _power(power: int) -> str:
    for least, letter in ((6, "M"), (3, "k")):
        if power >= least:
            return f"{10 ** (power - least)}{letter}"
    return f"{10.0**power:g}"
