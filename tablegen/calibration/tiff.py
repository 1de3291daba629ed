"""Pages of a TIFF file, each read when it is wanted, and no file that would take more time or memory than its pages.

tifffile reads them, if the extra ``images`` is installed. What it believes of a file is checked before: a directory
that points back at itself has no end, and a few packed bytes can unpack into any number.
"""

import logging
import lzma
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from math import prod
from typing import Any

import numpy as np

from tablegen.calibration.image_formats.channel import Channel, Matrix, first_line

_MAX_PAGES = 1000
_DEFLATE, _LZMA = (8, 32946), (34925,)  # values of the tag Compression


@dataclass(frozen=True, eq=False)
class TiffImage:
    """The shape of a page, and what reads it; that raises ``ValueError``."""

    shape: tuple[int, ...]
    load: Callable[[], Matrix]


def tiff_channels(content: bytes, _: str) -> list[Channel]:
    """The pages of a .tif file, in grey. Raises ``ValueError`` with what is wrong."""
    pages = tiff_pages(content)
    for page in pages:
        if len(page.shape) == 3 and page.shape[-1] in (3, 4):
            raise ValueError("is in colour, not heights; export it in grey, 16 bits or floating point")
    return [Channel(number, "", page.shape, partial(_of_frame, page)) for number, page in enumerate(pages)]


def _of_frame(page: TiffImage, _: int) -> Matrix:
    return page.load()


def tiff_pages(content: bytes) -> list[TiffImage]:
    """The pages of a file, in order. Raises ``ValueError`` with what is wrong."""
    import tifffile

    logging.getLogger("tifffile").setLevel(logging.CRITICAL)  # what it logs is said by what it raises
    try:
        _require_end(content)
        file = tifffile.TiffFile(BytesIO(content))
        pages = list(file.pages)
        return [TiffImage(tuple(map(int, page.shape)), _loader(page, content)) for page in pages]
    except Exception as error:  # the library raises whatever a damaged structure leads to
        raise _unreadable(error) from None


def _loader(page: Any, content: bytes) -> Callable[[], Matrix]:
    def load() -> Matrix:
        try:
            _require_bounded(page, content)
            return np.asarray(page.asarray())
        except Exception as error:
            raise _unreadable(error) from None

    return load


def _unreadable(error: Exception) -> ValueError:
    advice = "save it without compression" if "codec" in str(error) else "copy or export it again"
    return ValueError(f"is not a readable TIFF file ({first_line(error)}); {advice}")


def _require_end(content: bytes) -> None:
    """Raise ``ValueError`` unless the chain of directories ends, inside the file and after a sensible number."""
    order = {b"II": "<", b"MM": ">"}.get(content[:2])
    version = struct.unpack_from(f"{order}H", content, 2)[0] if order and len(content) >= 4 else 0
    if order is None or version not in (42, 43):
        raise ValueError("does not begin as a TIFF file does")
    # Where the first directory is named; how a count of tags, a tag, and a place are stored.
    at, count, tag_bytes, place = (4, "H", 12, "I") if version == 42 else (8, "Q", 20, "Q")
    count, place = order + count, order + place
    seen: set[int] = set()
    while True:
        directory = _number(content, at, place)
        if directory == 0:
            return
        if directory in seen:
            raise ValueError(f"its directory at byte {directory} comes again after itself")
        if len(seen) == _MAX_PAGES:
            raise ValueError(f"more than {_MAX_PAGES} pages")
        seen.add(directory)
        at = directory + struct.calcsize(count) + tag_bytes * _number(content, directory, count)


def _number(content: bytes, at: int, layout: str) -> int:
    if at + struct.calcsize(layout) > len(content):
        raise ValueError(f"ends before byte {at}, where a directory should be")
    return int(struct.unpack_from(layout, content, at)[0])


def _require_bounded(page: Any, content: bytes) -> None:
    """Raise ``ValueError`` where a part of the page unpacks into more than the page has."""
    most = prod(page.shape) * page.dtype.itemsize + (1 << 20)
    for first, count in zip(page.dataoffsets, page.databytecounts, strict=False):
        packed = content[first : first + count]
        if page.compression in _DEFLATE:
            size = len(zlib.decompressobj().decompress(packed, most + 1))
        elif page.compression in _LZMA:
            size = len(lzma.LZMADecompressor().decompress(packed, most + 1))
        else:
            size = 0
        if size > most:
            raise ValueError("a part of it unpacks into more than the image has")
