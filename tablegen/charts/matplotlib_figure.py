"""A drawing as PNG or PDF, by matplotlib: the same lines, texts and areas at the same positions as in the SVG."""

from collections.abc import Iterable, Sequence
from io import BytesIO
from typing import Any, Literal

import numpy as np

from tablegen.charts.chart import Chart
from tablegen.charts.drawing import Box, Clip, CurvePath, Group, Part, Segments, Shades, Text, Translation, sheet
from tablegen.charts.style import LOOKS, Look, look_of, spot_of

_POINTS = 0.72  # of a pixel, where 100 pixels are an inch
_ANCHORS = {"start": "left", "middle": "center", "end": "right"}
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Producer": None, "Creator": None},
}


def render(charts: Sequence[Chart], kind: Literal["png", "pdf"], heading: str = "", columns: int = 2) -> bytes:
    """Render the file, without a date, so that the same charts give the same bytes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width, height, parts = sheet(heading, charts, columns)
    figure = Figure(figsize=(0.01 * width, 0.01 * height))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set(xlim=(0.0, width), ylim=(height, 0.0), aspect="auto")
    _Painter(axes).paint(parts, 0.0, 0.0, None)
    axes.set(xlim=(0.0, width), ylim=(height, 0.0), aspect="auto")  # images change them
    stream = BytesIO()
    figure.savefig(stream, format=kind, dpi=150, metadata=_METADATA[kind])
    return stream.getvalue()


class _Painter:
    """Draws the parts of a drawing on axes whose units are its pixels."""

    def __init__(self, axes: Any) -> None:
        self.axes = axes
        self.order = 0

    def paint(self, parts: Iterable[Part], x: float, y: float, frame: Any) -> None:
        """Draw parts at an origin, clipped to ``frame``."""
        for part in parts:
            self.order += 1  # later parts are render above
            match part:
                case Translation():
                    self.paint(part.parts, x + part.x, y + part.y, frame)
                case Group():
                    self.paint(part.parts, x, y, frame)
                case Clip():
                    self._inside(part, x, y)
                case Box():
                    self._box(part, x, y, frame)
                case Segments():
                    for x0, y0, x1, y1 in part.lines:
                        self._line([x + x0, x + x1], [y + y0, y + y1], LOOKS[part.style], frame)
                case Text():
                    self._words(part, x, y)
                case CurvePath():
                    self._trail(part, x, y, frame)
                case Shades():
                    self._shades(part, x, y)

    def _inside(self, part: Clip, x: float, y: float) -> None:
        from matplotlib.patches import Rectangle

        x0, y0 = x + part.x, y + part.y
        edge = Rectangle((x0, y0), part.width, part.height, transform=self.axes.transData)
        self.paint(part.parts, x0, y0, edge)

    def _box(self, part: Box, x: float, y: float, frame: Any) -> None:
        from matplotlib.patches import Rectangle

        look = LOOKS[part.style]
        colours: dict[str, Any] = {
            "facecolor": look.fill or "none",
            "edgecolor": look.stroke or "none",
            "alpha": look.opacity,
        }
        box = Rectangle(
            (x + part.x, y + part.y),
            part.width,
            part.height,
            linewidth=_POINTS * look.width,
            clip_on=False,
            zorder=self.order,
            **colours,
        )
        self.axes.add_patch(box)
        if frame is not None:
            box.set_clip_path(frame)

    def _line(self, x: Any, y: Any, look: Look, frame: Any, **more: Any) -> None:
        width = _POINTS * look.width
        style: Any = (0.0, tuple(_POINTS * one / width for one in look.dashes)) if look.dashes else "-"
        (line,) = self.axes.plot(
            x,
            y,
            color=look.stroke,
            linewidth=width,
            linestyle=style,
            solid_joinstyle="round",
            clip_on=False,
            zorder=self.order,
            **more,
        )
        if frame is not None:
            line.set_clip_path(frame)

    def _words(self, part: Text, x: float, y: float) -> None:
        look = LOOKS[part.style]
        self.axes.text(
            x + part.x,
            y + part.y,
            part.text,
            color=look.fill,
            fontsize=_POINTS * look.size,
            fontweight="bold" if look.bold else "normal",
            ha=_ANCHORS[part.anchor],
            va="bottom" if part.upright else "baseline",
            rotation=90 if part.upright else 0,
            rotation_mode="anchor" if part.upright else "default",
            parse_math=False,
            zorder=self.order,
        )

    def _trail(self, part: CurvePath, x: float, y: float, frame: Any) -> None:
        look = look_of(part.curve)
        for across, down in part.stretches:
            px, py = x + across, y + down
            if part.curve.kind == "points":
                size, form = spot_of(part.curve)
                marker = {"round": "o", "square": "s"}[form]
                spots: dict[str, Any] = {"marker": marker, "markersize": _POINTS * size, "markeredgewidth": 0.0}
                self._line(px, py, Look(look.stroke, 0.0001), frame, **spots)
            elif part.curve.kind == "stems":
                plain = Look(look.stroke, look.width)
                for a, b in zip(px.tolist(), py.tolist(), strict=True):
                    self._line([a, a], [b, y + part.base], plain, frame)
            else:
                self._line(px, py, look, frame)
                if part.curve.kind == "area":
                    area = LOOKS["area"]
                    filled = self.axes.fill_between(
                        px, py, y + part.base, color=area.fill, alpha=area.opacity, lw=0, zorder=self.order
                    )
                    if frame is not None:
                        filled.set_clip_path(frame)

    def _shades(self, part: Shades, x: float, y: float) -> None:
        colours = part.palette[part.shades]
        ends = (x + part.x, x + part.x + part.width, y + part.y + part.height, y + part.y)
        self.axes.imshow(np.asarray(colours), extent=ends, interpolation="nearest", aspect="auto", zorder=self.order)
