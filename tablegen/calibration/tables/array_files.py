"""Columns from numpy's files: the arrays of an ``.npz``, or the fields of a structured ``.npy``.

What an archive unpacks into is bounded before it is unpacked.
"""

import io
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tablegen.base.input_errors import Problem, Rejected
from tablegen.base.reading import MEASUREMENT, size_shown
from tablegen.images.npy import AnyArray, npy_array
from tablegen.numerics.arrays import Floats

_SUFFIXES = (".npy", ".npz")
_MAX_ARRAYS = 1000
_HOW = "np.savez(FILE, time_s=..., displacement_nm=...)"


def is_array_file(path: Path) -> bool:
    """Return True if the ending of a name is one of numpy's."""
    return path.suffix.lower() in _SUFFIXES


def columns_of(content: bytes, name: str) -> dict[str, AnyArray]:
    """Read arrays by their names, as they are stored.

    Raises
    ------
    Rejected
        If the file cannot be read; the message has ``name``.
    """
    try:
        return dict(_members(content) if content.startswith(b"PK") else _fields(content))
    except (ValueError, zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError) as error:
        raise Rejected([Problem(name, 0, "", f"cannot be read: {error}"[:300])]) from None


def numbers_of(column: AnyArray, name: str, spelt: str) -> Floats:
    """Convert a column of real numbers to floats.

    Parameters
    ----------
    column
        Values of any type of element, shape (rows,).
    name
        Name of the file in a message.
    spelt
        Name of the column in the file.

    Returns
    -------
    Floats
        In the unit of the file, shape (rows,).

    Raises
    ------
    Rejected
        If the column has another shape, or something else than real numbers.
    """
    if column.ndim != 1:
        shape = " x ".join(map(str, column.shape)) or "one number"
        raise Rejected([Problem(name, 0, spelt, f"has shape {shape}; a column has one dimension")])
    if column.dtype.kind not in "fiu":
        raise Rejected([Problem(name, 0, spelt, f"has elements of type {column.dtype}; real numbers are needed")])
    with np.errstate(over="ignore"):
        return column.astype(np.float64, copy=False)


def _members(content: bytes) -> Iterator[tuple[str, AnyArray]]:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = [one for one in archive.infolist() if one.filename.endswith(".npy")]
        if len(members) > _MAX_ARRAYS:
            raise ValueError(f"it has {len(members)} arrays; at most {_MAX_ARRAYS} are read")
        if sum(one.file_size for one in members) > MEASUREMENT.most_bytes:
            raise ValueError(f"its arrays are above {size_shown(MEASUREMENT.most_bytes)}")
        for one in members:
            if one.flag_bits & 1:
                raise ValueError(f"{one.filename} is encrypted")
            yield one.filename.removesuffix(".npy"), _array(archive.read(one))


def _fields(content: bytes) -> Iterator[tuple[str, AnyArray]]:
    array = _array(content)
    if array.dtype.names is None:
        raise ValueError(f"its columns have no names; write them by {_HOW}")
    for field in array.dtype.names:
        yield field, array[field]


def _array(content: bytes) -> AnyArray:
    array, remaining = npy_array(content)
    if remaining:
        raise ValueError(f"{remaining} bytes follow its numbers")
    return array
