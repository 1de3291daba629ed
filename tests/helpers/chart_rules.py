"""What every chart has to have: a title, labels with units, a legend, and directions that are told apart."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from unittest.mock import patch

from tablegen.charts import drawing, svg
from tablegen.charts.chart import Chart, DrawnCurve
from tablegen.charts.style import look_of, spot_of
from tablegen.charts.text import mark_of, text_plot

WITH_UNIT = re.compile(r"\S.* \[[^\[\]]+\]$")
DIRECTIONS = ("forward", "backward")


def faults(chart: Chart) -> list[str]:
    """What is missing or cannot be told apart."""
    found = [] if chart.title.strip() else ["no title"]
    found += [f"{label!r} has no unit" for label in (chart.x_label, chart.y_label) if not WITH_UNIT.fullmatch(label)]
    if chart.raster is not None and not WITH_UNIT.fullmatch(chart.raster.label):
        found.append("the shades have no unit")
    if len(chart.curves) > 1:
        found += ["a curve without a name"] * any(not curve.name for curve in chart.curves)
        shown = {curve.name for curve in chart.needed_legend}
        found += [f"{curve.name!r} is not in the legend" for curve in chart.curves if curve.name not in shown]
    for curve in chart.curves:
        said = [side for side in DIRECTIONS if side in f"{curve.name} {chart.title}".split(":")[-1]]
        if curve.role in DIRECTIONS and curve.role not in f"{curve.name} {chart.title}":
            found.append(f"{curve.name!r} is drawn as {curve.role}")
        if len(said) == 1 and said[0] in curve.name and curve.role != said[0]:
            found.append(f"{curve.name!r} is drawn as {curve.role}")
    both = [next((c for c in chart.curves if c.role == side), None) for side in DIRECTIONS]
    if all(one is not None for one in both):
        found += _alike(*both)  # type: ignore[arg-type]
    found += _alike_names(chart)
    return found


def _alike(forward: DrawnCurve, backward: DrawnCurve) -> Iterator[str]:
    """What is the same of the directions: colour, line style or form, mark of the terminal."""
    if look_of(forward).stroke == look_of(backward).stroke:
        yield "both directions have one colour"
    points = forward.kind == backward.kind == "points"
    styles = (
        (spot_of(forward)[1], spot_of(backward)[1]) if points else (look_of(forward).dashes, look_of(backward).dashes)
    )
    if styles[0] == styles[1]:
        yield "both directions have one line style"
    if mark_of(forward) == mark_of(backward):
        yield "both directions have one mark"


def _alike_names(chart: Chart) -> Iterator[str]:
    """Two names that look the same."""
    looks: dict[tuple[object, ...], str] = {}
    for curve in chart.legend:
        look = (curve.role, curve.faint, curve.kind)
        if looks.setdefault(look, curve.name) != curve.name:
            yield f"{curve.name!r} looks as {looks[look]!r} does"


def text_faults(chart: Chart, width: int, unicode: bool) -> list[str]:
    """The same of the characters of a terminal."""
    lines = ["".join(text for text, _ in line) for line in text_plot(chart, width, unicode)]
    whole = "\n".join(lines)
    found = [f"{len(line)} characters: {line}" for line in lines if len(line) > width]
    found += [f"{char!r} is not ASCII" for char in whole if not unicode and not char.isascii()]
    if not lines[0].startswith(chart.title[: width - 3]):
        found.append("no title")
    found += [f"no {label!r}" for label in (chart.x_label, chart.y_label) if label not in whole]
    found += [f"no {c.name!r}" for c in chart.needed_legend if f"{mark_of(c)} {c.name}" not in whole]
    body = "\n".join(lines[3:-3])
    for curve in chart.curves:
        if curve.role in DIRECTIONS and mark_of(curve) not in body:
            found.append(f"no mark of {curve.name!r}")
    return found


@contextmanager
def drawn_charts() -> Iterator[list[Chart]]:
    """Every chart that is drawn meanwhile, for a page or for a file."""
    seen: list[Chart] = []
    real = drawing.drawing

    def noted(chart: Chart) -> tuple[drawing.Part, ...]:
        seen.append(chart)
        return real(chart)

    with patch.object(drawing, "drawing", noted), patch.object(svg, "drawing", noted):
        yield seen
