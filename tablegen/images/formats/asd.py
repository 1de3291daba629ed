"""Movies of high-speed AFM (.asd): a header of version 0 to 2, then frames of integers, one channel after the other."""

import struct
from functools import partial
from math import isfinite, prod

import numpy as np

from tablegen.images.formats.channel import MAX_PIXELS, Channel, Matrix, positive

_MAX_SIDE = 1 << 15  # pixels
_RANGES = {  # code: full scale in V, and whether it goes below 0
    **{0x00001: (1.0, False), 0x00002: (2.5, False), 0x00003: (9.99, False), 0x00004: (5.0, False)},
    **{0x10000: (1.0, True), 0x20000: (2.5, True), 0x40000: (5.0, True)},
}
# Names and layouts after the version. What is passed over has no name: dates, ranges, text sizes, averaging.
_FIRST = (
    ("titles", "4s"),
    ("header_bytes frame_bytes name_bytes", "3i8x"),
    ("columns rows width height", "4h"),
    ("frame_ms z_nm_per_v z_gain range bits", "3fIi"),
    ("", "1x4x2x2x5x1x8x12x4x"),
    ("frames", "i4x2x"),
)
_FIRST_SENSORS = (("sensor phase", "2f"),)  # behind the name of the operator
_LATER = (
    ("header_bytes frame_bytes", "2i12x"),
    ("titles", "8s4x"),
    ("frames", "i8x"),
    ("columns rows width height", "4i1x4x24x8x"),
    ("frame_ms sensor phase", "3f4x12x4x"),
    ("range bits", "Ii8x8x"),
    ("z_nm_per_v z_gain", "2f"),
)

_Header = dict[str, float]


def asd_channels(content: bytes, _: str) -> list[Channel]:
    """Return the channels of a movie (.asd).

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    try:
        version = struct.unpack_from("<i", content)[0]
        if version not in (0, 1, 2):
            raise ValueError("does not begin as a movie of high-speed AFM of version 0, 1 or 2 does")
        header, titles = _header(content, version)
    except struct.error:
        raise ValueError("ends in its header; copy it again") from None
    start, before, frames, columns, rows = (
        int(header[key]) for key in ("header_bytes", "frame_bytes", "frames", "columns", "rows")
    )
    if not (0 < columns <= _MAX_SIDE and 0 < rows <= _MAX_SIDE and columns * rows <= MAX_PIXELS):
        raise ValueError(f"has frames of {columns} x {rows} pixels by its header; is it damaged?")
    if start < 4 or before < 0 or frames < 1:
        raise ValueError(f"has {frames} frames behind {start} bytes of header; is it damaged?")
    size = before + 2 * columns * rows
    if start + size * frames * len(titles) > len(content):
        there = max(0, len(content) - start) // (size * max(1, len(titles)))
        raise ValueError(f"has {frames} frames by its header and bytes for {there}; copy it again")
    line_rate = positive(1000.0 * rows / header["frame_ms"]) if header["frame_ms"] else None
    channels = []
    for number, title in enumerate(titles):
        first = start + number * size * frames + before
        zero, step, unit = _scale(title, header)
        channels.append(
            Channel(
                number,
                title,
                (rows, columns),
                partial(_load, content, first, size, (rows, columns), zero, step),
                signal=title,
                unit=unit,
                width_nm=positive(header["width"]),
                height_nm=positive(header["height"]),
                line_rate_hz=line_rate,
                frames=frames,
            )
        )
    return channels


def _load(
    content: bytes, first: int, size: int, shape: tuple[int, int], zero: float, step: float, frame: int
) -> Matrix:
    levels = np.frombuffer(content, "<i2", prod(shape), first + size * frame).reshape(shape)
    return zero + step * levels


def _header(content: bytes, version: int) -> tuple[_Header, list[str]]:
    """Read the numbers of a header, and the names of its channels. Raise ``struct.error`` where it ends."""
    values: dict[str, float | bytes] = {}
    at = _take(content, 4, _LATER if version else _FIRST, values)
    if not version:
        at += max(0, int(values["name_bytes"]))
        _take(content, at, _FIRST_SENSORS, values)
    titles = values.pop("titles")
    assert isinstance(titles, bytes)
    half = len(titles) // 2
    names = [part.replace(b"\0", b"").decode("latin-1").strip() for part in (titles[:half], titles[half:])]
    return {key: float(value) for key, value in values.items()}, [name for name in names if name]


def _take(content: bytes, at: int, fields: tuple[tuple[str, str], ...], values: dict[str, float | bytes]) -> int:
    for names, layout in fields:
        values.update(zip(names.split(), struct.unpack_from(f"<{layout}", content, at), strict=True))
        at += struct.calcsize(f"<{layout}")
    return at


def _scale(title: str, header: _Header) -> tuple[float, float, str]:
    """Return the value at level 0, that of one level, and their unit; levels if the file states none."""
    factor, unit = {
        "TP": (header["z_nm_per_v"] * header["z_gain"], "nm"),
        "ER": (-header["sensor"], "nm"),
        "PH": (-header["phase"], "deg"),
    }.get(title, (0.0, ""))
    volts, below = _RANGES.get(int(header["range"]), (0.0, False))
    bits = int(header["bits"])
    if not (factor * volts and isfinite(factor) and 8 <= bits <= 16):
        return 0.0, 1.0, "LSB"
    step = -volts * factor / (1 << bits)
    return (volts * factor, 2.0 * step, unit) if below else (0.0, step, unit)
