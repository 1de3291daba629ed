"""A calibration as a page: parameters with standard errors, residuals, outliers, and the data with the fit."""

from collections.abc import Sequence
from math import isfinite
from typing import Literal

import numpy as np

from tablegen.base.data_files import Source
from tablegen.calibration.fit_checks import doubts
from tablegen.calibration.fit_warnings import fit_findings
from tablegen.calibration.laws.hysteresis import HysteresisFit
from tablegen.calibration.summary import change, parameters
from tablegen.charts.chart import Chart, DrawnCurve, Mark
from tablegen.charts.picture_file import PlottedCharts
from tablegen.fitting.estimate import Curve, Estimate, Fit
from tablegen.fitting.measured_branch import AmplitudeFit
from tablegen.html_report.blocks import Block, Charts, Grid, Paragraph, Section, TableCell, row
from tablegen.html_report.document import document
from tablegen.html_report.ranking import Finding
from tablegen.version import __version__

_LOG_SPAN = 30.0  # of frequencies: a wider range is drawn over their logarithm
_BESIDE = 0.08  # of the distance of two traces
_FEW = 60  # points that are drawn large
_FOOT = f"Made by tablegen {__version__} from measurements whose SHA-256 are above."


def fit_page(fit: Fit, axis: str, sources: Sequence[Source], places: Sequence[str], points: bool = False) -> bytes:
    """Render the page of a fit.

    ``places`` are files and lines of its outliers; ``points`` is true if measured points would be written.
    """
    kind = change(fit, []).kind
    meaningless = doubts(fit, points)
    findings = fit_findings(fit, places, points)
    verdict = TableCell("\u2713 No warning for this fit.", "good")
    if meaningless:
        verdict = TableCell("\u2717 This fit is insignificant; measure again.", "bad")
    elif places:
        many = "one outlier" if len(places) == 1 else f"{len(places)} outliers"
        verdict = TableCell(f"! Check {many} first.", "warn")
    sections = [
        _parameters(fit),
        Section("data", "Data and fit", (Charts(fit_charts(fit, axis).charts),)),
        _sources(sources),
    ]
    return document(f"{kind} of {axis}", verdict, findings, sections, "", _FOOT)


def _parameters(fit: Fit) -> Section:
    rows = tuple(
        row(key.strip("()"), f"{estimate.value:.6g}", _error(estimate), meaning)
        for key, estimate, meaning in parameters(fit)
    )
    what = "position error, % of the scan" if isinstance(fit, HysteresisFit) else "scale error, %"
    residuals = (
        f"{what}: up to {fit.before_percent:.2f} without the correction; residual {fit.rms_percent:.2g} rms, "
        f"{fit.largest_percent:.2g} at most, of {fit.points} points"
    )
    blocks: list[Block] = [
        Grid("", ("", "value", "standard error", "meaning"), rows),
        Paragraph(residuals),
        Paragraph("Twice the standard error covers the truth in 95 % of measurements.", "quiet"),
    ]
    if isinstance(fit, HysteresisFit):
        blocks.append(_traces(fit))
    return Section("parameters", "Parameters", tuple(blocks))


def _error(estimate: Estimate) -> str:
    return f"\u00b1 {estimate.standard_error:.2g}" if isfinite(estimate.standard_error) else "not known"


def _traces(fit: HysteresisFit) -> Grid:
    """Return the results of each trace, or pair of images, separately."""
    rows = []
    for branch in fit.branches:
        for trace in branch.traces:
            rows += [_trace(branch.turn.value, trace, i, side) for i, side in enumerate(("forward", "backward"))]
    head = ("turn, direction", "V_scan", "noise [%]", "drift [%]", "beta", "u_peak", "residual [%, peak to peak]")
    return Grid("Each trace by itself", head, tuple(rows))


def _trace(turn: float, trace: AmplitudeFit, at: int, side: str) -> tuple[TableCell, ...]:
    measured = getattr(trace, side)
    both = (f"{one.value:.4g} {_error(one)}" for one in (measured.beta, measured.u_peak))
    quality = f"{trace.v_scan:.4g}", f"{trace.noise_percent:.2g}", f"{trace.drift_percent:.2g}"
    return row(f"{turn:.3g} {side}", *quality, *both, f"{trace.scaling_percent[at]:.2g}")


def fit_charts(fit: Fit, axis: str) -> PlottedCharts:
    """Draw the data of a calibration with the fit."""
    heading = f"{change(fit, []).kind} of {axis}: data and fit"
    return PlottedCharts(heading, tuple(_chart(number, curve) for number, curve in enumerate(fit.curves, 1)), 3)


def _chart(number: int, curve: Curve) -> Chart:
    return Chart(
        f"fit-{number}",
        curve.title,
        curve.x_label,
        curve.y_label,
        tuple(drawn_curves(curve)),
        marks=(Mark(0.0, "", "y"),) if "less a straight line" in curve.y_label else (),
        log_x=_over_decades(curve),
    )


def drawn_curves(curve: Curve) -> list[DrawnCurve]:
    """Return measured points and the fitted line, of each direction that the curve has."""
    kinds: tuple[Literal["points", "line"], ...] = ("points", "line")
    curves = []
    for name, kind, (x, y), at in zip(
        ("measured", "fit"), kinds, (curve.measured, curve.fitted), curve.backward or (None, None), strict=True
    ):
        many = kind == "points" and len(x) > _FEW
        if at is not None:
            curves.append(DrawnCurve(f"forward, {name}", "forward", x[:at], y[:at], kind, many))
            curves.append(DrawnCurve(f"backward, {name}", "backward", x[at:], y[at:], kind, many))
        elif curve.direction:
            curves.append(DrawnCurve(f"{curve.direction}, {name}", curve.direction, x, y, kind, many))
        else:
            curves.append(DrawnCurve(name, "other", x, y, kind, many))
    return curves


def _over_decades(curve: Curve) -> bool:
    x = np.concatenate([curve.measured[0], curve.fitted[0]])
    low, high = float(np.min(x)), float(np.max(x))
    return "Hz" in curve.x_label and low > 0.0 and high / low > _LOG_SPAN


def _sources(sources: Sequence[Source]) -> Section:
    rows = tuple(row(source.name, TableCell(source.sha256, "quiet")) for source in sources)
    return Section("sources", "Measurements", (Grid("", ("file", "beginning of its SHA-256"), rows),))


def operator_page(
    axis: str,
    family: str,
    candidates: Sequence[tuple[str, float]],
    traces: Sequence[tuple[str, Sequence[float]]],
    further: str,
    sources: Sequence[Source],
) -> bytes:
    """Render the page of an operator.

    Parameters
    ----------
    candidates
        Name and mean rms of a trace left out, in percent of the line, of each family.
    traces
        Name of each trace; size and offset in V, rate in Hz; rms, scaling error and mismatch in percent of the line in
        the fit; the same with the size where the trace is left out.
    further
        The advice for the next measurement.
    """
    errors = (f"{name}, {where}" for where in ("fit", "out") for name in ("rms", "scaling", "mismatch"))
    head = ("trace", "size [V]", "offset [V]", "rate [Hz]", *errors, "size, out")
    rows = tuple(row(name, *(f"{value:.3g}" for value in figures)) for name, figures in traces)
    caption = "Percent of the line over x = 0.1..0.9: in the fit, and out, with an operator without the trace"
    families = Grid("Families that were compared", ("", "mean rms of a trace left out [%]"), _candidates(candidates))
    numbers = np.arange(1.0, len(traces) + 1.0)
    inside, left_out = (np.array([figures[at] for _, figures in traces], dtype=np.float64) for at in (3, 6))
    chart = Chart(
        "left-out",
        "rms residual of each trace",
        "trace [number]",
        "rms residual [% of the line]",
        (
            DrawnCurve("in the fit", "before", numbers - _BESIDE, inside, "points"),
            DrawnCurve("left out", "other", numbers + _BESIDE, left_out, "points"),
        ),
        marks=(Mark(0.0, "", "y"),),
        x_range=(0.0, len(traces) + 1.0),
    )
    sections = [
        Section("traces", "Traces", (Grid(caption, head, rows), Charts((chart,)))),
        Section("family", "Family", (Paragraph(f"Chosen: {family}."), families)),
        _sources(sources),
    ]
    worst = max(range(len(traces)), key=lambda at: left_out[at])
    verdict = TableCell(
        f"The median error on a trace that is left out is {float(np.median(left_out)):.2g} % rms.", "quiet"
    )
    note = f"the worst is {traces[worst][0]}, {left_out[worst]:.2g} % rms where it is left out"
    findings = [Finding("expect", 1.0, note), Finding("note", 0.0, further)]
    return document(f"operator of {axis}", verdict, findings, sections, "", _FOOT)


def records_page(
    axis: str,
    family: str,
    candidates: Sequence[tuple[str, float]],
    records: Sequence[tuple[str, Sequence[float]]],
    charts: Sequence[Chart],
    further: str,
    sources: Sequence[Source],
) -> bytes:
    """Render the page of an operator that was fitted in time.

    Parameters
    ----------
    candidates
        Name and mean rms of the predicted last parts, in percent of the stroke, of each model.
    records
        Name of each record; stroke in V, rate in Hz, rms and worst error in the fit in percent of the stroke; the time
        in s from which it is predicted, rms and worst error there.
    charts
        The errors of each record over time.
    further
        The advice for the next measurement.
    """
    head = ("record", "size [V]", "rate [Hz]", "rms, fit", "worst, fit", "predicted from [s]", "rms", "worst")
    rows = tuple(row(name, *(f"{value:.3g}" for value in figures)) for name, figures in records)
    caption = "Percent of the stroke: in the fit, and of the last part, predicted from a fit to the part before"
    models = Grid("Models that were compared", ("", "rms of the last parts [%]"), _candidates(candidates))
    sections = [
        Section("records", "Records", (Grid(caption, head, rows), Charts(tuple(charts)))),
        Section("family", "Model", (Paragraph(f"Chosen: {family}."), models)),
        _sources(sources),
    ]
    worst = max(records, key=lambda one: one[1][5])
    verdict = TableCell(f"The last part of a record is predicted within {worst[1][5]:.2g} % rms.", "quiet")
    note = f"the worst is {worst[0]}, {worst[1][6]:.2g} % of its stroke at most"
    findings = [Finding("expect", 1.0, note), Finding("note", 0.0, further)]
    return document(f"operator of {axis}", verdict, findings, sections, "", _FOOT)


def _candidates(candidates: Sequence[tuple[str, float]]) -> tuple[tuple[TableCell, ...], ...]:
    return tuple(row(name, f"{score:.3g}") for name, score in candidates)
