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
from tablegen.html_report.turned_tables import TurnedTables, turned_tables
from tablegen.planning.line_plan import make_plan
from tablegen.planning.turned_plan import make_turned_plan


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
        error; of a scan at an angle, on coupled axes or with drift a row has the tables of line and frame.

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
    if setup.mixes_motions:
        return _turned(setup, axis, progress)
    plan = make_plan(setup, sines=True)
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


def _turned(setup: Setup, axis: str | None, progress: Callable[[str], object]) -> "FeasibleTables":
    plan, axes = make_turned_plan(setup, progress), []
    for one in plan.axes:
        if axis in (None, one.axis):
            progress(f"measuring tables of {one.axis}")
            axes.append(turned_tables(setup, plan, one))
    return FeasibleTables(plan.name, tuple(axes))


@dataclass(frozen=True, eq=False, repr=False)
class FeasibleTables(Result):
    """The tables of a scan by axis; ``name`` is the scan's."""

    name: str
    axes: tuple[AxisTables | TurnedTables, ...]

    @property
    def record(self) -> dict[str, Any]:
        """The tables as plain data, as ``tablegen tables --json`` prints them."""
        return {"name": self.name, "axes": [one.record() for one in self.axes]}

    def texts(self) -> list[list[str]]:
        """Return the lines of each axis, its title first."""
        return [list(tables_text(one) if isinstance(one, AxisTables) else one.text()) for one in self.axes]

    def summary(self) -> str:
        """Return what ``tablegen tables`` prints: a line a table, and what to write into the scan file."""
        return "\n\n".join("\n".join(lines) for lines in self.texts())

    def charts(self) -> PlottedCharts:
        """Return a chart for each axis: memory and error."""
        from tablegen.html_report.table_charts import table_charts

        return table_charts(self.name, self.axes)

    def _lines(self) -> Sequence[str]:
        return f"tables of {self.name!r}", *(f"{one.axis}: {one.brief}" for one in self.axes)
