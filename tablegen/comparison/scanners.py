"""The compared quantities of a scanner file: its parameters, with the standard errors beside them in comments."""

import re
from collections.abc import Iterator
from dataclasses import replace
from math import isclose
from pathlib import Path

import msgspec

from tablegen.base.input_errors import Document
from tablegen.base.reading import CONFIGURATION, read_text
from tablegen.comparison.quantity import ComparedQuantity, keys_of
from tablegen.config.scanner import Scanner

_MARK = "# standard errors: "
_ENTRY = re.compile(r"([\w.\[\]]+) (\S+) \+- (\S+)$")
_TABLE = re.compile(r"([xy])\.(size|offset|frequency|resonance|hysteresis\.branches\[\d+\])$")


def scanner_quantities(file: Document, scanner: Scanner) -> list[ComparedQuantity]:
    """Return every value of a scanner file, with its standard error where `tablegen calibrate` wrote one.

    An error belongs to the value beside it in the comment. If the value was edited since, its error is unknown.
    """
    errors, plain = dict(_errors(file)), msgspec.to_builtins(scanner)
    quantities = [*keys_of("scanner", "", {key: value for key, value in plain.items() if key not in ("x", "y")})]
    for axis in ("x", "y"):
        for table, value in plain[axis].items():
            section, key = (f"scanner, {axis} {table}", "") if isinstance(value, dict) else (f"scanner, {axis}", table)
            for one in keys_of(section, key, value):
                measured, error = errors.get(f"{axis}.{table}.{one.name}", (0.0, 0.0))
                same = not isinstance(one.value, str) and isclose(one.value, measured, rel_tol=1e-8)
                quantities.append(replace(one, error=error) if error > 0.0 and same else one)
    return quantities


def _errors(file: Document) -> Iterator[tuple[str, tuple[float, float]]]:
    """Yield keys with the value and the standard error from the comments above their tables."""
    if file.lines is None:
        return
    try:
        rows = read_text(Path(file.name), CONFIGURATION).replace("\r\n", "\n").split("\n")
    except (OSError, UnicodeDecodeError):  # it was read a moment ago
        return
    for key, line in file.lines.items():
        if not _TABLE.match(key):
            continue
        at = line - 2  # of the row above
        while at >= 0 and rows[at].strip().startswith("#"):
            row = rows[at].strip()
            at -= 1
            for part in row.removeprefix(_MARK).split(", ") if row.startswith(_MARK) else ():
                if entry := _ENTRY.match(part):
                    try:
                        yield f"{key}.{entry[1]}", (float(entry[2]), float(entry[3]))
                    except ValueError:
                        continue
