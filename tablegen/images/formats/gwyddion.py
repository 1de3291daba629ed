"""Data fields of a Gwyddion file (.gwy): named components, each of a type, in objects that state their length.

Nothing is read beyond the end of the object that holds it, so that the message names the damage.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import prod

import numpy as np

from tablegen.images.formats.channel import Channel, channel_of_array, number, positive, rotation_deg
from tablegen.numerics.arrays import Floats

_MAGIC = b"GWYP"
_MAX_COMPONENTS = 100_000  # of an object or a list; files have some hundred
_ANGLES = ("scanangle", "rotateang", "rotation", "scanrotation", "fastscanangle")  # keys of metadata: letters alone
_NANOSCOPE_ANGLE = "rotateang"
_FIXED = {b"b": 1, b"c": 1, b"i": 4, b"q": 8, b"d": 8}
_ITEMS = {b"C": 1, b"I": 4, b"Q": 8, b"D": 8}


@dataclass(frozen=True, eq=False)
class DataField:
    """An image of the file: its number and title, the values, the sides in m where those are lengths, and the unit.

    ``angle_deg`` is the scan angle by the metadata that the instrument's file had; None where there is none.
    """

    number: int
    title: str
    values: Floats
    width_m: float | None
    height_m: float | None
    unit: str
    angle_deg: float | None = None


def gwy_channels(content: bytes, _: str) -> list[Channel]:
    """Return the data fields of a .gwy file as channels.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    channels = []
    for field in data_fields(content):
        width, height = (None if side is None else side * 1e9 for side in (field.width_m, field.height_m))
        channel = channel_of_array(field.number, field.title, field.values)
        channels.append(replace(channel, unit=field.unit, width_nm=width, height_nm=height, angle_deg=field.angle_deg))
    return channels


def data_fields(content: bytes) -> list[DataField]:
    """Return the data fields, by number.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    if content[:4] != _MAGIC:
        raise ValueError("does not begin as a Gwyddion file does")
    _, outer, _ = _object(content, 4, len(content))
    titles: dict[int, str] = {}
    fields: dict[int, tuple[int, int]] = {}
    angles: dict[int, float | None] = {}
    for name, kind, at, end in _components(content, *outer):
        own, _, rest = name.removeprefix("/").partition("/")
        if not own.isdecimal() or len(own) > 6:
            continue
        if rest == "data/title" and kind == b"s":
            titles[int(own)] = content[at : end - 1].decode("utf-8", "replace")
        elif rest == "data" and kind == b"o":
            fields[int(own)] = at, end
        elif rest == "meta" and kind == b"o":
            angles[int(own)] = _angle(content, at, end)
    return [_field(content, *fields[one], one, titles.get(one, ""), angles.get(one)) for one in sorted(fields)]


def _angle(content: bytes, at: int, end: int) -> float | None:
    """Return the scan angle of metadata in degrees, as instruments name it; None if it is not there."""
    _, inside, _ = _object(content, at, end)
    for key, kind, start, stop in _components(content, *inside):
        letters = "".join(c for c in key.rpartition("::")[2].lower() if c.isalpha())
        if kind == b"s" and letters in _ANGLES:
            text = content[start : stop - 1].decode("utf-8", "replace")
            if letters == _NANOSCOPE_ANGLE:
                return rotation_deg(text)
            words = text.split()
            return number(words[0].rstrip("°")) if words else None
    return None


def _field(content: bytes, at: int, end: int, own: int, title: str, angle_deg: float | None) -> DataField:
    name, inside, _ = _object(content, at, end)
    size: dict[str, int] = {}
    sides: dict[str, float] = {}
    units = {"si_unit_xy": "", "si_unit_z": ""}
    values = None
    for key, kind, start, stop in _components(content, *inside):
        if key in ("xres", "yres") and kind == b"i":
            size[key] = struct.unpack("<i", content[start:stop])[0]
        elif key in ("xreal", "yreal") and kind == b"d":
            sides[key] = struct.unpack("<d", content[start:stop])[0]
        elif key in units and kind == b"o":
            units[key] = _unit(content, start, stop)
        elif key == "data" and kind == b"D":
            values = np.frombuffer(content[start + 4 : stop], dtype="<f8").astype(np.float64)
    if values is None or len(size) != 2:
        raise ValueError(f"an object {name[:40]!r} has no data, xres or yres")
    if min(size.values()) < 1 or prod(size.values()) != len(values):
        raise ValueError(f"a data field of {size['xres']} x {size['yres']} has {len(values)} values")
    lengths = [positive(sides.get(key)) if units["si_unit_xy"] == "m" else None for key in ("xreal", "yreal")]
    matrix = values.reshape(size["yres"], size["xres"])
    return DataField(own, title, matrix, lengths[0], lengths[1], units["si_unit_z"], angle_deg)


def _unit(content: bytes, at: int, end: int) -> str:
    _, inside, _ = _object(content, at, end)
    for key, kind, start, stop in _components(content, *inside):
        if key == "unitstr" and kind == b"s":
            return content[start : stop - 1].decode("utf-8", "replace")
    return ""


def _object(content: bytes, at: int, end: int) -> tuple[str, tuple[int, int], int]:
    """Return the name of the object that begins at ``at``, the bounds of its components, and its end."""
    name, at = _string(content, at, end)
    size = _count(content, at, end)
    if at + 4 + size > end:
        raise ValueError(f"ends in the middle of an object {name[:40]!r}; copy it again")
    return name, (at + 4, at + 4 + size), at + 4 + size


def _components(content: bytes, at: int, end: int) -> Iterator[tuple[str, bytes, int, int]]:
    """Yield name, type, first and last place of each component."""
    for _ in range(_MAX_COMPONENTS):
        if at >= end:
            return
        name, at = _string(content, at, end)
        kind = content[at : at + 1]
        start = at + 1
        at = _after(content, kind, start, end)
        if at > end:
            raise ValueError(f"ends in the middle of {name[:40]!r}; copy it again")
        yield name, kind, start, at
    raise ValueError(f"has an object of more than {_MAX_COMPONENTS} components")


def _after(content: bytes, kind: bytes, at: int, end: int) -> int:
    if kind in _FIXED:
        return at + _FIXED[kind]
    if kind in _ITEMS:
        return at + 4 + _ITEMS[kind] * _count(content, at, end)
    if kind in (b"s", b"o"):
        return _one(content, kind, at, end)
    if kind in (b"S", b"O"):
        count, at = _count(content, at, end), at + 4
        if count > _MAX_COMPONENTS:
            raise ValueError(f"has {count} texts or objects in one; at most {_MAX_COMPONENTS} are read")
        for _ in range(count):
            at = _one(content, kind.lower(), at, end)
        return at
    raise ValueError(f"has a component of the unknown type {kind!r}; is it damaged?")


def _one(content: bytes, kind: bytes, at: int, end: int) -> int:
    return _string(content, at, end)[1] if kind == b"s" else _object(content, at, end)[2]


def _count(content: bytes, at: int, end: int) -> int:
    if at + 4 > end:
        raise ValueError("ends too early; copy it again")
    return int(struct.unpack("<I", content[at : at + 4])[0])


def _string(content: bytes, at: int, end: int) -> tuple[str, int]:
    stop = content.find(b"\0", at, end)
    if stop < 0:
        raise ValueError("ends too early; copy it again")
    return content[at:stop].decode("utf-8", "replace"), stop + 1
