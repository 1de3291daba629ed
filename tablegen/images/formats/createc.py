"""Images of Createc STM and AFM (.dat): ``key=value`` lines, then one number that is not used, and all channels.

A file does not say which channel is which, nor in which direction it was taken; values are steps of the converter.
"""

import zlib
from functools import partial

import numpy as np

from tablegen.images.formats.channel import Channel, Matrix, check_pixels, number, positive, whole_number

_HEADER = 1 << 14  # bytes
_KINDS = {b"[Parameter]": ("<i2", False), b"[Paramet32]": ("<f4", False), b"[Paramco32]": ("<f4", True)}  # is packed
CREATEC_MAGICS = tuple(_KINDS)
_MAX_CHANNELS = 100
_NM = 0.1  # of an angstrom


def createc_channels(content: bytes, _: str) -> list[Channel]:
    """Return the channels of a Createc image (.dat).

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    magic = next((one for one in _KINDS if content.startswith(one)), None)
    if magic is None:
        raise ValueError("does not begin as a Createc image does")
    kind, packed = _KINDS[magic]
    keys = _keys(content[:_HEADER].decode("latin-1"))
    columns, rows = (whole_number(keys.get(key, ""), key) for key in ("Num.X", "Num.Y"))
    check_pixels(columns, rows)
    count = whole_number(keys.get("Channels", ""), "Channels")
    if not 1 <= count <= _MAX_CHANNELS:
        raise ValueError(f"has {count} channels; 1 to {_MAX_CHANNELS} are read")
    item = np.dtype(kind).itemsize
    size = item * (1 + columns * rows * count)
    numbers = _unpacked(content[_HEADER:], size) if packed else content[_HEADER : _HEADER + size]
    if len(numbers) < size:
        raise ValueError(f"ends in the middle of its {count} images of {columns} x {rows} pixels; copy it again")
    values = np.frombuffer(numbers, kind, columns * rows * count, item).reshape(count, rows, columns)
    scanned = np.flatnonzero(np.any(values != 0, axis=(0, 2)))  # rows of a stopped scan are 0 in all channels
    complete = int(scanned[-1]) + 1 if len(scanned) else rows
    height = positive(keys.get("Length y[A]"), _NM)
    return [
        Channel(
            at,
            f"channel {at}",
            (complete, columns),
            partial(_load, values, at, complete),
            f"channel {at}",
            unit="LSB",
            width_nm=positive(keys.get("Length x[A]"), _NM),
            height_nm=None if height is None else height * complete / rows,
            angle_deg=number(keys.get("Rotation")),
        )
        for at in range(count)
    ]


def _load(values: Matrix, channel: int, rows: int, _: int) -> Matrix:
    return values[channel, :rows]


def _keys(header: str) -> dict[str, str]:
    """Return the keys by their first name: ``Num.X / Num.X=512`` is ``Num.X``."""
    keys: dict[str, str] = {}
    for line in header.splitlines():
        key, equals, value = line.partition("=")
        if equals:
            keys.setdefault(key.partition(" / ")[0].strip(), value.strip())
    return keys


def _unpacked(packed: bytes, most: int) -> bytes:
    """Unpack at most so many bytes."""
    try:
        return zlib.decompressobj().decompress(packed, most)
    except zlib.error as error:
        raise ValueError(f"cannot be unpacked ({error}); copy it again") from None
