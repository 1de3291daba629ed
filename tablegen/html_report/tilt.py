"""The outputs beside x and y on the page: what each follows, its range, its errors, and a frame of it."""

from math import atan, degrees

from msgspec import Struct

from tablegen.config.schema import TiltName
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.html_report.blocks import Charts, Grid, Section, TableCell, row
from tablegen.html_report.number_text import figure
from tablegen.html_report.promises import bounded
from tablegen.html_report.subject import Subject
from tablegen.html_report.tilt_chart import tilt_chart
from tablegen.html_report.turned_subject import TurnedSubject
from tablegen.manifest.frame_fields import TiltFields, TurnedCodes

_WHAT = {"z": "the height of the tilted sample", "aux": "the second output, linear in x and y, for the sample"}


class ShownTilt(Struct, frozen=True, eq=False):
    """An output beside x and y of a manifest, its program, and its certificate; errors are at the imaged ticks.

    With ``steps`` y moves in steps.
    """

    name: TiltName
    fields: TiltFields
    program: FrameProgram
    codes: TurnedCodes
    error_lsb: float
    error_nm: float
    steps: bool = False


def shown_tilts(subject: Subject | TurnedSubject) -> list[ShownTilt]:
    """List the outputs beside x and y of a scan or a build; none without any."""
    sequence, tilts = subject.manifest.sequence, []
    if isinstance(subject, Subject):
        steps = subject.manifest.axes.y.line.hold_ticks > 1
        for name, tilt in subject.tilts.items():
            its, program = tilt.certificate, tilt.program(sequence)
            tilts.append(ShownTilt(name, tilt, program, its.codes, its.error_lsb, its.error_nm, steps))
        return tilts
    certificate = subject.manifest.certificate
    for name, fields in subject.manifest.turned.tilts.items():
        codes, errors = certificate.codes.get(name), getattr(certificate, name)
        if codes is not None and errors is not None:
            program = fields.program(sequence)
            tilts.append(ShownTilt(name, fields, program, codes, errors.error_lsb, errors.error_nm))
    return tilts


def tilt_section(z: ShownTilt, max_error_lsb: float | None) -> Section:
    """Return the section of an output; ``max_error_lsb`` is the limit of the scan file, None without it."""
    fields, output, codes = z.fields, z.fields.output, z.codes
    low, high = sorted(_volts(z, code) for code in (codes.least, codes.most))
    share = 100.0 * (codes.most - codes.least + 1) / (1 << output.dac_bits)
    level = row("with the steps of y", "the level of each line, a smooth step between lines", "", "")
    steps = [level] if z.steps else []
    rows = [
        row("slope along x", _slope(fields.slope_x), "", ""),
        row("slope along y", _slope(fields.slope_y), "", ""),
        *steps,
        row("piezo", f"{fields.nm_per_v:g} nm/V, taken as linear", "", ""),
        row("height over the frame", f"{figure((high - low) * abs(fields.nm_per_v), 4)} nm from end to end", "", ""),
        row("drive at the piezo", f"{low:.6g}..{high:.6g} V", "", ""),
        row("codes", f"{codes.least}..{codes.most}, {share:.3g} % of the converter", "", ""),
        _margin("lowest", z, low),
        _margin("highest", z, high),
        bounded("largest error at imaged ticks", z.error_lsb, max_error_lsb, "LSB"),
        row("the same in height", f"{figure(z.error_nm, 3)} nm", "", ""),
        bounded("largest step", codes.steepest, output.max_step, "codes a tick"),
    ]
    lead = (
        f"What a second sequencer plays beside x and y: {_WHAT[z.name]} under the wanted place. The "
        "limits of the drive are those that driver and converter have in common."
    )
    chart = Charts((tilt_chart(z.name, z.program, output.v_zero, output.v_per_code),))
    grid = Grid(f"{z.name}, of its integers", ("", "figure", "limit", ""), tuple(rows))
    return Section(z.name, f"Output {z.name}", (grid, chart), lead)


def _slope(slope: float) -> str:
    return f"{slope:+g}, {degrees(atan(slope)):+.3g} degrees"


def _volts(z: ShownTilt, code: int) -> float:
    return z.fields.output.v_zero + z.fields.output.v_per_code * code


def _margin(end: str, z: ShownTilt, volts: float) -> tuple[TableCell, ...]:
    """Return the room between an end of the drive and the end of its range, in volts and in height."""
    limits = sorted(_volts(z, code) for code in (z.fields.output.code_min, z.fields.output.code_max))
    limit = limits[0] if end == "lowest" else limits[1]
    room = volts - limit if end == "lowest" else limit - volts
    good = room >= -abs(z.fields.output.v_per_code)
    cell = TableCell("\u2713 within", "good") if good else TableCell("\u2717 outside", "bad")
    text = f"{figure(room, 4)} V, {figure(room * abs(z.fields.nm_per_v), 4)} nm, from the {end} voltage"
    return row("room " + ("below" if end == "lowest" else "above"), text, f"{limit:.6g} V", cell)
