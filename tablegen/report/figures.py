"""A chart as PNG or PDF, by matplotlib, for documents; the colours and line styles are those of the page."""

from io import BytesIO
from typing import Literal

from tablegen.report.chart import Chart, runs

_COLOURS = {"forward": "#0072b2", "backward": "#c44e00", "before": "#6f7681", "other": "#00795c", "limit": "#b00040"}
_STYLES = {"forward": "-", "backward": "--", "before": ":", "other": "-", "limit": "-"}


def drawn(chart: Chart, kind: Literal["png", "pdf"] | str) -> bytes:
    """The file. Without a date, so that the same chart gives the same bytes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.2, 3.8), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for band in chart.bands:
        axes.axvspan(band.low, band.high, color="#4b78b8", alpha=0.13, lw=0)
    for mark in chart.marks:
        (axes.axvline if mark.of == "x" else axes.axhline)(mark.at, color="#6f7681", lw=0.9, ls=":")
    named: set[str] = set()
    (low, _), base = chart.y_limits, 0.0
    base = max(base, low)
    for curve in chart.curves:
        colour, style = _COLOURS[curve.role], _STYLES[curve.role]
        for x, y in runs(curve):
            label = curve.name if curve.name not in named else "_"
            named.add(curve.name)
            if curve.kind == "stems":
                axes.vlines(x, low, y, color=colour, lw=1.2, label=label)
            elif curve.kind == "points":
                axes.plot(x, y, "o", color=colour, label=label)
            else:
                axes.plot(x, y, color=colour, ls=style, lw=1.6, label=label)
                if curve.kind == "area":
                    axes.fill_between(x, y, base, color="#4b78b8", alpha=0.16, lw=0)
    if chart.log_x:
        axes.set_xscale("log")
    axes.set(title=chart.title, xlabel=chart.x_label, ylabel=chart.y_label, xlim=chart.x_limits, ylim=chart.y_limits)
    axes.spines[["top", "right"]].set_visible(False)
    if len(chart.legend) > 1:
        axes.legend(frameon=False, fontsize=9)
    stream = BytesIO()
    metadata = {"Software": None} if kind == "png" else {"CreationDate": None, "Producer": None, "Creator": None}
    figure.savefig(stream, format=kind, dpi=150, metadata=metadata)
    return stream.getvalue()
