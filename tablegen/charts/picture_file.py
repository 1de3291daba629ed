"""Charts as the bytes of a picture: the one way from charts to a file."""

from collections.abc import Sequence
from dataclasses import dataclass

from tablegen.charts.chart import Chart

KINDS = ("png", "svg", "pdf")
NEEDS_MATPLOTLIB = ("png", "pdf")


@dataclass(frozen=True, eq=False)
class PlottedCharts:
    """What a command shows: a heading, and charts, some in a row of a file.

    ``brief`` are those that fit a terminal; without any all do.
    """

    heading: str
    charts: tuple[Chart, ...]
    columns: int = 2
    brief: tuple[Chart, ...] = ()

    @property
    def shown(self) -> tuple[Chart, ...]:
        """In a terminal."""
        return self.brief or self.charts


def picture(charts: Sequence[Chart], kind: str, heading: str = "", columns: int = 2) -> bytes:
    """Render a file of one of ``KINDS``; PNG and PDF need matplotlib. The same charts give the same bytes: no date."""
    if kind == "svg":
        from tablegen.charts.svg import standalone

        return standalone(charts, heading, columns).encode("utf-8")
    from tablegen.charts.matplotlib_figure import drawn

    if kind not in NEEDS_MATPLOTLIB:
        raise ValueError(f"{kind}: is none of {', '.join(KINDS)}")
    return drawn(charts, "png" if kind == "png" else "pdf", heading, columns)
