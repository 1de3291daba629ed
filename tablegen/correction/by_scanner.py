"""Correct images by the model of a scanner file, with the drive that is known."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tablegen.base.input_errors import Rejected, Unphysical
from tablegen.base.reading import CONFIGURATION, file_sha256
from tablegen.compensation import models
from tablegen.config.load import load, load_scanner
from tablegen.correction.corrected_images import corrected
from tablegen.correction.old_scan import OldAxis, OldScan
from tablegen.correction.scan_images import Images, timed
from tablegen.correction.settled_scan import AxisScan, ScannerModel, lines_of, scanner_distortion, triangle
from tablegen.correction.straight import StraightScan
from tablegen.correction.turned_scan import by_turned_scan
from tablegen.numerics.arrays import Floats
from tablegen.planning.laws import size_law_of
from tablegen.planning.line_plan import LinePlan, make_straight_plan

_SINE = (
    "the pixels of a sine are at equal steps of the position that its operator predicted, and are not evenly in time, "
    "as this correction takes them; correct the image by its own lattice, with --fit"
)


def by_scanner(images: Images, scanner: Path, conditions: OldScan) -> StraightScan:
    """Correct images by a scanner file.

    Raises
    ------
    Rejected
        If the scanner file is faulty.
    Unphysical
        If the drive or the line rate is unknown, or such a scan is impossible.
    """
    model = _model(scanner)
    rate_hz = conditions.rate_hz or images.first.line_rate_hz
    if rate_hz is None:
        raise Unphysical("the file does not say at which line rate it was taken; give --rate-hz")
    rows, _ = images.shape
    conditions = timed(images, conditions)
    x = _axis(model, "x", conditions.x, rate_hz)
    slow = conditions.y
    if slow.size_v is None and slow.size_nm is None:
        slow = replace(slow, size_v=conditions.x.size_v, size_nm=conditions.x.size_nm)
    if slow.offset_v is None:
        slow = replace(slow, offset_v=conditions.x.offset_v)
    y = _axis(model, "y", slow, rate_hz)
    lines = conditions.lines or lines_of(rows, y, conditions.back)
    y = replace(y, rate_hz=rate_hz / lines)
    return _scanned(images, model, x, y, lines, conditions, {})


def by_scan_file(images: Images, scan: Path, scanner: Path | None, conditions: OldScan) -> StraightScan:
    """Correct an image of a build: the drive is that of the scan file, the scanner its own unless given.

    Raises
    ------
    Rejected
        If a file is faulty, or the scan is a line scan.
    Unphysical
        If the image has another number of rows than the scan.
    """
    setup = load(scan)
    model = (
        ScannerModel(setup.scanner, setup.scanner_file, setup.scanner_folder) if scanner is None else _model(scanner)
    )
    if setup.mixes_motions:
        return by_turned_scan(images, setup, scan, model, conditions)
    plan = make_straight_plan(setup, _SINE)
    if plan.y.drive.resting:
        raise Rejected([setup.scan_file.problem("y.motion", "'off' makes a line scan, whose rows are one line of x")])
    part = plan.schedule.down if conditions.back else plan.schedule.up
    rows, _ = images.shape
    if rows != part.count:
        raise Unphysical(
            f"{rows} rows, and {scan.name} images {part.count} lines a frame; give the frame, or how it was taken "
            "as options"
        )
    x, y = (_played(line) for line in (plan.x, plan.y))
    y = replace(y, window=_rows_window(part.first / plan.schedule.lines, y, conditions.back))
    how = {"scan": {"file": scan.name, "sha256": file_sha256(scan, CONFIGURATION)}}
    return _scanned(images, model, x, y, plan.schedule.lines, conditions, how)


def _rows_window(first: float, y: AxisScan, back: bool) -> tuple[float, float]:
    """Return the window that begins with the first row, ``first`` of a period."""
    if back:
        return 0.0, 1.0 - (first - y.turn) / (1.0 - y.turn)
    return first / y.turn, 1.0


def _played(line: LinePlan) -> AxisScan:
    drive, series = line.drive, line.drive_series

    def volts(time: Floats) -> Floats:
        return np.asarray(drive.v_offset + drive.v_amplitude * (series.value(time) - 0.5), dtype=np.float64)

    return AxisScan(volts, float(line.rate), drive.turn, line.band_limit.window)


def _model(scanner: Path) -> ScannerModel:
    its, file = load_scanner(scanner)
    return ScannerModel(its, file, scanner.parent)


def _axis(model: ScannerModel, axis: Literal["x", "y"], conditions: OldAxis, rate_hz: float) -> AxisScan:
    """Return the scan of an axis that plays a triangle."""
    driver = model.scanner.driver
    size_v = conditions.size_v
    if size_v is None and conditions.size_nm is not None:
        size_v = driver.span * size_law_of(getattr(model.scanner, axis).size, driver).voltage(conditions.size_nm)
    if size_v is None:
        raise Unphysical(
            "the drive is not known; give --size-v, the scan voltage at the piezo, or --size-nm, or --scan"
        )
    offset_v = driver.middle if conditions.offset_v is None else conditions.offset_v
    turn, window = conditions.timing
    return AxisScan(triangle(size_v, offset_v, turn), rate_hz, turn, window)


def _scanned(
    images: Images, model: ScannerModel, x: AxisScan, y: AxisScan, lines: int, conditions: OldScan, how: dict[str, Any]
) -> StraightScan:
    rows, columns = images.shape
    ways = tuple(sorted(set(images.forward), reverse=True))
    distortion = scanner_distortion(model, x, y, rows, columns, lines, conditions.back, ways, conditions.delay_pixels)
    size = distortion.x_range[1] - distortion.x_range[0], distortion.y_range[1] - distortion.y_range[0]
    path = model.folder / Path(model.file.name).name
    record: dict[str, Any] = {
        "by": "scanner file",
        "sources": images.sources,
        **images.angle,
        **images.timing,
        **images.missing,
        "scanner": {"file": path.name, "sha256": file_sha256(path, CONFIGURATION)},
        **how,
    }
    for name, axis, scan in (("x", model.scanner.x, x), ("y", model.scanner.y, y)):
        drive = scan.drive()
        low, high = float(np.min(drive)), float(np.max(drive))
        one: dict[str, Any] = {
            "model": models.UNCOMPENSATED if axis.hysteresis is None else axis.hysteresis.model(),
            "drive_v": round(high - low, 6),
            "offset_v": round(0.5 * (high + low), 6),
            "rate_hz": round(scan.rate_hz, 9),
            "turn": scan.turn,
            "window": list(scan.window),
        }
        if axis.hysteresis is not None and axis.hysteresis.files():
            names, digests = axis.hysteresis.files(), axis.hysteresis.contents(model.folder)
            one["files"] = [
                {"file": Path(its).name, "sha256": digest} for its, digest in zip(names, digests, strict=True)
            ]
        record[name] = one
    record["lines"] = lines
    return corrected(images, distortion, size, record)
