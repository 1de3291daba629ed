"""Correct images of a scan at an angle: the frame that was played, on the operators of a scanner file."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import replace

from tablegen.base.input_errors import Unphysical
from tablegen.base.reading import CONFIGURATION, file_sha256
from tablegen.certificate.turned_errors import frame_codes, played_position
from tablegen.config.load import Setup
from tablegen.correction.corrected_images import corrected
from tablegen.correction.frame_distortion import FrameDistortion
from tablegen.correction.old_scan import OldScan
from tablegen.correction.scan_images import Images
from tablegen.correction.settled_scan import ScannerModel
from tablegen.correction.straight import StraightScan
from tablegen.device.schedule import Window
from tablegen.numerics.arrays import Floats
from tablegen.planning.known_axis import KnownAxis
from tablegen.planning.turned_plan import TurnedPlan, make_turned_plan, piezo_in_time

_MOST_SAMPLES = 512  # of a line


def by_turned_scan(images: Images, setup: Setup, scan: Path, model: ScannerModel, conditions: OldScan) -> StraightScan:
    """Correct an image of a scan at an angle, on coupled axes or with drift.

    Columns and rows of the picture are along the lines and across them, as the scan file wants them.

    Raises
    ------
    Rejected
        If a file is faulty, or an axis of the scanner has no operator.
    Unphysical
        If the image has another number of rows than the scan, or the scanner cannot have taken it.
    """
    plan = make_turned_plan(setup)
    part = plan.schedule.down if conditions.back else plan.schedule.up
    rows, columns = images.shape
    if rows != part.count:
        raise Unphysical(f"{rows} rows, and {scan.name} images {part.count} lines a frame; give a whole frame of it")
    x_nm, y_nm = _positions(setup, plan, model)
    ways = tuple(sorted(set(images.forward), reverse=True))
    distortion = _distortion(plan, model, (x_nm, y_nm), part, columns, ways, conditions)
    size = distortion.x_range[1] - distortion.x_range[0], distortion.y_range[1] - distortion.y_range[0]
    path = model.folder / Path(model.file.name).name
    angle_deg = plan.geometry.angle_deg
    record: dict[str, Any] = {
        "by": "scanner file",
        "sources": images.sources,
        **images.angle,
        **images.timing,
        **images.missing,
        "scanner": {"file": path.name, "sha256": file_sha256(path, CONFIGURATION)},
        "scan": {"file": scan.name, "sha256": file_sha256(scan, CONFIGURATION), "angle_deg": angle_deg},
    }
    for axis in plan.axes:
        table = (model.scanner.x if axis.axis == "x" else model.scanner.y).hysteresis
        assert table is not None  # an axis without an operator was refused
        volts = axis.converter.v_zero + axis.converter.v_per_code * axis.program.frame()
        low, high = float(np.min(volts)), float(np.max(volts))
        names, digests = table.files(), table.contents(model.folder)
        record[axis.axis] = {
            "model": table.model(),
            "drive_v": round(high - low, 6),
            "offset_v": round(0.5 * (high + low), 6),
            "rate_hz": round(float(plan.schedule.line_rate), 9),
            "turn": axis.motion.fast_turn,
            "window": list(axis.motion.fast_window),
            "files": [{"file": Path(one).name, "sha256": digest} for one, digest in zip(names, digests, strict=True)],
        }
    record["lines"] = plan.schedule.lines
    return corrected(images, distortion, size, record)


def _positions(setup: Setup, plan: TurnedPlan, model: ScannerModel) -> tuple[Floats, Floats]:
    """Return the positions of both axes over a frame on the operators of a scanner file, (lines, samples) each."""
    schedule = plan.schedule
    ticks = np.arange(0, schedule.ticks, -(-schedule.ticks // _MOST_SAMPLES))
    positions = []
    for axis in plan.axes:
        known = KnownAxis.of(model.scanner, model.file, model.folder, axis.axis)
        its = model.scanner.x if axis.axis == "x" else model.scanner.y
        piezo = piezo_in_time(known, its, float(schedule.line_rate), float(schedule.frame_rate))
        codes, motion = frame_codes(axis, ticks), axis.motion
        planned = setup.scanner.x if axis.axis == "x" else setup.scanner.y
        assert its.hysteresis is not None  # an axis without an operator was refused
        assert planned.hysteresis is not None
        if its.hysteresis.contents(model.folder) != planned.hysteresis.contents(setup.scanner_folder):
            motion = dataclasses.replace(motion, layer=None)  # it was learnt beside another operator
        played = replace(axis, known=known, piezo=piezo, motion=motion)
        positions.append(played_position(played, codes, ticks, schedule.ticks))
    return positions[0], positions[1]


def _distortion(
    plan: TurnedPlan,
    model: ScannerModel,
    positions: tuple[Floats, Floats],
    part: Window,
    columns: int,
    ways: tuple[bool, ...],
    conditions: OldScan,
) -> FrameDistortion:
    """Return the places of all pixels along the lines and across them, 0 at the left edge and at the first row."""
    motion, coupling = plan.x.motion, model.scanner.coupling
    geometry = replace(plan.geometry, x_per_y=coupling.x_per_y, y_per_x=coupling.y_per_x)
    ticks, samples = plan.schedule.ticks, positions[0].shape[1]
    stride = -(-ticks // samples)
    at = (np.arange(motion.lines)[:, None] + (stride * np.arange(samples) + 0.5) / ticks).ravel()
    low, high = motion.fast_window
    place = low + (high - low) * (np.arange(columns) + 0.5) / columns
    late = conditions.delay_pixels * (high - low) / columns
    numbers = part.first + np.arange(part.count)
    places, times = {}, {}
    for forward in ways:
        way = (place if forward else 1.0 - place) - late
        time = motion.fast_turn * way if forward else motion.fast_turn + (1.0 - motion.fast_turn) * way
        lines = numbers[:, None] + time
        x, y = (np.interp(lines, at, one.ravel(), period=float(motion.lines)) for one in positions)
        along, across = geometry.on_the_sample(x, y, lines / motion.line_rate_hz)
        places[forward], times[forward] = (along, -across if conditions.back else across), time
    whole = FrameDistortion.of(places, times)
    whole.check()
    left, top = whole.x_range[0], whole.y_range[0]
    return FrameDistortion.of({way: (u - left, v - top) for way, (u, v) in places.items()}, times)
