"""From image files to a corrected scan: the choice of channels, the correction, and its record."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tablegen.base.input_errors import Problem, Rejected, Unphysical
from tablegen.base.reading import CONFIGURATION, file_sha256
from tablegen.compensation import models
from tablegen.config.load import load, load_scanner
from tablegen.correction.affine_map import ImplausibleMap, affine_map
from tablegen.correction.agreement import difference
from tablegen.correction.distortion import Distortion, Resampler
from tablegen.correction.fit_checks import (
    check_agreement,
    check_cell,
    check_constant,
    check_moves,
    check_sample_cell,
    check_straight_cell,
)
from tablegen.correction.lattice_bow import check_bows
from tablegen.correction.periodic_scan import PeriodicScan, periodic_scan
from tablegen.correction.settled_scan import AxisScan, ScannerModel, lines_of, scanner_distortion, triangle
from tablegen.correction.straight import ScanPicture, StraightScan, corrected_scan
from tablegen.images.files import ScanImage, channels_of, read_channels, read_image
from tablegen.images.formats.channel import Channel, Direction, channel_list, choose, partner, quote
from tablegen.images.frame_registration import registered
from tablegen.images.measured_cell import IDEAL_ANGLES
from tablegen.images.missing import count_missing, imaged_rows, valid_pixels
from tablegen.images.pair_checks import check_heights, check_pair, check_size
from tablegen.images.periodicity import NOTHING_PERIODIC, shows_nothing_periodic
from tablegen.images.scan_angle import is_turned
from tablegen.numerics.arrays import Floats
from tablegen.planning.laws import size_law_of
from tablegen.planning.line_plan import LinePlan, make_plan

_ALIKE = 0.3  # of the contrast: trace and retrace that differ by less are stored as declared
_BETTER = 0.6  # times the difference: the agreement that shows mirrored or exchanged images
_OLD_TURN = 0.5  # of an instrument that scans forward and back, up and down, at one speed
_WHOLE = 0.0, 1.0  # window of a whole sweep


@dataclass(frozen=True, kw_only=True)
class OldAxis:
    """The drive of an axis of an existing image; a value of None is unknown, and replaced as ``OldScan`` says.

    ``turn`` and ``window`` of x are then those of the file; where it does not say, 0.5 and the whole sweep.
    """

    size_v: float | None = None
    size_nm: float | None = None
    offset_v: float | None = None
    turn: float | None = None
    window: tuple[float, float] | None = None

    def with_defaults(self, turn: float | None = None, window: tuple[float, float] | None = None) -> "OldAxis":
        """Return the axis with turn and window: its own, else these, else those of a symmetric triangle."""
        turn = next((one for one in (self.turn, turn) if one is not None), _OLD_TURN)
        return replace(self, turn=turn, window=self.window or window or _WHOLE)

    @property
    def timing(self) -> tuple[float, tuple[float, float]]:
        """Turn and window, with those of a symmetric triangle where they are unknown."""
        return _OLD_TURN if self.turn is None else self.turn, self.window or _WHOLE


@dataclass(frozen=True, kw_only=True)
class OldScan:
    """The drive of an existing image: volts at the piezo, peak to peak, of a triangle on each axis.

    Instead of ``size_v`` the size in nm that a scan file would have: its volts come from the scanner file. The offset
    is in the middle of the driver's range unless given. The slow axis is driven as the fast one unless given; ``lines``
    are those of its period, ``back`` is true if the rows are of its way back. Columns are ``delay_pixels`` late.
    """

    x: OldAxis = field(default_factory=OldAxis)
    y: OldAxis = field(default_factory=OldAxis)
    rate_hz: float | None = None
    lines: int | None = None
    back: bool = False
    delay_pixels: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Choice:
    """The choice of images in the files, and how they are stored; see ``tablegen calibrate images``."""

    channel: str | None = None
    retrace_channel: str | None = None
    retrace_mirrored: bool = False
    frame: int | None = None
    frames: tuple[int, int] | None = None


@dataclass(frozen=True, eq=False)
class Images:
    """All channels of a scan.

    ``reference`` are the numbers of the channels that are fitted and compared, trace first; ``left_out`` are channels
    that cannot be read, with the reason. ``frames`` are the first one of a movie and the one after the last, of which
    the channels are the means; ``imaged_rows`` the first row with data and the one after the last, where others are
    left out, and ``frame_share`` the part of the frame that they are.
    """

    channels: tuple[ScanImage, ...]
    forward: tuple[bool, ...]
    reference: tuple[int, ...]
    left_out: tuple[str, ...]
    mirrored: bool
    frames: tuple[int, int] | None = None
    imaged_rows: tuple[int, int] | None = None
    frame_share: float = 1.0

    @property
    def shape(self) -> tuple[int, int]:
        """The number of rows and columns."""
        rows, columns = self.channels[0].heights.shape
        return rows, columns

    @property
    def first(self) -> ScanImage:
        """The trace of the reference channels, or the only image."""
        return self.channels[self.reference[0]]

    def heights(self, number: int) -> Floats:
        """Return the heights of a channel.

        Returns
        -------
        Heights in its unit, shape (rows, columns), the left end of the line first.
        """
        recorded = self.channels[number].heights
        mirrored = self.mirrored and not self.forward[number]
        return np.ascontiguousarray(recorded[:, ::-1]) if mirrored else recorded

    def of_imaged_rows(self) -> "Images":
        """Return the rows from the first with data in the reference to the last one, and their part of the height.

        Rows of the reference without data between them become NaN.

        Raises
        ------
        Unphysical
            If the reference has too little data.
        """
        rows, count = imaged_rows([self.channels[i].heights for i in self.reference]), self.shape[0]
        if rows == slice(0, count) and not self.missing:
            return self
        share = (rows.stop - rows.start) / count
        channels = []
        for i, one in enumerate(self.channels):
            heights = one.heights
            if i in self.reference:
                heights = np.where(valid_pixels(heights), heights, np.nan)
            height_nm = None if one.height_nm is None else share * one.height_nm
            channels.append(replace(one, heights=heights[rows], height_nm=height_nm))
        imaged = None if share == 1.0 else (rows.start, rows.stop)
        return replace(self, channels=tuple(channels), imaged_rows=imaged, frame_share=share)

    @property
    def missing(self) -> dict[str, Any]:
        """Missing rows and pixels of the reference, and the rows of the frame, for the record; empty if none is."""
        counts = [count_missing(self.channels[i].heights) for i in self.reference]
        record: dict[str, Any] = {}
        if any(counts):
            record["missing"] = {
                self.channels[i].channel or side: count.record
                for i, side, count in zip(self.reference, ("trace", "retrace"), counts, strict=False)
            }
        if self.imaged_rows is not None:
            record["imaged_rows"] = list(self.imaged_rows)
        return record

    @property
    def pictures(self) -> list[ScanPicture]:
        """All channels as pictures."""
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
    def timing(self) -> dict[str, Any]:
        """Turn and window of the fast axis by the file, for the record; what it does not say is left out."""
        timing = {"file_turn": self.first.turn, "file_window": self.first.window}
        return {name: value for name, value in timing.items() if value is not None}

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
            readable, without = (
                _channels(path, choice.frame) if choice.frames is None else (_mean_channels(path, choice.frames), [])
            )
            groups.append((readable, forward))
            left_out += without
    channels = [one for group, _ in groups for one in group]
    ways = [one.direction != "retrace" if one.direction else way for group, way in groups for one in group]
    _check_exchange(groups)
    reference = _reference(channels, ways, choice, len(groups[0][0]))
    if reference[0] >= 0 and len(reference) == 2 and choice.retrace_channel is not None:
        ways[reference[1]] = False
    shape = channels[reference[0]].heights.shape
    for one in channels:
        if one.heights.shape != shape:
            sizes = " and ".join(f"{rows} x {columns}" for rows, columns in (shape, one.heights.shape))
            raise Rejected([Problem(one.file, 0, "", f"has {sizes} pixels; all channels must be of one scan")])
    return Images(tuple(channels), tuple(ways), reference, tuple(left_out), choice.retrace_mirrored, choice.frames)


def _channels(path: Path, frame: int | None) -> tuple[list[ScanImage], list[str]]:
    """Return all channels of a file that can be read, and why others cannot."""
    try:
        return read_channels(path, frame), []
    except Rejected as rejected:
        if len(channels := channels_of(path)) < 2:
            raise
        readable, without = [], []
        for one in channels:
            try:
                readable.append(read_image(path, str(one.number), frame=frame))
            except Rejected as reason:
                without += [str(problem) for problem in reason.problems]
        if not readable:
            raise rejected from None
        return readable, without


def _mean_channels(path: Path, frames: tuple[int, int]) -> list[ScanImage]:
    """Return the mean of the frames of each channel of a movie, registered by those of the first channel."""
    first, stop = frames
    if not 0 <= first < stop:
        why = f"{first}:{stop} is empty; give the first frame, and the one after the last"
        raise Rejected([Problem(str(path), 0, "frames", why)])
    movie = [read_channels(path, number) for number in range(first, stop)]
    shifts = registered([channels[0].heights for channels in movie]).shifts
    return [
        replace(frames_of_one[0], heights=registered([one.heights for one in frames_of_one], shifts, 0.0).mean)
        for frames_of_one in zip(*movie, strict=True)
    ]


def _check_exchange(groups: Sequence[tuple[list[ScanImage], bool]]) -> None:
    """Check that the names of channels do not contradict files that hold one direction each."""
    if len(groups) < 2:
        return
    for group, forward in groups:
        directions = {one.direction for one in group} - {None}
        if directions == {"retrace" if forward else "trace"}:
            have, need = ("retrace", "trace") if forward else ("trace", "retrace")
            why = f"its channels are the {have} by the file, and the {need} is needed here; are the files exchanged?"
            raise Rejected([Problem(group[0].file, 0, "", why)])


def _reference(channels: Sequence[ScanImage], ways: Sequence[bool], choice: Choice, first: int) -> tuple[int, ...]:
    """Return the trace and the retrace that are fitted and compared; one of them if there is no other.

    Parameters
    ----------
    channels, ways
        The channels of one file or two, and whether each is a trace.
    first
        Number of channels of the first file.

    Raises
    ------
    Rejected
        If the choice fits none of them, or several.
    """
    listed = [_as_channel(one, way) for one, way in zip(channels, ways, strict=True)]
    whole = listed[:first]
    rest = listed[first:] or listed
    try:
        trace = _trace(listed, whole) if choice.channel is None else choose(whole, choice.channel, "trace")
    except ValueError as reason:
        raise Rejected([Problem(channels[0].file, 0, "", str(reason))]) from None
    try:
        if choice.retrace_channel is not None:
            retraces = [choose(rest, choice.retrace_channel, "retrace")]
        elif len(retraces := _retraces(listed, trace)) > 1:
            retraces = [partner(listed, trace) or retraces[0]]
    except ValueError as reason:
        raise Rejected([Problem(channels[-1].file, 0, "", str(reason))]) from None
    return tuple(listed.index(one) for one in (trace, *retraces))


def _as_channel(image: ScanImage, way: bool) -> Channel:
    """Return a channel that was read, with the direction that it is taken for."""
    direction: Direction = "trace" if way else "retrace"
    shape = image.heights.shape
    return Channel(image.number, image.channel, shape, lambda _: image.heights, image.signal, direction)


def _trace(listed: Sequence[Channel], whole: Sequence[Channel]) -> Channel:
    """Return the best trace of the first file: one with a retrace, which is a height.

    Raises
    ------
    ValueError
        If the file has another channel of that name, which would do as well.
    """

    def rank(one: Channel) -> tuple[bool, bool, bool]:
        return one.direction != "trace", not _retraces(listed, one), not _height(one)

    best = min(whole, key=rank)
    alike = [one for one in whole if one.title == best.title and rank(one) == rank(best)]
    if len(alike) > 1:
        of_name = channel_list(alike)
        raise ValueError(f"has more than one channel {quote(best.title)}: {of_name}; choose with --channel")
    return best


def _retraces(listed: Sequence[Channel], trace: Channel) -> list[Channel]:
    """Return channels of the other direction with the same signal, or the only one there is."""
    if trace.direction != "trace":
        return []
    others = [one for one in listed if one.direction == "retrace"]
    same = [one for one in others if one.signal == trace.signal]
    return same or (others if len(others) == 1 and len(listed) == 2 else [])


def _height(channel: Channel) -> bool:
    return any(word in channel.title.lower() for word in ("height", "topo", "zsensor", "z sensor"))


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
    conditions = _timed(images, conditions)
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
    plan = make_plan(setup)
    model = (
        ScannerModel(setup.scanner, setup.scanner_file, setup.scanner_folder) if scanner is None else _model(scanner)
    )
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


def _timed(images: Images, conditions: OldScan) -> OldScan:
    """Return the conditions with turn and window of the file where they are not given."""
    first = images.first
    return replace(conditions, x=conditions.x.with_defaults(first.turn, first.window))


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
    return _corrected(images, distortion, size, record)


def by_fit(
    images: Images,
    conditions: OldScan,
    pitch_nm: float | None = None,
    lattice_nm: float | None = None,
    kind: str | None = None,
) -> tuple[StraightScan, PeriodicScan]:
    """Correct images by a fit to a periodic sample; return the fit too.

    ``kind`` is that of the lattice of ``lattice_nm``: "hexagonal" or "square".

    Raises
    ------
    Unphysical
        If there is no fit, or the image does not support the correction: the cell is ambiguous, the displacement is too
        large, or trace and retrace do not agree better.
    """
    images = images.of_imaged_rows()
    try:
        return _by_fit(images, conditions, pitch_nm, lattice_nm, kind)
    except Unphysical as reason:
        if shows_nothing_periodic(images.heights(images.reference[0])):
            raise Unphysical(NOTHING_PERIODIC) from None
        advice = "" if pitch_nm is not None else _affine_advice(images, lattice_nm, kind)
        if not advice:
            raise
        raise Unphysical(f"{reason}; {advice}") from None


def _affine_advice(images: Images, lattice_nm: float | None, kind: str | None) -> str:
    """Return a sentence for the text of a refused fit, where an affine map is possible; else nothing."""
    for name in IDEAL_ANGLES if kind is None else (kind,):
        try:
            by_affine_map(images, lattice_nm, name)
        except ImplausibleMap:
            continue
        except Unphysical:
            return ""
        condition = "" if kind is not None else f"if the lattice is {name}, "
        return f"{condition}--affine --lattice {name} corrects width, height and shear alone"
    return ""


def _by_fit(
    images: Images, conditions: OldScan, pitch_nm: float | None, lattice_nm: float | None, kind: str | None
) -> tuple[StraightScan, PeriodicScan]:
    conditions = _timed(images, conditions)
    trace, retrace = (*(images.channels[i].heights for i in images.reference), None)[:2]
    retrace_alone = not any(images.forward)
    first, (rows, columns) = images.first, images.shape
    expected = None
    if lattice_nm is not None and first.width_nm is not None and first.height_nm is not None:
        angle = np.radians(IDEAL_ANGLES[kind or "hexagonal"])
        expected = lattice_nm**2 * float(np.sin(angle)) * rows * columns / (first.width_nm * first.height_nm)
    _check_reference(images)
    assert trace is not None
    (turn, (low, high)), delay_pixels, mirrored = conditions.x.timing, conditions.delay_pixels, images.mirrored
    if retrace_alone:  # a way back is a way forward over the mirror image of the sample
        trace = np.ascontiguousarray(images.heights(images.reference[0])[:, ::-1])
        fit = periodic_scan(trace, None, 1.0 - turn, (1.0 - high, 1.0 - low), False, delay_pixels, expected)
    else:
        fit = periodic_scan(trace, retrace, turn, (low, high), mirrored, delay_pixels, expected)
    fit = replace(fit, frame_share=images.frame_share)
    size: tuple[float, float] | None = None
    distortion: Distortion = fit.distortion
    record: dict[str, Any] = {"by": "fit to a periodic sample", "sources": images.sources}
    record |= {**images.angle, **images.timing, **images.missing}
    if lattice_nm is not None or pitch_nm is not None:
        if lattice_nm is not None:
            check_constant(fit, lattice_nm, expected is not None)
            distortion = fit.of_lattice(lattice_nm, kind)
            kind = kind or fit.likely_kind()
            record |= {"lattice_nm": lattice_nm, "lattice": kind}
        else:
            has_size = first.width_nm is not None and first.height_nm is not None
            aspect = (first.height_nm or 1.0) / (first.width_nm or 1.0) if has_size else rows / columns
            check_constant(fit, pitch_nm or 0.0, first.width_nm is not None)
            distortion = fit.of_pitch(pitch_nm or 0.0, aspect)
            record["pitch_nm"] = pitch_nm
        size = distortion.x_range[1] - distortion.x_range[0], distortion.y_range[1] - distortion.y_range[0]
        if first.width_nm is not None:
            check_size(size[0], first.width_nm, "the file")
        if first.height_nm is not None and fit.tells_y and lattice_nm is not None:
            check_size(size[1], first.height_nm, "the file", "frame")
    elif first.width_nm is not None and first.height_nm is not None:
        size = first.width_nm, first.height_nm
    record |= {
        "turn": turn,
        "window": [low, high],
        "periods_in_the_line": [round(float(q), 4) for q in fit.waves[:, 0]],
        "explained": round(fit.explained, 6),
        "slow_axis": "fitted" if fit.tells_y else "as taken: a grating does not tell it",
    }
    if fit.straight_axes:
        record["not_displaced"] = list(fit.straight_axes)
    if retrace_alone:
        distortion = distortion.mirrored()
        record["retrace_alone"] = True
    scan = _corrected(images, distortion, size, record)
    check_moves(distortion)
    recorded, pictures = _checked_pictures(fit, scan, trace)
    check_cell(fit, recorded, True)
    check_agreement(scan.agreement)
    check_straight_cell(fit, pictures, size, lattice_nm, kind or "hexagonal", expected is not None)
    return scan, fit


def _checked_pictures(fit: PeriodicScan, scan: StraightScan, trace: Floats) -> tuple[Floats, list[Floats]]:
    """Return the first image as it was fitted, without steps and gaps, and the straight pictures without gaps."""
    recorded, pictures = trace, [scan.pictures[i].heights for i in scan.reference]
    if fit.without_gaps is not None:
        recorded = fit.without_gaps[0]
        both = zip((True, False), fit.without_gaps, strict=False)
        pictures = [Resampler.of(fit.distortion, way)(one) for way, one in both]
    return recorded if fit.stepless is None else fit.stepless, pictures


def _check_reference(images: Images) -> None:
    """Check that each direction that the file has is among the channels that are fitted."""
    if len(images.reference) == 1 and not all(images.forward) and any(images.forward):
        raise Unphysical("has channels of the retrace, but none of the fitted signal; give --retrace-channel")


def by_affine_map(images: Images, lattice_nm: float | None, kind: str) -> StraightScan:
    """Correct width, height and shear of images of a lattice by its cell; lines and rows stay straight.

    Parameters
    ----------
    images
        Images of a file that has its size.
    lattice_nm
        Constant of the lattice in nm; None where it is unknown: then the width of the file stands.
    kind
        "hexagonal" or "square".

    Raises
    ------
    Unphysical
        If the cell does not determine the map, the map is implausible, or the image does not support it.
    """
    _check_reference(images)
    images = images.of_imaged_rows()
    first = images.first
    if first.width_nm is None or first.height_nm is None:
        raise Unphysical("--affine needs a file that has its size, which decides between cells of several sizes")
    heights = [images.heights(i) for i in images.reference]
    ways = [images.forward[i] for i in images.reference]
    affine = affine_map(heights, ways, (first.width_nm, first.height_nm), lattice_nm, kind)
    distortion = affine.distortion
    size = distortion.x_range[1] - distortion.x_range[0], distortion.y_range[1] - distortion.y_range[0]
    record: dict[str, Any] = {"by": "affine map of a lattice", "sources": images.sources, **images.angle}
    record |= {"lattice_nm": lattice_nm, "lattice": affine.kind, "affine": affine.record}
    record["not_corrected"] = "displacement within lines and between rows"
    scan = _corrected(images, distortion, size, record)
    check_agreement(scan.agreement)
    pictures = [scan.pictures[i].heights for i in images.reference]
    rows, columns = images.shape
    start = affine.sides_nm(first.height_nm) * [columns / size[0], rows / size[1]]
    bows = check_bows(pictures, start, scan.agreement)
    check_sample_cell(pictures, size, affine.constant_nm, affine.kind, lattice_nm is not None, start)
    names = ["trace" if way else "retrace" for way in ways]
    scan.record["affine"]["bows_percent"] = {name: one.record for name, one in zip(names, bows, strict=True)}
    return scan


def check_order(images: Images, distortion: Distortion) -> None:
    """Check that trace and retrace do not agree far better mirrored or exchanged.

    Each image is corrected with the distortion of the other direction, and compared.

    Raises
    ------
    Unphysical
        If they do.
    """
    if len(images.reference) < 2:
        return
    trace, retrace = (images.heights(i) for i in images.reference)
    ways = [Resampler.of(distortion, way) for way in (True, False)]

    def mismatch(one: Floats, other: Floats) -> float:
        return difference(ways[0](one), ways[1](other))

    as_stored = mismatch(trace, retrace)
    if as_stored < _ALIKE:
        return
    turned = np.ascontiguousarray(retrace[:, ::-1])
    if mismatch(trace, turned) < _BETTER * as_stored:
        advice = "leave --retrace-mirrored out" if images.mirrored else "give --retrace-mirrored"
        raise Unphysical(f"the retrace agrees with the trace only when it is mirrored; {advice}")
    if mismatch(retrace, trace) < _BETTER * as_stored:
        raise Unphysical(
            "trace and retrace agree only when they are exchanged; is the retrace the first of both files?"
        )


def _corrected(
    images: Images, distortion: Distortion, size: tuple[float, float] | None, record: dict[str, Any]
) -> StraightScan:
    heights = [images.heights(i) for i in images.reference]
    if len(heights) == 2:
        check_pair(heights[0], heights[1])
    else:
        check_heights("image", heights[0])
    check_order(images, distortion)
    if images.frames is not None:
        record["frames"] = list(images.frames)
    if images.left_out:
        record["left_out"] = list(images.left_out)
    return corrected_scan(images.pictures, distortion, size, images.reference, record)
