"""A round of `tablegen refine` as a page: measured and predicted errors, the layer, and the rounds before."""

from collections.abc import Sequence

import numpy as np

from tablegen.base.data_files import Source
from tablegen.base.warnings import Finding, of_remarks, worst_first
from tablegen.charts.chart import POSITION, Chart, DrawnCurve, Mark
from tablegen.charts.picture_file import PlottedCharts
from tablegen.html_report.blocks import Charts, Grid, Paragraph, Section, TableCell, row
from tablegen.html_report.document import document
from tablegen.html_report.scan_errors import windows
from tablegen.refinement.round import Round
from tablegen.version import __version__

_TURNS = np.linspace(0.0, 1.0, 601)


def round_page(round_: Round, name: str, sources: Sequence[Source], earlier: Sequence[str], refused: str) -> bytes:
    """Render the page of a round; ``earlier`` are comments of earlier rounds, ``refused`` why it is not used."""
    axis, update = round_.line.axis, round_.update
    findings = worst_first(of_remarks(round_.remarks))
    both = f"{update.before.rms_percent:.3g} % rms measured; {update.after.rms_percent:.2g} % predicted after it."
    verdict = TableCell(f"\u2713 {both}", "good")
    if refused:
        findings.insert(0, Finding("limit", 1.0, refused, "\u2717 not used"))
        verdict = TableCell("\u2717 This measurement is not used.", "bad")
    elif not update.harmonics:
        verdict = TableCell("Nothing was learnt: the residual is noise.", "quiet")
    parts = [_errors(round_), _layer(round_)]
    if earlier:
        rows = tuple(row(str(number), text) for number, text in enumerate(earlier, 1))
        parts.append(Section("rounds", "Rounds before", (Grid("", ("round", "learnt from"), rows),)))
    files = ", ".join(f"{source.name}, sha256 {source.sha256}" for source in sources)
    foot = f"From {files}; tablegen {__version__}."
    return document(f"{name}: refinement of {axis}", verdict, findings, parts, "", foot)


def _errors(round_: Round) -> Section:
    update = round_.update
    rows = []
    for label, departure in (("measured", update.before), ("predicted", update.after)):
        for side, (rms, largest) in departure.residual_percent.items():
            figures = (rms, largest, departure.scaling_percent[side])
            rows.append(row(f"{side}, {label}", *(f"{value:.3g}" for value in figures)))
    noise = f"{update.chord_noise_percent:.2g} rms of a chord"
    rows.append(row("noise of it", f"{update.noise_percent:.2g}", "", noise))
    head = ("", "rms residual [% of the line]", "largest [% of the line]", "scaling error [%, peak to peak]")
    parts = (Grid("", head, tuple(rows)), Charts(_residuals(round_)))
    return Section("errors", "Measured and predicted", parts, f"{round_.recorded}.")


def round_charts(round_: Round, name: str) -> PlottedCharts:
    """Draw the measured and the predicted residual of a round, and its change of the drive."""
    heading = f"{name}: refinement of {round_.line.axis}"
    return PlottedCharts(heading, (*_residuals(round_), _layer_chart(round_)), 3)


def _residuals(round_: Round) -> tuple[Chart, ...]:
    update = round_.update
    charts = []
    points = update.before.points
    for side, x in points.by_side(points.position).items():
        before, after = (100.0 * one.points.by_side(one.error)[side] for one in (update.before, update.after))
        curves = (DrawnCurve("measured", "before", x, before), DrawnCurve("predicted", "forward", x, after))
        if side == "backward":
            curves = (curves[0], DrawnCurve("predicted", "backward", x, after))
        zero = (Mark(0.0, "", "y"),)
        title = f"residual {side}"
        charts.append(Chart(f"residual-{side}", title, POSITION, "residual [% of the line]", curves, marks=zero))
    return tuple(charts)


def _layer(round_: Round) -> Section:
    update, bound = round_.update, round_.bound
    text = (
        f"Harmonics 1 to {update.harmonics} of {bound.used}, at a gain of {bound.gain:g}. It converges while the "
        f"response of the scanner is below {bound.largest_gain:.3g} times the modelled one, or off by less than "
        f"{bound.phase_deg:.3g} degrees."
    )
    return Section("layer", "The layer", (Paragraph(text), Charts((_layer_chart(round_),))))


def _layer_chart(round_: Round) -> Chart:
    update = round_.update
    curves = (
        DrawnCurve("this round", "other", _TURNS, 100.0 * update.change.value(_TURNS), faint=True),
        DrawnCurve("the layer now", "other", _TURNS, 100.0 * update.layer.value(_TURNS)),
    )
    return Chart(
        "layer",
        "What is added to the drive",
        "time [periods]",
        "added to the drive [% of V_scan]",
        curves,
        windows(round_.line, 1.0),
    )
