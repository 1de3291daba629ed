"""Images of heights from files: .npy, .tif, .png, Gwyddion's .gwy, and matrices of numbers as text.

Needs the extra ``images`` for .tif and .png.
"""

import hashlib
import re
import struct
import warnings
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tablegen.calibration.gwyddion import data_fields
from tablegen.calibration.table import Source, file_content, file_text
from tablegen.config.figures import shown_path
from tablegen.numerics.arrays import Floats
from tablegen.problems import Problem, Rejected

_MIN_PIXELS = 32  # rows and columns
_MAX_PIXELS = 1 << 26
_MAX_CHANNELS_LISTED = 12  # channels in a message
_DECIMAL_COMMA = re.compile(r"[+-]?\d+(,\d+)?([eE][+-]?\d+)?")
MODULES = {".png": "PIL", ".tif": "tifffile", ".tiff": "tifffile"}  # what reads them, beside numpy


@dataclass(frozen=True, eq=False)
class ScanImage:
    """Heights, rows x columns, row 0 first in time; ``file`` as messages call it."""

    file: str
    source: Source
    heights: Floats


_Channel = tuple[int, str, npt.NDArray[np.generic]]  # number, title, matrix


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
    content = file_content(path, name)
    if not content:
        raise refuse("is empty")
    try:
        channels = reader(content, name)
        number, title, matrix = _chosen(channels, channel)
    except ValueError as reason:
        raise refuse(str(reason)) from None
    what = f"channel {number} ({title!r}): " if len(channels) > 1 else ""
    if matrix.ndim != 2:
        raise refuse(f"{what}has the shape {' x '.join(map(str, matrix.shape))}; rows x columns are needed")
    if min(matrix.shape) < _MIN_PIXELS or matrix.size > _MAX_PIXELS:
        size = " x ".join(map(str, matrix.shape))
        raise refuse(f"{what}has {size} pixels; at least {_MIN_PIXELS} x {_MIN_PIXELS} and at most 2^26 are read")
    if matrix.dtype.kind not in "iufb":
        raise refuse(f"{what}has values of the type {matrix.dtype}; heights are real numbers")
    heights = matrix.astype(np.float64)
    bad = int(np.sum(~np.isfinite(heights)))
    if bad:
        raise refuse(f"{what}{bad} pixels are not finite; crop or interpolate them")
    if not np.ptp(heights) > 0.0:
        raise refuse(f"{what}all pixels are {heights.flat[0]:g}; was a different channel saved?")
    return ScanImage(name, Source(path.name, hashlib.sha256(content).hexdigest()[:16]), heights)


def _chosen(channels: list[_Channel], wanted: str | None) -> _Channel:
    """By title, or by number. Raises ``ValueError``."""
    if not channels:
        raise ValueError("contains no image")
    there = ", ".join(
        f"{number} ({title})" if title else f"{number}" for number, title, _ in channels[:_MAX_CHANNELS_LISTED]
    )
    there += ", ..." if len(channels) > _MAX_CHANNELS_LISTED else ""
    if wanted is None:
        if len(channels) > 1:
            raise ValueError(f"has several channels, {there}; choose with --channel")
        return channels[0]
    found = [one for one in channels if one[1] == wanted] or [one for one in channels if str(one[0]) == wanted]
    if len(found) != 1:
        raise ValueError(f"has {'no' if not found else 'more than one'} channel {wanted!r}; there is {there}")
    return found[0]


def _npy(content: bytes, _: str) -> list[_Channel]:
    try:
        array = np.load(BytesIO(content), allow_pickle=False)
    except (ValueError, OSError, EOFError, SyntaxError, MemoryError, OverflowError) as error:
        raise ValueError(f"is not a complete .npy file of numbers ({_first_line(error)})") from None
    if not isinstance(array, np.ndarray):
        raise ValueError("is an .npz archive; save one array with numpy.save")
    if array.ndim == 3:
        return [(number, "", image) for number, image in enumerate(array)]
    return [(0, "", array)]


def _png(content: bytes, _: str) -> list[_Channel]:
    from PIL import Image as Pillow

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Pillow.DecompressionBombWarning)
            picture = Pillow.open(BytesIO(content), formats=("PNG",))
            picture.load()
    except (
        OSError,
        SyntaxError,
        ValueError,
        struct.error,
        zlib.error,
        Pillow.DecompressionBombError,
        Warning,
    ) as error:
        raise ValueError(f"is not a complete PNG file ({_first_line(error)})") from None
    mode = picture.mode
    if mode in ("1", "L") or mode.startswith("I"):
        return [(0, "", np.asarray(picture))]
    if mode in ("LA", "RGB", "RGBA", "P", "PA"):
        colours = np.asarray(picture.convert("RGB")).astype(np.float64)
        if np.array_equal(colours[..., 0], colours[..., 1]) and np.array_equal(colours[..., 0], colours[..., 2]):
            return [(0, "", colours[..., 0])]
        raise ValueError("is in colour, not heights; export it in grey, 16 bits, or as numbers")
    raise ValueError(f"has pixels of the kind {mode}; export it in grey, 16 bits, or as numbers")


def _tiff(content: bytes, _: str) -> list[_Channel]:
    import tifffile

    try:
        with tifffile.TiffFile(BytesIO(content)) as file:
            pages = [page.asarray() for page in file.pages]
    except Exception as error:  # the library raises whatever a damaged structure leads to
        advice = "save it without compression" if "codec" in str(error) else "copy or export it again"
        raise ValueError(f"is not a readable TIFF file ({_first_line(error)}); {advice}") from None
    for page in pages:
        if page.ndim == 3 and page.shape[-1] in (3, 4):
            raise ValueError("is in colour, not heights; export it in grey, 16 bits or floating point")
    return [(number, "", page) for number, page in enumerate(pages)]


def _gwy(content: bytes, _: str) -> list[_Channel]:
    return list(data_fields(content))


def _ascii(content: bytes, name: str) -> list[_Channel]:
    """Rows of numbers; the first tells what separates. Between blanks, tabs and semicolons a comma is a decimal one."""
    lines = file_text(content, name).splitlines()
    rows = [(n, line.strip()) for n, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")]
    if not rows:
        raise ValueError("has no numbers")
    first = rows[0][1]
    mark = next((mark for mark in (";", "\t") if mark in first), None)
    if mark is None and "," in first:
        cells = first.split()
        mark = None if len(cells) > 1 and all(map(_DECIMAL_COMMA.fullmatch, cells)) else ","
    values: list[list[float]] = []
    for line, text in rows:
        cells = text.strip(mark).split(mark) if mark else text.split()
        if mark != ",":
            cells = [cell.replace(",", ".") for cell in cells]
        try:
            values.append([float(cell) for cell in cells])
        except ValueError:
            wrong = next(cell for cell in cells if not _is_number(cell)).strip()
            why = f"{wrong[:40]!r} is not a number; comment lines must begin with #"
            raise Rejected([Problem(name, line, "", why)]) from None
        if len(values[-1]) != len(values[0]):
            why = f"{len(values[-1])} numbers where the first row has {len(values[0])}"
            raise Rejected([Problem(name, line, "", why)])
    return [(0, "", np.array(values))]


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _first_line(error: BaseException) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0][:100]


_READERS: dict[str, Callable[[bytes, str], list[_Channel]]] = {
    ".npy": _npy,
    ".tif": _tiff,
    ".tiff": _tiff,
    ".png": _png,
    ".gwy": _gwy,
    **dict.fromkeys((".txt", ".asc", ".csv", ".dat"), _ascii),
}
