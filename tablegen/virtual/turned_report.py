"""The report of a simulation of a scan at an angle, as text, rows of a CSV and plain data."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tablegen.base.warnings import Finding, Weight, worst_first
from tablegen.planning.turned_plan import TurnedPlan
from tablegen.virtual import own_report, report
from tablegen.virtual.turned_run import BUILT, MEASURES, SEEDS, FrameRow, FrameRun

_LABELS = dict(
    zip(
        MEASURES,
        (
            "residual, rms [%]",
            "worst line, rms [%]",
            "trace to retrace [%]",
            "scaling, peak to peak [%]",
            "size along the lines [%]",
            "size across the lines [%]",
            "shear [%]",
            "scan angle [degrees]",
        ),
        strict=True,
    )
)
_SIGNED = ("fast_size", "slow_size", "shear", "rotation_deg")
_LARGE_PERCENT = 1.0  # more spoils an image
_MOST_CSV_ROWS = 10_000


@dataclass(frozen=True)
class FrameStage:
    """Rows with one scanner file, and the reason why the scan could not be played with it; empty if it was.

    ``own``: the rows are means over scanners that depart from the operators.
    """

    name: str
    heading: str
    rows: tuple[FrameRow, ...]
    rejected: str = ""
    own: bool = False


def text(plan: TurnedPlan, on: str, stages: Sequence[FrameStage], identified_on: str) -> list[str]:
    """Format a table for the terminal; ``on`` names the scanner, ``identified_on`` the source of its parameters."""
    fast_nm, slow_nm = plan.geometry.size_nm
    own = stages[0].own
    lines = [
        f"{plan.name} at {plan.geometry.angle_deg:g} degrees: {own_report.LABEL if own else report.LABEL}"
        f"{'' if own else f' ({on!r})'}; {fast_nm:g} nm along the lines and {slow_nm:g} nm across requested"
    ]
    if own:
        lines.append(
            f"mean (worst) of {SEEDS} scanners whose axes depart from their operators at random, by their uncertainty"
        )
    for stage in stages:
        lines.append("")
        if stage.heading:
            lines.append(stage.heading)
        lines += [stage.rejected] if stage.rejected else _table(stage)
    lines.append("")
    lines += [finding.line for finding in frame_findings(stages)]
    if own:
        lines.append("A simulation, not a measurement: the scanner is modelled from its traces, without aging.")
    else:
        lines.append(f"A simulation, not a measurement: the virtual scanner was identified on {identified_on}.")
    return lines


def _table(stage: FrameStage) -> list[str]:
    played = [row for row in stage.rows if row.errors]
    lines = [f"{'error':<28}" + "".join(f"{row.correction:<20}" for row in played)]
    summaries = [row.summary() for row in played]
    for name in MEASURES:
        sign = "+" if name in _SIGNED else ""
        cells = []
        for summary in summaries:
            mean, worst = summary[name]
            cells.append(f"{mean:{sign}.3f} ({worst:{sign}.3f})" if stage.own else f"{mean:{sign}.3f}")
        lines.append(f"{_LABELS[name]:<28}" + "".join(f"{cell:<20}" for cell in cells))
    lines += [f"{row.correction}: {row.rejected}" for row in stage.rows if not row.errors]
    return [line.rstrip() for line in lines]


def frame_findings(stages: Sequence[FrameStage]) -> list[Finding]:
    """Return the errors that the emitted integers leave in the last stage's image, the worst first."""
    rows = [row for stage in stages for row in stage.rows if row.correction == BUILT and row.errors]
    if not rows:
        return []
    worst = {name: value for name, (_, value) in rows[-1].summary().items()}
    where = "on scanners as uncertain as the operators" if stages[-1].own else "on this virtual scanner"
    residual = worst["worst_line"]
    weight: Weight = "spoils" if residual > _LARGE_PERCENT else "expect"
    findings = [Finding(weight, residual, f"{where} the worst line is off by {residual:.2g} % rms")]
    for name, what in (("fast_size", "along"), ("slow_size", "across")):
        if abs(worst[name]) > _LARGE_PERCENT:
            words = f"{where} the size {what} the lines is {worst[name]:+.2g} % off; compare with a known lattice"
            findings.append(Finding("spoils", abs(worst[name]), words, code="expected-size-error"))
    if abs(worst["shear"]) > _LARGE_PERCENT:
        words = f"{where} lines and slow direction are {worst['shear']:+.2g} % off a right angle"
        findings.append(Finding("spoils", abs(worst["shear"]), words, code="shear"))
    return worst_first(findings)


def data(plan: TurnedPlan, on: str, stages: Sequence[FrameStage], identified_on: str) -> dict[str, Any]:
    """Return the report for JSON, by stage and correction; ``null`` with a reason where one cannot be played."""
    geometry, own = plan.geometry, stages[0].own
    return {
        "simulation": True,
        "label": own_report.LABEL if own else report.LABEL,
        "scan": plan.name,
        "virtual_scanner": on,
        "identified_on": None if own else identified_on,
        "scanners": SEEDS if own else 1,
        "angle_deg": geometry.angle_deg,
        "size_nm": list(geometry.size_nm),
        **{
            stage.name: {
                "rejected": stage.rejected or None,
                "corrections": {row.correction: _plain(row) for row in stage.rows},
            }
            for stage in stages
        },
    }


def _plain(row: FrameRow) -> dict[str, Any]:
    summary = row.summary() if row.errors else {}
    return {
        "rejected": row.rejected or None,
        "errors": {name: {"mean": mean, "worst": worst} for name, (mean, worst) in summary.items()} or None,
    }


def csv(plan: TurnedPlan, stages: Sequence[FrameStage]) -> str:
    """Format a settled frame of both axes, at most some 10,000 samples, those of the first scanner."""
    out = io.StringIO()
    out.write("# simulation\n")
    out.write("scanner,correction,line,time_s,x_drive_v,y_drive_v,x_nm,y_nm,along_nm,across_nm,imaged\n")
    for stage in stages:
        for row in stage.rows:
            if row.example is not None:
                _write_samples(out, f"{stage.name},{row.correction}", plan, row.example)
    return out.getvalue()


def _write_samples(out: io.StringIO, start: str, plan: TurnedPlan, run: FrameRun) -> None:
    motion, t = plan.x.motion, run.volts.t
    lines = np.broadcast_to(np.arange(motion.lines)[:, None], run.x_nm.shape)
    time_s = (lines + t) / motion.line_rate_hz
    imaged = (motion.imaged[:, None] & motion.inside(t)).astype(np.int64)
    grids = (run.volts.x, run.volts.y, run.x_nm, run.y_nm, run.imaged.fast_nm, run.imaged.slow_nm)
    thin = slice(None, None, -(-lines.size // _MOST_CSV_ROWS))
    columns = (lines.ravel()[thin], time_s.ravel()[thin], *(one.ravel()[thin] for one in grids), imaged.ravel()[thin])
    for line, at_s, *values, flag in zip(*columns, strict=True):
        out.write(f"{start},{line},{at_s:.9g},{','.join(f'{one:.9g}' for one in values)},{flag}\n")
