"""The corrections of both axes step by step, each with its equation, its factor and the volts after it."""

import numpy as np

from tablegen.charts.chart import POSITION, Band, Chart, DrawnCurve, Mark, Role
from tablegen.compensation import models
from tablegen.compensation.line import SineLine
from tablegen.html_report.blocks import Charts, Grid, Section, TableCell, row
from tablegen.html_report.number_text import hertz
from tablegen.html_report.subject import Subject
from tablegen.manifest.fields import ManifestAxis, ManifestFourier
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan
from tablegen.waveform.series import FourierSeries

_HEAD = ("", "equation", "factor", "after it")


def corrections(subject: Subject) -> Section:
    """Return a table per axis, and the shape of the hysteresis correction."""
    tables, charts = [], []
    for at, (axis, entry) in enumerate(subject.axes):
        line = None if subject.planned is None else subject.planned.plan.lines[at]
        tables.append(Grid(f"{axis} axis", _HEAD, tuple(_steps(entry, line))))
        if line is not None and line.drive.hysteresis.compensates:
            charts.append(shape_chart(line))
    return Section("corrections", "The corrections, step by step", (*tables, Charts(tuple(charts))))


def _steps(entry: ManifestAxis, line: LinePlan | None) -> list[tuple[TableCell, ...]]:
    drive, fourier, rows = entry.drive, entry.fourier, []
    if line is not None:
        share = drive.size_nm / line.drive.size_law.size_nm(1e-6) * 1e-6 * line.drive.driver.span
        rows.append(row("request", "", "", f"{drive.size_nm:.6g} nm line, {share:.6g} V at the slope of small scans"))
        rows.append(row("size", "(9), (12)", f"{drive.v_scan / share:.5f}", f"V_scan = {drive.v_scan:.6g} V"))
    else:
        rows.append(row("size", "(9), (12)", "", f"{drive.size_nm:.6g} nm: V_scan = {drive.v_scan:.6g} V"))
    rows += [
        row("offset, m", "(1)-(4)", f"{drive.m:.5f}", f"{drive.m * drive.v_scan:.6g} V at {drive.v_offset:.6g} V"),
        row("line rate, g", "(23)", f"{drive.g:.5f}", f"{drive.v_amplitude:.6g} V peak to peak"),
    ]
    kind = models.get(drive.model) if drive.model in models.names() else None  # of another package, it may be missing
    for side in () if fourier.imaged is not None else ("forward", "backward"):  # a sine is not bent
        branch = getattr(drive, side)
        text = f"peak residual of the {drive.model} model at u = {branch.u_peak:.3f}"
        applied = kind is None or kind.compensates
        equation = "" if kind is None or not applied else kind.purpose
        text = text if applied else "not compensated"
        rows.append(row(f"hysteresis {side}", equation, f"{branch.beta:+.5f}", text))
    rate = entry.line.rate_exact[0] / entry.line.rate_exact[1]
    if fourier.imaged is not None:
        low, high = fourier.imaged
        text = (
            f"a sine at {hertz(rate)}; pixels at equal steps of the predicted position, {low:g}..{high:g} of the line"
        )
        rows.append(row("motion", "", "", text))
    else:
        rows.append(_band_limit(fourier, rate))
    if fourier.refinement is not None:
        rows.append(
            row(
                "refinement",
                "learnt",
                f"{len(fourier.refinement.a)}",
                "harmonics from measurements of this running scan",
            )
        )
    if drive.resonance is not None:
        limited = len(fourier.held_harmonics)
        text = f"inverse of the resonance at {hertz(drive.resonance.hz)}"
        rows.append(
            row("dynamics", "1 / H(f)", "", text + (f"; {limited} harmonics held back by max_boost_db" * (limited > 0)))
        )
    hold_us = 5e5 / rate * entry.line.hold_ticks / entry.line.ticks
    rows.append(row("converter's hold", "", "", f"played {hold_us:.4g} us ahead, half of the zero-order hold"))
    volts = abs(entry.output.v_per_code)
    rows.append(
        row("rounding", "", f"{1e3 * volts:.4g} mV", f"an LSB; {drive.v_amplitude / volts:.6g} codes peak to peak")
    )
    return rows


def _band_limit(fourier: ManifestFourier, rate_hz: float) -> tuple[TableCell, ...]:
    """Return the row of the harmonics of a straight line."""
    (low, high), error = fourier.window, fourier.max_scaling_error_percent
    text = (
        f"harmonics, up to {hertz(fourier.harmonics * rate_hz)}; straight over {low:g}..{high:g} {fourier.directions}"
    )
    if error is not None:
        text += f"; least acceleration at {error:g} % of scaling error"
    return row("band limit", fourier.band_limit, f"{fourier.harmonics}", text)


def shape_chart(line: LinePlan) -> Chart:
    """Draw the deviation of the drive from a straight line; of a sine that of the position from the drive."""
    if isinstance(line.drive.shape, SineLine):
        return _loop_chart(line.target, line.drive.shape.place)
    x = np.linspace(0.0, 1.0, 301)
    low, high = line.band_limit.window
    shape = line.drive.shape
    forward, backward = (shape.value(shape.times(side, x)) - x for side in ("forward", "backward"))
    return Chart(
        f"shape-{line.axis}",
        f"{line.axis}: bend of the drive",
        POSITION,
        "drive less line [% of V_scan]",
        (DrawnCurve("forward", "forward", x, 100.0 * forward), DrawnCurve("backward", "backward", x, 100.0 * backward)),
        (Band(low, high, "imaged"),),
        (Mark(0.0, "", "y"),),
    )


def _loop_chart(wave: FourierSeries, place: FourierSeries) -> Chart:
    """Draw the predicted position less the sine that a piezo without hysteresis would follow, over that sine."""
    half = np.linspace(0.0, 0.5, 301)
    low, span = wave.a0 - np.hypot(wave.a[0], wave.b[0]), 2.0 * np.hypot(wave.a[0], wave.b[0])
    curves: list[DrawnCurve] = []
    sides: tuple[tuple[Role, Floats], ...] = (("forward", half), ("backward", half + 0.5))
    for side, t in sides:
        along = (wave.value(t) - low) / span
        curves.append(DrawnCurve(side, side, along, 100.0 * (place.value(t) - along)))
    return Chart(
        "shape-x",
        "x: predicted position less the sine",
        "the sine [share of the line]",
        "position less sine [% of the line]",
        tuple(curves),
        marks=(Mark(0.0, "", "y"),),
    )
