"""Images of Nanosurf (.nid): sections of ``key=value`` lines up to ``#!``, then the numbers of all data sets.

The first row is the bottom one; whether it is the first in time is not known.
"""

import re
from functools import partial

import numpy as np

from tablegen.images.formats.channel import (
    Channel,
    Direction,
    Matrix,
    check_pixels,
    length_nm,
    number,
    quote,
    split_direction,
    whole_number,
)

_MAGIC, _DATA = b"[DataSet]", b"#!"
_MAX_HEADER = 4 << 20  # bytes; files have some ten thousand
_MAX_CHANNELS = 1000
_BITS = ("8", "16", "32")
_ORDERS = {"Intel": "<", "Motorola": ">"}

_Section = dict[str, str]


def nid_channels(content: bytes, _: str) -> list[Channel]:
    """Return the images of a file of Nanosurf; curves are left out.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    if not content.startswith(_MAGIC):
        raise ValueError("does not begin as a file of Nanosurf does")
    end = content.find(_DATA, 0, _MAX_HEADER)
    if end < 0:
        raise ValueError("has no end of its header; copy it again")
    sections = _sections(content[:end].decode("latin-1"))
    angle = _angle(sections.get("DataSet-Info", {}))
    at = end + len(_DATA)
    channels: list[Channel] = []
    for name in _listed(sections.get("DataSet", {})):
        one = sections.get(name)
        if one is None:
            continue
        columns, rows = (whole_number(one.get(key, ""), f"{key} of {name}") for key in ("Points", "Lines"))
        check_pixels(columns, rows)
        kind = _kind(name, one)
        size = columns * rows * np.dtype(kind).itemsize
        if at + size > len(content):
            raise ValueError(f"ends in the middle of its data set {quote(name)} of {columns} x {rows}; copy it again")
        if one.get("Dim1Name", "Y").startswith("Y"):  # rows of points of curves are no images
            channels.append(_channel(len(channels), content, one, kind, at, (rows, columns), angle))
        at += size
    return channels


def _sections(header: str) -> dict[str, _Section]:
    """Return the keys of each section; the first of a repeated one."""
    sections: dict[str, _Section] = {}
    section: _Section = {}
    for line in header.splitlines():
        text = line.strip()
        if text.startswith("[") and text.endswith("]"):
            section = sections.setdefault(text[1:-1], {})
        elif "=" in text:
            key, _, value = text.partition("=")
            section.setdefault(key, value)
    return sections


def _listed(data_set: _Section) -> list[str]:
    """Return the names of the sections of all data sets, in the order of their numbers."""
    places = []
    for key, name in data_set.items():
        match = re.fullmatch(r"Gr(\d{1,4})-Ch(\d{1,4})", key)
        if match:
            places.append((int(match[1]), int(match[2]), name))
    if len(places) > _MAX_CHANNELS:
        raise ValueError(f"has {len(places)} data sets; at most {_MAX_CHANNELS} are read")
    return [name for _, _, name in sorted(places)]


def _kind(name: str, one: _Section) -> str:
    bits, order, sign = one.get("SaveBits", ""), _ORDERS.get(one.get("SaveOrder", "Intel")), one.get("SaveSign", "")
    if bits not in _BITS or order is None or one.get("SaveMode", "Binary") != "Binary":
        raise ValueError(f"has numbers of an unknown kind in {quote(name)}; integers of 8, 16 or 32 bits are read")
    return f"{order}{'u' if sign == 'Unsigned' else 'i'}{int(bits) // 8}"


def _channel(
    at: int, content: bytes, one: _Section, kind: str, start: int, shape: tuple[int, int], angle: float | None
) -> Channel:
    signal = one.get("Dim2Name", "")
    _, direction = split_direction(one.get("Frame", ""))
    low, span = number(one.get("Dim2Min")), number(one.get("Dim2Range"))
    scaled = low is not None and span is not None and span != 0.0
    levels = np.iinfo(np.dtype(kind))
    step = (span or 0.0) / (float(levels.max) - float(levels.min) + 1.0) if scaled else 1.0
    zero = (low or 0.0) - float(levels.min) * step if scaled else 0.0
    return Channel(
        at,
        f"{signal} {_name(direction)}".strip(),
        shape,
        partial(_load, content, kind, start, shape, zero, step),
        signal,
        direction,
        one.get("Dim2Unit", "") if scaled else "LSB",
        length_nm(one.get("Dim0Range"), one.get("Dim0Unit", "")),
        length_nm(one.get("Dim1Range"), one.get("Dim1Unit", "")),
        angle_deg=angle,
    )


def _name(direction: Direction | None) -> str:
    return {"trace": "forward", "retrace": "backward"}.get(direction or "", "")


def _angle(info: _Section) -> float | None:
    """Return the rotation of the scan, such as ``90°``; None where the file does not say."""
    return number(info.get("Rotation", "").removesuffix("\u00b0").strip())


def _load(content: bytes, kind: str, start: int, shape: tuple[int, int], zero: float, step: float, _: int) -> Matrix:
    rows, columns = shape
    values = np.frombuffer(content, kind, rows * columns, start).reshape(shape)
    return zero + step * values.astype(np.float64)
