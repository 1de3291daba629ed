"""Images of Park Systems (.tiff): a picture in colour, and in tags of their own the heights and a header.

The first row is the bottom one; it is the last in time, and rows are turned, if the slow axis went down.
"""

import struct
from functools import partial

import numpy as np

from tablegen.images.formats.channel import (
    Channel,
    Direction,
    FirstRow,
    Matrix,
    check_pixels,
    number,
    positive,
)
from tablegen.images.formats.tiff import tiff_block

_MAGIC, _DATA, _HEADER = 50432, 50434, 50435
_PARK = 0x0E031301
_LAYOUT = struct.Struct("<i64s32x2id12x3i2d16xd40x3d16s")  # without what no field below names
_DATA_TYPE_AT = 348  # bytes; headers of the first version end before
_TYPES = {0: "<i2", 1: "<i4", 2: "<f4"}
_NM = 1e3  # of a micrometre
_LEVELS = 0.0, 1.0  # zero and step of values that have no scale


def is_park(content: bytes) -> bool:
    """Return True if a TIFF file has the mark of Park Systems; False also for what is no TIFF file."""
    try:
        mark = tiff_block(content, _MAGIC)
    except ValueError:
        return False
    return mark is not None and len(mark) == 4 and struct.unpack("<I", mark)[0] == _PARK


def park_channels(content: bytes, _: str) -> list[Channel]:
    """Return the image of a file of Park Systems.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    header, data = tiff_block(content, _HEADER), tiff_block(content, _DATA)
    if header is None or data is None:
        raise ValueError("has the mark of Park Systems, and no heights; copy it again")
    if len(header) < _LAYOUT.size:
        raise ValueError(f"has a header of {len(header)} bytes, and Park Systems has {_LAYOUT.size} or more; damaged?")
    kind, source, columns, rows, angle, right, up, swapped, *scales = _LAYOUT.unpack_from(header)
    width, height, rate, gain, scale, offset, unit = scales
    if kind != 0:
        raise ValueError("holds a profile or curves, not an image")
    if swapped:
        raise ValueError("was scanned with x and y exchanged, so that its lines are columns; turn it by 90 degrees")
    check_pixels(columns, rows)
    code = struct.unpack_from("<i", header, _DATA_TYPE_AT)[0] if len(header) >= _DATA_TYPE_AT + 4 else 0
    number_kind = _TYPES.get(code)
    if number_kind is None or columns * rows * np.dtype(number_kind).itemsize != len(data):
        raise ValueError(f"has {len(data)} bytes for {columns} x {rows} pixels of the kind {code}; copy it again")
    signal, direction = _text(source), _direction(right)
    first: FirstRow = "bottom" if up else "top"
    step = number(gain * (scale or 1.0))
    zero = number(gain * offset)
    scaled = bool(step) and zero is not None
    return [
        Channel(
            0,
            f"{signal} {direction}",
            (rows, columns),
            partial(
                _load, data, number_kind, (rows, columns), first, (zero or 0.0, step or 1.0) if scaled else _LEVELS
            ),
            signal,
            direction,
            _text(unit) if scaled else "LSB",
            positive(width, _NM),
            positive(height, _NM),
            positive(rate),
            first,
            angle_deg=number(angle),
        )
    ]


def _direction(right: int) -> Direction:
    return "trace" if right else "retrace"


def _text(wide: bytes) -> str:
    return wide.decode("utf-16-le", "replace").split("\0")[0].strip()


def _load(
    data: bytes, kind: str, shape: tuple[int, int], first: FirstRow, scale: tuple[float, float], _: int
) -> Matrix:
    zero, step = scale
    values = zero + step * np.frombuffer(data, kind).reshape(shape).astype(np.float64)
    return values[::-1] if first == "top" else values
