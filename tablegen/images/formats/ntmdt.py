"""Images of NT-MDT (.mdt): frames one after the other, each with a header, the scales of its axes, and integers.

Frames of the older kind, of scanned data, are read; curves, texts and frames of the newer kind (MDA) are left out. The
first row is the bottom one; whether it is the first in time is not known. A title such as ``2F:Height`` has the
direction.
"""

import re
import struct
from functools import partial

import numpy as np

from tablegen.images.formats.channel import Channel, Direction, Matrix, check_pixels, positive, split_direction

_MAGIC = b"\x01\xb0\x93\xff"
_LAST_FRAME_AT, _FILE_HEADER = 12, 33  # bytes
_FRAME = struct.Struct("<IH2B6HH")  # bytes, kind, version, date, bytes of the variables
_SCALE = struct.Struct("<ffh")  # offset, step, code of the unit
_SIZE = struct.Struct("<4H")  # mode, columns, rows, dots
_DOT, _DOTS_HEADER = 16, 14  # bytes
_SCANNED = 0
_MAX_CHANNELS = 1000
_MAX_TITLE = 1000  # bytes
_NM = {-5: 1e9, -4: 1e7, -3: 1e6, -2: 1e3, -1: 1.0, 0: 0.1}
_UNITS = {
    **{-5: "m", -4: "cm", -3: "mm", -2: "um", -1: "nm", 0: "Å", 1: "nA", 2: "V", 4: "kHz", 5: "deg", 6: "%"},
    **{8: "V", 9: "s", 10: "ms", 11: "us", 12: "ns", 20: "A", 21: "mA", 22: "uA", 23: "nA", 24: "pA"},
    **{25: "V", 26: "mV", 27: "uV", 28: "nV", 29: "pV"},
}
_TITLE = re.compile(r"\d+([FB]):(.+)", re.DOTALL)
_DIRECTIONS: dict[str, Direction] = {"F": "trace", "B": "retrace"}


def mdt_channels(content: bytes, _: str) -> list[Channel]:
    """Return the images of a file of NT-MDT.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    if not content.startswith(_MAGIC):
        raise ValueError("does not begin as a file of NT-MDT does")
    channels: list[Channel] = []
    try:
        frames = struct.unpack_from("<H", content, _LAST_FRAME_AT)[0] + 1
        at = _FILE_HEADER
        for frame in range(frames):
            size, kind, *_date, variables = _FRAME.unpack_from(content, at)
            if size < _FRAME.size or at + size > len(content):
                raise ValueError(f"ends in its frame {frame} of {frames}; copy it again")
            if kind == _SCANNED:
                if len(channels) == _MAX_CHANNELS:
                    raise ValueError(f"has more than {_MAX_CHANNELS} images, which is the most that are read")
                channels.append(_channel(len(channels), content[at + _FRAME.size : at + size], variables))
            at += size
    except struct.error:
        raise ValueError("ends in the header of a frame; copy it again") from None
    if not channels:
        raise ValueError("has no frames of scanned data of the older kind; export the image as .gwy")
    return channels


def _channel(at: int, body: bytes, variables: int) -> Channel:
    x, y, z = (_SCALE.unpack_from(body, _SCALE.size * axis) for axis in range(3))
    _, columns, rows, dots = _SIZE.unpack_from(body, variables)
    check_pixels(columns, rows)
    start = variables + _SIZE.size + (_DOTS_HEADER + _DOT * dots if dots else 0)
    end = start + 2 * columns * rows
    if end > len(body):
        raise ValueError(f"has an image {at} of {columns} x {rows} pixels, which its frame does not hold; damaged?")
    title = _title(body, end)
    match = _TITLE.fullmatch(title)
    signal, direction = (match[2], _DIRECTIONS[match[1]]) if match else split_direction(title)
    zero, step, code = z
    scaled = bool(np.isfinite(zero) and np.isfinite(step) and step)
    return Channel(
        at,
        title,
        (rows, columns),
        partial(_load, body, start, (rows, columns), *((zero, step) if scaled else (0.0, 1.0))),
        signal,
        direction,
        _UNITS.get(code, "") if scaled else "LSB",
        positive(abs(x[1]) * columns, _NM.get(x[2], 0.0)),
        positive(abs(y[1]) * rows, _NM.get(y[2], 0.0)),
    )


def _title(body: bytes, at: int) -> str:
    """Return the title behind the numbers; empty if there is none."""
    if at + 4 > len(body):
        return ""
    length = struct.unpack_from("<I", body, at)[0]
    return body[at + 4 : at + 4 + min(length, _MAX_TITLE)].split(b"\0")[0].decode("cp1251", "replace").strip()


def _load(body: bytes, start: int, shape: tuple[int, int], zero: float, step: float, _: int) -> Matrix:
    rows, columns = shape
    return zero + step * np.frombuffer(body, "<i2", rows * columns, start).reshape(shape).astype(np.float64)
