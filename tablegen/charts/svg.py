"""A drawing as SVG, without a library: for the page, whose style sheet has its styles, and as a separate file.

Curves lie in a nested drawing, so that a script can zoom without redrawing them; positions within it are whole
hundredths of a pixel. All text is escaped here.
"""

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from markupsafe import Markup

from tablegen.charts.chart import Chart, DrawnCurve
from tablegen.charts.drawing import (
    WIDTH,
    Box,
    Clip,
    CurvePath,
    Group,
    Part,
    Segments,
    Shades,
    Text,
    Translation,
    drawing,
    height_of,
    sheet,
)
from tablegen.charts.png import data_address, indexed_png
from tablegen.charts.style import LOOKS, Look, look_of, spot_of
from tablegen.numerics.arrays import Ints

_FINE = 100  # positions to a pixel
_Attributes = Callable[[Part], Markup]


def svg(chart: Chart) -> Markup:
    """Render the chart for the page, without title and legend, which stand beside it as text that wraps."""
    return Markup(
        '<svg class="chart" viewBox="0 0 {} {}" role="img" aria-label="{}" tabindex="0" data-x="{!r} {!r}" '
        'data-y="{!r} {!r}" data-log="{}">{}</svg>'
    ).format(
        WIDTH,
        height_of(chart),
        chart.title,
        *chart.x_limits,
        *chart.y_limits,
        int(chart.log_x),
        _all(drawing(chart), _classes),
    )


def standalone(charts: Sequence[Chart], heading: str = "", columns: int = 2) -> str:
    """Render charts as a file, with titles and legends; without a style sheet, which would apply to a whole page."""
    space = Markup(' xmlns="http://www.w3.org/2000/svg"')
    return f'<?xml version="1.0" encoding="utf-8"?>\n{_alone(charts, heading, columns, space)}\n'


def embedded(charts: Sequence[Chart], columns: int = 2) -> str:
    """Render the charts as a part of an HTML page of another program, such as a notebook."""
    return str(_alone(charts, "", columns, Markup("")))


def _alone(charts: Sequence[Chart], heading: str, columns: int, space: Markup) -> Markup:
    width, height, parts = sheet(heading, charts, columns)
    return Markup(
        '<svg{3} width="{0}" height="{1}" viewBox="0 0 {0} {1}" font-family="sans-serif">'
        '<rect width="{0}" height="{1}" fill="#ffffff"/>{2}</svg>'
    ).format(width, height, _all(parts, _looks), space)


def swatch(curve: DrawnCurve) -> Markup:
    """Draw a sample of a curve, for a legend of the page."""
    return Markup(
        '<svg class="swatch" viewBox="0 0 30 10" width="30" height="10" aria-hidden="true"><path{} d="{}"/></svg>'
    ).format(_classes(CurvePath(curve, ())), "M15 5h0" if curve.kind == "points" else "M0 5h30")


def _all(parts: Iterable[Part], attributes: _Attributes, fine: int = 1) -> Markup:
    return Markup("").join(_part(part, attributes, fine) for part in parts)


def _part(part: Part, attributes: _Attributes, fine: int) -> Markup:
    match part:
        case Box():
            places = [_number(fine * value, fine) for value in (part.x, part.y, part.width, part.height)]
            return Markup('<rect{} x="{}" y="{}" width="{}" height="{}"/>').format(attributes(part), *places)
        case Segments():
            lines = ([_number(fine * value, fine) for value in line] for line in part.lines)
            path = "".join("M{} {}L{} {}".format(*line) for line in lines)
            return Markup('<path{} d="{}"/>').format(attributes(part), path)
        case Text():
            place = Markup('x="{}" y="{}"').format(_number(part.x, 1), _number(part.y, 1))
            if part.upright:
                place = Markup('transform="translate({} {}) rotate(-90)"').format(
                    _number(part.x, 1), _number(part.y, 1)
                )
            return Markup('<text{} {} text-anchor="{}">{}</text>').format(
                attributes(part), place, part.anchor, part.text
            )
        case CurvePath():
            return Markup('<path{} data-name="{}" d="{}"/>').format(
                attributes(part), part.curve.name, _path(part, fine)
            )
        case Shades():
            places = [_number(fine * value, fine) for value in (part.x, part.y, part.width, part.height)]
            return Markup(
                '<image x="{}" y="{}" width="{}" height="{}" preserveAspectRatio="none" '
                'image-rendering="pixelated" href="{}"/>'
            ).format(*places, data_address(indexed_png(part.shades, part.palette)))
        case Group():
            return Markup('<g class="{}">{}</g>').format(part.style, _all(part.parts, attributes, fine))
        case Translation():
            return Markup('<g transform="translate({} {})">{}</g>').format(
                _number(part.x, 1), _number(part.y, 1), _all(part.parts, attributes, fine)
            )
        case Clip():
            width, height = (_number(_FINE * value, _FINE) for value in (part.width, part.height))
            return Markup(
                '<svg class="inner" x="{}" y="{}" width="{}" height="{}" viewBox="0 0 {} {}" '
                'preserveAspectRatio="none">{}</svg>'
            ).format(
                *(_number(value, 1) for value in (part.x, part.y, part.width, part.height)),
                width,
                height,
                _all(part.parts, attributes, _FINE),
            )


def _number(value: float, fine: int) -> str:
    """Format tenths of a pixel, or whole numbers of a fine grid, with no more digits than needed."""
    return f"{value:.0f}" if fine > 1 else f"{value:.1f}".removesuffix(".0")


def _path(trail: CurvePath, fine: int) -> str:
    parts = []
    for x, y in trail.stretches:
        px, py = (np.rint(values * fine).astype(np.int64) for values in (x, y))
        zero = round(trail.base * fine)
        if trail.curve.kind == "points":
            parts += [f"M{a} {b}h0" for a, b in zip(px.tolist(), py.tolist(), strict=True)]
        elif trail.curve.kind == "stems":
            parts += [f"M{a} {b}V{zero}" for a, b in zip(px.tolist(), py.tolist(), strict=True)]
        else:
            parts.append(f"M{px[0]} {py[0]}" + _steps(px, py))
            if trail.curve.kind == "area":
                parts[-1] += f"V{zero}H{px[0]}Z"
    return "".join(parts)


def _steps(x: Ints, y: Ints) -> str:
    steps = " ".join(f"{a} {b}" for a, b in zip(np.diff(x).tolist(), np.diff(y).tolist(), strict=True))
    return f"l{steps}" if steps else "h0"


def _classes(part: Part) -> Markup:
    """Return the classes of a part for the style sheet of the page."""
    match part:
        case CurvePath():
            faint = " faint" if part.curve.faint else ""
            return Markup(' class="curve {} {}{}"').format(part.curve.role, part.curve.kind, faint)
        case Box() | Segments() | Text() if part.style not in ("tick", "word"):
            return Markup(' class="{}"').format(part.style)
    return Markup("")


def _looks(part: Part) -> Markup:
    """Return the style of a part as attributes."""
    match part:
        case CurvePath():
            look = look_of(part.curve)
            if part.curve.kind == "points":
                size, form = spot_of(part.curve)
                cap = "round" if form == "round" else "square"
                width = size if form == "round" else 0.8 * size
                return _stroke(Look(look.stroke, width)) + Markup(' stroke-linecap="{}"').format(cap)
            if part.curve.kind == "stems":
                look = Look(look.stroke, look.width)
            fill = LOOKS["area"] if part.curve.kind == "area" else None
            return _stroke(look, fill)
        case Text():
            look = LOOKS[part.style]
            weight = Markup(' font-weight="bold"') if look.bold else Markup("")
            return Markup(' fill="{}" font-size="{}"').format(look.fill, _number(look.size, 1)) + weight
        case Box() if LOOKS[part.style].fill:
            look = LOOKS[part.style]
            return Markup(' fill="{}" fill-opacity="{}"').format(look.fill, look.opacity)
        case Box() | Segments():
            return _stroke(LOOKS[part.style])
    return Markup("")


def _stroke(look: Look, area: Look | None = None) -> Markup:
    attributes = Markup(' fill="none"')
    if area is not None:
        attributes = Markup(' fill="{}" fill-opacity="{}"').format(area.fill, area.opacity)
    attributes += Markup(' stroke="{}" stroke-width="{}" vector-effect="non-scaling-stroke"').format(
        look.stroke, _number(look.width, 1)
    )
    if look.dashes:
        attributes += Markup(' stroke-dasharray="{}"').format(" ".join(f"{one:g}" for one in look.dashes))
    return attributes + Markup(' stroke-linejoin="round"')
