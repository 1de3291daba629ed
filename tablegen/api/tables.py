"""List the feasible tables of a scan, and the smallest of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from tablegen.api.result import Result
from tablegen.base.input_errors import Problems
from tablegen.charts.picture_file import PlottedCharts
from tablegen.config.load import Setup, load
from tablegen.html_report.table_rows import AxisTables, axis_tables
from tablegen.html_report.tables_text import tables_text
from tablegen.planning.line_plan import make_plan


def tables(
    scan: str | Path | Setup,
    axis: Literal["x", "y"] | None = None,
    *,
    progress: Callable[[str], object] = lambda _: None,
) -> "FeasibleTables":
    """List the feasible tables of a scan: memory, error of a code, and the resources that each takes of a device.

    Parameters
    ----------
    scan : path or Setup
        Scan file, or a result of ``load``.
    axis : {"x", "y"}, optional
        One axis; every axis that moves unless given.
    progress : callable
        Called with a text for each stage.

    Returns
    -------
    FeasibleTables
        ``axes``, each with ``rows`` by memory in bits, errors in LSB, and ``chosen``, the least memory within the
        error.

    Raises
    ------
    Rejected
        The scan is wrong, or no table keeps the error.
    ValueError
        The axis is static in this scan.

    Examples
    --------
    >>> found = tablegen.tables("scan.toml", "x")
    >>> found.axes[0].chosen.max_error_lsb <= found.axes[0].max_error_lsb
    True
    """
    progress("shaping the waveforms")
    setup = scan if isinstance(scan, Setup) else load(scan)
    plan = make_plan(setup)
    lines = [line for line in plan.moving if axis in (None, line.axis)]
    if not lines:
        raise ValueError(f"{axis} is static in this scan: it has no table to choose.")
    problems, axes = Problems(), []
    for line in lines:
        progress(f"measuring tables of {line.axis}")
        with problems.at(setup.scan_file, f"{line.axis}.table"):
            axes.append(axis_tables(setup, line, plan.y if line.axis == "x" else plan.x))
    problems.stop_if_any()
    return FeasibleTables(plan.name, tuple(axes))


@dataclass(frozen=True, eq=False, repr=False)
class FeasibleTables(Result):
    """The tables of a scan by axis; ``name`` is the scan's."""

    name: str
    axes: tuple[AxisTables, ...]

    @property
    def record(self) -> dict[str, Any]:
        """The tables as plain data, as ``tablegen tables --json`` prints them."""
        return {"name": self.name, "axes": [one.record() for one in self.axes]}

    def texts(self) -> list[list[str]]:
        """Return the lines of each axis, its title first."""
        return [list(tables_text(one)) for one in self.axes]

    def summary(self) -> str:
        """Return what ``tablegen tables`` prints: a line a table, and what to write into the scan file."""
        return "\n\n".join("\n".join(lines) for lines in self.texts())

    def charts(self) -> PlottedCharts:
        """Return a chart for each axis: memory and error."""
        from tablegen.html_report.table_charts import table_charts

        return table_charts(self.name, self.axes)

    def _lines(self) -> Sequence[str]:
        return f"tables of {self.name!r}", *(
            f"{one.axis}: {one.chosen.shape.mode}, {one.chosen.shape.length} words of {one.chosen.shape.bits} bits, "
            f"error up to {one.chosen.max_error_lsb:.3g} LSB"
            for one in self.axes
        )
