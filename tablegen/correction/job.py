"""From files of images to a scan put straight: which channels, by what, and what the record says of it."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tablegen.base.input_errors import Problem, Rejected, Unphysical
from tablegen.base.reading import CONFIGURATION, file_sha256
from tablegen.compensation import models
from tablegen.config.load import load, load_scanner
from tablegen.correction.agreement import difference
from tablegen.correction.distortion import Distortion, Resampler
from tablegen.correction.fit_checks import check_agreement, check_cell, check_moves
from tablegen.correction.periodic_scan import PeriodicScan, periodic_scan
from tablegen.correction.settled_scan import AxisScan, ScannerModel, lines_of, scanner_distortion, triangle
from tablegen.correction.straight import ScanPicture, StraightScan, put_straight
from tablegen.images.files import ScanImage, channels_of, read_channels, read_image
from tablegen.images.pair_checks import check_heights, check_pair, check_size
from tablegen.images.scan_angle import is_turned
from tablegen.numerics.arrays import Floats
from tablegen.planning.laws import size_law_of
from tablegen.planning.line_plan import LinePlan, make_plan

_ALIKE = 0.3  # of the contrast: trace and retrace that differ by less are what they are said to be
_BETTER = 0.6  # times the difference: how much better mirrored or exchanged images have to agree
_OLD_TURN = 0.5  # of the slow axis of an instrument that scans up, then down


@dataclass(frozen=True, kw_only=True)
class OldAxis:
    """How an axis was driven; what is None is not known, and taken as ``Conditions`` says."""

    size_v: float | None = None
    size_nm: float | None = None
    offset_v: float | None = None
    turn: float = 0.5
    window: tuple[float, float] = (0.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class OldScan:
    """How a scan was taken: volts at the piezo, peak to peak, of a triangle on each axis.

    Instead of ``size_v`` the size in nm that a scan file would have: its volts come from the scanner file. The offset
    is in the middle of the driver's range unless given. The slow axis is driven as the fast one unless given; ``lines``
    are those of its period, ``back`` that the rows are of its way back. Columns are ``delay_pixels`` late.
    """

    x: OldAxis = field(default_factory=OldAxis)
    y: OldAxis = field(default_factory=lambda: OldAxis(turn=_OLD_TURN))
    rate_hz: float | None = None
    lines: int | None = None
    back: bool = False
    delay_pixels: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Choice:
    """Which images of the files, and how they are stored; see ``tablegen calibrate images``."""

    channel: str | None = None
    retrace_channel: str | None = None
    retrace_mirrored: bool = False
    frame: int | None = None


@dataclass(frozen=True, eq=False)
class Images:
    """All channels of a scan, which of them are judged, trace first, and what was left out and why."""

    channels: tuple[ScanImage, ...]
    forward: tuple[bool, ...]
    judged: tuple[int, ...]
    left_out: tuple[str, ...]
    mirrored: bool

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        rows, columns = self.channels[0].heights.shape
        return rows, columns

    @property
    def first(self) -> ScanImage:
        """The trace that is judged, or whatever there is."""
        return self.channels[self.judged[0]]

    def heights(self, number: int) -> Floats:
        """Of a channel, left on the left."""
        found = self.channels[number].heights
        mirrored = self.mirrored and not self.forward[number]
        return np.ascontiguousarray(found[:, ::-1]) if mirrored else found

    @property
    def pictures(self) -> list[ScanPicture]:
        """All of them."""
        return [
            ScanPicture(one.channel, forward, self.heights(i), one.unit, one.first_row == "bottom")
            for i, (one, forward) in enumerate(zip(self.channels, self.forward, strict=True))
        ]

    @property
    def sources(self) -> list[dict[str, str]]:
        """The files, for the record."""
        return [
            {"file": source.name, "sha256": source.sha256}
            for source in dict.fromkeys(channel.source for channel in self.channels)
        ]

    @property
    def angle(self) -> dict[str, float]:
        """The scan angle in degrees, for the record; empty where the file states none, or 0."""
        angle = self.first.angle_deg
        return {"scan_angle_deg": round(angle, 4)} if angle is not None and is_turned(self.first) else {}


def read_scan(trace: Path, retrace: Path | None, choice: Choice) -> Images:
    """Read all channels of one file, or of one for each direction.

    Raises
    ------
    Rejected
        If a file cannot be read or has no such channels.
    """
    groups: list[tuple[list[ScanImage], bool]] = []
    left_out: list[str] = []
    for path, forward in ((trace, True), (retrace, False)):
        if path is not None:
            found, without = _channels(path, choice.frame)
            groups.append((found, forward))
            left_out += without
    channels = [one for group, _ in groups for one in group]
    ways = [one.direction != "retrace" if one.direction else way for group, way in groups for one in group]
    _check_exchange(groups)
    judged = _judged(channels, ways, choice, len(groups[0][0]))
    if judged[0] >= 0 and len(judged) == 2 and choice.retrace_channel is not None:
        ways[judged[1]] = False
    shape = channels[judged[0]].heights.shape
    for one in channels:
        if one.heights.shape != shape:
            sizes = " and ".join(f"{rows} x {columns}" for rows, columns in (shape, one.heights.shape))
            raise Rejected([Problem(one.file, 0, "", f"has {sizes} pixels; all channels must be of one scan")])
    return Images(tuple(channels), tuple(ways), judged, tuple(left_out), choice.retrace_mirrored)


def _channels(path: Path, frame: int | None) -> tuple[list[ScanImage], list[str]]:
    """All channels of a file that can be read, and why others cannot."""
    try:
        return read_channels(path, frame), []
    except Rejected as rejected:
        if len(channels := channels_of(path)) < 2:
            raise
        found, without = [], []
        for one in channels:
            try:
                found.append(read_image(path, str(one.number), frame=frame))
            except Rejected as reason:
                without += [str(problem) for problem in reason.problems]
        if not found:
            raise rejected from None
        return found, without


def _check_exchange(groups: Sequence[tuple[list[ScanImage], bool]]) -> None:
    """Where each direction has its own file, the names of channels must not say the contrary."""
    if len(groups) < 2:
        return
    for group, forward in groups:
        said = {one.direction for one in group} - {None}
        if said == {"retrace" if forward else "trace"}:
            have, need = ("retrace", "trace") if forward else ("trace", "retrace")
            why = f"its channels are the {have} by the file, and the {need} is needed here; are the files exchanged?"
            raise Rejected([Problem(group[0].file, 0, "", why)])


def _judged(channels: Sequence[ScanImage], ways: Sequence[bool], choice: Choice, first: int) -> tuple[int, ...]:
    """Return the trace and the retrace that are compared and fitted; one of them if there is no other."""

    def named(wanted: str, among: range, way: bool | None) -> int:
        found = [i for i in among if channels[i].channel == wanted and way in (None, ways[i])]
        found = found or [i for i in among if channels[i].signal == wanted and way in (None, ways[i])]
        found = found or [i for i in among if str(channels[i].number) == wanted]
        if len(found) != 1:
            there = ", ".join(f"{channels[i].number} ({channels[i].channel})" for i in among)
            why = f"has {'no' if not found else 'more than one'} channel '{wanted}'; there is {there}"
            raise Rejected([Problem(channels[among[0]].file, 0, "", why)])
        return found[0]

    everything = range(len(channels))
    whole = range(first) if first < len(channels) else everything
    rest = range(first, len(channels)) if first < len(channels) else everything
    if choice.channel is not None:
        trace = named(choice.channel, whole, True if any(ways[i] for i in whole) else None)
    else:
        ranked = sorted(whole, key=lambda i: (not ways[i], not _partners(channels, ways, i), not _height(channels[i])))
        trace = ranked[0]
    if choice.retrace_channel is not None:
        return trace, named(choice.retrace_channel, rest, None)
    partners = _partners(channels, ways, trace)
    return (trace, partners[0]) if partners else (trace,)


def _partners(channels: Sequence[ScanImage], ways: Sequence[bool], of: int) -> list[int]:
    """Channels of the other direction with the same signal; or the only one there is."""
    if not ways[of]:
        return []
    others = [i for i, way in enumerate(ways) if not way]
    same = [i for i in others if channels[i].signal == channels[of].signal]
    return same or (others if len(others) == 1 and sum(ways) == 1 else [])


def _height(channel: ScanImage) -> bool:
    return any(word in channel.channel.lower() for word in ("height", "topo", "zsensor", "z sensor"))


def by_scanner(images: Images, scanner: Path, taken: OldScan) -> StraightScan:
    """Correct images by a scanner file.

    Raises
    ------
    Rejected
        If the scanner file is faulty.
    Unphysical
        If the scan cannot have been taken so.
    """
    model = _model(scanner)
    rate_hz = taken.rate_hz or images.first.line_rate_hz
    if rate_hz is None:
        raise Unphysical("the file does not say at which line rate it was taken; give --rate-hz")
    rows, _ = images.shape
    x = _axis(model, "x", taken.x, rate_hz)
    slow = taken.y
    if slow.size_v is None and slow.size_nm is None:
        slow = replace(slow, size_v=taken.x.size_v, size_nm=taken.x.size_nm)
    if slow.offset_v is None:
        slow = replace(slow, offset_v=taken.x.offset_v)
    y = _axis(model, "y", slow, rate_hz)
    lines = taken.lines or lines_of(rows, y, taken.back)
    y = replace(y, rate_hz=rate_hz / lines)
    return _scanned(images, model, x, y, lines, taken, {})


def by_scan_file(images: Images, scan: Path, scanner: Path | None, taken: OldScan) -> StraightScan:
    """Correct an image of a build: the drive is that of the scan file, the scanner its own unless given."""
    setup = load(scan)
    plan = make_plan(setup)
    model = (
        ScannerModel(setup.scanner, setup.scanner_file, setup.scanner_folder) if scanner is None else _model(scanner)
    )
    if plan.y.drive.resting:
        raise Rejected([setup.scan_file.problem("y.motion", "'off' makes a line scan, whose rows are one line of x")])
    part = plan.schedule.down if taken.back else plan.schedule.up
    rows, _ = images.shape
    if rows != part.count:
        raise Unphysical(
            f"{rows} rows, and {scan.name} images {part.count} lines a frame; give the frame, or how it was taken "
            "as options"
        )
    x, y = (_played(line) for line in (plan.x, plan.y))
    y = replace(y, window=_rows_window(part.first / plan.schedule.lines, y, taken.back))
    how = {"scan": {"file": scan.name, "sha256": file_sha256(scan, CONFIGURATION)}}
    return _scanned(images, model, x, y, plan.schedule.lines, taken, how)


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


def _axis(model: ScannerModel, axis: Literal["x", "y"], taken: OldAxis, rate_hz: float) -> AxisScan:
    """Return the scan of an axis that plays a triangle."""
    driver = model.scanner.driver
    size_v = taken.size_v
    if size_v is None and taken.size_nm is not None:
        size_v = driver.span * size_law_of(getattr(model.scanner, axis).size, driver).voltage(taken.size_nm)
    if size_v is None:
        raise Unphysical(
            "the drive is not known; give --size-v, the scan voltage at the piezo, or --size-nm, or --scan"
        )
    offset_v = driver.middle if taken.offset_v is None else taken.offset_v
    return AxisScan(triangle(size_v, offset_v, taken.turn), rate_hz, taken.turn, taken.window)


def _scanned(
    images: Images, model: ScannerModel, x: AxisScan, y: AxisScan, lines: int, taken: OldScan, how: dict[str, Any]
) -> StraightScan:
    rows, columns = images.shape
    ways = tuple(sorted(set(images.forward), reverse=True))
    found = scanner_distortion(model, x, y, rows, columns, lines, taken.back, ways, taken.delay_pixels)
    size = found.x_range[1] - found.x_range[0], found.y_range[1] - found.y_range[0]
    path = model.folder / Path(model.file.name).name
    record: dict[str, Any] = {
        "by": "scanner file",
        "sources": images.sources,
        **images.angle,
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
    return _made(images, found, size, record)


def by_fit(
    images: Images, taken: OldScan, pitch_nm: float | None = None, lattice_nm: float | None = None
) -> tuple[StraightScan, PeriodicScan]:
    """Correct images by a fit to a periodic sample; return the fit too.

    Raises ``Unphysical`` where there is no fit, or where the image does not support the correction: another cell would
    do as well, the displacement is too large, or trace and retrace do not agree better.
    """
    if not images.forward[images.judged[0]]:
        raise Unphysical("is a retrace by the file; a fit needs the trace")
    trace, retrace = (*(images.channels[i].heights for i in images.judged), None)[:2]
    if retrace is None and not all(images.forward):
        raise Unphysical("has channels of the retrace, and none that is the judged one's; give --retrace-channel")
    assert trace is not None
    fit = periodic_scan(trace, retrace, taken.x.turn, taken.x.window, images.mirrored, taken.delay_pixels)
    first, (rows, columns) = images.first, images.shape
    size: tuple[float, float] | None = None
    found: Distortion = fit.distortion
    record: dict[str, Any] = {"by": "fit to a periodic sample", "sources": images.sources, **images.angle}
    if lattice_nm is not None or pitch_nm is not None:
        if lattice_nm is not None:
            found = fit.of_lattice(lattice_nm)
            record["lattice_nm"] = lattice_nm
        else:
            known = first.width_nm is not None and first.height_nm is not None
            aspect = (first.height_nm or 1.0) / (first.width_nm or 1.0) if known else rows / columns
            found = fit.of_pitch(pitch_nm or 0.0, aspect)
            record["pitch_nm"] = pitch_nm
        size = found.x_range[1] - found.x_range[0], found.y_range[1] - found.y_range[0]
        if first.width_nm is not None:
            check_size(size[0], first.width_nm, "the file")
        if first.height_nm is not None and fit.tells_y and lattice_nm is not None:
            check_size(size[1], first.height_nm, "the file", "frame")
    elif first.width_nm is not None and first.height_nm is not None:
        size = first.width_nm, first.height_nm
    record |= {
        "turn": taken.x.turn,
        "window": list(taken.x.window),
        "periods_in_the_line": [round(float(q), 4) for q in fit.waves[:, 0]],
        "explained": round(fit.explained, 6),
        "slow_axis": "fitted" if fit.tells_y else "as taken: a grating does not tell it",
    }
    scan = _made(images, found, size, record)
    check_moves(found)
    check_cell(fit, images.heights(images.judged[0]), True)
    check_agreement(scan.agreement)
    return scan, fit


def check_order(images: Images, distortion: Distortion) -> None:
    """Raise ``Unphysical`` where trace and retrace agree far better mirrored, or exchanged.

    Each of both is put straight as the other one would be, and compared.
    """
    if len(images.judged) < 2:
        return
    trace, retrace = (images.heights(i) for i in images.judged)
    ways = [Resampler.of(distortion, way) for way in (True, False)]

    def left(one: Floats, other: Floats) -> float:
        return difference(ways[0](one), ways[1](other))

    given = left(trace, retrace)
    if given < _ALIKE:
        return
    turned = np.ascontiguousarray(retrace[:, ::-1])
    if left(trace, turned) < _BETTER * given:
        advice = "leave --retrace-mirrored out" if images.mirrored else "give --retrace-mirrored"
        raise Unphysical(f"the retrace agrees with the trace only when it is mirrored; {advice}")
    if left(retrace, trace) < _BETTER * given:
        raise Unphysical(
            "trace and retrace agree only when they are exchanged; is the retrace the first of both files?"
        )


def _made(images: Images, found: Distortion, size: tuple[float, float] | None, record: dict[str, Any]) -> StraightScan:
    judged = [images.heights(i) for i in images.judged]
    if len(judged) == 2:
        check_pair(judged[0], judged[1])
    else:
        check_heights("image", judged[0])
    check_order(images, found)
    if images.left_out:
        record["left_out"] = list(images.left_out)
    return put_straight(images.pictures, found, size, images.judged, record)
