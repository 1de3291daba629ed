"""A chart as lines, texts and areas at their positions: the one drawing that pages, SVG, PNG and PDF show.

Positions are in pixels from the upper left. Parts of a ``Clip`` have positions of their own, and are cut at its edges.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import log10
from textwrap import wrap
from typing import Literal

import numpy as np

from tablegen.charts.chart import Band, Chart, DrawnCurve, Mark, Raster, runs, ticks
from tablegen.charts.style import palette, shades_of
from tablegen.numerics.arrays import Floats

WIDTH, HEIGHT = 536, 290
PICTURE_HEIGHT = 430  # of charts whose axes have one scale, as images have
_LEFT, _RIGHT, _TOP, _BOTTOM = 70, 20, 16, 44
_SCALE_ROOM, _SCALE_WIDTH = 78, 14  # of the scale of shades, on the right
_FAR = 10_000.0  # positions are clipped to this distance
_HEAD = 4.0  # of an arrow
_ROW = 18  # of a legend
_LETTER = 7.1  # the mean width of one
_TITLE_LETTERS = 50  # of a row


@dataclass(frozen=True)
class Box:
    """A rectangle with a style."""

    style: str
    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True)
class Segments:
    """Straight lines, each from (x, y) to (x, y)."""

    style: str
    lines: tuple[tuple[float, float, float, float], ...]


@dataclass(frozen=True)
class Text:
    """A text; ``upright`` is turned to read from below."""

    style: str
    x: float
    y: float
    text: str
    anchor: Literal["start", "middle", "end"] = "start"
    upright: bool = False


@dataclass(frozen=True, eq=False)
class CurvePath:
    """A curve as stretches of positions; areas and stems reach to ``base``."""

    curve: DrawnCurve
    stretches: tuple[tuple[Floats, Floats], ...]
    base: float = 0.0


@dataclass(frozen=True, eq=False)
class Shades:
    """An image of shades, (rows, columns), with its palette, (256, 3)."""

    shades: np.typing.NDArray[np.uint8]
    palette: np.typing.NDArray[np.uint8]
    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True)
class Group:
    """Parts with a common style."""

    style: str
    parts: "tuple[Part, ...]"


@dataclass(frozen=True)
class Clip:
    """Parts that are clipped to the frame of a chart."""

    x: float
    y: float
    width: float
    height: float
    parts: "tuple[Part, ...]"


@dataclass(frozen=True)
class Translation:
    """Parts at a displaced origin."""

    x: float
    y: float
    parts: "tuple[Part, ...]"


Part = Box | Segments | Text | CurvePath | Shades | Group | Clip | Translation


class _Frame:
    """The frame of the axes of a chart, and the map from values to positions in it."""

    def __init__(self, chart: Chart, height: float) -> None:
        self.x0, self.x1 = chart.x_limits
        self.y0, self.y1 = chart.y_limits
        self.log = chart.log_x
        scale = chart.raster is not None and chart.raster.label
        self.width = float(WIDTH - _LEFT - _RIGHT - (_SCALE_ROOM if scale else 0))
        self.height = float(height - _TOP - _BOTTOM)
        if chart.equal:
            unit = min(self.width / abs(self.x1 - self.x0), self.height / abs(self.y1 - self.y0))
            self.width, self.height = unit * abs(self.x1 - self.x0), unit * abs(self.y1 - self.y0)

    def x(self, values: Floats | float) -> Floats:
        """Return the horizontal positions of values.

        Returns
        -------
        Pixels from the left edge, of the shape of ``values``.
        """
        low, high, at = self.x0, self.x1, np.asarray(values, dtype=np.float64)
        if self.log:
            low, high, at = log10(low), log10(high), np.log10(np.maximum(at, 1e-300))
        return np.clip((at - low) / (high - low) * self.width, -_FAR, _FAR)

    def y(self, values: Floats | float) -> Floats:
        """Return the vertical positions of values, downwards.

        Returns
        -------
        Pixels from the upper edge, of the shape of ``values``.
        """
        share = (self.y1 - np.asarray(values, dtype=np.float64)) / (self.y1 - self.y0)
        return np.clip(share * self.height, -_FAR, _FAR)


def height_of(chart: Chart) -> int:
    """Return the height of the drawing of a chart, in pixels."""
    return PICTURE_HEIGHT if chart.equal else HEIGHT


def drawing(chart: Chart) -> tuple[Part, ...]:
    """Draw the axes and the contents of a chart, without title and legend: WIDTH by ``height_of`` pixels."""
    frame = _Frame(chart, height_of(chart))
    inner: list[Part] = []
    if chart.raster is not None:
        inner.append(_image(chart.raster, frame))
    for band in chart.bands:
        x_low, x_high = float(frame.x(band.low)), float(frame.x(band.high))
        inner.append(Box("band", x_low, 0.0, x_high - x_low, frame.height))
    for mark in chart.marks:
        inner.append(Segments("mark", (_line(mark, frame),)))
    inner += [_trail(curve, frame) for curve in chart.curves]
    if chart.arrows is not None:
        inner.append(Segments("arrow", tuple(_arrows(chart, frame))))
    return (
        Box("plot", _LEFT, _TOP, frame.width, frame.height),
        Group("ticks", tuple(_ticks(chart, frame))),
        Clip(_LEFT, _TOP, frame.width, frame.height, tuple(inner)),
        Group("words", tuple(_mark_words(chart, frame))),
        Text("label", _LEFT + frame.width / 2, _TOP + frame.height + 36, chart.x_label, "middle"),
        Text("label", 20, _TOP + frame.height / 2, chart.y_label, "middle", upright=True),
        *(_scale(chart.raster, frame) if chart.raster is not None and chart.raster.label else ()),
    )


def _ticks(chart: Chart, frame: _Frame) -> Iterator[Part]:
    for value, text in ticks(min(chart.x_limits), max(chart.x_limits), log=chart.log_x):
        x = _LEFT + float(frame.x(value))
        yield Segments("tick", ((x, _TOP, x, _TOP + frame.height),))
        yield Text("tick", x, _TOP + frame.height + 16, text, "middle")
    for value, text in ticks(min(chart.y_limits), max(chart.y_limits)):
        y = _TOP + float(frame.y(value))
        yield Segments("tick", ((_LEFT, y, _LEFT + frame.width, y),))
        yield Text("tick", _LEFT - 6, y + 4, text, "end")


def _line(mark: Mark, frame: _Frame) -> tuple[float, float, float, float]:
    if mark.of == "x":
        x = float(frame.x(mark.at))
        return x, 0.0, x, frame.height
    y = float(frame.y(mark.at))
    return 0.0, y, frame.width, y


def _mark_words(chart: Chart, frame: _Frame) -> Iterator[Part]:
    """Draw the labels of marks, each a row lower where the one before it is near."""
    row, last = 0, -1e9
    for mark in sorted((mark for mark in chart.marks if mark.of == "x"), key=lambda one: one.at):
        x = float(frame.x(mark.at))
        if not mark.name or not 0.0 <= x <= frame.width:
            continue
        row = row + 1 if x - last < _LETTER * len(mark.name) else 0
        last, right = x, x > 0.6 * frame.width
        place = _LEFT + x + (-4 if right else 4)
        yield Text("word", place, _TOP + 13 + 13 * row, mark.name, "end" if right else "start")
    for mark in (mark for mark in chart.marks if mark.of == "y" and mark.name):
        yield Text("word", _LEFT + frame.width - 4, _TOP + float(frame.y(mark.at)) - 4, mark.name, "end")


def _trail(curve: DrawnCurve, frame: _Frame) -> CurvePath:
    base = frame.height if curve.kind == "stems" else float(np.clip(frame.y(0.0), 0.0, frame.height))
    return CurvePath(curve, tuple((frame.x(x), frame.y(y)) for x, y in runs(curve)), base)


def _image(raster: Raster, frame: _Frame) -> Shades:
    (x_low, x_high), (below, above) = (
        (float(scale(ends[0])), float(scale(ends[1]))) for scale, ends in ((frame.x, raster.x), (frame.y, raster.y))
    )
    return Shades(shades_of(raster), palette(raster.shades), x_low, above, x_high - x_low, below - above)


def _scale(raster: Raster, frame: _Frame) -> Iterator[Part]:
    """Draw the scale of shades with its values, on the right."""
    x = _LEFT + frame.width + 14
    column = np.arange(254, -1, -1, dtype=np.uint8)[:, None]
    yield Shades(column, palette(raster.shades), x, _TOP, _SCALE_WIDTH, frame.height)
    yield Box("plot", x, _TOP, _SCALE_WIDTH, frame.height)
    for value, text in ticks(raster.low, raster.high):
        share = (raster.high - value) / ((raster.high - raster.low) or 1.0)
        yield Text("tick", x + _SCALE_WIDTH + 5, _TOP + share * frame.height + 4, text)
    yield Text("label", x + _SCALE_WIDTH + 58, _TOP + frame.height / 2, raster.label, "middle", upright=True)


def _arrows(chart: Chart, frame: _Frame) -> Iterator[tuple[float, float, float, float]]:
    """Yield the shaft and the two strokes of the head of each arrow."""
    assert chart.arrows is not None
    one = chart.arrows
    x0, y0, x1, y1 = frame.x(one.x), frame.y(one.y), frame.x(one.x + one.dx), frame.y(one.y + one.dy)
    for a, b, c, d in zip(x0.tolist(), y0.tolist(), x1.tolist(), y1.tolist(), strict=True):
        yield a, b, c, d
        length = float(np.hypot(c - a, d - b))
        if length > 0.0:
            along, across, head = (c - a) / length, (d - b) / length, min(_HEAD, 0.5 * length)
            for side in (-1.0, 1.0):
                yield c, d, c - head * (along + side * across), d - head * (across - side * along)


def legend_rows(chart: Chart) -> list[list[tuple[float, DrawnCurve | Band]]]:
    """Arrange the entries of a legend in rows, each with its position from the left."""
    rows: list[list[tuple[float, DrawnCurve | Band]]] = []
    bands = {band.name: band for band in chart.bands if band.name}
    x = float(WIDTH)
    entries: list[DrawnCurve | Band] = [*chart.needed_legend, *bands.values()]
    for one in entries:
        needs = 56.0 + _LETTER * len(one.name)
        if x + needs > WIDTH - _LEFT - _RIGHT:
            rows.append([])
            x = 0.0
        rows[-1].append((x, one))
        x += needs
    return rows


def _title_rows(chart: Chart) -> list[str]:
    """Wrap the title into as many rows as it takes."""
    return wrap(chart.title, _TITLE_LETTERS) or [""]


def _with_title(chart: Chart, titles: int, rows: int) -> tuple[Part, ...]:
    """Draw a chart below its title and a legend, which have room for some rows."""
    parts: list[Part] = [Text("title", _LEFT, 20 + _ROW * at, text) for at, text in enumerate(_title_rows(chart))]
    for number, entries in enumerate(legend_rows(chart)):
        y = 20.0 + _ROW * (titles + number)
        for x, one in entries:
            entry_x = _LEFT + x
            parts += [_swatch(one, entry_x, y), Text("legend", entry_x + 38, y + 4, one.name)]
    return (*parts, Translation(0, 8 + _ROW * (titles + rows), drawing(chart)))


def _swatch(one: DrawnCurve | Band, x: float, y: float) -> Part:
    """Draw a sample of the line of a legend's entry."""
    if isinstance(one, Band):
        return Box("band", x, y - 7, 30, 14)
    across = np.array([x + 15.0] if one.kind == "points" else [x, x + 30.0])
    piece = one if one.kind == "points" else replace(one, kind="line")
    return CurvePath(piece, ((across, np.full(len(across), y)),))


def sheet(heading: str, charts: Sequence[Chart], columns: int) -> tuple[int, int, tuple[Part, ...]]:
    """Return width, height and parts of charts in rows, with a heading unless it is empty."""
    y = 0
    parts: list[Part] = []
    if heading:
        parts.append(Text("heading", 20, 26, heading))
        y = 40
    columns = min(columns, len(charts))
    for first in range(0, len(charts), columns):
        row = charts[first : first + columns]
        titles = max(len(_title_rows(chart)) for chart in row)
        rows = max(len(legend_rows(chart)) for chart in row)
        parts += [Translation(WIDTH * at, y, _with_title(chart, titles, rows)) for at, chart in enumerate(row)]
        y += 8 + _ROW * (titles + rows) + max(map(height_of, row))
    return WIDTH * columns, y, tuple(parts)
