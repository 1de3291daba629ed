"""What a simulation says, as text, rows of a CSV, plain data and a figure. All of it is labelled as a simulation."""

import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from tablegen.virtual.measurement import Branch, ideal_triangle
from tablegen.virtual.simulation import AxisRun, Run

LABEL = "simulation on a virtual scanner, before calibration on it"
_MOST_ROWS = 10_000


def text(name: str, truth: str, runs: Sequence[Run], rejected: Sequence[tuple[str, str]]) -> list[str]:
    """A table for the terminal; ``rejected`` are models that could not be planned, and why."""
    lines = [
        f"{name}: {LABEL} ({truth!r})",
        "",
        "                   line [nm]         residual in the window [% of the line]",
        "axis  model        nominal  moved      direction  peak      at x   range              "
        "scaling error [% peak to peak]",
    ]
    for axis in ("x", "y"):
        for run in runs:
            one: AxisRun = getattr(run, axis)
            mark = "*" if axis in run.asked else " "
            start = f"{axis:<4}  {run.model:<10}{mark}  {one.nominal_nm:7.1f}  {one.error.size_nm:7.1f}"
            for i, side in enumerate(one.directions):
                branch: Branch = getattr(one.error, side)
                peak, at = branch.peak
                low, high = branch.residual_range
                lines.append(
                    f"{start if i == 0 else ' ' * len(start)}    {side:<9}  {peak:+6.3f}   {at:5.3f}   "
                    f"{low:+6.3f} .. {high:+6.3f}   {branch.scaling_peak_to_peak:6.3f}"
                )
    lines += ["", "* the model of the scanner file", *(f"{model}: {why}" for model, why in rejected)]
    lines.append("A simulation, not a measurement: the virtual scanner was identified from figures in a paper.")
    return lines


def data(name: str, truth: str, runs: Sequence[Run], rejected: Sequence[tuple[str, str]]) -> dict[str, Any]:
    """The same as plain data, for JSON."""

    def branch(one: Branch) -> dict[str, Any]:
        peak, at = one.peak
        return {
            "residual_peak_percent": peak,
            "residual_peak_at": at,
            "residual_range_percent": list(one.residual_range),
            "scaling_error_peak_to_peak_percent": one.scaling_peak_to_peak,
            "window": list(one.window),
        }

    def axis(one: AxisRun) -> dict[str, Any]:
        return {
            "nominal_nm": one.nominal_nm,
            "moved_nm": one.error.size_nm,
            "size_error_percent": one.size_error_percent,
            **{side: branch(getattr(one.error, side)) for side in one.directions},
        }

    models = {run.model: {"in_scanner_file": list(run.asked), "x": axis(run.x), "y": axis(run.y)} for run in runs}
    return {
        "simulation": True,
        "label": LABEL,
        "scan": name,
        "virtual_scanner": truth,
        "models": models,
        "rejected": dict(rejected),
    }


def csv(runs: Sequence[Run]) -> str:
    """One settled period of each axis, at most some ten thousand of its ticks; ``position`` is that of the triangle."""
    out = io.StringIO()
    out.write("# simulation\n")
    out.write("model,axis,tick,time_s,code,drive_v,displacement_nm,position,residual_percent\n")
    for run in runs:
        for one in (run.x, run.y):
            ticks = len(one.displacement_nm)
            thin = slice(None, None, -(-ticks // _MOST_ROWS))
            position = ideal_triangle(ticks, one.turn)[thin]
            rising = (np.arange(ticks) / ticks <= one.turn)[thin]
            forward, backward = one.error.forward, one.error.backward
            residual = np.where(
                rising,
                np.interp(position, forward.position, forward.residual),
                np.interp(position, backward.position, backward.residual),
            )
            drive = one.drive
            columns = (drive.tick, drive.time_s, drive.codes, drive.volts, one.displacement_nm)
            for k, t, code, v, d, p, r in zip(*(c[thin] for c in columns), position, residual, strict=True):
                out.write(f"{run.model},{one.axis},{k},{t:.9g},{code},{v:.9g},{d:.9g},{p:.6f},{r:.6f}\n")
    return out.getvalue()


def figure(title: str, runs: Sequence[Run]) -> bytes:
    """A PNG: displacement, residual and scaling error of both axes. Needs matplotlib."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    page = Figure(figsize=(12, 6.4), layout="constrained")
    FigureCanvasAgg(page)
    rows = page.subplots(2, 3)
    for axes, name in zip(rows, ("x", "y"), strict=True):
        for run, colour in zip(runs, ("#c23b22", "#d98e04", "#1f5fa8"), strict=False):
            one: AxisRun = getattr(run, name)
            thin = slice(None, None, max(1, len(one.displacement_nm) // 4000))
            axes[0].plot(one.drive.time_s[thin], one.displacement_nm[thin], color=colour, lw=1.4, label=run.model)
            for side in one.directions:
                branch: Branch = getattr(one.error, side)
                style = "-" if side == "forward" else "--"
                low, high = branch.window
                inside = (branch.position >= low) & (branch.position <= high)
                axes[1].plot(branch.position[inside], branch.residual[inside], style, color=colour, lw=1.4)
                axes[2].plot(branch.scaling_position, branch.scaling, style, color=colour, lw=1.4)
        axes[0].set(title=f"{name}: displacement (simulation)", xlabel="time [s]", ylabel="nm")
        axes[1].set(title=f"{name}: residual", xlabel="position in the line", ylabel="% of the line")
        axes[2].set(title=f"{name}: scaling error", xlabel="position in the line", ylabel="%")
        axes[0].legend(frameon=False, fontsize=8)
    page.suptitle(f"{title}; forward solid, backward dashed")
    out = io.BytesIO()
    page.savefig(out, dpi=110, metadata={"Software": None})
    return out.getvalue()
