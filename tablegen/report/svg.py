"""A chart as SVG, without a library: curves lie in a nested drawing, so that a script can zoom without redrawing them.

Positions within it are whole hundredths of a pixel. Everything that is text is escaped here; colours are the page's.
"""

from math import log10

import numpy as np
from markupsafe import Markup, escape

from tablegen.numerics.arrays import Floats
from tablegen.report.chart import Chart, DrawnCurve, runs, ticks

WIDTH, HEIGHT = 536, 290
_LEFT, _RIGHT, _TOP, _BOTTOM = 70, 20, 16, 44
PLOT_WIDTH, PLOT_HEIGHT = WIDTH - _LEFT - _RIGHT, HEIGHT - _TOP - _BOTTOM
_FINE = 100  # positions to a pixel
_FAR = 1_000_000  # nothing is drawn farther out than that


class _Scale:
    """From values to positions in the nested drawing."""

    def __init__(self, chart: Chart) -> None:
        self.log = chart.log_x
        self.x0, self.x1 = chart.x_limits
        self.y0, self.y1 = chart.y_limits

    def x(self, values: Floats | float) -> Floats:
        """Horizontal."""
        low, high, at = self.x0, self.x1, np.asarray(values, dtype=np.float64)
        if self.log:
            low, high, at = log10(low), log10(high), np.log10(np.maximum(at, 1e-300))
        return _whole((at - low) / (high - low) * PLOT_WIDTH)

    def y(self, values: Floats | float) -> Floats:
        """Vertical, downwards."""
        return _whole((self.y1 - np.asarray(values, dtype=np.float64)) / (self.y1 - self.y0) * PLOT_HEIGHT)


def _whole(pixels: Floats) -> Floats:
    return np.clip(np.rint(pixels * _FINE), -_FAR, _FAR)


def svg(chart: Chart) -> Markup:
    """The chart for the page: without its title and legend, which stand beside it as text that wraps."""
    return Markup(
        '<svg class="chart" viewBox="0 0 {} {}" role="img" aria-label="{}" tabindex="0" data-x="{!r} {!r}" '
        'data-y="{!r} {!r}" data-log="{}">{}</svg>'
    ).format(WIDTH, HEIGHT, chart.title, *chart.x_limits, *chart.y_limits, int(chart.log_x), _drawing(chart))


def _drawing(chart: Chart) -> Markup:
    scale = _Scale(chart)
    parts = [
        Markup('<rect class="plot" x="{}" y="{}" width="{}" height="{}"/>').format(
            _LEFT, _TOP, PLOT_WIDTH, PLOT_HEIGHT
        ),
        _grid(chart, scale),
        Markup('<svg class="inner" x="{}" y="{}" width="{}" height="{}" viewBox="0 0 {} {}" ').format(
            _LEFT, _TOP, PLOT_WIDTH, PLOT_HEIGHT, PLOT_WIDTH * _FINE, PLOT_HEIGHT * _FINE
        ),
        Markup('preserveAspectRatio="none">'),
        *(_band(scale, band.low, band.high) for band in chart.bands),
        *(_mark(scale, mark.at, mark.of) for mark in chart.marks),
        *(_curve(curve, scale) for curve in chart.curves),
        Markup("</svg>"),
        _words(chart, scale),
        Markup('<text class="label" x="{}" y="{}" text-anchor="middle">{}</text>').format(
            _LEFT + PLOT_WIDTH // 2, HEIGHT - 8, chart.x_label
        ),
        Markup('<text class="label" transform="translate(14 {}) rotate(-90)" text-anchor="middle">{}</text>').format(
            _TOP + PLOT_HEIGHT // 2, chart.y_label
        ),
    ]
    return Markup("").join(parts)


def _grid(chart: Chart, scale: _Scale) -> Markup:
    parts = [Markup('<g class="ticks">')]
    for value, text in ticks(*chart.x_limits, log=chart.log_x):
        x = _LEFT + float(scale.x(value)) / _FINE
        parts.append(
            Markup('<path d="M{:.1f} {}v{}"/><text x="{:.1f}" y="{}" text-anchor="middle">{}</text>').format(
                x, _TOP, PLOT_HEIGHT, x, _TOP + PLOT_HEIGHT + 16, text
            )
        )
    for value, text in ticks(*chart.y_limits):
        y = _TOP + float(scale.y(value)) / _FINE
        parts.append(
            Markup('<path d="M{} {:.1f}h{}"/><text x="{}" y="{:.1f}" text-anchor="end">{}</text>').format(
                _LEFT, y, PLOT_WIDTH, _LEFT - 6, y + 4, text
            )
        )
    return Markup("").join([*parts, Markup("</g>")])


def _band(scale: _Scale, low: float, high: float) -> Markup:
    left, right = float(scale.x(low)), float(scale.x(high))
    return Markup('<rect class="band" x="{:.0f}" y="0" width="{:.0f}" height="{}"/>').format(
        left, right - left, PLOT_HEIGHT * _FINE
    )


def _mark(scale: _Scale, at: float, of: str) -> Markup:
    if of == "x":
        return Markup('<path class="mark" d="M{:.0f} 0v{}"/>').format(float(scale.x(at)), PLOT_HEIGHT * _FINE)
    return Markup('<path class="mark" d="M0 {:.0f}h{}"/>').format(float(scale.y(at)), PLOT_WIDTH * _FINE)


def _words(chart: Chart, scale: _Scale) -> Markup:
    """The words of marks, each a row lower where the one before it is near."""
    parts, row, last = [Markup('<g class="words">')], 0, -1e9
    for mark in sorted((mark for mark in chart.marks if mark.of == "x"), key=lambda one: one.at):
        x = float(scale.x(mark.at)) / _FINE
        if not 0.0 <= x <= PLOT_WIDTH:
            continue
        row = row + 1 if x - last < 7 * len(mark.name) else 0
        last, right = x, x > 0.6 * PLOT_WIDTH
        parts.append(
            Markup('<text x="{:.1f}" y="{}" text-anchor="{}">{}</text>').format(
                _LEFT + x + (-4 if right else 4), _TOP + 13 + 13 * row, "end" if right else "start", mark.name
            )
        )
    for mark in (mark for mark in chart.marks if mark.of == "y"):
        y = float(scale.y(mark.at)) / _FINE
        parts.append(
            Markup('<text x="{}" y="{:.1f}" text-anchor="end">{}</text>').format(
                WIDTH - _RIGHT - 4, _TOP + y - 4, mark.name
            )
        )
    return Markup("").join([*parts, Markup("</g>")])


def _curve(curve: DrawnCurve, scale: _Scale) -> Markup:
    zero = float(np.clip(scale.y(0.0), 0, PLOT_HEIGHT * _FINE)) if curve.kind != "stems" else PLOT_HEIGHT * _FINE
    parts = []
    for x, y in runs(curve):
        px, py = scale.x(x).astype(np.int64), scale.y(y).astype(np.int64)
        if curve.kind == "points":
            parts += [f"M{a} {b}h0" for a, b in zip(px.tolist(), py.tolist(), strict=True)]
        elif curve.kind == "stems":
            parts += [f"M{a} {b}V{zero:.0f}" for a, b in zip(px.tolist(), py.tolist(), strict=True)]
        else:
            steps = " ".join(f"{a} {b}" for a, b in zip(np.diff(px).tolist(), np.diff(py).tolist(), strict=True))
            parts.append(f"M{px[0]} {py[0]}" + (f"l{steps}" if steps else "h0"))
            if curve.kind == "area":
                parts[-1] += f"V{zero:.0f}H{px[0]}Z"
    return Markup('<path class="curve {} {}" data-name="{}" d="{}"/>').format(
        curve.role, curve.kind, curve.name, Markup("".join(parts))
    )


# In light colours, since a picture in a document has a white page around it.
_ALONE = """
svg{background:#fff;font:13px sans-serif}.plot{fill:none;stroke:#999}.ticks path{stroke:#e3e3e3}
.curve,.mark{fill:none;vector-effect:non-scaling-stroke;stroke-width:1.8}.band{fill:#5b7fb5;fill-opacity:.12}
.mark{stroke:#777;stroke-dasharray:2 3}.words{fill:#555;font-size:12px}
.forward{stroke:#0072b2}.backward{stroke:#c44e00;stroke-dasharray:6 3}.before{stroke:#777;stroke-dasharray:2 3}
.other{stroke:#00795c}.limit{stroke:#b00040}.points{stroke-width:8;stroke-linecap:round;stroke-dasharray:none}.before.points{stroke-width:4}
.area{fill:#5b7fb5;fill-opacity:.15}.title{font-size:15px;font-weight:bold}
"""


def standalone(chart: Chart) -> str:
    """The chart as a file of its own, with its title and its legend."""
    top = 30 + 18 * len(chart.legend)
    rows = [
        Markup('<path class="curve {} {}" d="M{} {}h30"/><text x="{}" y="{}">{}</text>').format(
            one.role, one.kind, _LEFT, 38 + 18 * i, _LEFT + 40, 42 + 18 * i, one.name
        )
        for i, one in enumerate(chart.legend)
    ]
    return str(
        Markup(
            '<svg xmlns="http://www.w3.org/2000/svg" width="{0}" height="{1}" viewBox="0 0 {0} {1}"><style>{2}</style>'
            '<text class="title" x="{3}" y="20">{4}</text>{5}<g transform="translate(0 {6})">{7}</g></svg>\n'
        ).format(WIDTH, HEIGHT + top, Markup(_ALONE), _LEFT, chart.title, Markup("").join(rows), top, _drawing(chart))
    )


def swatch(role: str, kind: str) -> Markup:
    """A piece of a curve, for a legend."""
    return Markup(
        '<svg class="swatch" viewBox="0 0 30 10" width="30" height="10" aria-hidden="true">'
        '<path class="curve {} {}" d="{}"/></svg>'
    ).format(escape(role), escape(kind), Markup("M15 5h0" if kind == "points" else "M0 5h30"))
