"""Find columns in the header of any program: names and units in their usual spellings, or the user's choice."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tablegen.base.input_errors import Problem, Rejected
from tablegen.base.warnings import Remark
from tablegen.calibration.tables.columns import Column, Conversion

_MAX_CELLS_SHOWN = 12
_UNIT_WORDS = {
    "volt": "v",
    "volts": "v",
    "millivolt": "mv",
    "millivolts": "mv",
    "kilovolt": "kv",
    "kilovolts": "kv",
    "micron": "um",
    "microns": "um",
    "sec": "s",
    "secs": "s",
    "second": "s",
    "seconds": "s",
    "msec": "ms",
    "usec": "us",
    "nsec": "ns",
    "millisecond": "ms",
    "milliseconds": "ms",
    "microsecond": "us",
    "microseconds": "us",
    "hertz": "hz",
    "kilohertz": "khz",
    "\u00b0": "deg",
    "degree": "deg",
    "degrees": "deg",
    "radian": "rad",
    "radians": "rad",
    **{
        f"{prefix}{metre}": unit
        for prefix, unit in (("", "m"), ("milli", "mm"), ("micro", "um"), ("nano", "nm"), ("pico", "pm"))
        for metre in ("meter", "meters", "metre", "metres")
    },
}
_UNITS = frozenset(
    ("v", "mv", "kv", "nm", "pm", "um", "mm", "m", "s", "ms", "us", "ns", "hz", "khz", "mhz", "db", "deg", "rad")
)
_MICRO = str.maketrans({"\u00b5": "u", "\u03bc": "u"})
_BRACKETS = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\)|\{([^{}]*)\}|<([^<>]*)>)\s*")
_SLASH = re.compile(r"(.*\S)\s*/\s*(\S+)")
_TAIL = re.compile(r"(.*[^\W_])[\s_.:,-]+([^\s_.:,-]+)")
_IN = re.compile(r"(?<=[^\W_])[\s_]+in$", re.IGNORECASE)
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+|\d+|[^\W\d_]+")
_NUMBERED = re.compile(r"[1-9]\d{0,4}")


Place = tuple[int, Column, Conversion, str]  # index in the header, column, conversion, name in the file


@dataclass(frozen=True)
class Label:
    """Words of a header cell in small letters, and its unit: as written, and ``unit`` as columns have it.

    ``unit`` is None for a cell without a unit, and "?" for one that is not known.
    """

    words: tuple[str, ...]
    unit: str | None
    written: str = ""

    @classmethod
    def of(cls, cell: str) -> "Label":
        """Split a cell such as ``Position (um)``, ``DAC out [V]``, ``time / ms``, ``time_ms``, ``Drive in V``."""
        name, written = cell, ""
        brackets = _BRACKETS.fullmatch(cell)
        if brackets is not None and brackets[1]:
            name, written = brackets[1], next(part for part in brackets.groups()[1:] if part is not None).strip()
        else:
            for pattern in (_SLASH, _TAIL):
                parts = pattern.fullmatch(cell)
                if parts is not None and unit_of(parts[2]) != "?":
                    name, written = _IN.sub("", parts[1]), parts[2]
                    break
        words = tuple(word.lower() for word in _WORD.findall(name.translate(_MICRO)))
        return cls(words, unit_of(written) if written else None, written)

    def names(self, column: Column) -> bool:
        """Return True if the words are those of the quantity, and no other word stands beside them."""
        words = [word for word in self.words if not word.isdigit()]
        known = {*column.words, *column.qualifiers}
        return any(word in column.words for word in words) and known.issuperset(words)


def unit_of(written: str) -> str:
    """Return a unit as columns have it; "?" if it is none, or may be two: mHz is not MHz."""
    if written == "mHz":
        return "?"
    unit = written.translate(_MICRO).lower()
    unit = _UNIT_WORDS.get(unit, unit)
    return unit if unit in _UNITS else "?"


def units_row(cells: Sequence[str]) -> list[str] | None:
    """Return the units of a row that follows the header, such as ``(ms),(V),(um)``; None if it is none."""
    units = [cell.strip("()[] ") for cell in cells]
    return units if any(units) and all(not unit or unit_of(unit) != "?" for unit in units) else None


@dataclass(frozen=True)
class ColumnChoice:
    """Columns that the user chose: a number from 1 or a name in the header by quantity, and perhaps a unit."""

    places: Mapping[str, tuple[str, str]]

    @classmethod
    def parse(cls, choice: str | Mapping[str, str | int] | None, columns: Sequence[Column]) -> "ColumnChoice":
        """Read ``time=3,drive=2,position=1:um``, or the same as a mapping.

        Raises
        ------
        ValueError
            If it is not such a text, or names a quantity that is none of ``columns``.
        """
        if choice is None:
            return cls({})
        if isinstance(choice, str):
            entries = [part.partition("=")[::2] for part in choice.split(",")]
        else:
            entries = [(key, str(value)) for key, value in choice.items()]
        places: dict[str, tuple[str, str]] = {}
        for key, value in entries:
            name = key.strip().lower()
            matching = [one for one in columns if name in (one.quantity, one.name)]
            matching = matching or [one for one in columns if name in one.words]
            listed = ", ".join(one.quantity for one in columns)
            if not name or not value.strip():
                raise ValueError(f"{key.strip() or value.strip()!r}: give QUANTITY=COLUMN; quantities are {listed}")
            if len(matching) != 1:
                raise ValueError(f"{key.strip()!r} is none of {listed}")
            column = matching[0]
            if column.quantity in places:
                raise ValueError(f"{column.quantity} is given twice")
            place, colon, written = value.strip().rpartition(":")
            unit = unit_of(written.strip()) if colon else ""
            if colon and unit not in column.units:
                raise ValueError(f"{written!r} is no unit of {column.quantity}; it takes {_units_of(column)}")
            places[column.quantity] = (place.strip(), unit) if colon else (value.strip(), "")
        numbers = [place for place, _ in places.values() if _NUMBERED.fullmatch(place)]
        if len(set(numbers)) < len(numbers):
            raise ValueError("two quantities are of one column")
        return cls(places)

    @property
    def by_number(self) -> bool:
        """True if every column is given by its number, so that no header is needed."""
        return bool(self.places) and all(_NUMBERED.fullmatch(place) for place, _ in self.places.values())


NO_CHOICE = ColumnChoice({})


@dataclass(frozen=True)
class Header:
    """Cells of a header, the file and the line on which they stand, and units of the line below them."""

    file: str
    line: int
    cells: Sequence[str]
    units: Sequence[str] = ()

    def places(
        self, expected: Sequence[Column], needed: Sequence[Column], choice: ColumnChoice = NO_CHOICE
    ) -> tuple[list[Place], list[Remark]]:
        """Return where each column stands, with the conversion of its unit, and remarks on units that are not stated.

        A choice comes first, then a name such as ``time_s``, then the usual spellings of other programs.

        Raises
        ------
        Rejected
            If a column is missing, or two may be meant, or its unit is not known.
        """
        search = _Search(self, [Label.of(cell) for cell in self.cells])
        places = [place for column in expected if (place := search.place(column, column in needed, choice)) is not None]
        if search.problems:
            raise Rejected(search.problems)
        return places, search.remarks(places)

    @property
    def shown(self) -> str:
        """The cells in small letters, the first of them."""
        text = ", ".join(cell.lower()[:40] for cell in self.cells[:_MAX_CELLS_SHOWN])
        return text + (", ..." if len(self.cells) > _MAX_CELLS_SHOWN else "")


class _Search:
    """Search for columns in one header; problems are collected."""

    def __init__(self, header: Header, labels: Sequence[Label]) -> None:
        self.problems: list[Problem] = []
        self._header, self._labels = header, labels
        self._assumed: list[tuple[str, str]] = []

    def place(self, column: Column, is_needed: bool, choice: ColumnChoice) -> Place | None:
        """Return the place of a column, None if there is none."""
        if column.quantity in choice.places:
            return self._chosen(column, *choice.places[column.quantity])
        spelt = {column.spelt(unit): unit for unit in column.units}
        cells = [(at, cell.lower()) for at, cell in enumerate(self._header.cells) if cell.lower() in spelt]
        if len(cells) > 1:
            both = " and ".join(cell for _, cell in cells[:2])
            return self._refuse(cells[1][1], f"the header has both {both}; keep one of them{_or_choose(column)}")
        if cells:
            at, cell = cells[0]
            if self._header.units and cell == column.quantity:
                return self._with_unit(at, column)
            return at, column, column.units[spelt[cell]], cell
        usual = [at for at, label in enumerate(self._labels) if label.names(column)]
        allowed = {*column.units, *([] if column.needs_unit else [None])}
        of_unit = [at for at in usual if self._unit(at) in allowed]
        if not of_unit and not is_needed:
            return None
        if len(of_unit) > 1:
            names = " and ".join(self._header.cells[at][:40] for at in of_unit[:4])
            which = f"{names} may each be the {column.quantity}; keep one of them{_or_choose(column)}"
            return self._refuse(column.name, which)
        if of_unit or usual:
            return self._with_unit((of_unit or usual)[0], column)
        others = [name for name in spelt if name != column.name]
        instead = f" (or {', '.join(others)})" if others else ""
        why = f"missing{instead}; the header has {self._header.shown}{_or_choose(column)}"
        return self._refuse(column.name, why)

    def remarks(self, places: Sequence[Place]) -> list[Remark]:
        """Return a remark on the columns whose unit the header does not state."""
        assumed = [(cell, unit) for cell, unit in self._assumed if any(place[3] == cell for place in places)]
        if not assumed:
            return []
        cells, units = (", ".join(one) for one in zip(*assumed, strict=True))
        quantity = next(place[1].quantity for place in places if place[3] == assumed[-1][0])
        text = (
            f"{self._header.file}: the header states no unit of {cells}: taken as {units}. Write the unit into the "
            f"header, as {assumed[-1][0]} ({assumed[-1][1]}), or give it: --columns {quantity}=COLUMN:UNIT"
        )
        return [Remark(text, code="assumed-unit")]

    def _chosen(self, column: Column, place: str, unit: str) -> Place | None:
        cells = self._header.cells
        at = [n for n, cell in enumerate(cells) if cell.lower() == place.lower()]
        if not at and _NUMBERED.fullmatch(place):
            if int(place) > len(cells):
                why = f"--columns {column.quantity}={place}: the file has {len(cells)} columns"
                return self._refuse(column.name, why)
            at = [int(place) - 1]
        if len(at) != 1:
            state = "no column" if not at else f"{len(at)} columns"
            why = f"--columns {column.quantity}={place}: {state} of this name; the header has {self._header.shown}"
            return self._refuse(column.name, why)
        if unit:
            return at[0], column, column.units[unit], cells[at[0]] or place
        return self._with_unit(at[0], column)

    def _with_unit(self, at: int, column: Column) -> Place | None:
        cell, unit = self._header.cells[at], self._unit(at)
        if unit is None:
            usual = next(iter(column.units))
            if usual:
                self._assumed.append((cell, "V" if usual == "v" else "Hz" if usual == "hz" else usual))
            return at, column, column.units[usual], cell
        if unit in column.units:
            return at, column, column.units[unit], cell
        written = self._labels[at].written or (self._header.units[at] if self._header.units else "")
        hint = " (milli or mega?)" if written == "mHz" else ""
        why = f"{written[:40]!r} is no unit of {column.quantity}{hint}; it takes {_units_of(column)}"
        if unit in ("v", "mv", "kv") and "nm" in column.units:
            why += ": multiply the volts of a sensor by its nm per volt first"
        return self._refuse(cell, f"{why}{_or_choose(column, ':UNIT')}")

    def _unit(self, at: int) -> str | None:
        label, units = self._labels[at], self._header.units
        if label.unit is None and units and units[at]:
            return unit_of(units[at])
        return label.unit

    def _refuse(self, key: str, why: str) -> Place | None:
        self.problems.append(Problem(self._header.file, self._header.line, key, why))
        return None


def _units_of(column: Column) -> str:
    return ", ".join(unit or "a ratio" for unit in column.units)


def _or_choose(column: Column, unit: str = "") -> str:
    return f", or choose it: --columns {column.quantity}=NAME{unit}"
