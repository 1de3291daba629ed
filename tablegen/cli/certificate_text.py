"""Format the certificate of a build for the terminal."""

from tablegen.certificate.certificate import Certificate
from tablegen.certificate.summary import expected_lines, rate
from tablegen.certificate.tilt_text import tilt_rows
from tablegen.planning.line_plan import Plan


def certificate_table(plan: Plan, certificates: dict[str, Certificate]) -> list[str]:
    """Format the certificate of both axes, a line an axis."""
    schedule = plan.schedule
    lines = [
        f"{plan.name} on {plan.scanner!r}: {rate(schedule.line_rate)} lines of {schedule.ticks} ticks, "
        f"{schedule.lines} lines a frame, {rate(schedule.frame_rate)} frames",
        "",
        "                      error [LSB]   scaling error in the window [%, peak to peak]",
        "axis  drive [V p-p]    max    rms   direction  uncompensated  emitted  band limit  size   step/limit",
    ]
    for line in plan.lines:
        certificate = certificates[line.axis]
        for i, (side, error) in enumerate(certificate.scaling.items()):
            start = f"{line.axis:<4}  {line.drive.v_amplitude:13.4f}  {certificate.max_error_lsb:5.3f}  "
            start += f"{certificate.rms_error_lsb:5.3f}"
            step = f"{certificate.largest_step}/{certificate.max_step}"
            if i:
                start, step = " " * len(start), ""
            bare = f"{'-':>13}" if error.uncompensated is None else f"{error.uncompensated:13.2f}"
            lines.append(
                f"{start}   {side:<9}  {bare}  {error.total:7.3f}  {error.band_limit:10.4f}  "
                f"{error.size:+.3f}  {step}".rstrip()
            )
        if line.drive.resting:
            step = f"{certificate.largest_step}/{certificate.max_step}"
            lines.append(
                f"{line.axis:<4}  rests at {line.drive.v_offset:.6g} V, code {certificate.lowest_code}; {step}"
            )
    for line in plan.lines:
        for side, effect in (certificates[line.axis].refinement or {}).items():
            lines.append(
                f"{line.axis:<4}  refinement, {side}: moves up to {effect.position:.3g} % of the line and takes away "
                f"{effect.scaling:.3g} % of scaling error, peak to peak"
            )
        expected = certificates[line.axis].expected
        if expected is not None and expected.basis == "traces":
            texts = expected_lines(expected)
            lines += [
                f"{line.axis if i == 0 else '':<4}  {'' if i else 'on the scanner':<14}  {text}"
                for i, text in enumerate(texts)
            ]
    for tilt in plan.tilts:
        rows = enumerate(tilt_rows(tilt))
        lines += [f"{'' if i else tilt.name:<4}  {label:<20}{value}" for i, (label, value) in rows]
    return lines
