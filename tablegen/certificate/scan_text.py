"""A scan in the words of who takes the image: what is imaged, how fast, with which drive, and what is corrected."""

from collections.abc import Mapping

from tablegen.certificate.certificate import Certificate
from tablegen.certificate.error_answer import converter_percent, pixel_count, short
from tablegen.certificate.tilt_text import tilt_blocks
from tablegen.planning.line_plan import LinePlan, Plan


def scan_text(plan: Plan, certificates: Mapping[str, Certificate]) -> list[str]:
    """List the lines of ``tablegen show`` below the errors; ``summary`` has factors, words and equations as well."""
    schedule = plan.schedule
    directions = "trace and retrace" if schedule.backward.count else "trace alone"
    pixel_us = 1e6 * float(schedule.pixel_ticks) / float(schedule.update_rate_hz)
    a_pixel = f"{pixel_us:.3g} us" if pixel_us < 999.5 else f"{1e-3 * pixel_us:.3g} ms"
    lines = [
        f"{float(schedule.line_rate):.4g} lines a second, {directions}; {a_pixel} a pixel; "
        f"{schedule.lines} line periods a frame with its turnarounds",
    ]
    for line in plan.lines:
        rows = _rows(plan, line, certificates[line.axis])
        lines += ["", line.axis, *(f"  {label:<20}{value}" for label, value in rows)]
    return lines + tilt_blocks(plan)


def _rows(plan: Plan, line: LinePlan, certificate: Certificate) -> list[tuple[str, str]]:
    drive = line.drive
    if drive.resting:
        return [("rests", f"at {drive.v_offset:.6g} V, {drive.position_nm:.6g} nm")]
    count = pixel_count(line, plan.schedule)
    what = "pixels" if line.axis == "x" else "lines"
    speed = drive.window_nm * float(line.rate) / max(_imaged_share(line), 1e-12)
    rows = [
        ("image", f"{drive.window_nm:.6g} nm in {count} {what} of {short(drive.window_nm / count)} nm"),
        *([("motion", "a sine: pixels are at equal steps of the position, not of time")] if line.imaged else []),
        ("whole way", f"{drive.size_nm:.6g} nm from turn to turn, about {drive.position_nm:.6g} nm"),
        ("speed", f"{short(1e-3 * speed)} um/s" if speed >= 100.0 else f"{short(speed)} nm/s"),
        ("drive at the piezo", f"{drive.v_amplitude:.4g} V peak to peak about {drive.v_offset:.4g} V"),
    ]
    if certificate.scaling:
        bare = max((one.uncompensated or 0.0) for one in certificate.scaling.values())
        if bare > 0.0005:
            rows.append(("without correction", f"the local size would vary by {bare:.3g} % along the image"))
        scaling = certificate.scaling_error_percent
        rows.append(("as it is emitted", f"it varies by {scaling:.3g} %, if the piezo does as its model says"))
    steps = certificate.highest_code - certificate.lowest_code + 1
    share = converter_percent(line, certificate)
    rows.append(("converter", f"{steps} codes; their rounding moves the tip by {share:.2g} % of the line, rms"))
    if line.layer is not None:
        rows.append(("refined", f"{line.layer.harmonics} harmonics learnt from the running scan"))
    return rows


def _imaged_share(line: LinePlan) -> float:
    """Return the share of the period in which the window is passed on the way forward."""
    low, high = line.band_limit.window
    return (high - low) * line.drive.turn
