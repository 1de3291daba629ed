"""A planned scan as charts: its drive, the bend of the drive, and the expected error."""

from collections.abc import Mapping

import numpy as np

from tablegen.certificate.certificate import Certificate
from tablegen.charts.chart import POSITION, Chart, DrawnCurve, Mark
from tablegen.charts.picture_file import PlottedCharts
from tablegen.config.load import Setup
from tablegen.device.schedule import Schedule
from tablegen.html_report.corrections import shape_chart
from tablegen.html_report.lines import drive_chart
from tablegen.html_report.pixels import pixel_error_chart
from tablegen.html_report.playing import played_axes
from tablegen.html_report.scan_errors import SIDES, residual_chart
from tablegen.html_report.subject import PlannedScan
from tablegen.html_report.tilt_chart import tilt_chart
from tablegen.planning.line_plan import LinePlan, Plan

_POINTS = 321


def scan_charts(setup: Setup, plan: Plan, certificates: Mapping[str, Certificate], brief: bool) -> PlottedCharts:
    """Draw a row for each axis; ``brief`` leaves out its last chart, which takes a simulation."""
    rows = [[drive_of(line, plan.schedule), *([shape_chart(line)] if _bent(line) else [])] for line in plan.moving]
    if not brief:
        for row, line, axis in zip(rows, plan.moving, played_axes(PlannedScan(setup, plan, certificates)), strict=True):
            row += [residual_chart(line.axis, one) for one in axis.corrections[-1:]]
    columns = max(map(len, rows))
    rows.append(charts_of_tilts(plan))
    return PlottedCharts(f"{plan.name} on {plan.scanner}", tuple(chart for row in rows for chart in row), columns)


def charts_of_tilts(plan: Plan) -> list[Chart]:
    """Draw a frame of each output beside x and y; empty without any."""
    return [
        tilt_chart(tilt.name, tilt.program, tilt.converter.v_zero, tilt.converter.v_per_code) for tilt in plan.tilts
    ]


def _bent(line: LinePlan) -> bool:
    return line.drive.hysteresis.compensates


def drive_of(line: LinePlan, schedule: Schedule) -> Chart:
    """Draw the drive over a period."""
    pixels = None if line.imaged is None else schedule
    both = line.band_limit.directions == "both"
    return drive_chart(line.axis, line.drive, line.series, line.band_limit.window, both, float(1 / line.rate), pixels)


def modelled_error(plan: Plan, line: LinePlan) -> Chart:
    """Draw the modelled position less the requested one, inside the imaging windows; faint without compensation.

    To first order in the deviation between drive and branch: x - tau = (w - u) / u'. Of a sine they are the errors of
    its pixels.
    """
    if line.imaged is not None and (pixels := plan.pixel_errors) is not None:
        number = np.arange(1.0, plan.schedule.pixels + 1.0)
        curves = tuple(DrawnCurve(side, side, number, pixels.errors[side]) for side in SIDES)
        return pixel_error_chart(f"modelled-{line.axis}", curves)
    low, high = line.band_limit.window
    x = np.linspace(low, high, _POINTS)
    shape, plain, errors = line.drive.shape, [], []
    for side in SIDES[: 2 if line.band_limit.directions == "both" else 1]:
        times, rising = np.asarray(shape.times(side, x)), side == "forward"
        branch, along = (shape.forward, x) if rising else (shape.backward, 1.0 - x)
        error = (line.described.value(times) - shape.value(times)) / branch.slope(along)
        without = (branch.inverse(along) - along) * (1.0 if rising else -1.0)
        plain.append(DrawnCurve(f"{side}, triangle", side, x, 100.0 * without, faint=True))
        errors.append(DrawnCurve(f"{side}, compensated", side, x, 100.0 * error))
    return Chart(
        f"modelled-{line.axis}",
        f"{line.axis}: modelled error",
        POSITION,
        "error [% of the line]",
        (*plain, *errors),
        marks=(Mark(0.0, "", "y"),),
    )
