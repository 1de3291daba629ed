"""Drive, position and error of both axes over time."""

from typing import Protocol

import numpy as np

from tablegen.charts.chart import Band, Chart, DrawnCurve, Mark
from tablegen.device.schedule import Schedule
from tablegen.html_report.blocks import Charts, Section
from tablegen.html_report.playing import PlayedAxis
from tablegen.html_report.scan_errors import over_time, pixel_windows, run_windows
from tablegen.html_report.subject import PlannedScan, Subject, series_of
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan
from tablegen.waveform.series import FourierSeries

_POINTS = 601


def lines(subject: Subject, axes: tuple[PlayedAxis, ...] | None) -> Section:
    """Return one line of x and one frame of y; of a directory the drive alone."""
    charts = []
    for at, (axis, entry) in enumerate(subject.axes):
        period_s = entry.line.rate_exact[1] / entry.line.rate_exact[0]
        window, both = entry.fourier.window, entry.fourier.directions == "both"
        pixels = None if entry.fourier.place is None else subject.manifest.sequence.schedule
        charts.append(drive_chart(axis, entry.drive, series_of(entry), window, both, period_s, pixels))
        times, unit = time_unit(period_s)
        if subject.planned is not None and axes is not None:
            charts += _moved(subject.planned, axes[at], at, times * period_s, f"time [{unit}]")
    return Section(
        "lines",
        "Drive, position and error over time",
        (Charts(tuple(charts)),),
        "The image is taken in the shaded windows. Drag across a chart to zoom, press Escape to come back; the arrow "
        "keys step along the curves.",
    )


class DriveFigures(Protocol):
    """The properties of a drive that a chart needs: volts at the piezo, and the share of the period that is forward."""

    @property
    def v_offset(self) -> float:
        """The offset in V."""

    @property
    def v_amplitude(self) -> float:
        """The peak-to-peak voltage in V."""

    @property
    def turn(self) -> float:
        """The share of the period in which the drive rises."""


def time_unit(period_s: float) -> tuple[float, str]:
    """Return the number of units in a second, and the name of the unit."""
    return (1e3, "ms") if period_s < 1.0 else (1.0, "s")


def drive_chart(
    axis: str,
    drive: DriveFigures,
    series: FourierSeries,
    window: tuple[float, float],
    both: bool,
    period_s: float,
    pixels: Schedule | None = None,
) -> Chart:
    """Draw the drive over a period, forward and backward, beside a plain triangle; the imaged windows are shaded.

    ``pixels`` is the schedule of a sine, beside which there is no triangle.
    """
    times, unit = time_unit(period_s)
    period, turn, (low, high) = times * period_s, drive.turn, window
    t = np.linspace(0.0, 1.0, _POINTS)
    volts = drive.v_offset + drive.v_amplitude * (series.value(t) - 0.5)
    curves = _sides(t, period, volts, turn)
    if pixels is not None:
        bands = pixel_windows(pixels, period)
    else:
        shares = [(turn * low, turn * high)]
        if both:
            shares.append((turn + (1.0 - turn) * (1.0 - high), turn + (1.0 - turn) * (1.0 - low)))
        bands = tuple(Band(a * period, b * period, "imaged") for a, b in shares)
        triangle = drive.v_offset + drive.v_amplitude * (np.where(t <= turn, t / turn, (1 - t) / (1 - turn)) - 0.5)
        curves = (*curves, DrawnCurve("plain triangle", "before", t * period, triangle))
    return Chart(
        f"drive-{axis}",
        f"{axis} drive, one {'line' if axis == 'x' else 'frame'}",
        f"time [{unit}]",
        "drive at the piezo [V]",
        curves,
        bands,
    )


def _sides(t: Floats, period: float, values: Floats, turn: float) -> tuple[DrawnCurve, ...]:
    """Split values over a period by direction; both have the point at which they meet."""
    forward, backward = t <= turn + 1e-12, t >= turn - 1e-12
    return (
        DrawnCurve("forward", "forward", t[forward] * period, values[forward]),
        DrawnCurve("backward", "backward", t[backward] * period, values[backward]),
    )


def _moved(planned: PlannedScan, played: PlayedAxis, at: int, period: float, label: str) -> list[Chart]:
    line: LinePlan = planned.plan.lines[at]
    run = played.emitted or played.before
    if run is None:
        return []
    displacement_nm = run.displacement_nm - 0.5 * float(np.max(run.displacement_nm) + np.min(run.displacement_nm))
    axis, turns, what = line.axis, run.drive.turns, "on the operator" if played.on_operator else "by the laws"
    charts = [
        Chart(
            f"position-{axis}",
            f"{axis} position, {what}",
            label,
            "from the centre [nm]",
            _sides(turns, period, displacement_nm, line.drive.turn),
            run_windows(run, line, period),
            x_range=(0.0, period),
        )
    ]
    for name, one in (("without correction", played.before), ("as built", played.emitted)):
        if one is not None:
            charts.append(
                Chart(
                    f"error-{axis}-{name.replace(' ', '-')}",
                    f"{axis} position error, {name}, {what}",
                    label,
                    "error [nm]",
                    tuple(over_time(one, line, period)),
                    run_windows(one, line, period),
                    (Mark(0.0, "", "y"),),
                    x_range=(0.0, period),
                )
            )
    return charts
