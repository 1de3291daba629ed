"""Curves of a calibration as a picture. Needs the extra ``plot``."""

from collections.abc import Sequence
from io import BytesIO
from typing import Any, Literal

from matplotlib import rc_context
from matplotlib.figure import Figure

from tablegen.calibration.estimate import Curve

METADATA_WITHOUT_DATE: dict[str, dict[str, Any]] = {"png": {}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}


def draw(curves: Sequence[Curve], kind: Literal["png", "svg", "pdf"]) -> bytes:
    """The curves beside each other, three a row: measured as points, fitted as a line."""
    rows, columns = (len(curves) + 2) // 3, min(len(curves), 3)
    figure = Figure(figsize=(4.6 * columns, 3.4 * rows), layout="constrained")
    for axes, curve in zip(figure.subplots(rows, columns, squeeze=False).flat, curves, strict=False):
        axes.plot(*_in_parts(curve), color="C1", linewidth=1.2)
        axes.plot(*curve.measured, "o", color="C0", markersize=3.5)
        axes.set_title(curve.title, fontsize="small", wrap=True)
        axes.set_xlabel(curve.x_label)
        axes.set_ylabel(curve.y_label)
        axes.grid(alpha=0.3)
    for axes in figure.axes[len(curves) :]:
        axes.set_visible(False)
    out = BytesIO()
    with rc_context({"svg.hashsalt": "tablegen"}):  # names inside the file are otherwise drawn by lot
        figure.savefig(out, format=kind, dpi=130, metadata=METADATA_WITHOUT_DATE[kind])
    return out.getvalue()


def _in_parts(curve: Curve) -> tuple[list[float], list[float]]:
    """The fitted line, lifted where x turns back: forward and backward are two lines."""
    x: list[float] = []
    y: list[float] = []
    for at, value in zip(curve.fitted[0].tolist(), curve.fitted[1].tolist(), strict=True):
        if len(x) > 1 and (at - x[-1]) * (x[-1] - x[-2]) < 0.0:
            x.append(float("nan"))
            y.append(float("nan"))
        x.append(at)
        y.append(value)
    return x, y
