"""The compared quantities and the chart of the output z."""

from collections.abc import Iterator

from tablegen.charts.chart import Chart
from tablegen.comparison.frame_axis import frame_quantities
from tablegen.comparison.overlay import overlay
from tablegen.comparison.quantity import ComparedQuantity
from tablegen.comparison.scans import output_limits
from tablegen.html_report.subject import Subject
from tablegen.html_report.tilt import ShownTilt, shown_tilt
from tablegen.html_report.tilt_chart import tilt_chart
from tablegen.html_report.turned_subject import TurnedSubject
from tablegen.numerics.arrays import Floats


def tilt_quantities(subject: Subject | TurnedSubject) -> Iterator[ComparedQuantity]:
    """Yield every quantity of the output z of a scan or a build; none without z."""
    z = shown_tilt(subject)
    if z is None:
        return
    fields, codes = z.fields, z.codes
    numbers = (
        ("slope along x", fields.slope_x, ""),
        ("slope along y", fields.slope_y, ""),
        ("piezo", fields.nm_per_v, "nm/V"),
    )
    for name, value, unit in numbers:
        yield ComparedQuantity("z drive", name, value, unit)
    yield from frame_quantities("z", fields)
    certified = (
        ("lowest code", codes.least, ""),
        ("highest code", codes.most, ""),
        ("largest step", codes.steepest, "codes"),
        ("largest error at imaged ticks", z.error_lsb, "LSB"),
        ("largest error in height", z.error_nm, "nm"),
    )
    for name, value, unit in certified:
        yield ComparedQuantity("z certificate", name, value, unit)
    yield from output_limits("z", fields.output)


def tilt_charts(a: Subject | TurnedSubject, b: Subject | TurnedSubject) -> Iterator[Chart]:
    """Yield the chart of a frame of z, where both have z."""
    one, other = shown_tilt(a), shown_tilt(b)
    if one is not None and other is not None:
        yield overlay("drive-z", "z drive, one frame", "line", "drive at the piezo [V]", _frame(one), _frame(other))


def _frame(z: ShownTilt) -> tuple[Floats, Floats]:
    output = z.fields.output
    (curve,) = tilt_chart(z.program, output.v_zero, output.v_per_code).curves
    return curve.x, curve.y
