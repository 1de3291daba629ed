"""The terminal output of `tablegen correct`."""

from typing import Any

from tablegen.base.warnings import Finding, worst_first
from tablegen.correction.scan_images import Images
from tablegen.correction.straight import StraightScan
from tablegen.images.missing import missing_text
from tablegen.images.scan_angle import angle_text

_WORSE = 1.05  # times the distance before: the correction does not fit the image
_OTHER = 1.4  # times the size of the file: another size
_SAME_ANGLE_DEG = 1.0
_FEW_PERIODS = 8.0  # in the line
_NOT_MOVED = 1e-9  # pixels: rounding
_FAR = 1.0  # pixels of mismatch of trace and retrace that need a finding


def correct_text(scan: StraightScan, images: Images) -> list[str]:
    """Format a correction, in lines of at most 120 characters, except for notes."""
    rows, columns = images.shape
    record = scan.record
    files = ", ".join(dict.fromkeys(one.file for one in images.channels))
    count = len(images.channels)
    lines = [f"{files}: {columns} x {rows} pixels, {count} channel{'s' if count > 1 else ''}"]
    if "affine" in record:
        lines += _affine_lines(record)
    elif record["by"].startswith("fit"):
        periods = ", ".join(f"{value:.4g}" for value in record["periods_in_the_line"])
        lines.append(
            f"fit           {periods} periods in the line; {100.0 * record['explained']:.3g} % of the contrast"
        )
        lines.append(f"slow axis     {record['slow_axis']}")
    else:
        for axis in ("x", "y"):
            one = record[axis]
            its = "".join(f" {file['file']}" for file in one.get("files", []))
            lines.append(
                f"{axis}             {one['model']}{its}, {one['drive_v']:.6g} V at {one['offset_v']:.6g} V, "
                f"{one['rate_hz']:.4g} Hz, turn {one['turn']:g}"
            )
    lines.append(f"size          {_size(scan.size_nm)}; the file has {_size(_of_file(images))}")
    x, y = (value if value > _NOT_MOVED else 0.0 for value in scan.moved_pixels)
    lines.append(
        f"moved         up to {x:.3g} pixels ({100.0 * x / columns:.3g} %) along x, "
        f"{y:.3g} pixels ({100.0 * y / rows:.3g} %) along y"
    )
    lines += _agreement(scan)
    if scan.lattice is not None:
        across, along = record["lattice_off_percent"]
        of_y = "" if scan.lattice.y is None else f", {along:.2g} % along y"
        lines.append(f"lattice       off a perfect one by up to {across:.2g} % along x{of_y}, after")
    return [*lines, *(finding.line for finding in _findings(scan, images))]


def _affine_lines(record: dict[str, Any]) -> list[str]:
    """Return the lines of an affine map: the cell of the recorded image, the map, and what it leaves."""
    affine, cell = record["affine"], record["affine"]["cell_nm"]
    sides = " x ".join(_shown(cell[side]) for side in ("a", "b"))
    kind, constant = record["lattice"], record["lattice_nm"]
    sample = f"{kind}, {constant:.6g} nm" if constant else f"{kind}, of unknown constant: the width is that of the file"
    lines = [
        f"cell          {sides} nm at {_shown(cell['angle_deg'])} degrees as recorded",
        f"sample        {sample}",
        f"affine map    width x {_shown(affine['width_factor'])}, height x {_shown(affine['height_factor'])}, last row "
        f"{_shown(affine['shear_nm'])} nm to the right",
    ]
    if "retrace_shift_pixels" in affine:
        x, y = affine["retrace_shift_pixels"]
        moved = f"{x:.3g} pixels along x, {y:.3g} along y from the trace; each was moved by half of it"
        lines.append(f"retrace       {moved}")
    for direction, bows in affine["bows_percent"].items():
        line, rows_x, rows_y = (f"{one['value']:.2g} +- {one['standard_error']:.2g} %" for one in bows.values())
        lines.append(f"bow left      {direction}: lines {line}; rows {rows_x} along x, {rows_y} along y")
    return lines


def _shown(number: dict[str, float]) -> str:
    value, error = number["value"], number["standard_error"]
    return f"{value:.4g} +- {error:.2g}" if error else f"{value:.4g}"


def _size(size: tuple[float, float] | None) -> str:
    return "no size" if size is None else f"{size[0]:.6g} x {size[1]:.6g} nm"


def _of_file(images: Images) -> tuple[float, float] | None:
    first = images.first
    return None if first.width_nm is None or first.height_nm is None else (first.width_nm, first.height_nm)


def _agreement(scan: StraightScan) -> list[str]:
    if scan.agreement is None:
        return ["trace-retrace  there is no retrace to check this correction against"]
    before, after = scan.agreement.difference
    lines = [f"trace-retrace  differ by {100.0 * before:.3g} % of the contrast before, {100.0 * after:.3g} % after"]
    worst = scan.agreement.worst
    if worst is None:
        lines.append("               have too little in common to be registered")
    else:
        lines.append(f"               are up to {worst[0]:.3g} pixels apart before, {worst[1]:.2g} after")
    return lines


def _by_file(scan: StraightScan) -> list[Finding]:
    """Return what the correction took from the image file: the timing of the line, and a retrace without its trace."""
    record, notes = scan.record, []
    if record.get("retrace_alone"):
        text = "the file has the retrace alone; it was fitted as the trace of the mirror image, and turned back"
        notes.append(Finding("note", 0.0, text))
    used = record.get("x", record)
    turn, window = record.get("file_turn"), record.get("file_window")
    timing = []
    if turn is not None and turn != 0.5 and used["turn"] == turn:
        timing.append(f"turn {turn:.4g}")
    if window is not None and tuple(window) != (0.0, 1.0) and tuple(used["window"]) == tuple(window):
        timing.append("window {:.4g} to {:.4g}".format(*window))
    if timing:
        text = f"{' and '.join(timing)}, as the image file states; the drive is that of the whole sweep"
        notes.append(Finding("note", 0.0, text))
    return notes


def _by_affine_map(scan: StraightScan) -> list[Finding]:
    """Return what an affine map leaves."""
    if "affine" not in scan.record:
        return []
    text = "the affine map leaves the displacement within lines and between rows, as of hysteresis, as it was"
    notes = [Finding("spoils", 0.0, text)]
    if not scan.record["affine"]["sheared"]:
        notes.append(Finding("note", 0.0, "shear and aspect are within their errors; they were not applied"))
    return notes


def _by_angle(scan: StraightScan) -> list[Finding]:
    """Return what the scan angle that the file states is to a correction by a scanner or a scan file."""
    angle = scan.record.get("scan_angle_deg")
    if angle is None or scan.record.get("affine") is not None or scan.record["by"].startswith("fit"):
        return []
    played = scan.record.get("scan", {}).get("angle_deg")
    if played is None:
        text = f"{angle_text(angle)}; the correction took [x] of the scanner file for the fast axis"
        return [Finding("spoils", 0.0, f"{text}. With --fit no axis is needed")]
    apart = (abs((angle - one + 180.0) % 360.0 - 180.0) for one in (played, -played))  # signs differ by instrument
    if min(apart) <= _SAME_ANGLE_DEG:
        return []
    text = f"{angle_text(angle)}, and the scan file has {played:g} degrees; is the image of this scan?"
    return [Finding("spoils", 0.0, text)]


def _findings(scan: StraightScan, images: Images) -> list[Finding]:
    """Return the findings, the worst first; percentages are of the picture."""
    notes = [Finding("note", 0.0, f"left out: {text}") for text in images.left_out]
    notes += _by_angle(scan)
    notes += _by_file(scan)
    if scan.record.get("missing"):
        text = missing_text([images.channels[i].heights for i in images.reference])
        text += ", and no corrected pixel" if scan.record["by"].startswith("fit") else "; a missing pixel stays missing"
        notes.append(Finding("note", 0.0, text))
    if imaged := scan.record.get("imaged_rows"):
        text = f"rows {imaged[0] + 1} to {imaged[1]} have data; the picture is of these"
        notes.append(Finding("note", 0.0, text))
    notes += _by_affine_map(scan)
    if straight := scan.record.get("not_displaced"):
        text = f"the displacement along {' and '.join(straight)} is within its errors; it was not applied"
        notes.append(Finding("note", 0.0, text))
    first, last = scan.distortion.left_out
    rows, columns = images.shape
    if first or last:
        text = f"{first + last} rows are from the end of the slow axis's way back, after its turn; they are left out"
        notes.append(Finding("expect", 100.0 * (first + last) / rows, text))
    file_size = _of_file(images)
    if file_size is not None and scan.size_nm is not None:
        ratio = scan.size_nm[0] / file_size[0]
        if not 1.0 / _OTHER < ratio < _OTHER:
            text = "the file has quite another size; is the drive that of this image?"
            notes.append(Finding("spoils", 100.0 * abs(ratio - 1.0), text))
    periods = scan.record.get("periods_in_the_line")
    if periods is not None and max(map(abs, periods)) < _FEW_PERIODS:
        text = "with so few periods the waves, and with them the line, are poorly determined; image more of them"
        notes.append(Finding("spoils", 0.0, text))
    agreement = scan.agreement
    if agreement is not None:
        worst = agreement.worst
        offset_percent = 0.0 if worst is None else 100.0 * worst[1] / columns
        if agreement.difference[1] > _WORSE * agreement.difference[0]:
            text = (
                "trace and retrace differ more than before; are drive and scanner file those of this image, and "
                "are trace and retrace not exchanged or mirrored?"
            )
            notes.append(Finding("limit", offset_percent, text))
        elif worst is not None and worst[1] > _FAR:
            text = "trace and retrace are still apart; are drive, offset, rate, turn and window those of the image?"
            text = "trace and retrace are still apart: the lines are bent" if "affine" in scan.record else text
            notes.append(Finding("spoils", offset_percent, text))
    return worst_first(notes)
