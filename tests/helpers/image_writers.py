"""Files of images, each by its format's description or by another program than tablegen."""

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

from gwyfile.objects import GwyContainer, GwyDataField, GwyObject

from tablegen.numerics.arrays import Floats


def npy(heights: Floats) -> bytes:
    """By the format's description: magic, version, header, values in C order."""
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {heights.shape}, }}".encode()
    header += b" " * (-(len(header) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + heights.astype("<f8").tobytes()


def png(values: Floats, bits: int = 16) -> bytes:
    """By the format's description: signature, header, one filtered stream, end; each chunk with its CRC."""

    def chunk(name: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))

    rows = values.astype(">u2" if bits == 16 else "u1")
    head = struct.pack(">IIBBBBB", values.shape[1], values.shape[0], bits, 0, 0, 0, 0)
    stream = b"".join(b"\0" + row.tobytes() for row in rows)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(stream)) + chunk(b"IEND", b"")


def gwy(path: Path, meta: Mapping[str, str] | None = None, /, **channels: Floats) -> bytes:
    """As the Python package gwyfile writes it, with what Gwyddion keeps beside the data, and more metadata."""
    container = GwyContainer()
    container["/0/base/palette"] = "Gwyddion.net"
    for number, (title, heights) in enumerate(channels.items()):
        container[f"/{number}/data/title"] = title
        container[f"/{number}/data"] = GwyDataField(heights, xreal=1e-6, yreal=1e-6, si_unit_z="m")
        container[f"/{number}/meta"] = GwyObject("GwyContainer", {"Scan rate": "1 Hz", "Lines": 40, **(meta or {})})
    container.tofile(str(path))
    return path.read_bytes()


def ascii_of(heights: Floats, separator: str, comma: bool = False) -> bytes:
    rows = [separator.join(repr(float(v)).replace(".", "," if comma else ".") for v in row) for row in heights]
    return ("# Channel: Height\n# Width: 1 um\n\n" + "\n".join(rows) + "\n").encode()
