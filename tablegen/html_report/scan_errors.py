"""Residual and scaling error inside the windows, before and after, over the line and over time."""

import numpy as np

from tablegen.charts.chart import POSITION, Band, Chart, DrawnCurve, Mark, Role
from tablegen.device.schedule import Schedule
from tablegen.html_report.blocks import Charts, Grid, Paragraph, Section, TableCell, row
from tablegen.html_report.playing import PlayedAxis, PlayedCorrection
from tablegen.html_report.subject import PlannedScan
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan
from tablegen.virtual.line_error import BranchError
from tablegen.virtual.own_run import image_errors
from tablegen.virtual.simulation import AxisRun

SIDES: tuple[Role, Role] = ("forward", "backward")


def errors(planned: PlannedScan, axes: tuple[PlayedAxis, ...]) -> Section:
    """Return residual and scaling error of both axes."""
    charts, rows, words = [], [], []
    for line, played in zip(planned.plan.moving, axes, strict=True):
        for correction in played.corrections:
            charts += _charts(line, correction)
            rows.append(_row(played.axis, correction))
        words += [f"{played.axis} {why}" for why in played.rejected]
        charts += _refinement(line)
    blocks: list[Paragraph | Grid | Charts] = [
        Grid(
            "In the image, about the best straight line through the imaged windows; the worse direction",
            (
                "",
                "rms residual [% of the line]",
                "scaling error [%, peak to peak]",
                "trace to retrace [% of the line]",
                "size error [%]",
            ),
            tuple(rows),
        ),
        Charts(tuple(charts)),
    ]
    blocks += [Paragraph(f"Not played: {why}", "warn") for why in words]
    lead = (
        "A simulation: the emitted integers on the scanner that the scanner file describes. It shows the residual of a "
        "correction if the scanner file is right; it cannot show whether it is. Each chart has a scale of its own."
    )
    if planned.plan.schedule.pixel_table is not None:
        lead += (
            " x is a sine: its errors are those of its pixels, each the mean position over its ticks. Without "
            "correction the drive is the same, and the pixels are where a piezo without hysteresis would be."
        )
    refined = [line.axis for line in planned.plan.moving if line.layer is not None]
    if refined:
        lead += (
            f" What `refine` learnt of {' and '.join(refined)} is in no figure of this section but its own charts, as "
            "the scanner file does not describe what it corrects: the first lines of the page say what the image has."
        )
    return Section("errors", "Residual and scaling error", tuple(blocks), lead)


def _row(axis: str, correction: PlayedCorrection) -> tuple[TableCell, ...]:
    rms, scaling, mismatch, size = image_errors(correction.run)
    scaling_text, mismatch_text = ("-" if np.isnan(value) else f"{value:.3g}" for value in (scaling, mismatch))
    return row(f"{axis} {correction.title}", f"{rms:.3g}", scaling_text, mismatch_text, f"{size:+.3g}")


def inside(branch: BranchError) -> tuple[Floats, Floats]:
    """Return the residual within the window.

    Returns
    -------
    Position on the line, 0..1, and residual in percent of the line, shape (points,) each.
    """
    low, high = branch.window
    inside_window = (branch.position >= low - 1e-9) & (branch.position <= high + 1e-9)
    return branch.position[inside_window], branch.residual[inside_window]


def residual_chart(axis: str, correction: PlayedCorrection) -> Chart:
    """Draw the residual in the image, about the best straight line through it."""
    run = correction.run
    return Chart(
        f"residual-{axis}-{correction.name}",
        f"{axis} residual, {correction.title}",
        POSITION,
        "residual [% of the line]",
        tuple(DrawnCurve(side, side, *inside(getattr(run.imaged, side))) for side in SIDES if side in run.directions),
        marks=(Mark(0.0, "", "y"),),
    )


def _charts(line: LinePlan, correction: PlayedCorrection) -> list[Chart]:
    run = correction.run
    errors = [(side, getattr(run.imaged, side)) for side in SIDES if side in run.directions]
    errors = [(side, one) for side, one in errors if not np.isnan(one.scaling).any()]
    if not errors:
        return [residual_chart(line.axis, correction)]
    scaling = Chart(
        f"scaling-{line.axis}-{correction.name}",
        f"{line.axis} scaling error, {correction.title}",
        POSITION,
        "scaling error [%]",
        tuple(DrawnCurve(side, side, one.scaling_position, one.scaling) for side, one in errors),
        marks=(Mark(0.0, "", "y"),),
    )
    return [residual_chart(line.axis, correction), scaling]


def _refinement(line: LinePlan) -> list[Chart]:
    """Draw the displacement of the piezo by the layer."""
    if line.layer is None:
        return []
    low, high = line.band_limit.window
    x = np.linspace(low, high, 401)
    curves = []
    for side in SIDES[: 2 if line.band_limit.directions == "both" else 1]:
        shape = line.drive.shape
        branch = shape.forward if side == "forward" else shape.backward
        steepness = branch.slope(x if side == "forward" else 1.0 - x)
        curves.append(DrawnCurve(side, side, x, 100.0 * line.layer.value(shape.times(side, x)) / steepness))
    return [
        Chart(
            f"refinement-{line.axis}",
            f"{line.axis}: effect of the refinement",
            POSITION,
            "moved by [% of the line]",
            tuple(curves),
        )
    ]


def windows(line: LinePlan, period: float) -> tuple[Band, ...]:
    """Return the imaged stretches of a period, in its unit of time."""
    sides = SIDES if line.band_limit.directions == "both" else SIDES[:1]
    low, high = line.band_limit.window
    bands = []
    for side in sides:
        first, last = sorted(float(t) for t in line.drive.shape.times(side, np.array([low, high])))
        bands.append(Band(first * period, last * period, "imaged"))
    return tuple(bands)


def run_windows(run: AxisRun, line: LinePlan, period: float) -> tuple[Band, ...]:
    """Return the imaged stretches of a period of a run: of a sine those of its pixels."""
    return windows(line, period) if run.pixels is None else pixel_windows(run.pixels, period)


def pixel_windows(schedule: Schedule, period: float) -> tuple[Band, ...]:
    """Return the imaged stretches of a line by its schedule, in the unit of ``period``."""
    tick = period / schedule.ticks
    both = schedule.forward, schedule.backward
    return tuple(Band(tick * each.first, tick * each.stop, "imaged") for each in both if each.count)


def pixel_times(schedule: Schedule) -> dict[str, Floats]:
    """Return the middle of each pixel, trace and retrace in the order of the position, in lines; (pixels,) each."""
    forward, backward = (0.5 * (edges[:-1] + edges[1:]) / schedule.ticks for edges in schedule.pixel_edges)
    return {"forward": forward, "backward": backward[::-1]}


def over_time(run: AxisRun, line: LinePlan, period: float) -> list[DrawnCurve]:
    """Return the curves of the residual in nm over time."""
    curves = []
    for side in (side for side in SIDES if side in run.directions):
        x, residual = inside(getattr(run.imaged, side))
        of_pixels = None if run.pixels is None else pixel_times(run.pixels)[side]
        times = (np.asarray(line.drive.shape.times(side, x)) if of_pixels is None else of_pixels) * period
        order = np.argsort(times)
        curves.append(DrawnCurve(side, side, times[order], 0.01 * residual[order] * run.nominal_nm))
    return curves
