"""An operator's fit as a picture: what it leaves of every trace, and where another one would help. Needs ``plot``."""

from collections.abc import Sequence
from io import BytesIO
from typing import Literal

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon, Rectangle

from tablegen.calibration.figure import METADATA_WITHOUT_DATE
from tablegen.calibration.operator.advice import NextTrace, expected_rms
from tablegen.calibration.operator.errors import WINDOW, LineErrors
from tablegen.calibration.operator.fit import OperatorFit
from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.compensation.models.operator import CENTRE_REACH, STROKE_REACH
from tablegen.driver import Driver

_ROW_INCHES, _LEAST_INCHES, _WIDTH_INCHES = 1.25, 4.6, 12.5
_MANY = 16  # traces from which on three panels are in a row
_GRID = 121  # points of the map, each way
_IN, _OUT = "C0", "C1"


def draw_operator(
    fit: OperatorFit,
    lines: Sequence[PeriodicLine],
    further: NextTrace,
    driver: Driver,
    kind: Literal["png", "svg", "pdf"],
) -> bytes:
    """Left a panel for each trace, with its residual in the fit and left out; right the map over size and offset."""
    columns = 2 if len(lines) <= _MANY else 3
    rows = -(-len(lines) // columns)
    figure = Figure(figsize=(_WIDTH_INCHES, max(_ROW_INCHES * rows + 1.0, _LEAST_INCHES)), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=(1.35, 1.0), squeeze=False)[0]
    _draw_traces(left, rows, columns, fit, lines, driver)
    _draw_map(right, fit, lines, further, driver)
    out = BytesIO()
    with rc_context({"svg.hashsalt": "tablegen"}):  # names inside the file are otherwise drawn by lot
        figure.savefig(out, format=kind, dpi=130, metadata=METADATA_WITHOUT_DATE[kind])
    return out.getvalue()


def _draw_traces(
    part: SubFigure, rows: int, columns: int, fit: OperatorFit, lines: Sequence[PeriodicLine], driver: Driver
) -> None:
    panels = part.subplots(rows, columns, sharex=True, squeeze=False)
    for axes, line, inside, outside in zip(panels.flat, lines, fit.left, fit.left_out, strict=False):
        for errors, colour, width in ((outside, _OUT, 1.0), (inside, _IN, 1.2)):
            _draw_sides(axes, errors, colour, width)
        where = f"{line.stroke * driver.span:.3g} V about {driver.volts(line.centre):.3g} V, {line.rate_hz:.3g} Hz"
        axes.set_title(f"{where}: rms {inside.rms:.2g}, left out {outside.rms:.2g}", fontsize="x-small", pad=3.0)
        most = max([0.01, *(float(np.max(np.abs(one.sides))) for one in (inside, outside) if one.sides is not None)])
        axes.set_ylim(-1.1 * most, 1.1 * most)
        axes.set_xlim(*WINDOW)
        axes.tick_params(labelsize="x-small")
        axes.grid(alpha=0.3)
    for axes in panels.flat[len(lines) :]:
        axes.set_visible(False)
    for column in range(columns):
        last = panels[rows - 1 if (rows - 1) * columns + column < len(lines) else rows - 2, column]
        last.tick_params(labelbottom=True)
    part.supxlabel("position on the line", fontsize="small")
    part.supylabel("residual [% of the line]", fontsize="small")
    handles = [
        Line2D([], [], color=_IN, label="in the fit"),
        Line2D([], [], color=_OUT, label="left out: predicted from the other traces"),
        Line2D([], [], color="0.3", label="trace"),
        Line2D([], [], color="0.3", linestyle="--", label="retrace"),
    ]
    part.legend(handles=handles, loc="outside upper center", ncols=4, fontsize="x-small", frameon=False)


def _draw_sides(axes: Axes, errors: LineErrors, colour: str, width: float) -> None:
    """Rising as a line, falling dashed."""
    if errors.sides is None:
        return
    x = np.linspace(*WINDOW, errors.sides.shape[1])
    for side, style in zip(errors.sides, ("-", "--"), strict=True):
        axes.plot(x, side, style, color=colour, linewidth=width)


def _draw_map(
    part: SubFigure, fit: OperatorFit, lines: Sequence[PeriodicLine], further: NextTrace, driver: Driver
) -> None:
    axes = part.subplots()
    strokes = np.linspace(0.02, 1.0, _GRID)
    centres = np.linspace(0.0, 1.0, _GRID)
    points = np.array([(stroke, centre) for stroke in strokes for centre in centres])
    rms = expected_rms(fit, points).reshape(_GRID, _GRID)
    bottom, middle, top = driver.v_min, driver.middle, driver.v_max
    inside = Polygon([(bottom, 0.0), (middle, driver.span), (top, 0.0)], transform=axes.transData)
    mesh = axes.contourf(driver.volts(centres), strokes * driver.span, rms, levels=12, cmap="viridis")
    mesh.set_clip_path(inside)
    known = np.array([line.centre for line in lines])
    largest = max(line.stroke for line in lines) + STROKE_REACH
    refused = (np.min(np.abs(centres[:, None] - known), axis=1) > CENTRE_REACH) | (strokes[:, None] > largest)
    if np.any(refused):
        out = axes.contourf(
            driver.volts(centres),
            strokes * driver.span,
            refused.astype(float),
            levels=[0.5, 1.5],
            colors="none",
            hatches=["///"],
        )
        out.set_clip_path(inside)
    bar = part.colorbar(mesh, ax=axes, location="bottom", shrink=0.9, pad=0.02)
    bar.set_label("expected rms residual of a line [% of it]", fontsize="small")
    bar.ax.tick_params(labelsize="x-small")
    axes.plot([bottom, middle, top], [0.0, driver.span, 0.0], color="0.4", linewidth=1.0)
    axes.text(driver.volts(0.02), 0.97 * driver.span, "beyond the driver", color="0.4", fontsize="small", va="top")
    axes.plot(
        [driver.volts(line.centre) for line in lines],
        [line.stroke * driver.span for line in lines],
        "o",
        color="white",
        markeredgecolor="black",
        markersize=7,
        label="traces",
    )
    axes.plot(
        [further.offset_v],
        [further.size_v],
        "*",
        color="red",
        markeredgecolor="white",
        markersize=16,
        label=f"next trace: {further.size_v:.3g} V at {further.offset_v:.3g} V",
    )
    if np.any(refused):
        axes.add_patch(Rectangle((0.0, 0.0), 0.0, 0.0, fill=False, hatch="///", label="too far: scans are refused"))
    axes.set_xlim(bottom, top)
    axes.set_ylim(0.0, 1.02 * driver.span)
    axes.set_xlabel("offset [V]")
    axes.set_ylabel("size [V]")
    axes.legend(loc="upper right", fontsize="x-small")
