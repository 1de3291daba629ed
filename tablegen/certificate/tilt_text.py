"""The outputs beside x and y in words: rows of their slopes, volts, codes and errors."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tablegen.planning.line_plan import Plan
    from tablegen.planning.tilt import TiltedOutput


def tilt_blocks(plan: "Plan") -> list[str]:
    """List a block of lines for each output beside x and y; none without any."""
    lines = []
    for tilt in plan.tilts:
        lines += ["", tilt.name, *(f"  {label:<20}{value}" for label, value in tilt_rows(tilt))]
    return lines


def tilt_rows(z: "TiltedOutput") -> list[tuple[str, str]]:
    """List what an output beside x and y does, and the errors of its integers: label and value."""
    errors, output, volts = z.errors, z.program.output, z.converter
    codes = errors.codes
    ends = sorted(volts.v_zero + volts.v_per_code * code for code in (codes.least, codes.most))
    centre = volts.v_zero + volts.v_per_code * z.offset
    return [
        ("tilt", f"{z.slope_x:+g} of x and {z.slope_y:+g} of y, by {z.nm_per_v:g} nm/V"),
        *_motion(z),
        ("drive at the piezo", f"{ends[0]:.6g}..{ends[1]:.6g} V, {centre:.6g} V in the centre of the scan"),
        ("error", f"max {errors.error_lsb:.3f} LSB, {errors.error_nm:.2g} nm, over all imaged ticks"),
        (
            "codes",
            f"{codes.least}..{codes.most}, headroom {codes.least - output.code_min} below, "
            f"{output.code_max - codes.most} above",
        ),
        ("step", f"at most {codes.steepest} of {output.max_step} codes a tick"),
    ]


def _motion(z: "TiltedOutput") -> list[tuple[str, str]]:
    """List what an output follows where that is no straight line in x, or no ramp in y."""
    from tablegen.planning.tilt_motion import TiltMotion  # here: most scans have no z

    motion = z.motion
    if not isinstance(motion, TiltMotion):
        return []
    rows = []
    if motion.place is not None:
        rows.append(("x", "the position that the operator predicts for the sine"))
    if motion.steps:
        room = f"{200.0 * motion.step_room:.3g} % of a line"
        rows.append(("y", f"the level of each line; between lines it moves within {room}"))
    return rows
