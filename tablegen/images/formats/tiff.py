"""Pages of a TIFF file, each read on demand; a file that would take more time or memory than its pages is refused.

tifffile reads them, if the extra ``images`` is installed. What it believes of a file is checked before: a directory
that points back at itself has no end, and a few packed bytes can unpack into any number.
"""

import logging
import lzma
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from math import prod
from typing import Any

import numpy as np

from tablegen.images.formats.channel import Channel, Matrix, first_line, length_nm, positive

_MAX_PAGES = 1000
_MAX_TAGS = 100_000  # of all pages
_MAX_TEXT = 256  # characters of a tag
_MAX_DESCRIPTION = 4096  # characters of the tag in which ImageJ has its unit
_TEXT, _RATIONAL = 2, 5
_DESCRIPTION, _PIXELS_ACROSS, _PIXELS_ALONG = 270, 282, 283
_KINDS = {1: "B", 3: "H", 4: "I", 5: "2I", 6: "b", 8: "h", 9: "i", 11: "f", 12: "d"}  # of a number in a tag
TiffTags = dict[int, int | float | str]
_BYTES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8}  # of a number of a kind
_DEFLATE, _LZMA = (8, 32946), (34925,)  # values of the tag Compression


@dataclass(frozen=True, eq=False)
class TiffImage:
    """The shape of a page, and its reader, which raises ``ValueError``."""

    shape: tuple[int, ...]
    load: Callable[[], Matrix]


def tiff_channels(content: bytes, _: str) -> list[Channel]:
    """Return the pages of a .tif file, in grey.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    pages = tiff_pages(content)
    for page in pages:
        if len(page.shape) == 3 and page.shape[-1] in (3, 4):
            raise ValueError("is in colour, not heights; export it in grey, 16 bits or floating point")
    tags = tiff_tags(content)
    across, along = _imagej_pixel(tags[0]) if tags else (None, None)
    return [
        Channel(
            at,
            "",
            page.shape,
            partial(_of_frame, page),
            width_nm=None if across is None or len(page.shape) != 2 else across * page.shape[1],
            height_nm=None if along is None or len(page.shape) != 2 else along * page.shape[0],
        )
        for at, page in enumerate(pages)
    ]


def _imagej_pixel(tags: TiffTags) -> tuple[float | None, float | None]:
    """Return width and height of a pixel in nm as ImageJ writes them; None where it has no unit of length."""
    text = tags.get(_DESCRIPTION)
    if not isinstance(text, str) or not text.startswith("ImageJ="):
        return None, None
    unit = next((line[5:].strip() for line in text.splitlines() if line.startswith("unit=")), "")
    unit = unit.replace("\\u00B5", "\u00b5").replace("\u00c2", "")  # as ImageJ, and as programs that take it for UTF-8
    sides = [positive(tags.get(code)) for code in (_PIXELS_ACROSS, _PIXELS_ALONG)]
    across, along = (None if side is None else length_nm(1.0 / side, unit) for side in sides)
    return across, along


def _of_frame(page: TiffImage, _: int) -> Matrix:
    return page.load()


def tiff_pages(content: bytes) -> list[TiffImage]:
    """Return the pages of a file, in order.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    import tifffile

    logging.getLogger("tifffile").setLevel(logging.CRITICAL)  # it logs what it also raises
    try:
        for _ in _directories(content):
            pass
        file = tifffile.TiffFile(BytesIO(content))
        pages = list(file.pages)
        return [TiffImage(tuple(map(int, page.shape)), _loader(page, content)) for page in pages]
    except Exception as error:  # the library raises whatever a damaged structure leads to
        raise _unreadable(error) from None


def _loader(page: Any, content: bytes) -> Callable[[], Matrix]:
    def load() -> Matrix:
        """Read the pixels of the page.

        Returns
        -------
        Matrix
            Values of the page, of its shape.

        Raises
        ------
        ValueError
            If the page is damaged, or unpacks into more than it has.
        """
        try:
            _require_bounded(page, content)
            return np.asarray(page.asarray())
        except Exception as error:
            raise _unreadable(error) from None

    return load


def _unreadable(error: Exception) -> ValueError:
    advice = "save it without compression" if "codec" in str(error) else "copy or export it again"
    return ValueError(f"is not a readable TIFF file ({first_line(error)}); {advice}")


def tiff_tags(content: bytes) -> list[TiffTags]:
    """Return the tags of each page that hold one number or a short text, by code; others are left out.

    Raises
    ------
    ValueError
        If the directories, or what these tags point at, do not end inside the file.
    """
    pages: list[TiffTags] = []
    for order, big, at, count in _directories(content):
        tags: TiffTags = {}
        for entry in range(at, at + count * (20 if big else 12), 20 if big else 12):
            code, kind = struct.unpack_from(f"{order}HH", content, entry)
            length = _number(content, entry + 4, order + ("Q" if big else "I"))
            most = _MAX_DESCRIPTION if code == _DESCRIPTION else _MAX_TEXT
            layout = f"{length}s" if kind == _TEXT and length <= most else _KINDS.get(kind, "")
            if not layout or (kind != _TEXT and length != 1):
                continue
            place = entry + (12 if big else 8)
            if struct.calcsize(layout) > (8 if big else 4):
                place = _number(content, place, order + ("Q" if big else "I"))
            if place + struct.calcsize(layout) > len(content):
                raise ValueError(f"ends before byte {place}, where a tag should be; copy it again")
            value, *divisor = struct.unpack_from(order + layout, content, place)
            if kind == _RATIONAL:
                tags[code] = value / divisor[0] if divisor[0] else 0.0
            else:
                tags[code] = value.split(b"\0")[0].decode("latin-1") if isinstance(value, bytes) else value
        pages.append(tags)
    return pages


def tiff_block(content: bytes, code: int) -> bytes | None:
    """Return the bytes of a tag of the first page; None if it has no such tag.

    Raises
    ------
    ValueError
        If the directories, or what this tag points at, do not end inside the file.
    """
    for order, big, at, count in _directories(content):
        step, place, most, layout = (20, 12, 8, "Q") if big else (12, 8, 4, "I")
        for entry in range(at, at + count * step, step):
            own, kind = struct.unpack_from(f"{order}HH", content, entry)
            if own != code:
                continue
            length = _number(content, entry + 4, order + layout) * _BYTES.get(kind, 1)
            start = entry + place if length <= most else _number(content, entry + place, order + layout)
            if start + length > len(content):
                raise ValueError(f"ends before byte {start}, where a tag should be; copy it again")
            return content[start : start + length]
        return None
    return None


def _directories(content: bytes) -> Iterator[tuple[str, bool, int, int]]:
    """Yield byte order, True for a BigTIFF, place and number of the tags of each page.

    Raises ``ValueError`` unless the chain ends, inside the file and after a sensible number.
    """
    order = {b"II": "<", b"MM": ">"}.get(content[:2])
    version = struct.unpack_from(f"{order}H", content, 2)[0] if order and len(content) >= 4 else 0
    if order is None or version not in (42, 43):
        raise ValueError("does not begin as a TIFF file does")
    # Place of the pointer to the first directory; layouts of a count of tags, a tag, and a place.
    at, count, tag_bytes, place = (4, "H", 12, "I") if version == 42 else (8, "Q", 20, "Q")
    count, place = order + count, order + place
    visited: set[int] = set()
    total = 0
    while True:
        directory = _number(content, at, place)
        if directory == 0:
            return
        if directory in visited:
            raise ValueError(f"its directory at byte {directory} comes again after itself")
        if len(visited) == _MAX_PAGES:
            raise ValueError(f"more than {_MAX_PAGES} pages")
        visited.add(directory)
        first, tags = directory + struct.calcsize(count), _number(content, directory, count)
        total += tags
        if total > _MAX_TAGS:
            raise ValueError(f"more than {_MAX_TAGS} tags")
        at = first + tag_bytes * tags
        _number(content, at, place)
        yield order, version == 43, first, tags


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
