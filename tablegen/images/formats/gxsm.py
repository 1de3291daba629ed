"""Images of GXSM (.nc): NetCDF of the classic layout, a file for each channel and direction.

The description of NetCDF 3 is public: a header of dimensions, attributes and variables, big-endian, then the data. GXSM
has the numbers in ``FloatField`` or ``H``, over (time, value, dimy, dimx), and one variable for each value of the scan.
Lengths are in Ångström whatever ``unit`` says, which is that of the display; newer files name it in ``var_unit``.
``-Xm-`` in ``basename`` marks lines that were scanned from right to left, and are stored so. Which row was first in
time is not documented; rows are as stored.
"""

from dataclasses import dataclass
from functools import partial
from math import prod

import numpy as np

from tablegen.images.formats.channel import (
    LENGTHS_NM,
    Channel,
    Direction,
    Matrix,
    check_pixels,
    length_nm,
    number,
    quote,
)

_MAGIC, _HDF5 = b"CDF", b"\x89HDF"
_OFFSET_BYTES = {1: 4, 2: 8}  # by the version of the format
_DIMENSIONS, _VARIABLES, _ATTRIBUTES = 10, 11, 12  # tags of lists
_TYPES = {1: ">i1", 2: "S1", 3: ">i2", 4: ">i4", 5: ">f4", 6: ">f8"}
_CHARACTERS = 2
_MAX_HEADER = 4 << 20  # bytes
_MOST = 4096  # entries of a list
_MOST_AXES = 8  # of a variable
_MOST_TEXT = 1000  # characters
_AXES = ("time", "value", "dimy", "dimx")
_FIELDS = ("FloatField", "H")
_FAST = "sranger_mk2_hwi_fast_scan_flag"
_ANGSTROM = ("AA", "Ang", "Angstrom", "A", "Å")
_DIRECTIONS: dict[bool, Direction] = {True: "retrace", False: "trace"}


@dataclass(frozen=True)
class _Variable:
    """A variable of the file: its axes, its texts by their names, and where its numbers begin."""

    name: str
    axes: tuple[int, ...]
    texts: dict[str, str]
    dtype: np.dtype[np.generic]
    begin: int


class _Header:
    """The header of a classic NetCDF file, which is read once, and the numbers behind it."""

    def __init__(self, content: bytes) -> None:
        if content.startswith(_HDF5):
            raise ValueError("is of NetCDF 4; convert it: nccopy -k classic FILE NEW, or export the image as .gwy")
        if not content.startswith(_MAGIC) or content[3:4] not in (b"\x01", b"\x02"):
            raise ValueError("does not begin as a file of classic NetCDF does")
        self._content, self._at = content, 4
        self._offset_bytes = _OFFSET_BYTES[content[3]]
        if self._number():
            raise ValueError("has records of NetCDF, which GXSM does not write; export the image as .gwy")
        self.lengths: list[tuple[str, int]] = [
            (self._text(), self._number()) for _ in range(self._entries(_DIMENSIONS))
        ]
        self._texts()
        self.variables = {one.name: one for one in [self._variable() for _ in range(self._entries(_VARIABLES))]}

    def shape(self, variable: _Variable) -> tuple[int, ...]:
        """Return the lengths of its axes."""
        return tuple(self.lengths[axis][1] for axis in variable.axes)

    def numbers(self, variable: _Variable, count: int, first: int = 0) -> Matrix:
        """Return numbers of a variable from the given one on."""
        start = variable.begin + first * variable.dtype.itemsize
        if start + count * variable.dtype.itemsize > len(self._content):
            raise ValueError(f"ends in the middle of {quote(variable.name)}; copy it again")
        return np.frombuffer(self._content, variable.dtype, count, start)

    def value(self, name: str) -> float | None:
        """Return the first number of a variable; None if there is none, or no finite one."""
        variable = self.variables.get(name)
        if variable is None or variable.dtype.kind == "S":
            return None
        return number(self.numbers(variable, 1)[0])

    def text(self, name: str) -> str:
        """Return the text of a variable; empty if there is none."""
        variable = self.variables.get(name)
        if variable is None or variable.dtype.kind != "S":
            return ""
        count = min(prod(self.shape(variable)), _MOST_TEXT)
        return self.numbers(variable, count).tobytes().split(b"\0")[0].decode("utf-8", "replace").strip()

    def unit(self, name: str) -> str:
        """Return the unit of a variable: ``var_unit``, else ``unit`` unless that can be the display's; else empty."""
        texts = self.variables[name].texts if name in self.variables else {}
        unit = texts.get("var_unit") or texts.get("unit", "")
        if unit in _ANGSTROM:
            return "Å"
        return unit if "var_unit" in texts or unit not in LENGTHS_NM else ""

    def length_nm(self, name: str) -> float | None:
        """Return a length in nm; None where it or its unit is unknown."""
        value = self.value(name)
        return None if value is None else length_nm(abs(value), self.unit(name))

    def _bytes(self, count: int) -> bytes:
        end = self._at + count
        if end > len(self._content):
            raise ValueError("ends in its header; copy it again")
        if end > _MAX_HEADER:
            raise ValueError(f"has a header of more than {_MAX_HEADER >> 20} MiB; is it damaged?")
        start, self._at = self._at, end
        return self._content[start:end]

    def _number(self, size: int = 4) -> int:
        return int.from_bytes(self._bytes(size), "big")

    def _padded(self, count: int) -> bytes:
        return self._bytes(count + -count % 4)[:count]

    def _text(self) -> str:
        return self._padded(self._number()).decode("utf-8", "replace")

    def _entries(self, tag: int) -> int:
        """Return the number of entries of a list, which has this tag, or is absent."""
        own, count = self._number(), self._number()
        if ((own, count) != (0, 0) and own != tag) or count > _MOST:
            raise ValueError("has a header that is not one of NetCDF; is it damaged?")
        return count

    def _texts(self) -> dict[str, str]:
        """Return the attributes that are texts."""
        texts: dict[str, str] = {}
        for _ in range(self._entries(_ATTRIBUTES)):
            name, kind, count = self._text(), self._number(), self._number()
            values = self._padded(count * _dtype(kind).itemsize)
            if kind == _CHARACTERS:
                texts[name] = values[:_MOST_TEXT].rstrip(b"\0").decode("utf-8", "replace").strip()
        return texts

    def _variable(self) -> _Variable:
        name, count = self._text(), self._number()
        if count > _MOST_AXES:
            raise ValueError(f"has a variable {quote(name)} of {count} axes; is it damaged?")
        axes = tuple(self._number() for _ in range(count))
        if any(axis >= len(self.lengths) for axis in axes):
            raise ValueError(f"has a variable {quote(name)} over an axis that is not there; is it damaged?")
        texts, dtype = self._texts(), _dtype(self._number())
        self._number()  # its size, which follows from its axes
        return _Variable(name, axes, texts, dtype, self._number(self._offset_bytes))


def _dtype(kind: int) -> "np.dtype[np.generic]":
    if kind not in _TYPES:
        raise ValueError(f"has numbers of the kind {kind}, which is none of NetCDF's; is it damaged?")
    return np.dtype(_TYPES[kind])


def gxsm_channels(content: bytes, _: str) -> list[Channel]:
    """Return the image of a file of GXSM, whose frames are its times and values.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    header = _Header(content)
    field = next((header.variables[name] for name in _FIELDS if name in header.variables), None)
    if field is None or tuple(header.lengths[axis][0] for axis in field.axes) != _AXES or field.dtype.kind == "S":
        raise ValueError(f"has no {' or '.join(_FIELDS)} over time, value, dimy and dimx; is it an image of GXSM?")
    if header.value(_FAST) == 1.0:
        raise ValueError("is a fast scan of GXSM, whose lines are no triangle; export the image as .gwy")
    times, values, rows, columns = header.shape(field)
    check_pixels(columns, rows)
    frames = times * values
    if not frames:
        raise ValueError("has no frames")
    header.numbers(field, rows * columns * frames)
    step = header.value("dz")
    scaled = step is not None and step != 0.0
    basename = header.text("basename")
    stated = ("-Xm-" in basename) != ("-Xp-" in basename)
    back = stated and "-Xm-" in basename
    title = field.texts.get("long_name", "")
    return [
        Channel(
            0,
            title,
            (rows, columns),
            partial(_load, header, field, (rows, columns), step if scaled and step else 1.0, back),
            title,
            _DIRECTIONS[back] if stated else None,
            header.unit("rangez") if scaled else "LSB",
            header.length_nm("rangex"),
            header.length_nm("rangey"),
            frames=frames,
            angle_deg=header.value("alpha"),
        )
    ]


def _load(header: _Header, field: _Variable, shape: tuple[int, int], step: float, back: bool, frame: int) -> Matrix:
    pixels = prod(shape)
    stored = header.numbers(field, pixels, pixels * frame).reshape(shape).astype(np.float64)
    return step * stored[:, :: -1 if back else 1]
