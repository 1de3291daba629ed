"""Charts as the bytes of a picture: the only way from charts to a file."""

from collections.abc import Sequence
from dataclasses import dataclass

from tablegen.charts.chart import Chart

KINDS = ("png", "svg", "pdf")
NEEDS_MATPLOTLIB = ("png", "pdf")


@dataclass(frozen=True, eq=False)
class PlottedCharts:
    """The charts of a command with a heading, ``columns`` of them in a row of a file.

    ``brief`` are those that fit a terminal; if empty, all of them do.
    """

    heading: str
    charts: tuple[Chart, ...]
    columns: int = 2
    brief: tuple[Chart, ...] = ()

    @property
    def shown(self) -> tuple[Chart, ...]:
        """The charts for a terminal."""
        return self.brief or self.charts


def picture(charts: Sequence[Chart], kind: str, heading: str = "", columns: int = 2) -> bytes:
    """Render a file of one of ``KINDS``, without a date; PNG and PDF need matplotlib.

    Raises
    ------
    ValueError
        If ``kind`` is none of ``KINDS``.
    """
    if kind == "svg":
        from tablegen.charts.svg import standalone

        return standalone(charts, heading, columns).encode("utf-8")
    from tablegen.charts.matplotlib_figure import render

    if kind not in NEEDS_MATPLOTLIB:
        raise ValueError(f"{kind}: is none of {', '.join(KINDS)}")
    return render(charts, "png" if kind == "png" else "pdf", heading, columns)
