"""The compared quantities and charts of a scan at an angle, or of a build of one."""

from collections.abc import Iterator

import numpy as np

from tablegen.certificate.turned_errors import ImagedFrame, played_frame
from tablegen.charts.chart import Chart, Mark
from tablegen.comparison.frame_axis import frame_quantities
from tablegen.comparison.overlay import overlay
from tablegen.comparison.quantity import ComparedQuantity, digest
from tablegen.comparison.scanners import scanner_quantities
from tablegen.comparison.scans import output_limits, rates, request_keys
from tablegen.comparison.tilt import tilt_charts, tilt_quantities
from tablegen.fixedpoint.frame_program import RATIO_FRACTION_BITS, FrameProgram
from tablegen.html_report.turned_codes import axes_of, frame_volts
from tablegen.html_report.turned_subject import TurnedSubject
from tablegen.manifest.frame_fields import TurnedAxisFields
from tablegen.numerics.arrays import Floats

_ERRORS = (
    ("rms", "residual, rms", "%"),
    ("worst_line", "residual of the worst line, rms", "%"),
    ("mismatch", "trace to retrace", "%"),
    ("scaling", "scaling along the mean line", "%"),
    ("fast_size", "size along the lines", "%"),
    ("slow_size", "size across the lines", "%"),
    ("shear", "shear", "%"),
    ("rotation_deg", "error of the scan angle", "deg"),
)


def turned_quantities(subject: TurnedSubject) -> list[ComparedQuantity]:
    """Return every quantity of a scan at an angle or its build, in the order of the report."""
    manifest, planned, errors = subject.manifest, subject.planned, subject.errors
    quantities = [] if planned is None else [*request_keys(planned.setup)]
    quantities += rates(manifest.sequence)
    turned = manifest.turned
    numbers: tuple[tuple[str, float, str], ...] = (
        ("scan angle", turned.angle_deg, "deg"),
        ("size along the lines", turned.size_nm[0], "nm"),
        ("size across the lines", turned.size_nm[1], "nm"),
        ("x for each nm of y", turned.coupling[0], "nm"),
        ("y for each nm of x", turned.coupling[1], "nm"),
        ("drift along x", turned.drift_nm_per_s[0], "nm/s"),
        ("drift along y", turned.drift_nm_per_s[1], "nm/s"),
    )
    quantities += [ComparedQuantity("frame", *one) for one in numbers]
    quantities += [
        ComparedQuantity("certificate", name, errors[key], unit) for key, name, unit in _ERRORS if key in errors
    ]
    for number, (axis, fields, _) in enumerate(axes_of(subject.stored)):
        codes, section = manifest.certificate.codes[axis], f"{axis} certificate"
        quantities += frame_quantities(axis, fields)
        quantities += [
            ComparedQuantity(section, "lowest code", codes.least),
            ComparedQuantity(section, "highest code", codes.most),
            ComparedQuantity(section, "largest step", codes.steepest, "codes"),
        ]
        if "code_lsb" in errors:
            quantities.append(ComparedQuantity(section, "largest error of a code", errors["code_lsb"][number], "LSB"))
        quantities += output_limits(axis, fields.output)
    quantities += tilt_quantities(subject)
    quantities += [
        ComparedQuantity("build", "name", manifest.name),
        ComparedQuantity("build", "formats", ", ".join(manifest.formats)),
        ComparedQuantity("build", "tablegen", manifest.tablegen),
        ComparedQuantity("build", "plan", manifest.hash[:16]),
        ComparedQuantity("build", "files", f"{len(manifest.files)}: {digest(sorted(manifest.files.items()))}"),
    ]
    if planned is not None:
        quantities += scanner_quantities(planned.setup.scanner_file, planned.setup.scanner)
    return quantities


def turned_charts(a: TurnedSubject, b: TurnedSubject) -> Iterator[Chart]:
    """Yield the charts of two scans at an angle: a line, the slow part, gains and ratios, and of two scans errors."""
    frame, volts = "time [frames]", "drive at the piezo [V]"
    for one, other in zip(axes_of(a.stored), axes_of(b.stored), strict=True):
        axis = one[0]
        both = [_curves(subject, *its[1:]) for subject, its in ((a, one), (b, other))]
        lines, slow, gains, ratios = zip(*both, strict=True)
        yield overlay(f"line-{axis}", f"{axis} drive, the middle line", "time [ms]", volts, *lines)
        yield overlay(f"slow-{axis}", f"{axis} slow part", frame, volts, *slow)
        yield overlay(f"gains-{axis}", f"{axis} gain of each line", frame, "gain word", *gains)
        yield overlay(f"ratios-{axis}", f"{axis} share of the second table", frame, "ratio", *ratios)
    yield from tilt_charts(a, b)
    plans = [one.planned.plan for one in (a, b) if one.planned is not None]
    if len(plans) == 2:
        curves = [_line_rms(played_frame(plan), plan.geometry.size_nm) for plan in plans]
        title = "Residual of the imaged lines, on the operators"
        yield overlay("lines", title, "imaged line", "rms [%]", *curves, marks=(Mark(0.0, "", "y"),))


_Curve = tuple[Floats, Floats]


def _curves(
    subject: TurnedSubject, fields: TurnedAxisFields, program: FrameProgram
) -> tuple[_Curve, _Curve, _Curve, _Curve]:
    """Return the middle line, the slow part, gains and ratios of an axis, over ms or shares of the frame."""
    schedule, volts = subject.stored.program.schedule, frame_volts(fields, program)
    part = schedule.up if schedule.up.count else schedule.down
    time_ms = np.linspace(0.0, 1e3 / float(schedule.line_rate), volts.shape[1], endpoint=False)
    whole = np.arange(program.lines + 1)
    share = np.linspace(0.0, 1.0, program.lines + 1)
    levels = program.slow.at(whole, program.lines) / (1 << program.output.gain_q)
    ratios = program.ratios.at(whole[:-1]) / (1 << RATIO_FRACTION_BITS)
    return (
        (time_ms, volts[part.first + part.count // 2]),
        (share, np.asarray(fields.output.v_zero + fields.output.v_per_code * levels, dtype=np.float64)),
        (share[:-1], program.gains.at(whole[:-1]).astype(np.float64)),
        (share[:-1], np.asarray(ratios, dtype=np.float64)),
    )


def _line_rms(frame: ImagedFrame, size_nm: tuple[float, float]) -> _Curve:
    rms = 100.0 * frame.line_rms(size_nm)
    return np.arange(len(rms), dtype=np.float64), rms
