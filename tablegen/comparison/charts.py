"""A and B in the same charts: A is grey and dotted, B green and solid."""

from collections.abc import Iterator, Sequence

import numpy as np

from tablegen.charts.chart import POSITION, Chart, Mark
from tablegen.comparison.comparison import SideBySide
from tablegen.comparison.law_charts import law_charts
from tablegen.comparison.operators import SIDES, ComparedOperator, Place, residuals
from tablegen.comparison.overlay import overlay
from tablegen.comparison.tilt import tilt_charts
from tablegen.comparison.turned import turned_charts
from tablegen.compensation.operator.loop import POINTS
from tablegen.html_report.blocks import Charts as ChartsBlock
from tablegen.html_report.blocks import Section
from tablegen.html_report.playing import PlayedAxis, played_axes
from tablegen.html_report.scan_errors import inside
from tablegen.html_report.subject import Subject, series_of
from tablegen.html_report.turned_subject import TurnedSubject
from tablegen.manifest.fields import ManifestAxis
from tablegen.numerics.arrays import Floats

_POINTS = 801
_MOST_LOOPS = 4


def comparison_charts(both: SideBySide) -> list[Chart]:
    """Return every chart that both sides can have."""
    a, b = both.a.subject, both.b.subject
    if isinstance(a, TurnedSubject) and isinstance(b, TurnedSubject):
        return [*turned_charts(a, b)]
    if isinstance(a, Subject) and isinstance(b, Subject):
        return [*_scans(a, b)]
    charts = [] if both.a.scanner is None or both.b.scanner is None else [*law_charts(both.a.scanner, both.b.scanner)]
    for name in both.a.operators:
        if name in both.b.operators:
            charts += _loops(name, both.a.operators[name], both.b.operators[name])
    return charts


def differing_charts(charts: Sequence[Chart]) -> list[Chart]:
    """Return the charts in which A and B are not one curve."""
    return [chart for chart in charts if not _alike(chart)]


def _alike(chart: Chart) -> bool:
    if len(chart.curves) == 1:  # a difference
        return not np.any(chart.curves[0].y)
    one, other = chart.curves
    return all(
        len(p) == len(q) and bool(np.allclose(p, q, rtol=1e-12, atol=0.0, equal_nan=True))
        for p, q in ((one.x, other.x), (one.y, other.y))
    )


def _scans(a: Subject, b: Subject) -> Iterator[Chart]:
    others = dict(b.axes)
    for axis, one in a.axes:
        other = others.get(axis)
        if other is None:  # one side is a line scan
            continue
        yield _drive(axis, one, other)
        yield _difference(axis, one, other)
        yield _spectrum(axis, one, other)
        yield from _pixels(axis, one, other)
    yield from tilt_charts(a, b)
    if a.planned is not None and b.planned is not None:
        played = {one.axis: one for one in played_axes(b.planned)}
        for first in played_axes(a.planned):
            if first.axis in played:
                yield from _errors(first, played[first.axis])


def _drive(axis: str, a: ManifestAxis, b: ManifestAxis) -> Chart:
    """Draw a line of x or a frame of y, each over its own time."""
    t = np.linspace(0.0, 1.0, _POINTS)
    periods = [entry.line.rate_exact[1] / entry.line.rate_exact[0] for entry in (a, b)]
    times, unit = (1e3, "ms") if max(periods) < 1.0 else (1.0, "s")
    curves = [(times * period * t, _volts(entry, t)) for entry, period in zip((a, b), periods, strict=True)]
    what = "line" if axis == "x" else "frame"
    return overlay(f"drive-{axis}", f"{axis} drive, one {what}", f"time [{unit}]", "drive at the piezo [V]", *curves)


def _difference(axis: str, a: ManifestAxis, b: ManifestAxis) -> Chart:
    """Draw the difference of two drives that an overlay cannot show."""
    t = np.linspace(0.0, 1.0, _POINTS)
    return overlay(
        f"apart-{axis}",
        f"{axis} drive, B less A",
        "time [periods]",
        "drive at the piezo [V]",
        None,
        (t, _volts(b, t) - _volts(a, t)),
    )


def _volts(entry: ManifestAxis, t: Floats) -> Floats:
    return entry.drive.v_offset + entry.drive.v_amplitude * (series_of(entry).value(t) - 0.5)


def _spectrum(axis: str, a: ManifestAxis, b: ManifestAxis) -> Chart:
    curves = []
    for entry in (a, b):
        series, rate = series_of(entry), entry.line.rate_exact[0] / entry.line.rate_exact[1]
        volts = entry.drive.v_amplitude * np.hypot(series.a, series.b)
        curves.append((rate * np.arange(1.0, series.harmonics + 1.0), 20.0 * np.log10(np.maximum(volts, 1e-9))))
    title = f"{axis} harmonics of the drive"
    return overlay(f"spectrum-{axis}", title, "frequency [Hz]", "amplitude [dB of 1 V]", *curves, log_x=True)


def _pixels(axis: str, a: ManifestAxis, b: ManifestAxis) -> Iterator[Chart]:
    """Draw the errors of pixels that are taken where the piezo is, if both sides have them."""
    stated, places = [entry.certificate.pixels for entry in (a, b)], []
    for entry, pixels in zip((a, b), stated, strict=True):
        if pixels is None or entry.fourier.imaged is None:
            return
        (low, high), count = entry.fourier.imaged, len(pixels.errors_percent["forward"])
        places.append(low + (high - low) * (np.arange(count) + 0.5) / count)
    for side in SIDES:
        errors = [np.array(pixels.errors_percent[side]) for pixels in stated if pixels is not None]
        yield overlay(
            f"pixels-{axis}-{side}",
            f"{axis} error of each pixel {side}, as certified",
            POSITION,
            "error [% of the line]",
            *zip(places, errors, strict=True),
            marks=(Mark(0.0, "", "y"),),
        )


def _errors(a: PlayedAxis, b: PlayedAxis) -> Iterator[Chart]:
    """Draw residual and scaling error on the scanner of each scanner file, as `tablegen report` simulates them."""
    one, other = (side.emitted or side.before for side in (a, b))
    if one is None or other is None:
        return
    for side in SIDES:
        if side not in one.directions or side not in other.directions:
            continue
        branches = [getattr(run.imaged, side) for run in (one, other)]
        key, place, zero = f"{a.axis}-{side}", POSITION, (Mark(0.0, "", "y"),)
        residual, scaling = f"residual-{key}", f"scaling-{key}"
        curves = [inside(branch) for branch in branches]
        title = f"{a.axis} residual {side}, simulated"
        yield overlay(residual, title, place, "residual [% of the line]", *curves, marks=zero)
        if any(np.isnan(branch.scaling).any() for branch in branches):  # an axis that rests between steps
            continue
        curves = [(branch.scaling_position, branch.scaling) for branch in branches]
        title = f"{a.axis} scaling error {side}, simulated"
        yield overlay(scaling, title, place, "scaling error [%]", *curves, marks=zero)


def _loops(name: str, a: ComparedOperator, b: ComparedOperator) -> Iterator[Chart]:
    """Draw both branches of the largest lines at which either side was measured, less a straight line."""
    places = sorted({*a.places, *b.places}, reverse=True)
    prefix = f"{name}-" if name else ""
    loop_places: list[Place] = []
    for place in places:
        loops = [operator.loop(place) for operator in (a, b)]
        if None in loops or len(loop_places) == _MOST_LOOPS:
            continue
        loop_places.append(place)
        both = [residuals(loop) for loop in loops if loop is not None]
        share = np.arange(POINTS) / (POINTS - 1)
        for at, side in enumerate(SIDES):
            yield overlay(
                f"{prefix}loop-{len(loop_places)}-{side}",
                f"{f'{name} ' if name else ''}{side}, {place[0]:g} V at {place[1]:g} V",
                "drive [share of the line's]",
                "position less straight line [%]",
                *((share, one[at]) for one in both),
                marks=(Mark(0.0, "", "y"),),
            )


def chart_section(charts: Sequence[Chart]) -> Section:
    """Return the section of a page with all charts."""
    lead = "Drag across a chart to zoom, press Escape to come back; the arrow keys step along the curves."
    return Section("charts", "A and B in one chart", (ChartsBlock(tuple(charts)),), lead)
