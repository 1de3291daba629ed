"""Scans of Nanonis (.sxm): tags in colons with their lines, then blocks of numbers, forward and backward.

Rows are in the order of time. Backward lines are too, from right to left, and are turned here. A scan that was stopped
has NaN in place of what is missing; it ends with its last whole line.
"""

from functools import partial
from math import prod

import numpy as np

from tablegen.images.formats.channel import (
    Channel,
    Direction,
    FirstRow,
    Matrix,
    complete_lines,
    number,
    positive,
    quote,
)

_MAGIC = b":NANONIS_VERSION:"
_END, _DATA = b":SCANIT_END:", b"\x1a\x04"
_MAX_HEADER = 1 << 20  # bytes; files have some thousand
_MAX_BLOCKS = 1000
_DIRECTIONS: dict[str, tuple[Direction, ...]] = {
    "both": ("trace", "retrace"),
    "forward": ("trace",),
    "fwd": ("trace",),
    "backward": ("retrace",),
    "bwd": ("retrace",),
}
_NAMES = {"trace": "forward", "retrace": "backward"}
_FIRST_ROW: dict[str, FirstRow] = {"up": "bottom", "down": "top"}


def sxm_channels(content: bytes, _: str) -> list[Channel]:
    """Return both directions of each signal of a .sxm file.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    if not content.startswith(_MAGIC):
        raise ValueError("does not begin as a Nanonis file does")
    end = content.find(_END, 0, _MAX_HEADER)
    start = content.find(_DATA, end, end + 64) + len(_DATA)
    if end < 0 or start < end:
        raise ValueError("has no end of its header, or no data after it; copy it again")
    tags = _tags(content[:end].decode("latin-1"))
    kind = {"FLOAT MSBFIRST": ">f4", "FLOAT LSBFIRST": "<f4"}.get(" ".join(_words(tags, "SCANIT_TYPE")))
    if kind is None:
        raise ValueError(f"has numbers of the kind {quote(' '.join(_words(tags, 'SCANIT_TYPE')))}; FLOAT is read")
    columns, rows = _whole(tags)
    if _words(tags, "NANONIS_VERSION") == ["1"] and columns != rows:
        raise ValueError("is of version 1, which does not tell columns from rows; save it with a newer version")
    blocks = _blocks(tags)
    if not blocks:
        return []
    size = 4 * columns * rows
    if start + size * len(blocks) > len(content):
        least = f"{len(blocks)} images of {columns} x {rows} pixels"
        raise ValueError(f"ends in the middle of its images ({least} by its header); copy it again")
    complete = complete_lines(
        np.frombuffer(content, kind, len(blocks) * columns * rows, start).reshape(-1, rows, columns)
    )
    width, height = _lengths(tags, "SCAN_RANGE", 1e9)
    forward_s, backward_s = _lengths(tags, "SCAN_TIME", 1.0)
    period_s = None if forward_s is None or backward_s is None else forward_s + backward_s
    turn = None if forward_s is None or period_s is None else forward_s / period_s
    angle = number(next(iter(_words(tags, "SCAN_ANGLE")), None))
    return [
        Channel(
            at,
            f"{signal} {_NAMES[direction]}",
            (complete, columns),
            partial(_load, content, kind, start + size * at, (complete, columns), direction),
            signal,
            direction,
            unit,
            width,
            None if height is None else height * complete / rows,
            None if period_s is None else 1.0 / period_s,
            _FIRST_ROW.get(" ".join(_words(tags, "SCAN_DIR"))),
            angle_deg=angle,
            turn=turn,
        )
        for at, (signal, unit, direction) in enumerate(blocks)
    ]


def _load(content: bytes, kind: str, start: int, shape: tuple[int, int], direction: Direction, _: int) -> Matrix:
    values = np.frombuffer(content, kind, prod(shape), start).reshape(shape)
    return values[:, ::-1] if direction == "retrace" else values


def _tags(header: str) -> dict[str, list[str]]:
    """Return the lines below each tag."""
    tags: dict[str, list[str]] = {}
    lines: list[str] = []
    for line in header.splitlines():
        text = line.strip()
        if len(text) > 2 and text[0] == text[-1] == ":":
            lines = tags.setdefault(text[1:-1], [])
        elif text:
            lines.append(line)
    return tags


def _words(tags: dict[str, list[str]], name: str) -> list[str]:
    return tags.get(name, [""])[0].split() if tags.get(name) else []


def _whole(tags: dict[str, list[str]]) -> tuple[int, int]:
    words = _words(tags, "SCAN_PIXELS")
    if len(words) != 2 or not all(word.isdecimal() and len(word) < 7 for word in words):
        raise ValueError(f"has no two numbers as SCAN_PIXELS, but {quote(' '.join(words))}")
    columns, rows = map(int, words)
    if not columns * rows:
        raise ValueError(f"has an image of {columns} x {rows} pixels; is it damaged?")
    return columns, rows


def _lengths(tags: dict[str, list[str]], name: str, unit: float) -> tuple[float | None, float | None]:
    """Return two positive numbers in units, each None where it is none."""
    first, second = [*_words(tags, name), "", ""][:2]
    return positive(first, unit), positive(second, unit)


def _blocks(tags: dict[str, list[str]]) -> list[tuple[str, str, Direction]]:
    """Return signal, unit and direction of each block, in the order of the file."""
    head, *rows = [line.strip().split("\t") for line in tags.get("DATA_INFO", [])] or [[]]
    try:
        name, unit, direction = (head.index(key) for key in ("Name", "Unit", "Direction"))
        channels = [
            (row[name].strip(), row[unit].strip(), one)
            for row in rows
            for one in _DIRECTIONS[row[direction].strip().lower()]
        ]
    except (ValueError, KeyError, IndexError):
        raise ValueError("has a table DATA_INFO that does not say Name, Unit and Direction of each row") from None
    if len(channels) > _MAX_BLOCKS:
        raise ValueError(f"has {len(channels)} images; at most {_MAX_BLOCKS} are read")
    return channels
