"""A scan at an angle and its certificate in words: errors, drives, warnings, and limits that are exceeded."""

from tablegen.base.input_errors import Problem
from tablegen.certificate.certified_scan import too_dear
from tablegen.certificate.error_answer import duration
from tablegen.certificate.summary import rate
from tablegen.certificate.turned_errors import TurnedCertificate
from tablegen.config.load import Setup
from tablegen.planning.turned_plan import TurnedPlan

_WARNED_PERCENT = 1.0


def turned_brief(plan: TurnedPlan, certificate: TurnedCertificate) -> list[str]:
    """Return the lines that every output of the scan begins with: its errors, and the time of an image."""
    errors = certificate.errors
    return [
        f"residual {errors.rms:.3f} % of the line by the operators; sizes {errors.fast_size:+.2f} % along the "
        f"lines, {errors.slow_size:+.2f} % across",
        duration(plan.schedule),
    ]


def turned_summary(plan: TurnedPlan, certificate: TurnedCertificate) -> list[str]:
    """Return errors and drives as lines of text."""
    errors, schedule = certificate.errors, plan.schedule
    lines = [
        f"{plan.name} on {plan.scanner!r} at {plan.geometry.angle_deg:g} degrees: {rate(schedule.line_rate)} lines "
        f"of {schedule.ticks} ticks, {schedule.lines} lines a frame",
        *mixed_motions(plan),
        "",
        "errors by the operators, percent of the line or of the frame",
        f"  residual {errors.rms:.3f} rms, worst line {errors.worst_line:.3f}",
        f"  scaling {errors.scaling:.2f} peak to peak",
        f"  size {errors.fast_size:+.3f} along the lines, {errors.slow_size:+.3f} across",
        f"  shear {errors.shear:+.3f}, angle {errors.rotation_deg:+.4f} degrees",
    ]
    if plan.x.motion.both:
        lines.append(f"  trace and retrace differ by up to {errors.mismatch:.3f}")
    lines += ["", "axis  of the line [nm]  of the frame [nm]  drive [V]  codes          step/limit  error [LSB]"]
    for axis, codes, lsb in zip(plan.axes, certificate.codes, errors.code_lsb, strict=True):
        volts = abs(axis.converter.v_per_code) * (codes.most - codes.least)
        reach, step = f"{codes.least}..{codes.most}", f"{codes.steepest}/{axis.program.output.max_step}"
        moves = f"{axis.motion.fast_nm:+16.2f}  {axis.motion.slow_nm:+17.2f}"
        lines.append(f"{axis.axis:<4}  {moves}  {volts:9.3f}  {reach:<13}  {step:<10}  {lsb:.2f}")
    return [*lines, *_tilt_summary(plan, certificate), *_costs(plan)]


def _costs(plan: TurnedPlan) -> list[str]:
    """Return what a sample of each axis takes, if the scan file names a processor."""
    takes = {axis.axis: axis.sample_cost for axis in plan.axes if axis.sample_cost is not None}
    lines = [f"{axis} takes {cost}, in C" for axis, cost in takes.items()]
    remedies = dict.fromkeys(cost.remedy for cost in takes.values() if cost.remedy)
    return ["", *lines, *remedies] if lines else []


def _tilt_summary(plan: TurnedPlan, certificate: TurnedCertificate) -> list[str]:
    """Return the rows of z and aux below those of x and y, and their slopes; empty without them."""
    rows, slopes = [], []
    for tilt in plan.tilts:
        errors = certificate.tilts[tilt.name]
        codes, output = errors.codes, tilt.program.output
        volts = abs(tilt.converter.v_per_code) * (codes.most - codes.least)
        reach, step = f"{codes.least}..{codes.most}", f"{codes.steepest}/{output.max_step}"
        moves = f"{tilt.motion.fast_nm:+16.2f}  {tilt.motion.slow_nm:+17.2f}"
        rows.append(f"{tilt.name:<4}  {moves}  {volts:9.3f}  {reach:<13}  {step:<10}  {errors.error_lsb:.2f}")
        slopes.append(
            f"{tilt.name} is {tilt.slope_x:+g} of x and {tilt.slope_y:+g} of y, by {tilt.nm_per_v:g} nm/V; within "
            f"{errors.error_nm:.2g} nm of the plane"
        )
    return [*rows, "", *slopes] if rows else []


def mixed_motions(plan: TurnedPlan) -> list[str]:
    """Return coupling and drift in a line each, where there is any."""
    geometry, lines = plan.geometry, []
    if geometry.x_per_y or geometry.y_per_x:
        lines.append(
            f"coupled axes: {100.0 * geometry.x_per_y:+g} % of y along x, {100.0 * geometry.y_per_x:+g} % of x along y"
        )
    if any(geometry.drift_nm_per_s):
        x, y = geometry.drift_nm_per_s
        lines.append(f"drift: {x:+g} nm/s along x, {y:+g} nm/s along y")
    return lines


def turned_warnings(certificate: TurnedCertificate) -> list[tuple[float, str]]:
    """Return sizes, shear or a residual above 1 %: the percentage, and a sentence."""
    errors = certificate.errors
    figures = {
        "the residual": errors.rms,
        "the size along the lines": errors.fast_size,
        "the size across the lines": errors.slow_size,
        "the shear": errors.shear,
    }
    return [
        (abs(value), f"{what} is off by {value:.2f} %")
        for what, value in figures.items()
        if abs(value) > _WARNED_PERCENT
    ]


def broken_limits(setup: Setup, plan: TurnedPlan, certificate: TurnedCertificate) -> list[Problem]:
    """Return the limits of the scan file that the certificate exceeds."""
    errors, limits, problems = certificate.errors, plan.limits, []
    of_tilts = [each.error_lsb for each in certificate.tilts.values()]
    figures = {
        "max_error_lsb": (limits.max_error_lsb, max(*errors.code_lsb, *of_tilts), "a code is off by", "LSB"),
        "max_scaling_error_percent": (
            limits.max_scaling_error_percent,
            max(errors.scaling, abs(errors.fast_size), abs(errors.slow_size)),
            "scaling and sizes are off by up to",
            "%",
        ),
    }
    for key, (limit, value, what, unit) in figures.items():
        if limit is not None and value > limit:
            problems.append(setup.scan_file.problem(f"limits.{key}", f"{what} {value:.3g} {unit}, above {limit:g}"))
    costs = [too_dear(setup, axis.axis, axis.sample_cost) for axis in plan.axes]
    return [*problems, *(problem for problem in costs if problem is not None)]
