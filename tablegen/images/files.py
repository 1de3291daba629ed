"""Images of heights from files: those of instruments, Gwyddion's .gwy, .npy, .tif, .png, and numbers as text.

Needs the extra ``images`` for .tif, .png and .jpk. docs/image_files.md lists the values that each format has.
"""

import hashlib
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import prod
from pathlib import Path

import numpy as np

from tablegen.base.data_files import Source, file_content
from tablegen.base.figures import shown_path
from tablegen.base.input_errors import Problem, Rejected, shortened
from tablegen.base.reading import IMAGE
from tablegen.images.formats.asd import asd_channels
from tablegen.images.formats.channel import (
    MAX_PIXELS,
    Channel,
    Direction,
    FirstRow,
    choose,
    partner,
    quote,
)
from tablegen.images.formats.createc import CREATEC_MAGICS, createc_channels
from tablegen.images.formats.gwyddion import gwy_channels
from tablegen.images.formats.gxsm import gxsm_channels
from tablegen.images.formats.h5_jpk import h5_jpk_channels
from tablegen.images.formats.igor import ibw_channels
from tablegen.images.formats.iso28600 import ISO_MAGIC, iso_channels
from tablegen.images.formats.jpk import jpk_channels
from tablegen.images.formats.matrix import npy_channels, text_channels
from tablegen.images.formats.nanonis import sxm_channels
from tablegen.images.formats.nanoscope import spm_channels
from tablegen.images.formats.nanosurf import nid_channels
from tablegen.images.formats.ntmdt import mdt_channels
from tablegen.images.formats.park import is_park, park_channels
from tablegen.images.formats.picture import png_channels
from tablegen.images.formats.tiff import tiff_channels
from tablegen.images.formats.wsxm import wsxm_channels
from tablegen.numerics.arrays import Floats

_MIN_PIXELS = 32  # rows and columns
_MAX_HEIGHT = 1e30  # in any unit; squares of heights have to be numbers
_NUMBERED = re.compile(r"\.\d{3}")  # Nanoscope's images of one name, .000 to .999
MODULES = {".png": "PIL", **dict.fromkeys((".tif", ".tiff", ".jpk", ".jpk-qi-image"), "tifffile")}  # beside numpy


@dataclass(frozen=True, eq=False)
class ScanImage:
    """Heights, rows x columns, with the data of their file; ``file`` is its name in messages.

    Row 0 is the first in time as far as the file states it; the left end of the line is at the left in both directions.
    NaN is a missing pixel.
    A value that the file does not have is None, or empty.
    """

    file: str
    source: Source
    heights: Floats  # in ``unit``
    channel: str = ""  # title in the file, such as "HeightRetrace"
    number: int = 0  # of the channel in the file
    signal: str = ""  # title without the direction, such as "Height"
    direction: Direction | None = None
    unit: str = ""  # of the heights, such as "m", "nm" or "V"
    width_nm: float | None = None  # of the line, all pixels
    height_nm: float | None = None  # of the slow axis, all rows
    line_rate_hz: float | None = None  # lines in one direction per second
    first_row: FirstRow | None = None  # where row 0 is in the picture
    frame: int = 0  # counted from 0
    frames: int = 1  # images of a movie
    angle_deg: float | None = None  # of the fast axis against the scanner's x
    turn: float | None = None  # share of the line period that is forward
    window: tuple[float, float] | None = None  # part of each sweep that the columns span


def read_image(
    path: Path, channel: str | None = None, direction: Direction | None = None, frame: int | None = None
) -> ScanImage:
    """Read an image of heights.

    Parameters
    ----------
    channel
        Title or number of the data in a file that has several; or the title without the direction.
    direction
        The direction of a title that has both.
    frame
        Frame of a movie, counted from 0.

    Raises
    ------
    Rejected
        If the file cannot be read or has no such heights; the message has file and reason.
    """
    file = _opened(path)
    with file.rejecting():
        return _read(file, choose(file.channels, channel, direction), frame)


def read_pair(
    trace: Path,
    retrace: Path | None = None,
    channel: str | None = None,
    retrace_channel: str | None = None,
    frame: int | None = None,
) -> tuple[ScanImage, ScanImage]:
    """Read trace and retrace of one scan, from two files, or from one that has both.

    The retrace is ``retrace_channel``, or the retrace that belongs to the trace's channel, or the channel of the same
    name.

    Raises
    ------
    Rejected
        If a file cannot be read, has no such channel, or calls the trace a retrace, or the reverse; the message has
        file and reason.
    """
    first = _opened(trace)
    second = first if retrace is None or retrace == trace else _opened(retrace)
    with first.rejecting():
        one = _required(choose(first.channels, channel, "trace"), "trace")
        read = _read(first, one, frame)
    with second.rejecting():
        other = partner(second.channels, one) if retrace_channel is None else None
        other = _required(other or choose(second.channels, retrace_channel or channel, "retrace"), "retrace")
        if first is second and one is other:
            raise ValueError(f"channel {one.number} ({quote(one.title)}) has no retrace in this file; give it too")
        return read, _read(second, other, frame)


def _required(channel: Channel, direction: Direction) -> Channel:
    if channel.direction not in (None, direction):
        what = f"channel {channel.number} ({quote(channel.title)}) is the {channel.direction} by the file"
        raise ValueError(f"{what}; the {direction} is needed here. Are trace and retrace exchanged?")
    return channel


def read_channels(path: Path, frame: int | None = None) -> list[ScanImage]:
    """Read all channels of a file, each of which has to be an image of heights.

    Raises
    ------
    Rejected
        If the file cannot be read, or a channel is no image of heights.
    """
    file = _opened(path)
    with file.rejecting():
        if not file.channels:
            raise ValueError("contains no image")
        return [_read(file, channel, frame) for channel in file.channels]


def channels_of(path: Path) -> list[Channel]:
    """Return the channels of a file, without reading more of it than its format needs.

    Raises
    ------
    Rejected
        If the file cannot be read.
    """
    return _opened(path).channels


@dataclass(frozen=True, eq=False)
class _ImageFile:
    """A file with its channels, and its origin."""

    name: str
    source: Source
    channels: list[Channel]

    @contextmanager
    def rejecting(self) -> Iterator[None]:
        """Turn a ``ValueError`` into ``Rejected`` with the name of the file.

        Raises
        ------
        Rejected
            If the block raises ``ValueError``.
        """
        try:
            yield
        except ValueError as reason:
            raise Rejected([Problem(self.name, 0, "", str(reason))]) from None


def _opened(path: Path) -> _ImageFile:
    """Return the channels of a file. Raise ``Rejected`` if it cannot be read."""
    name = shown_path(path)
    file = _ImageFile(name, Source(path.name, ""), [])
    ending = path.suffix.lower()
    reader = spm_channels if _NUMBERED.fullmatch(ending) else _READERS.get(ending)
    with file.rejecting():
        if reader is None:
            what = path.suffix or "no ending"
            raise ValueError(f"{what} is not one of {', '.join(_READERS)}; export it as one of these")
        content = file_content(path, name, IMAGE)
        if not content:
            raise ValueError("is empty")
        return _ImageFile(
            name, Source(path.name, hashlib.sha256(content).hexdigest()[:16]), list(reader(content, name))
        )


def _read(file: _ImageFile, channel: Channel, frame: int | None) -> ScanImage:
    """Return the image of a channel. Raise ``ValueError`` unless it has heights."""
    what = f"channel {channel.number} ({quote(channel.title)}): " if len(file.channels) > 1 else ""
    size = " x ".join(map(str, channel.shape))
    if len(channel.shape) != 2:
        raise ValueError(f"{what}has the shape {shortened(size, 60)}; rows x columns are needed")
    if min(channel.shape) < _MIN_PIXELS or prod(channel.shape) > MAX_PIXELS:
        least = f"{_MIN_PIXELS} x {_MIN_PIXELS}"
        raise ValueError(f"{what}has {size} pixels; at least {least} and at most 2^25 are read")
    if frame is None and channel.frames > 1:
        raise ValueError(
            f"{what}is a movie of {channel.frames} frames; choose one with --frame, 0 to {channel.frames - 1}"
        )
    frame_number = frame or 0
    if not 0 <= frame_number < channel.frames:
        raise ValueError(f"{what}has no frame {frame_number}; the last one is {channel.frames - 1}")
    if channel.frames > 1:
        what += f"frame {frame_number}: "
    with np.errstate(all="ignore"):  # of factors in a damaged file; what is infinite is counted below
        matrix = channel.load(frame_number)
        if matrix.dtype.kind not in "iufb":
            raise ValueError(f"{what}has values of the type {matrix.dtype}; heights are real numbers")
        if matrix.shape != channel.shape:
            raise ValueError(f"{what}has {matrix.size} pixels, not {size}; copy it again")
        heights = matrix.astype(np.float64)
    if infinite := int(np.sum(np.isinf(heights))):
        raise ValueError(f"{what}{infinite} pixels are infinite; if they are missing, save them as NaN")
    there = heights[np.isfinite(heights)]  # NaN marks a missing pixel
    if not len(there):
        raise ValueError(f"{what}all pixels are NaN; was a different channel saved?")
    if np.max(np.abs(there)) > _MAX_HEIGHT:
        raise ValueError(f"{what}has heights beyond {_MAX_HEIGHT:g}; is it damaged?")
    if not np.ptp(there) > 1.0 / _MAX_HEIGHT:
        raise ValueError(f"{what}all pixels are {there[0]:g}; was a different channel saved?")
    return ScanImage(
        file=file.name,
        source=file.source,
        heights=heights,
        channel=channel.title,
        number=channel.number,
        signal=channel.signal,
        direction=channel.direction,
        unit=channel.unit,
        width_nm=channel.width_nm,
        height_nm=channel.height_nm,
        line_rate_hz=channel.line_rate_hz,
        first_row=channel.first_row,
        frame=frame_number,
        frames=channel.frames,
        angle_deg=channel.angle_deg,
        turn=channel.turn,
        window=channel.window,
    )


def _spm(content: bytes, name: str) -> list[Channel]:
    """Return the channels of a .spm file, which is of Nanoscope or of ISO 28600."""
    return (iso_channels if content.startswith(ISO_MAGIC) else spm_channels)(content, name)


def _dat(content: bytes, name: str) -> list[Channel]:
    """Return the channels of a .dat file, which is of Createc or rows of numbers."""
    return (createc_channels if content.startswith(CREATEC_MAGICS) else text_channels)(content, name)


def _tiff(content: bytes, name: str) -> list[Channel]:
    """Return the channels of a TIFF file, which may be of Park Systems."""
    return (park_channels if is_park(content) else tiff_channels)(content, name)


_READERS: dict[str, Callable[[bytes, str], list[Channel]]] = {
    ".npy": npy_channels,
    **dict.fromkeys((".tif", ".tiff"), _tiff),
    ".png": png_channels,
    ".gwy": gwy_channels,
    **dict.fromkeys((".txt", ".asc", ".csv"), text_channels),
    ".dat": _dat,
    ".asd": asd_channels,
    ".ibw": ibw_channels,
    ".spm": _spm,
    **dict.fromkeys((".stp", ".top"), wsxm_channels),
    ".nid": nid_channels,
    ".mdt": mdt_channels,
    ".nc": gxsm_channels,
    ".jpk": jpk_channels,
    ".jpk-qi-image": jpk_channels,
    ".h5-jpk": h5_jpk_channels,
    ".sxm": sxm_channels,
}
