"""The compared quantities and the charts of the outputs beside x and y."""

from collections.abc import Iterator

from tablegen.charts.chart import Chart
from tablegen.comparison.frame_axis import frame_quantities
from tablegen.comparison.overlay import overlay
from tablegen.comparison.quantity import ComparedQuantity
from tablegen.comparison.scans import output_limits
from tablegen.html_report.subject import Subject
from tablegen.html_report.tilt import ShownTilt, shown_tilts
from tablegen.html_report.tilt_chart import tilt_chart
from tablegen.html_report.turned_subject import TurnedSubject
from tablegen.numerics.arrays import Floats


def tilt_quantities(subject: Subject | TurnedSubject) -> Iterator[ComparedQuantity]:
    """Yield every quantity of the outputs beside x and y of a scan or a build; none without any."""
    for tilt in shown_tilts(subject):
        yield from _quantities(tilt)


def _quantities(z: ShownTilt) -> Iterator[ComparedQuantity]:
    """Yield every quantity of an output."""
    fields, codes = z.fields, z.codes
    numbers = (
        ("slope along x", fields.slope_x, ""),
        ("slope along y", fields.slope_y, ""),
        ("piezo", fields.nm_per_v, "nm/V"),
    )
    for name, value, unit in numbers:
        yield ComparedQuantity(f"{z.name} drive", name, value, unit)
    yield from frame_quantities(z.name, fields)
    certified = (
        ("lowest code", codes.least, ""),
        ("highest code", codes.most, ""),
        ("largest step", codes.steepest, "codes"),
        ("largest error at imaged ticks", z.error_lsb, "LSB"),
        ("largest error in height", z.error_nm, "nm"),
    )
    for name, value, unit in certified:
        yield ComparedQuantity(f"{z.name} certificate", name, value, unit)
    yield from output_limits(z.name, fields.output)


def tilt_charts(a: Subject | TurnedSubject, b: Subject | TurnedSubject) -> Iterator[Chart]:
    """Yield the charts of a frame of the outputs beside x and y that both have."""
    others = {tilt.name: tilt for tilt in shown_tilts(b)}
    for one in shown_tilts(a):
        if (other := others.get(one.name)) is not None:
            title = f"{one.name} drive, one frame"
            frames = _frame(one), _frame(other)
            yield overlay(f"drive-{one.name}", title, "line", "drive at the piezo [V]", *frames)


def _frame(z: ShownTilt) -> tuple[Floats, Floats]:
    output = z.fields.output
    (curve,) = tilt_chart(z.name, z.program, output.v_zero, output.v_per_code).curves
    return curve.x, curve.y
