r"""Nanoscope files of Bruker and Veeco (.spm, .000): lists of ``\key: value`` lines, then integers.

The first row is the bottom one; it is the last in time, and rows are turned, if the frame's direction is Down. Of a
scan that was stopped only the valid rows are read; its aspect ratio is that of the whole scan.
"""

import re
from functools import partial
from math import prod

import numpy as np

from tablegen.images.formats.channel import Channel, Direction, FirstRow, Matrix, positive, rotation_deg

_MAGICS = b"\\*File list", b"\\*EC File list"  # EC: of an electrochemical cell
_END = b"File list end"
_MAX_HEADER = 4 << 20  # bytes; files have some hundred thousand at most
_MAX_IMAGES = 1000
_IMAGES, _SCAN = "*Ciao image list", "*Ciao scan list"
_SCALED = re.compile(r"\w+\s+(?:\[(?P<by>[^\]]*)\]\s*)?(?:\([^)]*\)\s*)?(?P<value>[-+.\deE]+)\s*(?P<unit>\S*)")
_NAMED = re.compile(r'\w+\s*(?:\[(?P<internal>[^\]]*)\]\s*)?(?:"(?P<name>[^"]*)")?')
_NM = {"nm": 1.0, "pm": 1e-3, "~m": 1e3, "um": 1e3, "µm": 1e3, "mm": 1e6}
_DIRECTIONS: dict[str, Direction] = {"trace": "trace", "retrace": "retrace"}

_List = dict[str, str]


def spm_channels(content: bytes, _: str) -> list[Channel]:
    """Return the images of a Nanoscope file.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    if not content.startswith(_MAGICS):
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
    scan = next((one for name, one in lists if name == _SCAN), {})
    if len(images) > _MAX_IMAGES:
        raise ValueError(f"has {len(images)} images; at most {_MAX_IMAGES} are read")
    return [_channel(content, at, one, others, scan) for at, one in enumerate(images)]


def _lists(header: str) -> list[tuple[str, _List]]:
    """Return each list with its keys, in lower case, since versions differ in that."""
    lists: list[tuple[str, _List]] = []
    for line in header.splitlines():
        text = line.strip().removeprefix("\\")
        if text.startswith("*"):
            lists.append((text, {}))
        elif lists:
            entry = re.match(r"(@\d+:[^:]*|[^:]*):(.*)", text)
            if entry:
                lists[-1][1].setdefault(entry[1].strip().lower(), entry[2].strip())
    return lists


def _channel(content: bytes, at: int, image: _List, others: _List, scan: _List) -> Channel:
    columns, rows = _whole(at, image, "samps/line"), _whole(at, image, "number of lines")
    start, size = _whole(at, image, "data offset"), _whole(at, image, "data length")
    count = columns * rows
    stored = size // count if count else 0  # bytes; version 9.2 stores 4 where Bytes/pixel says 2
    if stored not in (2, 4) or start + size > len(content):
        where = f"{columns} x {rows} pixels in {size} bytes from byte {start} of {len(content)}"
        raise ValueError(f"has an image {at} of {where}; copy it again")
    key = next((key for key in image if re.fullmatch(r"@\d+:image data", key)), "")
    name_match = _NAMED.match(image.get(key, ""))
    signal = (name_match["name"] or name_match["internal"] or "" if name_match else "").strip()
    direction = _DIRECTIONS.get(image.get("line direction", "").lower())
    factor, unit = _scale(image.get(f"{key.partition(':')[0]}:z scale", ""), others, stored)
    down = image.get("frame direction", "").lower()
    first: FirstRow = "top" if down == "down" else "bottom"
    valid = _valid_rows(image, rows)
    complete = len(range(*valid.indices(rows)))
    planned = max(rows, round(positive(scan.get("lines")) or 0.0))
    width, height = _size(image, columns, planned)
    return Channel(
        at,
        f"{signal} {direction}" if direction else signal,
        (complete, columns),
        partial(_load, content, f"<i{stored}", start, (rows, columns), valid, first, factor),
        signal,
        direction,
        unit,
        width,
        None if height is None else height * complete / planned,
        positive(scan.get("scan rate", "").partition(" ")[0]),
        first,
        angle_deg=rotation_deg(image.get("rotate ang.") or scan.get("rotate ang.") or ""),
    )


def _valid_rows(image: _List, rows: int) -> slice:
    """Return the stored rows that were scanned; all if the file states no valid number of them."""
    first, count = (image.get(f"valid data {what} y", "") for what in ("start", "len"))
    if not (first.isdecimal() and count.isdecimal() and len(first) < 7 and len(count) < 7):
        return slice(0, rows)
    valid = slice(int(first), int(first) + int(count))
    return valid if valid.start < valid.stop <= rows else slice(0, rows)


def _load(
    content: bytes, kind: str, start: int, shape: tuple[int, int], valid: slice, first: FirstRow, factor: float, _: int
) -> Matrix:
    values = np.frombuffer(content, kind, prod(shape), start).reshape(shape)[valid] * factor
    return values[::-1] if first == "top" else values


def _whole(at: int, image: _List, key: str) -> int:
    word = (image.get(key, "").split() or [""])[0]
    if not word.isdecimal() or len(word) > 10:
        raise ValueError(f"has no whole number as {key} of its image {at}")
    return int(word)


def _size(image: _List, columns: int, rows: int) -> tuple[float | None, float | None]:
    """Return width and height in nm of a whole scan; no height unless pixels are square, since readers differ then."""
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
    """Return the size of a step of the values, and their unit; steps if the file states none."""
    scale = _SCALED.match(text)
    most = positive(scale["value"]) if scale else None
    if scale is None or most is None:
        return 1.0, "LSB"
    step = most / 256.0**stored
    if not scale["by"]:
        return step, scale["unit"]
    sensitivity = _SCALED.match(others.get(f"@{scale['by'].lower()}", ""))
    each = positive(sensitivity["value"]) if sensitivity else None
    if sensitivity is None or each is None:
        return step, scale["unit"]
    return step * each, sensitivity["unit"].removesuffix("/V") or scale["unit"]
