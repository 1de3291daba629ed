"""The report of a simulation, as text, rows of a CSV and plain data, each labelled as a simulation."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tablegen.base.remedies import FindingCode
from tablegen.base.warnings import Finding, Weight, axis_name, worst_first
from tablegen.compensation.models import UNCOMPENSATED
from tablegen.virtual.line_error import BranchError, ideal_triangle
from tablegen.virtual.parameters import Truth
from tablegen.virtual.simulation import AxisRun, Run

LABEL = "simulation on a virtual scanner"
_MAX_CSV_ROWS = 10_000
_LARGE_PERCENT = 1.0  # of the line: more spoils an image


@dataclass(frozen=True)
class SimulationStage:
    """Runs with one scanner file, given or calibrated on the virtual scanner, and the models that could not run."""

    name: str
    heading: str
    runs: tuple[Run, ...]
    rejected: tuple[tuple[str, tuple[str, ...]], ...] = ()


def text(name: str, truth: Truth, stages: Sequence[SimulationStage]) -> list[str]:
    """Format a table for the terminal."""
    first = next(run for stage in stages for run in stage.runs)
    lines = [
        f"{name}: {LABEL} ({truth.name!r}); "
        f"{first.x.nominal_nm:g} nm in x and {first.y.nominal_nm:g} nm in y requested",
        "",
        "                  size    residual in the window [% of the line]               in the image       "
        "scaling error",
        "axis  model       [%]     direction  peak      at x   range                    about its line     "
        "[%, peak to peak]",
    ]
    for stage in stages:
        lines += ["", stage.heading]
        for axis in ("x", "y"):
            for run in stage.runs:
                lines += _rows(axis, run)
        lines += [f"{model}: {'; '.join(reasons)}" for model, reasons in stage.rejected]
    lines.append("")
    lines.append("* the model of the scanner file")
    if any(getattr(run, axis).refined for stage in stages for run in stage.runs for axis in ("x", "y")):
        lines.append("+ with the refinement of the scan file")
    lines += [finding.line for finding in simulation_findings(stages)]
    lines.append(f"A simulation, not a measurement: the virtual scanner was identified on {truth.identified_on}.")
    return lines


def simulation_findings(stages: Sequence[SimulationStage]) -> list[Finding]:
    """Return the errors that the scanner file's own models leave in the last stage's image, the worst first."""
    played = [stage for stage in stages if stage.runs]
    findings = []
    for run in played[-1].runs if played else ():
        for one in (getattr(run, axis) for axis in run.configured):
            residuals = {side: max(map(abs, getattr(one.imaged, side).residual_range)) for side in one.directions}
            side = max(residuals, key=lambda name: residuals[name])
            error = f"the {run.model} model leaves {residuals[side]:.2g} % of the line of {one.axis}, {side}, at most"
            text = f"on this virtual scanner {error}"
            weight: Weight = "spoils" if residuals[side] > _LARGE_PERCENT else "expect"
            code: FindingCode = "uncompensated-hysteresis" if run.model == UNCOMPENSATED else "model-mismatch"
            findings.append(Finding(weight, residuals[side], text, code=code, axis=axis_name(one.axis)))
            by = one.size_error_percent
            if abs(by) > _LARGE_PERCENT:
                text = f"the image is {by:+.2g} % off in the size of {one.axis}"
                code = "measured-size-error"
                findings.append(Finding("spoils", abs(by), text, code=code, axis=axis_name(one.axis)))
    return worst_first(findings)


def _rows(axis: str, run: Run) -> list[str]:
    one: AxisRun = getattr(run, axis)
    mark = ("*" if axis in run.configured else "") + ("+" if one.refined else "")
    start = f"{axis:<4}  {run.model + mark:<12}{one.size_error_percent:+6.2f}"
    rows: list[str] = []
    for side in one.directions:
        branch: BranchError = getattr(one.error, side)
        imaged: BranchError = getattr(one.imaged, side)
        peak, at = branch.peak
        rows.append(
            f"{start if not rows else ' ' * len(start)}  {side:<9}  {peak:+6.3f}   {at:5.3f}   {_range(branch)}       "
            f"{_range(imaged)}   {branch.scaling_peak_to_peak:6.3f}"
        )
    return rows


def _range(branch: BranchError) -> str:
    low, high = branch.residual_range
    return f"{low:+6.3f} .. {high:+6.3f}"


def data(name: str, truth: Truth, stages: Sequence[SimulationStage]) -> dict[str, Any]:
    """Return the report as plain data, for JSON, by stage and model."""

    def branch(one: BranchError, imaged: BranchError) -> dict[str, Any]:
        peak, at = one.peak
        return {
            "residual_peak_percent": peak,
            "residual_peak_at": at,
            "residual_range_percent": list(one.residual_range),
            "residual_about_image_line_percent": list(imaged.residual_range),
            "scaling_error_peak_to_peak_percent": one.scaling_peak_to_peak,
            "window": list(one.window),
        }

    def axis(one: AxisRun) -> dict[str, Any]:
        return {
            "nominal_nm": one.nominal_nm,
            "moved_nm": one.error.size_nm,
            "size_error_percent": one.size_error_percent,
            "refined": one.refined,
            **{side: branch(getattr(one.error, side), getattr(one.imaged, side)) for side in one.directions},
        }

    return {
        "simulation": True,
        "label": LABEL,
        "scan": name,
        "virtual_scanner": truth.name,
        "identified_on": truth.identified_on,
        **{
            stage.name: {
                "models": {
                    run.model: {"in_scanner_file": list(run.configured), "x": axis(run.x), "y": axis(run.y)}
                    for run in stage.runs
                },
                "rejected": {model: "; ".join(reasons) for model, reasons in stage.rejected},
            }
            for stage in stages
        },
    }


def csv(stages: Sequence[SimulationStage]) -> str:
    """Format one settled period of each axis, at most some 10,000 ticks; ``position`` is that of the triangle."""
    out = io.StringIO()
    out.write("# simulation\n")
    out.write("scanner,model,axis,tick,time_s,code,drive_v,displacement_nm,position,residual_percent\n")
    for stage in stages:
        for run in stage.runs:
            for one in (run.x, run.y):
                _write_ticks(out, f"{stage.name},{run.model},{one.axis}", one)
    return out.getvalue()


def _write_ticks(out: io.StringIO, start: str, one: AxisRun) -> None:
    ticks = len(one.displacement_nm)
    thin = slice(None, None, -(-ticks // _MAX_CSV_ROWS))
    position = ideal_triangle(ticks, one.turn, 0.5)[thin]
    rising = (one.drive.turns <= one.turn)[thin]
    forward, backward = one.error.forward, one.error.backward
    residual = np.where(
        rising,
        np.interp(position, forward.position, forward.residual),
        np.interp(position, backward.position, backward.residual),
    )
    drive = one.drive
    columns = (drive.tick, drive.time_s, drive.codes, drive.volts, one.displacement_nm)
    for k, t, code, v, d, p, r in zip(*(c[thin] for c in columns), position, residual, strict=True):
        out.write(f"{start},{k},{t:.9g},{code},{v:.9g},{d:.9g},{p:.6f},{r:.6f}\n")
