"""Images of heights from files: .npy, .tif, .png, Gwyddion's .gwy, and matrices of numbers as text.

Needs the extra ``images`` for .tif and .png.
"""

import hashlib
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from math import prod
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tablegen.calibration.gwyddion import data_fields
from tablegen.calibration.table import Source, file_content, file_text, lines_of
from tablegen.calibration.tiff import tiff_pages
from tablegen.figures import shown_path
from tablegen.numerics.arrays import Floats
from tablegen.problems import Problem, Rejected, shortened
from tablegen.reading import IMAGE

_MIN_PIXELS = 32  # rows and columns
_MAX_PIXELS = 1 << 25  # 5792 x 5792; more than that in floating point would be most of a computer's memory
_MAX_HEIGHT = 1e30  # in any unit; squares of heights have to be numbers
_MAX_CHANNELS_LISTED = 12  # channels in a message
_MAX_TITLE = 60  # characters of a channel in a message
_DECIMAL_COMMA = re.compile(r"[+-]?\d+(,\d+)?([eE][+-]?\d+)?")
MODULES = {".png": "PIL", ".tif": "tifffile", ".tiff": "tifffile"}  # what reads them, beside numpy


@dataclass(frozen=True, eq=False)
class ScanImage:
    """Heights, rows x columns, row 0 first in time; ``file`` as messages call it."""

    file: str
    source: Source
    heights: Floats


_Matrix = npt.NDArray[np.generic]


@dataclass(frozen=True, eq=False)
class _Channel:
    """One image of a file: what it is called, its shape by the file, and what reads it, once that is known to fit."""

    number: int
    title: str
    shape: tuple[int, ...]
    load: Callable[[], _Matrix]


def _loaded(number: int, title: str, matrix: _Matrix) -> _Channel:
    return _Channel(number, title, matrix.shape, lambda: matrix)


def read_image(path: Path, channel: str | None = None) -> ScanImage:
    """An image of heights.

    ``channel`` is the title or the number of the data in a file that has several. Raises ``Rejected`` with file and
    reason.
    """
    name = shown_path(path)

    def refuse(why: str) -> Rejected:
        return Rejected([Problem(name, 0, "", why)])

    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise refuse(f"{path.suffix or 'no ending'} is not one of {', '.join(_READERS)}; export it as one of these")
    content = file_content(path, name, IMAGE)
    if not content:
        raise refuse("is empty")
    try:
        channels = reader(content, name)
        chosen = _chosen(channels, channel)
        what = f"channel {chosen.number} ({_quoted(chosen.title)}): " if len(channels) > 1 else ""
        size = " x ".join(map(str, chosen.shape))
        if len(chosen.shape) != 2:
            raise refuse(f"{what}has the shape {shortened(size, 60)}; rows x columns are needed")
        if min(chosen.shape) < _MIN_PIXELS or prod(chosen.shape) > _MAX_PIXELS:
            least = f"{_MIN_PIXELS} x {_MIN_PIXELS}"
            raise refuse(f"{what}has {size} pixels; at least {least} and at most 2^25 are read")
        matrix = chosen.load()
    except ValueError as reason:
        raise refuse(str(reason)) from None
    if matrix.dtype.kind not in "iufb":
        raise refuse(f"{what}has values of the type {matrix.dtype}; heights are real numbers")
    heights = matrix.astype(np.float64)
    bad = int(np.sum(~np.isfinite(heights)))
    if bad:
        raise refuse(f"{what}{bad} pixels are not finite; crop or interpolate them")
    if np.max(np.abs(heights)) > _MAX_HEIGHT:
        raise refuse(f"{what}has heights beyond {_MAX_HEIGHT:g}; is it damaged?")
    if not np.ptp(heights) > 1.0 / _MAX_HEIGHT:
        raise refuse(f"{what}all pixels are {heights.flat[0]:g}; was a different channel saved?")
    return ScanImage(name, Source(path.name, hashlib.sha256(content).hexdigest()[:16]), heights)


def _chosen(channels: list[_Channel], wanted: str | None) -> _Channel:
    """By title, or by number. Raises ``ValueError``."""
    if not channels:
        raise ValueError("contains no image")
    there = ", ".join(
        f"{one.number} ({shortened(one.title, _MAX_TITLE)})" if one.title else f"{one.number}"
        for one in channels[:_MAX_CHANNELS_LISTED]
    )
    there += ", ..." if len(channels) > _MAX_CHANNELS_LISTED else ""
    if wanted is None:
        if len(channels) > 1:
            raise ValueError(f"has several channels, {there}; choose with --channel")
        return channels[0]
    found = [one for one in channels if one.title == wanted] or [one for one in channels if str(one.number) == wanted]
    if len(found) != 1:
        raise ValueError(f"has {'no' if not found else 'more than one'} channel {_quoted(wanted)}; there is {there}")
    return found[0]


def _quoted(title: str) -> str:
    return f"'{shortened(title, _MAX_TITLE)}'"


def _npy(content: bytes, _: str) -> list[_Channel]:
    if content[:2] == b"PK":
        raise ValueError("is an .npz archive; save one array with numpy.save")
    file = BytesIO(content)
    try:
        version = np.lib.format.read_magic(file)
        read_header = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }[version]
        shape, by_columns, kind = read_header(file)
        if kind.hasobject or kind.itemsize == 0 or len(shape) > 3 or min(shape, default=0) < 0:
            raise ValueError("no array of numbers in up to three dimensions")
        if prod(shape) * kind.itemsize > len(content) - file.tell():
            raise ValueError(f"{len(content) - file.tell()} bytes are fewer than those of {prod(shape)} values")
        flat = np.frombuffer(content, kind, prod(shape), file.tell())
        array = flat.reshape(shape, order="F" if by_columns else "C")
    except Exception as error:  # the header is read by the parser of Python, which raises whatever it meets
        raise ValueError(f"is not a complete .npy file of numbers ({_first_line(error)})") from None
    if array.ndim == 3:
        return [_loaded(number, "", image) for number, image in enumerate(array)]
    return [_loaded(0, "", array)]


def _png(content: bytes, _: str) -> list[_Channel]:
    from PIL import Image as Pillow

    def damaged(error: Exception) -> ValueError:
        return ValueError(f"is not a complete PNG file ({_first_line(error)})")

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            picture = Pillow.open(BytesIO(content), formats=("PNG",))
    except Exception as error:  # the library raises whatever a damaged structure leads to
        raise damaged(error) from None
    if picture.mode not in ("1", "L", "LA", "RGB", "RGBA", "P", "PA") and not picture.mode.startswith("I"):
        raise ValueError(f"has pixels of the kind {picture.mode}; export it in grey, 16 bits, or as numbers")

    def load() -> _Matrix:
        try:
            picture.load()
            if picture.mode in ("1", "L") or picture.mode.startswith("I"):
                return np.asarray(picture)
            colours = np.asarray(picture.convert("RGB"))
        except Exception as error:
            raise damaged(error) from None
        if np.array_equal(colours[..., 0], colours[..., 1]) and np.array_equal(colours[..., 0], colours[..., 2]):
            return colours[..., 0]
        raise ValueError("is in colour, not heights; export it in grey, 16 bits, or as numbers")

    return [_Channel(0, "", picture.size[::-1], load)]


def _tiff(content: bytes, _: str) -> list[_Channel]:
    pages = tiff_pages(content)
    for page in pages:
        if len(page.shape) == 3 and page.shape[-1] in (3, 4):
            raise ValueError("is in colour, not heights; export it in grey, 16 bits or floating point")
    return [_Channel(number, "", page.shape, page.load) for number, page in enumerate(pages)]


def _gwy(content: bytes, _: str) -> list[_Channel]:
    return [_loaded(number, title, matrix) for number, title, matrix in data_fields(content)]


def _ascii(content: bytes, name: str) -> list[_Channel]:
    """Rows of numbers; the first tells what separates. Between blanks, tabs and semicolons a comma is a decimal one."""
    mark: str | None = None
    width = 0
    values: list[Floats] = []
    for line, text in lines_of(file_text(content, name), name):
        text = text.strip()
        if not text or text.startswith("#"):
            continue
        if not values:
            mark = _separator(text)
        cells = text.strip(mark).split(mark) if mark else text.split()
        if mark != ",":
            cells = [cell.replace(",", ".") for cell in cells]
        try:
            row = np.array([float(cell) for cell in cells])
        except ValueError:
            wrong = next(cell for cell in cells if not _is_number(cell)).strip()
            why = f"{wrong[:40]!r} is not a number; comment lines must begin with #"
            raise Rejected([Problem(name, line, "", why)]) from None
        width = width or len(row)
        if len(row) != width:
            raise Rejected([Problem(name, line, "", f"{len(row)} numbers where the first row has {width}")])
        values.append(row)
        if width * len(values) > _MAX_PIXELS:
            raise ValueError("has more than 2^25 numbers, which is the most that are read")
    if not values:
        raise ValueError("has no numbers")
    return [_loaded(0, "", np.array(values))]


def _separator(row: str) -> str | None:
    """What separates the numbers of a row; None for blanks."""
    mark = next((mark for mark in (";", "\t") if mark in row), None)
    if mark is not None or "," not in row:
        return mark
    cells = row.split()
    return None if len(cells) > 1 and all(map(_DECIMAL_COMMA.fullmatch, cells)) else ","


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _first_line(error: BaseException) -> str:
    return shortened((str(error).strip() or type(error).__name__).splitlines()[0], 100)


_READERS: dict[str, Callable[[bytes, str], list[_Channel]]] = {
    ".npy": _npy,
    ".tif": _tiff,
    ".tiff": _tiff,
    ".png": _png,
    ".gwy": _gwy,
    **dict.fromkeys((".txt", ".asc", ".csv", ".dat"), _ascii),
}
