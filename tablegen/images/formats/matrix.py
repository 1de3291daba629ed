"""Matrices of numbers: .npy files, and rows of text."""

import re

import numpy as np

from tablegen.base.data_files import file_text, lines_of
from tablegen.base.input_errors import Problem, Rejected
from tablegen.images.formats.channel import MAX_PIXELS, Channel, channel_of_array
from tablegen.images.npy import npy_array
from tablegen.numerics.arrays import Floats

_DECIMAL_COMMA = re.compile(r"[+-]?\d+(,\d+)?([eE][+-]?\d+)?")


def npy_channels(content: bytes, _: str) -> list[Channel]:
    """Return the images of a .npy file.

    Raises
    ------
    ValueError
        If the content is damaged; the message has the reason.
    """
    if content[:2] == b"PK":
        raise ValueError("is an .npz archive; save one array with numpy.save")
    array = npy_array(content)[0]
    if array.ndim == 3:
        return [channel_of_array(number, "", image) for number, image in enumerate(array)]
    return [channel_of_array(0, "", array)]


def text_channels(content: bytes, name: str) -> list[Channel]:
    """Read rows of numbers; the first row shows the separator.

    Between blanks, tabs and semicolons a comma is a decimal one.

    Raises
    ------
    Rejected
        If a line is faulty; the message has its number.
    ValueError
        If the content is no text of numbers.
    """
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
        if width * len(values) > MAX_PIXELS:
            raise ValueError("has more than 2^25 numbers, which is the most that are read")
    if not values:
        raise ValueError("has no numbers")
    return [channel_of_array(0, "", np.array(values))]


def _separator(row: str) -> str | None:
    """Return the separator of the numbers of a row; None for blanks."""
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
