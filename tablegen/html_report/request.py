"""The request beside the played scan, the files of the build, and the record of verify."""

from collections.abc import Sequence

from tablegen.certificate.summary import rate
from tablegen.html_report.blocks import Bullets, Grid, Paragraph, Section, TableCell, row
from tablegen.html_report.subject import FileState, Subject
from tablegen.html_report.verify_record import VerifyRecord
from tablegen.manifest.fields import ManifestAxis, ManifestSequence
from tablegen.planning.line_plan import LinePlan
from tablegen.planning.settling import settling, settling_text


def request_section(subject: Subject) -> Section:
    """Return a table of the request and the played scan, a row per quantity."""
    sequence = subject.manifest.sequence
    schedule = sequence.schedule
    planned = subject.planned
    requested = "" if planned is None else f"{schedule_hz(subject):.6g} Hz"
    rows = [
        row("lines", requested, f"{rate(schedule.line_rate)}, {schedule.ticks} ticks each"),
        row("frames", "", f"{rate(schedule.frame_rate)}, {schedule.lines} lines each"),
        row("image", "", image_text(sequence)),
    ]
    for axis, entry in subject.axes:
        drive = entry.drive
        request, offset = "", ""
        if planned is not None:
            scan = getattr(planned.setup.scan, axis)
            request = f"{scan.size_nm:g} nm {scan.size_of}" if scan.size_nm is not None else f"{scan.size_v:g} V"
            offset = f"{scan.offset_v:g} V" if scan.offset_v is not None else f"{scan.offset_nm:g} nm"
        rows += [
            row(f"{axis} size", request, f"{drive.size_nm:.6g} nm line, {drive.window_nm:.6g} nm imaged"),
            row(f"{axis} offset", offset, f"{drive.v_offset:.6g} V"),
            row(f"{axis} drive", "", f"{drive.v_amplitude:.6g} V peak to peak, turns at {drive.turn:g} of the period"),
            row(f"{axis} imaged", "", f"{_imaged(entry)} of the line, {entry.fourier.directions}"),
            row(f"{axis} codes", "", _codes(subject, axis)),
            *_table(axis, entry),
        ]
        if planned is not None:
            rows += _settles(planned.plan.x if axis == "x" else planned.plan.y, subject)
    if planned is not None:
        rows += [row("" if i else "chosen", "", text) for i, text in enumerate(planned.setup.choices)]
    y = subject.manifest.axes.y
    if y.resting:
        rows.append(row("y", "off", f"rests at {y.drive.v_offset:.6g} V, code {y.output.offset_code}"))
    return Section("request", "Requested and played", (Grid("", ("", "requested", "played"), tuple(rows)),))


def _imaged(entry: ManifestAxis) -> str:
    """Return the imaged part of the line: of a sine as the scan file has it, in shares of the way."""
    low, high = entry.fourier.imaged or entry.fourier.window
    return f"{low:g}..{high:g}"


def schedule_hz(subject: Subject) -> float:
    """Return the requested line rate in Hz."""
    return subject.manifest.axes.x.line.requested_hz


def image_text(sequence: ManifestSequence) -> str:
    """Return the pixels and lines of an image, in words."""
    up, down = sequence.up_lines[1], sequence.down_lines[1]
    lines = f"{up} lines" + (f" up and {down} down" if down else "")
    both = "trace and retrace" if sequence.backward_ticks[1] else "trace alone"
    return f"{sequence.pixels} pixels x {lines}, {both}, after {sequence.settle_lines} lines to settle"


def _codes(subject: Subject, axis: str) -> str:
    entry = dict(subject.axes)[axis]  # type: ignore[index]
    certificate, output = entry.certificate, entry.output
    if certificate.lowest_code is None or certificate.highest_code is None:
        return f"{output.dac_bits} bits"
    share = 100.0 * (certificate.highest_code - certificate.lowest_code + 1) / (1 << output.dac_bits)
    codes = f"{certificate.lowest_code}..{certificate.highest_code}"
    return f"{codes}, {share:.3g} % of the converter's {output.dac_bits} bits"


def _table(axis: str, entry: ManifestAxis) -> list[tuple[TableCell, ...]]:
    """List the properties of a table that the build chose."""
    table = entry.table
    if table.asked is None:
        return []
    request = f"the least memory within {table.asked.max_error_lsb:g} LSB"
    if table.asked.max_instructions is not None:
        request += f" and {table.asked.max_instructions:g} instructions on {table.asked.processor}"
    played = f"{len(table.words)} words of {table.bits} bits, {table.mode}: {len(table.words) * table.bits} bits"
    return [row(f"{axis} table", request, played)]


def _settles(line: LinePlan, subject: Subject) -> list[tuple[TableCell, ...]]:
    planned = subject.planned
    settles = None if planned is None else settling(line.axis, line.drive, planned.plan.schedule)
    return [] if settles is None else [row(f"{line.axis} settles", "", "; ".join(settling_text(settles)))]


def verification(subject: Subject) -> Section:
    """Return the checks of a record, or how to get one."""
    return record_section(subject.verified, subject.digest)


def record_section(record: VerifyRecord | None, digest: str) -> Section:
    """Return the checks of a record of verify beside a build whose manifest has this SHA-256, or how to get one."""
    title = "Verification"
    if record is None:
        text = "No record was given. `tablegen verify DIR --junit verify.xml` makes one, `tablegen report --verified "
        return Section("verify", title, (Paragraph(text + "verify.xml` shows it here."),))
    same = record.digest == digest
    which = Paragraph("The record is of this very build.", "good")
    if not same:
        why = "is of another build" if record.digest else "does not say of which build it is"
        which = Paragraph(f"\u2717 The record {why}: it says nothing about this one. Verify again.", "bad")
    rows = []
    for check in record.checks:
        cell = TableCell("\u2713 passed", "good") if check.exercised else TableCell("not exercised", "quiet")
        if check.failure:
            cell = TableCell(f"\u2717 {check.failure}", "bad")
        rows.append(row(check.name, cell))
    failed = sum(bool(check.failure) for check in record.checks)
    caption = f"{len(rows)} checks, {failed or 'none'} failed"
    return Section("verify", title, (which, Grid(caption, ("check", ""), tuple(rows), folded=not failed)))


def files(subject: Subject) -> Section:
    """Return every file with its SHA-256."""
    manifest = subject.manifest
    models = [
        row(f"{axis}: {name}", TableCell(digest, "quiet"), "")
        for axis, entry in subject.axes
        for name, digest in (entry.drive.model_files or {}).items()
    ]
    origin = f"made by tablegen {manifest.tablegen}; formats {', '.join(manifest.formats) or 'c, verilog'}"
    return file_section(manifest.hash, origin, subject.files, models)


def file_section(
    plan_hash: str, origin: str, states: Sequence[FileState], more: Sequence[tuple[TableCell, ...]] = ()
) -> Section:
    """Return files with their SHA-256 below the hash of the plan and how they were made."""
    rows = [
        row(
            state.name,
            TableCell(state.sha256, "quiet"),
            TableCell(f"\u2717 {state.wrong}", "bad") if state.wrong else TableCell("", ""),
        )
        for state in states
    ]
    what = Bullets((TableCell(f"plan {plan_hash}"), TableCell(origin)))
    wrong = any(state.wrong for state in states)
    return Section(
        "files",
        "Files",
        (what, Grid(f"{len(rows)} files with their SHA-256", ("file", "SHA-256", ""), (*rows, *more), not wrong)),
    )
