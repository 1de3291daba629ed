"""Memory against error of the tables that an axis could have, as a chart."""

from collections.abc import Sequence

import numpy as np

from tablegen.charts.chart import Chart, DrawnCurve, Mark, Role
from tablegen.charts.picture_file import PlottedCharts
from tablegen.fixedpoint.program import Mode
from tablegen.fixedpoint.table_shape import MODES
from tablegen.html_report.table_rows import AxisTables
from tablegen.html_report.turned_tables import TurnedTables

_ROLES: dict[Mode, Role] = {"direct": "before", "interpolated": "limit", "cubic": "other"}
_HIGHEST = 4.0  # times the requested error


def table_charts(name: str, axes: Sequence[AxisTables | TurnedTables]) -> PlottedCharts:
    """Draw a chart per axis: its tables, the chosen one, and the requested error."""
    charts = (one.chart() if isinstance(one, TurnedTables) else table_chart(one) for one in axes)
    return PlottedCharts(f"tables of {name}", tuple(charts), len(axes))


def table_chart(tables: AxisTables) -> Chart:
    """Draw the tables of one axis."""
    most = _HIGHEST * tables.max_error_lsb
    curves = []
    for mode in MODES:
        rows = [row for row in tables.rows if row.shape.mode == mode and row.max_error_lsb <= most]
        if rows:
            memory = np.array([float(row.shape.memory_bits) for row in rows])
            curves.append(DrawnCurve(mode, _ROLES[mode], memory, np.array([row.max_error_lsb for row in rows])))
    choice = tables.chosen
    at = np.array([float(choice.shape.memory_bits)]), np.array([choice.max_error_lsb])
    curves.append(DrawnCurve(f"chosen: {choice.shape.length} x {choice.shape.bits}", "other", *at, kind="points"))
    return Chart(
        f"tables-{tables.axis}",
        f"{tables.axis}: the largest error of a code against memory",
        "memory [bits]",
        "error [LSB]",
        tuple(curves),
        marks=(Mark(tables.max_error_lsb, "asked", "y"),),
        log_x=True,
        y_range=(0.0, most),
    )
