"""The images of a scan: the choice of channels, their directions, and what of them is corrected."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tablegen.base.input_errors import Problem, Rejected, Unphysical
from tablegen.correction.old_scan import OldScan
from tablegen.correction.straight import ScanPicture
from tablegen.images.files import ScanImage, channels_of, read_channels, read_image
from tablegen.images.formats.channel import Channel, Direction, channel_list, choose, is_height, partner, quote
from tablegen.images.frame_registration import registered
from tablegen.images.missing import count_missing, imaged_rows, valid_pixels
from tablegen.images.scan_angle import is_turned
from tablegen.numerics.arrays import Floats


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
        return one.direction != "trace", not _retraces(listed, one), not is_height(one)

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


def timed(images: Images, conditions: OldScan) -> OldScan:
    """Return the conditions with turn and window of the file where they are not given."""
    first = images.first
    return replace(conditions, x=conditions.x.with_defaults(first.turn, first.window))


def check_reference(images: Images) -> None:
    """Check that each direction that the file has is among the channels that are fitted."""
    if len(images.reference) == 1 and not all(images.forward) and any(images.forward):
        if not images.forward[images.reference[0]]:
            raise Unphysical(
                "the fitted channel is a retrace, which does not tell how to correct the traces of the file; give the "
                "trace as --channel, and this one as --retrace-channel"
            )
        raise Unphysical("has channels of the retrace, but none of the fitted signal; give --retrace-channel")
