"""The pixels of a sine on the page: where they are on the predicted position, their lengths, their errors."""

import numpy as np

from tablegen.charts.chart import Band, Chart, DrawnCurve, Mark, Role
from tablegen.html_report.blocks import Charts, Grid, Section, row
from tablegen.html_report.number_text import figure
from tablegen.html_report.promises import bounded
from tablegen.html_report.subject import Subject
from tablegen.waveform.series import FourierSeries

_POINTS = 1024  # of a period
_SIDES: tuple[Role, Role] = ("forward", "backward")


def pixel_section(subject: Subject) -> Section | None:
    """Return the section of pixels that are taken where the piezo is; None where they have equal lengths."""
    entry, sequence = subject.manifest.axes.x, subject.manifest.sequence
    pixels, place, table = entry.certificate.pixels, entry.fourier.place, sequence.pixel_table
    if pixels is None or place is None or table is None:
        return None
    ticks = sequence.line_ticks
    limit = None if subject.planned is None else subject.planned.plan.limits.max_scaling_error_percent
    series = FourierSeries(place.a0, np.array(place.a), np.array(place.b))
    windows = sequence.forward_ticks, sequence.backward_ticks
    times = np.arange(_POINTS) / _POINTS
    curves = [DrawnCurve("predicted position", "other", times * ticks, series.on_grid(_POINTS))]
    lengths, errors, rows = [], [], []
    number = np.arange(1.0, sequence.pixels + 1.0)
    for side, counts, (first, _) in zip(_SIDES, table, windows, strict=True):
        edges = first + np.concatenate([[0], np.cumsum(counts)])
        curves.append(DrawnCurve(f"edges {side}", side, 1.0 * edges, series.value(edges / ticks), kind="points"))
        # Both directions have their pixels in the order of the position.
        along = counts if side == "forward" else counts[::-1]
        lengths.append(DrawnCurve(side, side, number, np.array(along, dtype=np.float64)))
        errors.append(DrawnCurve(side, side, number, np.array(pixels.errors_percent[side])))
        stated = (pixels.rms_percent[side], pixels.worst_percent[side])
        scaling = bounded("", pixels.scaling_percent[side], limit, "%")[1:]
        rows.append(row(side, f"{min(counts)}..{max(counts)}", *(figure(value, 3) for value in stated), *scaling))
    rows.append(row("trace to retrace", "", "", figure(pixels.mismatch_percent, 3), "", "", ""))
    head = ("", "ticks a pixel", "rms [% of the line]", "worst [% of the line]", "scaling error", "limit", "")
    bands = tuple(Band(float(first), float(first + count), "imaged") for first, count in windows)
    charts = (
        Chart("pixels-position", "x: predicted position, edges of pixels", "tick", "share of the line", tuple(curves),
              bands=bands),
        Chart("pixels-ticks", "x: lengths of pixels", "pixel along the position", "ticks", tuple(lengths)),
        pixel_error_chart("pixels-error", tuple(errors)),
    )  # fmt: skip
    lead = (
        "Pixels are at equal steps of the position that the operator predicts, and their edges on whole ticks. These "
        "are the errors that this rounding leaves, as the certificate states them."
    )
    grid = Grid("Pixels of x, by the certificate", head, tuple(rows))
    return Section("pixels", "Pixels of the sine", (grid, Charts(charts)), lead)


def pixel_error_chart(key: str, curves: tuple[DrawnCurve, ...]) -> Chart:
    """Draw the error of each pixel of a sine."""
    labels = "x: error of each pixel", "pixel along the position", "error [% of the line]"
    return Chart(key, *labels, curves, marks=(Mark(0.0, "", "y"),))
