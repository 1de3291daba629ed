"""Read files of measurements: columns with units in their names; every fault at its line and column."""

import hashlib
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from math import isfinite
from pathlib import Path

import numpy as np

from tablegen.base.data_files import Source, file_content, file_text, lines_of, require_file, unreadable
from tablegen.base.figures import shown_path
from tablegen.base.input_errors import Problem, Rejected
from tablegen.base.reading import MEASUREMENT
from tablegen.base.warnings import Remark
from tablegen.calibration.tables.array_files import columns_of, is_array_file, numbers_of
from tablegen.calibration.tables.columns import Column, Conversion, Times
from tablegen.calibration.tables.csv_blocks import Block, blocks_of, plain_rows
from tablegen.calibration.tables.header import NO_CHOICE, ColumnChoice, Header, Place, units_row
from tablegen.numerics.arrays import Floats, Ints

_MAX_PROBLEMS = 20


@dataclass(frozen=True)
class MeasuredTable:
    """Columns of numbers in the units of the fits, by name, and the line on which each row stands.

    The lines of numpy's files are their rows, from 1. ``remarks`` are on what the header leaves open.
    """

    file: str
    source: Source
    columns: dict[str, Floats]
    lines: Ints
    remarks: tuple[Remark, ...] = ()

    def __len__(self) -> int:
        return len(self.lines)

    def __contains__(self, column: Column) -> bool:
        return column.name in self.columns

    def __getitem__(self, column: Column) -> Floats:
        return self.columns[column.name]


def read_table(
    path: Path, needed: Sequence[Column], optional: Sequence[Column] = (), choice: ColumnChoice = NO_CHOICE
) -> MeasuredTable:
    """Read the columns that are needed, and the optional ones that are there; others are skipped.

    ``.npz`` and ``.npy`` are numpy's, with an array or a field a column; everything else is CSV with a header.

    Commas, semicolons or tabs separate, whichever the header has; with the latter two a decimal comma is understood.
    Lines that are blank or begin with # are skipped; the last of them before the numbers may be the header. A row of
    units may follow the header. With ``choice`` of columns by their numbers there need be no header.

    Raises
    ------
    Rejected
        If the table is faulty; the message has file, line and column.
    """
    name = shown_path(path)
    expected = [*needed, *optional]
    if is_array_file(path):
        return _array_table(path, name, expected, needed, choice)
    digest = hashlib.sha256()
    reader: _Reader | None = None
    header_line = 0
    remarks: list[Remark] = []
    for block in _blocks(path, name):
        digest.update(block.content)
        if reader is None:
            text = file_text(block.content, name, block.line)
            rows = _rows(text, name, block.line)
            header_line, first = next(rows, (0, ""))
            if header_line:
                separator = next((mark for mark in (";", "\t") if mark in first), ",")
                header, rows = _header(name, text, block.line, (header_line, first), rows, separator, needed, choice)
                header_line = header.line
                places, remarks = header.places(expected, needed, choice)
                reader = _Reader(name, separator, len(header.cells), places)
                reader.add_rows(rows)
        elif not reader.full:
            reader.add(block)
    if reader is None:
        raise Rejected([Problem(name, 0, "", f"is empty; a header with {_list(needed)} is needed")])
    columns, lines = reader.columns()
    if not len(lines):
        raise Rejected([Problem(name, header_line, "", "no numbers follow the header")])
    return MeasuredTable(name, Source(path.name, digest.hexdigest()[:16]), columns, lines, tuple(remarks))


_Rows = Iterator[tuple[int, str]]


def _header(
    name: str,
    text: str,
    first_line: int,
    first: tuple[int, str],
    rows: _Rows,
    separator: str,
    needed: Sequence[Column],
    choice: ColumnChoice,
) -> tuple[Header, _Rows]:
    """Return the header, and the rows of numbers after it and after its units."""
    line, row = first
    cells = _cells(row, separator)
    if all(_is_number(cell) for cell in cells):
        comments = [(n, one.strip()) for n, one in lines_of(text, name, first_line) if n < line]
        comments = [(n, one.lstrip("# \t")) for n, one in comments if one.startswith("#")]
        if comments and len(_cells(comments[-1][1], separator)) == len(cells) > 1:
            header = Header(name, comments[-1][0], _cells(comments[-1][1], separator))
        elif choice.by_number:
            header = Header(name, line, [str(n + 1) for n in range(len(cells))])
        else:
            why = (
                f"the first line has numbers; a header with {_list(needed)} has to stand above them, or say which "
                f"column is which: --columns {needed[0].quantity}=1,..."
                if needed
                else "the first line has numbers; a header has to stand above them"
            )
            raise Rejected([Problem(name, line, "", why)])
        return header, chain([first], rows)
    second = next(rows, None)
    units = None if second is None else units_row(_cells(second[1], separator))
    if units is not None and len(units) == len(cells):
        return Header(name, line, cells, units), rows
    return Header(name, line, cells), rows if second is None else chain([second], rows)


def _array_table(
    path: Path, name: str, expected: Sequence[Column], needed: Sequence[Column], choice: ColumnChoice
) -> MeasuredTable:
    content = file_content(path, name)
    source = Source(path.name, hashlib.sha256(content).hexdigest()[:16])
    arrays = columns_of(content, name)
    del content  # an archive is in memory a second time
    places, remarks = Header(name, 0, list(arrays)).places(expected, needed, choice)
    written = [numbers_of(list(arrays.values())[place[0]], name, place[3]) for place in places]
    if len({len(column) for column in written}) > 1:
        lengths = ", ".join(f"{place[3]} {len(column)}" for place, column in zip(places, written, strict=True))
        raise Rejected([Problem(name, 0, "", f"its columns have different numbers of rows: {lengths}")])
    if not written or not len(written[0]):
        raise Rejected([Problem(name, 0, "", "has no numbers")])
    reader = _Reader(name, ",", len(places), places)
    columns = {place[1].name: reader.values(column, place) for place, column in zip(places, written, strict=True)}
    reader.refuse()
    lines = np.arange(1, len(written[0]) + 1, dtype=np.int64)
    return MeasuredTable(name, source, columns, lines, tuple(remarks))


class _Reader:
    """Parser of rows of text to columns of numbers; notes faults and goes on."""

    def __init__(self, name: str, separator: str, width: int, places: list[Place]) -> None:
        self.problems: list[Problem] = []
        self._name, self._separator, self._width, self._places = name, separator, width, places
        self._values = [array("d") for _ in places]
        self._lines = array("q")

    @property
    def full(self) -> bool:
        """True if there are more faults than one message lists."""
        return len(self.problems) > _MAX_PROBLEMS

    def add(self, block: Block) -> None:
        """Add all lines of a block: at once where they are plain numbers in their ranges, otherwise one by one."""
        rows = plain_rows(block.content, self._separator, self._width)
        converted = [] if rows is None else [_converted(rows[:, place[0]], place) for place in self._places]
        values = [each for each in converted if each is not None]
        if rows is None or len(values) < len(self._places):
            self.add_rows(_rows(file_text(block.content, self._name, block.line), self._name, block.line))
            return
        for buffer, each in zip(self._values, values, strict=True):
            buffer.frombytes(each.tobytes())
        self._lines.frombytes(np.arange(block.line, block.line + len(rows), dtype=np.int64).tobytes())

    def add_rows(self, rows: Iterator[tuple[int, str]]) -> None:
        """Add lines one by one, until there are too many faults."""
        for line, text in rows:
            for buffer, value in zip(self._values, self.row(line, text), strict=False):
                buffer.append(value)
            self._lines.append(line)
            if self.full:
                return

    def values(self, written: Floats, place: Place) -> Floats:
        """Convert a column to the unit of the fits: at once if all are in range, otherwise one by one.

        Parameters
        ----------
        written
            Values in the unit of the file, shape (rows,).

        Returns
        -------
        Floats
            Values in the unit of the fits, shape (rows,).
        """
        numbers = _converted(written, place)
        if numbers is None:
            numbers = np.zeros(len(written))
            for row, value in enumerate(written.tolist()):
                numbers[row] = self._number(row + 1, repr(value), *place[1:])
                if self.full:
                    break
        return numbers

    def refuse(self) -> None:
        """End the reading of a faulty table.

        Raises
        ------
        Rejected
            If there was a fault; the message has all of them.
        """
        if self.problems:
            problems = self.problems[:_MAX_PROBLEMS]
            if self.full:
                problems.append(Problem(self._name, problems[-1].line, "", "more faults follow; stopped"))
            raise Rejected(problems)

    def columns(self) -> tuple[dict[str, Floats], Ints]:
        """Return the columns by name, and the line of every row.

        Returns
        -------
        tuple
            Columns in the units of the fits, shape (rows,) each, and line numbers, shape (rows,).

        Raises
        ------
        Rejected
            If there was a fault; the message has all of them.
        """
        self.refuse()
        values = (np.frombuffer(buffer, dtype=np.float64) for buffer in self._values)
        columns = {place[1].name: each for place, each in zip(self._places, values, strict=True)}
        return columns, np.frombuffer(self._lines, dtype=np.int64)

    def row(self, line: int, text: str) -> list[float]:
        """Return the numbers of one row."""
        cells = _cells(text, self._separator)
        if len(cells) != self._width:
            why = f"{len(cells)} fields where the header has {self._width}"
            self.problems.append(Problem(self._name, line, "", why))
            return []
        return [self._number(line, cells[at], column, convert, spelt) for at, column, convert, spelt in self._places]

    def _number(self, line: int, cell: str, column: Column, convert: Conversion, spelt: str) -> float:
        plain = cell
        if self._separator != "," and cell.count(",") == 1 and "." not in cell:
            plain = cell.replace(",", ".")
        try:
            if "_" in plain:  # Python would take 1_000
                raise ValueError
            written = float(plain)
        except ValueError:
            why = f"{cell[:40]!r} is not a number" if cell else "is empty"
            self.problems.append(Problem(self._name, line, spelt, why))
            return 0.0
        if not isfinite(written):
            self.problems.append(Problem(self._name, line, spelt, f"{cell[:40]} is not finite"))
            return 0.0
        try:
            value = convert(written)
        except OverflowError:
            value = column.below
        if not column.above < value < column.below:
            least = 0.0 if column.above > 0.0 >= value else column.above
            side = f"above {least:g}" if value <= column.above else f"below {column.below:g}"
            self.problems.append(Problem(self._name, line, spelt, f"{cell[:40]} is not {side} ({column.name})"))
        return value


def _converted(written: Floats, place: Place) -> Floats | None:
    """Convert a column to the unit of the fits; None if that is no plain factor, or a value is out of range."""
    _, column, convert, _ = place
    if not isinstance(convert, Times):
        return None
    numbers: Floats = written * convert.factor
    return numbers if bool(np.all((column.above < numbers) & (numbers < column.below))) else None


def _blocks(path: Path, name: str) -> Iterator[Block]:
    """Read a file in blocks; raise ``Rejected`` with its name if that fails."""
    require_file(path, name)
    try:
        yield from blocks_of(path, MEASUREMENT)
    except OSError as error:
        raise unreadable(name, error) from None


def _rows(text: str, name: str, first: int) -> Iterator[tuple[int, str]]:
    """Yield the rows of numbers with their line numbers."""
    lines = lines_of(text, name, first)
    return ((n, line) for n, line in lines if line.strip(" \t;,") and not line.lstrip().startswith("#"))


def _cells(line: str, separator: str) -> list[str]:
    cells = (cell.strip() for cell in line.split(separator))
    return [cell[1:-1].strip() if len(cell) >= 2 and cell[0] == cell[-1] == '"' else cell for cell in cells]


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _list(columns: Sequence[Column]) -> str:
    return ", ".join(column.name for column in columns)
