"""Images of WSxM (.stp, .top): sections of ``key: value`` lines, then numbers, the last pixel of the picture first.

A file has one channel in one direction. Rows are in the order of time where the file says whether the slow axis went up
or down.
"""

import re
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
    quantity_nm,
    quote,
    whole_number,
)

_MAGIC, _IMAGE = b"WSxM file copyright", b"SxM Image file"
_SIZE = re.compile(rb"Image header size:\s*(\d{1,7})\s")
_MAX_HEADER = 1 << 20  # bytes; files have some thousand
_BEGINNING = 256  # bytes, within which the size of the header stands
_KINDS = {"": "<i2", "short": "<i2", "float": "<f4", "floating": "<f4", "double": "<f8"}
_DIRECTIONS: dict[str, Direction] = {"forward": "trace", "backward": "retrace"}
_FIRST_ROW: dict[str, FirstRow] = {"up": "bottom", "down": "top"}


def wsxm_channels(content: bytes, _: str) -> list[Channel]:
    """Return the image of a file of WSxM.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    if not content.startswith(_MAGIC) or _IMAGE not in content[:_BEGINNING]:
        raise ValueError("does not begin as an image of WSxM does")
    size = _SIZE.search(content[:_BEGINNING])
    start = int(size[1]) if size else 0
    if not 0 < start <= min(len(content), _MAX_HEADER) or b"[Header end]" not in content[:start]:
        raise ValueError("has no end of its header where it says that it is; copy it again")
    keys = _keys(content[:start].decode("latin-1"))
    columns, rows = (
        whole_number(keys.get(f"number of {what}", ""), f"number of {what}") for what in ("columns", "rows")
    )
    check_pixels(columns, rows)
    kind = _KINDS.get(keys.get("image data type", "").lower())
    if kind is None:
        raise ValueError(f"has numbers of the kind {quote(keys['image data type'])}; short, float and double are read")
    if start + columns * rows * np.dtype(kind).itemsize > len(content):
        raise ValueError(f"ends in the middle of its image of {columns} x {rows} pixels; copy it again")
    signal = keys.get("acquisition channel", "")
    direction = _DIRECTIONS.get(keys.get("x scanning direction", "").lower())
    first = _FIRST_ROW.get(keys.get("y scanning direction", "").lower())
    most, _, unit = keys.get("z amplitude", "").partition(" ")
    span = positive(most) if kind == "<i2" else None
    scaled = span is not None or (kind != "<i2" and bool(unit))
    return [
        Channel(
            0,
            f"{signal} {direction}" if direction else signal,
            (rows, columns),
            partial(_load, content, kind, start, (rows, columns), first == "bottom", span),
            signal,
            direction,
            unit.strip() if scaled else "LSB",
            quantity_nm(keys.get("x amplitude", "")),
            quantity_nm(keys.get("y amplitude", "")),
            positive(keys.get("x-frequency", "").removesuffix("Hz")),
            first,
            angle_deg=number((keys.get("rotation") or keys.get("angle", "")).partition(" ")[0]),
        )
    ]


def _keys(header: str) -> dict[str, str]:
    """Return the keys of all sections in lower case, the first of a repeated one."""
    keys: dict[str, str] = {}
    for line in header.splitlines():
        key, colon, value = line.partition(":")
        if colon:
            keys.setdefault(key.strip().lower(), value.strip())
    return keys


def _load(
    content: bytes, kind: str, start: int, shape: tuple[int, int], up: bool, span: float | None, _: int
) -> Matrix:
    rows, columns = shape
    picture = np.frombuffer(content, kind, rows * columns, start)[::-1].reshape(shape)
    rows_in_time = picture[::-1] if up else picture
    if span is None:
        return rows_in_time
    levels = float(np.ptp(picture.astype(np.float64)))
    return rows_in_time * (span / levels) if levels else rows_in_time
