"""A picture in shades as PNG, uncompressed, so that every machine writes the same bytes."""

import struct
import zlib
from base64 import b64encode

import numpy as np

from tablegen.numerics.arrays import Floats

_MOST = 65535  # bytes of a stored block


def grey_png(heights: Floats, low: float, high: float) -> bytes:
    """Return heights as a grey PNG.

    Parameters
    ----------
    heights
        Heights, shape (rows, columns), the first row on top, without NaN.
    low, high
        The heights of black and white.
    """
    shades = np.clip(np.rint(255.0 * (heights - low) / (high - low)), 0, 255).astype(np.uint8)
    return _png(shades, 0)


def indexed_png(shades: np.typing.NDArray[np.uint8], palette: np.typing.NDArray[np.uint8]) -> bytes:
    """Return shades as a PNG with a palette.

    Parameters
    ----------
    shades
        Indices into the palette, shape (rows, columns), the first row on top.
    palette
        RGB of each shade, shape (256, 3).
    """
    return _png(shades, 3, (b"PLTE", palette.tobytes()))


def _png(shades: np.typing.NDArray[np.uint8], colours: int, *more: tuple[bytes, bytes]) -> bytes:
    rows, columns = shades.shape
    raw = b"".join(b"\0" + shades[row].tobytes() for row in range(rows))
    head = struct.pack(">IIBBBBB", columns, rows, 8, colours, 0, 0, 0)
    chunks = (b"IHDR", head), *more, (b"IDAT", _stored(raw)), (b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*chunk) for chunk in chunks)


def data_address(png: bytes) -> str:
    """Return the picture as a data URL."""
    return f"data:image/png;base64,{b64encode(png).decode('ascii')}"


def _chunk(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))


def _stored(raw: bytes) -> bytes:
    """Write a zlib stream of stored blocks."""
    parts = [b"\x78\x01"]
    for first in range(0, len(raw), _MOST):
        block = raw[first : first + _MOST]
        last = first + _MOST >= len(raw)
        parts.append(struct.pack("<BHH", last, len(block), len(block) ^ 0xFFFF) + block)
    return b"".join([*parts, struct.pack(">I", zlib.adler32(raw))])
