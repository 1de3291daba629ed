"""The style of every picture: lines are our numbers, open circles the numbers that the paper prints."""

import io
from collections.abc import Sequence
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

GREY, RED, BLUE, ORANGE, GREEN = "#777777", "#c23b22", "#1f5fa8", "#d98e04", "#3a7d44"
SHADE = "#e8f1e4"
DPI = 110
PRINTED = {"ls": "none", "marker": "o", "mfc": "white", "ms": 6.5, "mew": 1.5, "zorder": 5, "clip_on": False}
_STYLE = {
    "font.size": 9.5,
    "font.family": "DejaVu Sans",
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#ececec",
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.7,
}


def sheet(rows: int, columns: int, width: float, height: float, **settings: Any) -> tuple[Figure, Any]:
    """An empty figure of so many panels, inches wide and high; and its axes, an array (rows, columns)."""
    with rc_context(_STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        return figure, figure.subplots(rows, columns, squeeze=False, **settings)


def printed(
    axes: Any, x: Sequence[float], y: Sequence[float], colour: str, label: str = "printed in the paper"
) -> None:
    """Open circles."""
    axes.plot(x, y, color=colour, label=label, **PRINTED)


def span(axes: Any, x: float, low: float, height: float, colour: str, label: str) -> None:
    """A printed peak-to-peak value: two open circles, a line between them."""
    axes.plot([x, x], [low, low + height], color=colour, label=label, **{**PRINTED, "ls": ":", "lw": 1.2})


def key(axes: Any, **settings: Any) -> None:
    """The legend."""
    with rc_context(_STYLE):
        axes.legend(**{"handlelength": 1.6, **settings})


def png(figure: Figure) -> bytes:
    """The picture; the same bytes wherever matplotlib is the same."""
    out = io.BytesIO()
    with rc_context(_STYLE):
        figure.savefig(out, format="png", dpi=DPI, metadata={"Software": None})
    return out.getvalue()
