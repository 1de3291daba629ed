"""The page of a scan at an angle: its sections in order, the findings, and the verdict above them."""

from collections.abc import Callable, Iterator

from tablegen.base.warnings import Finding, worst_first
from tablegen.certificate.error_answer import duration
from tablegen.certificate.summary import rate
from tablegen.certificate.turned_errors import played_frame
from tablegen.certificate.turned_summary import turned_brief, turned_warnings
from tablegen.config.schema import Limits
from tablegen.html_report.blocks import Charts, Grid, Paragraph, Section, TableCell, row
from tablegen.html_report.document import document
from tablegen.html_report.number_text import figure
from tablegen.html_report.promises import bounded
from tablegen.html_report.ranking import file_findings
from tablegen.html_report.request import file_section, image_text, record_section
from tablegen.html_report.tilt import shown_tilts, tilt_section
from tablegen.html_report.turned_charts import error_maps, lattice_image, line_errors, mean_line
from tablegen.html_report.turned_codes import axes_of, frame_charts, line_charts, path_chart, table_charts
from tablegen.html_report.turned_subject import TurnedSubject

_FIGURES = (
    ("rms", "residual, rms", False),
    ("worst_line", "residual of the worst line, rms", False),
    ("mismatch", "trace to retrace", False),
    ("shear", "shear of lines and slow direction", True),
)
_ADVICE_PERCENT = 1.0
_HEAD = ("", "figure", "limit", "")


def turned_sections(subject: TurnedSubject, tell: Callable[[str], object] = lambda _: None) -> list[Section]:
    """Return all sections of the page, the most important first."""
    parts = []
    if subject.planned is not None:
        tell("playing the frame on the operators")
        parts.append(_image(subject))
    tell("drawing")
    parts += [_certificate(subject), *_of_tilts(subject), _request(subject), _codes(subject), _tables(subject)]
    manifest = subject.manifest
    origin = f"made by tablegen {manifest.tablegen}; formats {', '.join(manifest.formats)}"
    files = file_section(manifest.hash, origin, subject.files)
    return [*parts, record_section(subject.verified, subject.digest), files]


def turned_findings(subject: TurnedSubject) -> list[Finding]:
    """Return all findings, the worst first."""
    return worst_first(_findings(subject))


def _findings(subject: TurnedSubject) -> Iterator[Finding]:
    yield from file_findings(subject.files, subject.verified, subject.digest)
    planned = subject.planned
    if planned is None:
        return
    for problem in planned.broken:
        yield Finding("limit", 100.0, str(problem), code=problem.code, axis=problem.axis)
    for percent, text in turned_warnings(planned.certificate):
        yield Finding("spoils", percent, text, code="shear" if "shear" in text else "expected-size-error")
    errors = planned.certificate.errors
    text = f"by the operators the residual is {errors.rms:.3g} % rms, that of the worst line {errors.worst_line:.3g} %"
    yield Finding("expect", errors.rms, text)


def turned_answers(subject: TurnedSubject) -> list[str]:
    """Return the errors and the time of an image; the time alone for a build."""
    planned = subject.planned
    if planned is None:
        return [duration(subject.stored.program.schedule)]
    return turned_brief(planned.plan, planned.certificate)


def turned_page(subject: TurnedSubject, parts: list[Section]) -> bytes:
    """Render the page of a scan at an angle; the same subject gives the same bytes."""
    manifest, planned, findings = subject.manifest, subject.planned, turned_findings(subject)
    notice = ""
    if planned is None:
        notice = (
            "This page is made of a build alone. Give `tablegen report` the scan file to see limits, and the errors on "
            "the operators over the image, as well."
        )
    foot = (
        f"Plan {manifest.hash}, tablegen {manifest.tablegen}. All is computed from the scan and the scanner file; what "
        "is called measured stands in them."
    )
    title = f"{manifest.name} on {manifest.scanner} at {manifest.turned.angle_deg:g} degrees"
    return document(title, _verdict(subject, findings), findings, parts, notice, foot, turned_answers(subject))


def _verdict(subject: TurnedSubject, findings: list[Finding]) -> TableCell:
    weights = [one.weight for one in findings]
    if "limit" in weights:
        return TableCell("\u2717 Do not use it before the first points below are corrected.", "bad")
    if "spoils" in weights:
        return TableCell("! It can be played, but what is first below spoils the image.", "warn")
    if subject.planned is None:
        return TableCell("\u2713 No warning.", "good")
    limits = "within all limits of the scan file" if subject.planned.limited else "the scan file sets no limits"
    return TableCell(f"\u2713 No warning; {limits}.", "good")


def _image(subject: TurnedSubject) -> Section:
    planned = subject.planned
    assert planned is not None
    plan, frame = planned.plan, played_frame(planned.plan)
    charts = (
        lattice_image(plan, frame, "operators", "Trace"),
        *error_maps(plan, frame, "operators", "Trace"),
        mean_line(plan, frame, "operators", "Residual"),
        line_errors(plan, frame, "operators", "Residual"),
    )
    lead = (
        "Where the emitted integers put the tip, by the operators of both axes: about the linear map that fits the "
        "imaged positions best, whose sizes and shear the certificate has."
    )
    return Section("image", "The image, and its errors", (Charts(charts),), lead)


def _certificate(subject: TurnedSubject) -> Section:
    planned, errors = subject.planned, subject.errors
    limits = Limits() if planned is None else planned.plan.limits
    most = limits.max_scaling_error_percent
    rows = [
        bounded("scaling along the mean line, peak to peak", errors["scaling"], most, "%", None),
        bounded("size along the lines", errors["fast_size"], most, "%", _ADVICE_PERCENT, signed=True),
        bounded("size across the lines", errors["slow_size"], most, "%", _ADVICE_PERCENT, signed=True),
        *(bounded(text, errors[key], None, "%", _ADVICE_PERCENT, signed) for key, text, signed in _FIGURES),
        row("error of the scan angle", f"{figure(errors['rotation_deg'], 3, True)} degrees", "", ""),
    ]
    tables = [Grid("The frame, by the operators of both axes", _HEAD, tuple(rows))]
    for (axis, fields, _), lsb in zip(axes_of(subject.stored), errors["code_lsb"], strict=True):
        codes, output = subject.manifest.certificate.codes[axis], fields.output
        share = 100.0 * (codes.most - codes.least + 1) / (1 << output.dac_bits)
        rows = [
            bounded("largest error of a code", lsb, limits.max_error_lsb, "LSB"),
            bounded("largest step", codes.steepest, output.max_step, "codes a tick"),
            row("codes", f"{codes.least}..{codes.most}, {share:.3g} % of the converter", "", ""),
            _room("room below", codes.least - output.code_min),
            _room("room above", output.code_max - codes.most),
        ]
        tables.append(Grid(f"{axis} axis, of its integers", _HEAD, tuple(rows)))
    lead = "Limits in the third column are those of the scan file, of the converter and of the amplifier."
    if planned is None:
        lead = "The limits of the scan file are not in a build; give the scan file to see them."
    return Section("certificate", "Certificate", tuple(tables), lead)


def _of_tilts(subject: TurnedSubject) -> list[Section]:
    """Return the sections of the outputs beside x and y; empty without any."""
    limit = None if subject.planned is None else subject.planned.plan.limits.max_error_lsb
    return [tilt_section(tilt, limit) for tilt in shown_tilts(subject)]


def _room(name: str, codes: int) -> tuple[TableCell, ...]:
    cell = TableCell("\u2713 within", "good") if codes >= 0 else TableCell("\u2717 outside", "bad")
    return row(name, f"{codes} codes", "0", cell)


def _request(subject: TurnedSubject) -> Section:
    manifest, planned = subject.manifest, subject.planned
    schedule, turned = subject.stored.program.schedule, manifest.turned
    (fast_nm, slow_nm), (x_per_y, y_per_x), (drift_x, drift_y) = turned.size_nm, turned.coupling, turned.drift_nm_per_s
    rows = [
        row("lines", f"{rate(schedule.line_rate)}, {schedule.ticks} ticks each"),
        row("frames", f"{rate(schedule.frame_rate)}, {schedule.lines} lines each"),
        row("image", image_text(manifest.sequence)),
        row("scan angle", f"{turned.angle_deg:g} degrees, counterclockwise from x"),
        row("size", f"{fast_nm:.6g} nm along the lines, {slow_nm:.6g} nm across"),
        row("coupling", f"{100.0 * x_per_y:+g} % of y along x, {100.0 * y_per_x:+g} % of x along y"),
        row("drift of the sample", f"{drift_x:+g} nm/s along x, {drift_y:+g} nm/s along y"),
    ]
    for axis, fields, _ in axes_of(subject.stored):
        words = f"{len(fields.words)} words of {fields.bits} bits for the line, {len(fields.slow.words)} for the frame"
        knots = f"{len(fields.gains.words)} gains and ratios, {fields.gains.spacing} lines apart"
        rows += [
            row(f"{axis} follows", f"{fields.fast_nm:+.5g} nm of the line, {fields.slow_nm:+.5g} nm of the frame"),
            row(f"{axis} tables", f"{words}, {knots}"),
        ]
    if planned is not None:
        rows += [row("" if i else "chosen", text) for i, text in enumerate(planned.setup.choices)]
    return Section("request", "What is played", (Grid("", ("", ""), tuple(rows)),))


def _codes(subject: TurnedSubject) -> Section:
    lead = "The emitted codes before shaping, as volts at the piezo: the path of both drives, lines, and a frame."
    charts = (path_chart(subject.stored), *line_charts(subject.stored), *frame_charts(subject.stored))
    return Section("codes", "Codes of both axes", (Charts(charts),), lead)


def _tables(subject: TurnedSubject) -> Section:
    lead = (
        "In each line an axis plays gain times its table of a line, in which a share of a second table is mixed, and "
        "the slow part, which goes straight from line to line."
    )
    note = Paragraph("Between the imaged lines, where the frame turns, gains and ratios go straight.", "quiet")
    return Section("tables", "Tables of a line and of a frame", (Charts(table_charts(subject.stored)), note), lead)
