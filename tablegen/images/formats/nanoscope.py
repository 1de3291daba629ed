"""Nanoscope files of Bruker and Veeco (.spm, .000): lists of ``\\key: value`` lines, then integers.

The first row is the bottom one; it is the last in time, and rows are turned, if the frame's direction is Down.
"""

import re
from functools import partial
from math import prod

import numpy as np

from tablegen.images.formats.channel import Channel, Direction, FirstRow, Matrix, positive

_END = b"\\*File list end"
_MAX_HEADER = 4 << 20  # bytes; files have some hundred thousand at most
_MAX_IMAGES = 1000
_IMAGES, _SCAN = "*Ciao image list", "*Ciao scan list"
_SCALED = re.compile(r"\w+\s+(?:\[(?P<by>[^\]]*)\]\s*)?(?:\([^)]*\)\s*)?(?P<value>[-+.\deE]+)\s*(?P<unit>\S*)")
_NAMED = re.compile(r'\w+\s*(?:\[(?P<internal>[^\]]*)\]\s*)?(?:"(?P<name>[^"]*)")?')
_NM = {"nm": 1.0, "pm": 1e-3, "~m": 1e3, "um": 1e3, "µm": 1e3, "mm": 1e6}
_DIRECTIONS: dict[str, Direction] = {"trace": "trace", "retrace": "retrace"}

_List = dict[str, str]


def spm_channels(content: bytes, _: str) -> list[Channel]:
    """The images of a Nanoscope file. Raises ``ValueError`` with what is wrong."""
    if not content.startswith(b"\\*File list"):
        what = "is a file of force curves, not images" if content.startswith(b"\\*Force file list") else ""
        raise ValueError(what or "does not begin as a Nanoscope file does")
    end = content.find(_END, 0, _MAX_HEADER)
    if end < 0:
        raise ValueError("has no end of its header; copy it again")
    lists = _lists(content[:end].decode("cp1252", "replace"))
    images = [one for name, one in lists if name == _IMAGES]
    others: _List = {}  # the first of a key; sensitivities stand with the scanner, or with the scan
    for _, one in lists:
        for key, value in one.items():
            others.setdefault(key, value)
    rate = next((one.get("scan rate", "") for name, one in lists if name == _SCAN), "")
    if len(images) > _MAX_IMAGES:
        raise ValueError(f"has {len(images)} images; at most {_MAX_IMAGES} are read")
    line_rate = positive(rate.partition(" ")[0])
    return [_channel(content, number, one, others, line_rate) for number, one in enumerate(images)]


def _lists(header: str) -> list[tuple[str, _List]]:
    """Each list with its keys, in lower case, since versions differ in that."""
    lists: list[tuple[str, _List]] = []
    for line in header.splitlines():
        text = line.strip().removeprefix("\\")
        if text.startswith("*"):
            lists.append((text, {}))
        elif lists:
            found = re.match(r"(@\d+:[^:]*|[^:]*):(.*)", text)
            if found:
                lists[-1][1].setdefault(found[1].strip().lower(), found[2].strip())
    return lists


def _channel(content: bytes, number: int, image: _List, others: _List, line_rate: float | None) -> Channel:
    columns, rows = _whole(number, image, "samps/line"), _whole(number, image, "number of lines")
    start, size = _whole(number, image, "data offset"), _whole(number, image, "data length")
    count = columns * rows
    stored = size // count if count else 0  # bytes; version 9.2 stores 4 where Bytes/pixel says 2
    if stored not in (2, 4) or start + size > len(content):
        where = f"{columns} x {rows} pixels in {size} bytes from byte {start} of {len(content)}"
        raise ValueError(f"has an image {number} of {where}; copy it again")
    key = next((key for key in image if re.fullmatch(r"@\d+:image data", key)), "")
    named = _NAMED.match(image.get(key, ""))
    signal = (named["name"] or named["internal"] or "" if named else "").strip()
    direction = _DIRECTIONS.get(image.get("line direction", "").lower())
    factor, unit = _scale(image.get(f"{key.partition(':')[0]}:z scale", ""), others, stored)
    down = image.get("frame direction", "").lower()
    first: FirstRow = "top" if down == "down" else "bottom"
    width, height = _size(image, columns, rows)
    return Channel(
        number,
        f"{signal} {direction}" if direction else signal,
        (rows, columns),
        partial(_load, content, f"<i{stored}", start, (rows, columns), first, factor),
        signal,
        direction,
        unit,
        width,
        height,
        line_rate,
        first,
    )


def _load(
    content: bytes, kind: str, start: int, shape: tuple[int, int], first: FirstRow, factor: float, _: int
) -> Matrix:
    values = np.frombuffer(content, kind, prod(shape), start).reshape(shape) * factor
    return values[::-1] if first == "top" else values


def _whole(number: int, image: _List, key: str) -> int:
    word = (image.get(key, "").split() or [""])[0]
    if not word.isdecimal() or len(word) > 10:
        raise ValueError(f"has no whole number as {key} of its image {number}")
    return int(word)


def _size(image: _List, columns: int, rows: int) -> tuple[float | None, float | None]:
    """Width and height in nm; no height where the pixels are not square by the aspect ratio, since readers differ."""
    words = image.get("scan size", "").split()
    nm = _NM.get(words[-1]) if words else None
    width = positive(words[0]) if nm else None
    if width is None or nm is None:
        return None, None
    across, _, along = image.get("aspect ratio", "").partition(":")
    ratio = (positive(across) or 0.0) / (positive(along) or 1.0)
    square = not ratio or abs(ratio * rows / columns - 1.0) < 0.01
    return width * nm, width * nm * rows / columns if square else None


def _scale(text: str, others: _List, stored: int) -> tuple[float, str]:
    """The unit of the values, and how much of it is one step; steps where the file does not say."""
    found = _SCALED.match(text)
    most = positive(found["value"]) if found else None
    if found is None or most is None:
        return 1.0, "LSB"
    step = most / 256.0**stored
    if not found["by"]:
        return step, found["unit"]
    sensitivity = _SCALED.match(others.get(f"@{found['by'].lower()}", ""))
    each = positive(sensitivity["value"]) if sensitivity else None
    if sensitivity is None or each is None:
        return step, found["unit"]
    return step * each, sensitivity["unit"].removesuffix("/V") or found["unit"]
