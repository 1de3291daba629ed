"""A chart with a curve of each side."""

from typing import Any

from tablegen.charts.chart import Chart, DrawnCurve, Role
from tablegen.numerics.arrays import Floats

A_ROLE: Role = "before"
B_ROLE: Role = "other"


def overlay(
    key: str,
    title: str,
    x_label: str,
    y_label: str,
    a: tuple[Floats, Floats] | None,
    b: tuple[Floats, Floats] | None,
    **more: Any,
) -> Chart:
    """Return a chart of A and B; ``more`` goes to the chart.

    Parameters
    ----------
    a, b
        Coordinates and values in the units of the labels, shape (n,) each; None leaves the curve out.
    """
    sides: tuple[tuple[str, Role, tuple[Floats, Floats] | None], ...] = (("A", A_ROLE, a), ("B", B_ROLE, b))
    curves = tuple(DrawnCurve(name, role, *curve) for name, role, curve in sides if curve is not None)
    return Chart(key, title, x_label, y_label, curves, **more)
