"""The report of a simulation on the scanner file's own operator, as text and as plain data."""

from collections.abc import Sequence
from typing import Any

from tablegen.compensation.operator.field import SAME_CENTRE
from tablegen.virtual.own_run import MEASURES, SEEDS, OwnRow, OwnRun

LABEL = "simulation on the scanner file's own operator"


def text(name: str, runs: Sequence[OwnRun], without: Sequence[str]) -> list[str]:
    """Format a table for the terminal; ``without`` are the axes that have no operator."""
    sizes = " and ".join(f"{run.nominal_nm:g} nm in {run.axis}" for run in runs)
    lines = [
        f"{name}: {LABEL}; {sizes} requested",
        f"mean (worst) of {SEEDS} scanners that depart from the operator at random, by its own uncertainty",
    ]
    for run in runs:
        rms, size = ([abs(trace.left_out[i]) for trace in run.traces] for i in (0, 3))
        lines.append(
            f"  {run.axis}: error of the operator on each of its {len(run.traces)} traces when that is left out: "
            f"rms {min(rms):.2g} to {max(rms):.2g} %, size {min(size):.2g} to {max(size):.2g} %"
        )
        if run.distance > SAME_CENTRE:
            lines.append(
                f"  {run.axis}: the nearest trace is {100.0 * run.distance:.3g} % of v_max from this offset; the "
                "operator's error here is unknown, and larger"
            )
    lines += [
        "",
        "axis  correction        rms               scaling error     mismatch          size",
        "                        [% of the line]   [%, peak to peak] [% of the line]   [%]",
    ]
    for run in runs:
        lines += [_row(run.axis, row) for row in run.rows]
    lines += [f"{axis:<4}  has no operator; --scanner-truth default plays it on a built-in scanner" for axis in without]
    lines.append("")
    lines += [
        f"{run.axis} is without the refinement of the scan file, which was learnt on the piezo itself"
        for run in runs
        if run.refined
    ]
    lines += [
        "A simulation, not a measurement: the scanner is modelled from its traces, without drift, coupling and aging.",
    ]
    return lines


def _row(axis: str, row: OwnRow) -> str:
    start = f"{axis:<4}  {_called(row):<18}"
    if not row.errors:
        return f"{start}none: {row.rejected}"
    summary = row.summary()
    cells = []
    for name in MEASURES:
        if name not in summary:
            cells.append("-")
            continue
        mean, worst = summary[name]
        sign = "+" if name == "size" else ""
        cells.append(f"{mean:{sign}.3f} ({worst:{sign}.3f})")
    return (start + "".join(f"{cell:<18}" for cell in cells)).rstrip()


def _called(row: OwnRow) -> str:
    return f"{row.correction}, {row.model}" if row.correction == "laws" and row.model else row.correction


def data(name: str, runs: Sequence[OwnRun], without: Sequence[str]) -> dict[str, Any]:
    """Return the report for JSON, by axis and correction; ``null`` with a reason where one cannot be played."""

    def row(one: OwnRow) -> dict[str, Any]:
        return {
            "model": one.model or None,
            "rejected": one.rejected or None,
            "errors_percent": {name: {"mean": mean, "worst": worst} for name, (mean, worst) in one.summary().items()}
            if one.errors
            else None,
        }

    return {
        "simulation": True,
        "label": LABEL,
        "scan": name,
        "virtual_scanner": "own",
        "scanners": SEEDS,
        "axes": {
            run.axis: {
                "nominal_nm": run.nominal_nm,
                "refinement_left_out": run.refined,
                "offset_distance_percent": 100.0 * run.distance,
                "traces": [
                    {
                        "size_percent_of_range": 100.0 * trace.stroke,
                        "offset_percent_of_range": 100.0 * trace.centre,
                        "left_out_percent": dict(zip(MEASURES, trace.left_out, strict=True)),
                    }
                    for trace in run.traces
                ],
                "corrections": {one.correction: row(one) for one in run.rows},
            }
            for run in runs
        },
        "without_operator": list(without),
    }
