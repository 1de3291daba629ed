"""A calibration for the terminal: parameters with errors, residuals, and a table of the measurements."""

from collections.abc import Sequence
from math import floor, isfinite, log10

from tablegen.calibration.laws.hysteresis import HysteresisFit
from tablegen.calibration.laws.trace import TraceFit
from tablegen.calibration.summary import change, parameters
from tablegen.calibration.tables.table import MeasuredTable
from tablegen.fitting.estimate import Estimate, Fit
from tablegen.fitting.measured_branch import AmplitudeFit, MeasuredBranch
from tablegen.images.files import ScanImage
from tablegen.images.pair_fit import ImageFit

_TRACE_HEAD = ("turn", "V_scan", "rate [Hz]", "periods", "noise [%]", "drift [%]")
_IMAGE_HEAD = ("turn", "V_scan", "periods", "noise [%]", "drift [%]", "gap [%]")


def calibration_text(fit: Fit, axis: str, tables: Sequence[MeasuredTable | ScanImage]) -> list[str]:
    """Return lines of text; ``tables`` are the measurements of the fit."""
    hysteresis = isinstance(fit, HysteresisFit)
    rows = [(name, *figures(estimate), meaning) for name, estimate, meaning in parameters(fit)]
    widths = [max(len(row[i]) for row in rows) for i in range(3)]
    files = ", ".join(table.source.name for table in tables)
    if hysteresis:
        counted = "pixels" if isinstance(tables[0], ScanImage) else "samples"
    else:
        counted = "images" if fit.images else "points"
    lines = [f"{change(fit, []).kind} of {axis}, {fit.points} {counted} of {files}", ""]
    lines += [
        f"{name:<{widths[0]}}  {value:>{widths[1]}} {error:<{widths[2]}}  {meaning}"
        for name, value, error, meaning in rows
    ]
    metric = "position error [% of the scan]" if hysteresis else "scale error [%]"
    lines += [
        "",
        f"{metric}: up to {fit.before_percent:.2f} without correction; with it {fit.rms_percent:.2g} rms, "
        f"{fit.largest_percent:.2g} at most",
        "",
    ]
    if isinstance(fit, HysteresisFit):
        lines += [*_traces(fit), ""]
    if fit.images:
        lines += [*image_lines(fit), ""]
    return lines


def image_lines(fit: Fit) -> list[str]:
    """Format a table of the images, a row each."""
    offsets = fit.images[0].v_offset is not None
    head = (
        "V_scan",
        *(("offset [V]",) * offsets),
        "size [nm]",
        "periods",
        "angle",
        "noise [%]",
        "drift [%]",
        "open [%]",
    )
    rows: list[tuple[str, ...]] = [(*head, "residual [%]", "image")]
    for one, residual in zip(fit.images, fit.residual_percent, strict=True):
        at = (f"{one.v_offset:.4g}",) if one.v_offset is not None else ()
        drift, gap = (
            f"{value:.2g}" if isfinite(value) else "-" for value in (100.0 * one.size.drift, one.open_percent)
        )
        quality = f"{one.periods:.3g}", f"{one.size.angle_deg:.1f}", f"{one.noise_percent:.2g}", drift, gap
        rows.append((f"{one.v_scan:.4g}", *at, " ".join(figures(one.size.nm)), *quality, f"{residual:+.2f}", one.name))
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    lines.append("open: distance of trace and retrace at the turns, where they should meet, of the line")
    return lines


def _traces(fit: HysteresisFit) -> list[str]:
    """Format a table of the traces, two rows each: their fits and their quality."""
    images = isinstance(fit.branches[0].traces[0], ImageFit)
    offsets = any(branch.offsets_v for branch in fit.branches)
    at = ("offset [V]",) if offsets else ()
    head = (*at, *(_IMAGE_HEAD if images else _TRACE_HEAD), "direction", "beta", "u_peak", "error [% p-p]")
    rows: list[tuple[str, ...]] = [head]
    for branch in fit.branches:
        for trace in branch.traces:
            record = (f"{trace.v_offset or 0.0:.4g}",) * offsets + _record(trace)
            for side, residual in zip(("forward", "backward"), trace.scaling_percent, strict=True):
                measured: MeasuredBranch = getattr(trace, side)
                start = record if side == "forward" else ("",) * len(record)
                branch_figures = (" ".join(figures(measured.beta)), " ".join(figures(measured.u_peak)))
                rows.append((*start, side, *branch_figures, f"{residual:.2g}"))
    widths = [max(len(row[i]) for row in rows) for i in range(len(head))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    lines.append("residual: scaling error that the model does not describe, over x = 0.1..0.9")
    if images:
        lines.append("gap: largest distance between trace and retrace of one feature, of the line")
    return lines


def _record(trace: AmplitudeFit) -> tuple[str, ...]:
    """Return the cells of a trace or of a pair of images."""
    shape = f"{trace.turn.value:.3f}", f"{trace.v_scan:.4g}"
    quality = f"{trace.noise_percent:.2g}", f"{trace.drift_percent:.2g}"
    match trace:
        case TraceFit():
            return *shape, f"{1.0 / trace.triangle.period_s:.4g}", f"{trace.periods:.3g}", *quality
        case ImageFit():
            return *shape, f"{trace.periods:.3g}", *quality, f"{trace.registration_percent:.2f}"
    raise NotImplementedError(type(trace))


def figures(estimate: Estimate) -> tuple[str, str]:
    """Return a value and its error, in two digits of the error; without an error in six digits."""
    value, error = estimate.value, estimate.standard_error
    if not isfinite(error):
        return f"{value:.6g}", ""
    if error <= 1e-8 * abs(value):
        return f"{value:.9g}", "± 0"
    digits = 1 - floor(log10(error))
    if 0 <= digits <= 6:
        return f"{value:.{digits}f}", f"± {error:.{digits}f}"
    significant = max(2 + floor(log10(max(abs(value), error))) - floor(log10(error)), 2)
    return f"{value:.{significant}g}", f"± {error:.2g}"
