"""Write a calibration into a scanner file: values in place, comments and order preserved, a comment on their origin."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import tomlkit
from tomlkit.items import AoT, InlineTable, Table

from tablegen.base.input_errors import Problem, Problems, Rejected
from tablegen.base.toml import parse_toml
from tablegen.calibration.laws.hysteresis import TURN_TOLERANCE
from tablegen.compensation.branch import LAW, MEASURED
from tablegen.compensation.models import UNCOMPENSATED
from tablegen.config.decode import decode
from tablegen.config.like import inherited
from tablegen.config.scanner import Scanner
from tablegen.numerics.driver import Driver

_PROVENANCE_MARK = "# calibrate "
_FIRST_MARK = re.compile(r"# calibrate (\w+)(?:, turn ([\d.]+))?: ")
_FILE_MARK = re.compile(r"# (from .*, sha256 [0-9a-f]{16}|standard errors: .*)$")


@dataclass(frozen=True)
class Change:
    """Changes that one calibration makes in ``[AXIS.KIND]``, or in ``[KIND]`` of both axes.

    ``values`` replace keys or add them, ``removed`` keys are deleted since they would contradict. ``branches`` are for
    ``[[AXIS.hysteresis.branches]]``: an entry of the same turn is updated, another one added. ``provenance`` holds the
    lines of the comment above, for the table or for each of the branches: a summary, then "from FILE, sha256 DIGITS",
    then "standard errors: KEY VALUE +- ERROR, ...".
    """

    kind: str
    values: Mapping[str, Any]
    removed: Sequence[str] = ()
    branches: Sequence[Mapping[str, Any]] = ()
    provenance: Sequence[Sequence[str]] = ()


def new_file(name: str, driver: Driver | float) -> str:
    """Return the text of a scanner file with nothing calibrated yet."""
    document = tomlkit.document()
    document["name"] = name
    driver = Driver.of(driver)
    document["v_max"] = driver.v_max
    document["v_max"].comment("V, maximum output of the piezo driver")
    if driver.v_min:
        document["v_min"] = driver.v_min
        document["v_min"].comment("V, its minimum output")
    return tomlkit.dumps(document)


def updated(text: str, name: str, axis: str, change: Change) -> str:
    """Put a calibration into the text of a scanner file; messages call the file ``name``, ``axis`` is "" for both.

    Raises
    ------
    Rejected
        If the text is no TOML, or a new value is outside what the file can hold.
    """
    before, _ = parse_toml(text, name)
    windows = "\r\n" in text
    text = text.replace("\r\n", "\n")
    document = tomlkit.parse(text)
    _put(document, before, axis, change, name)
    expected = document.unwrap()
    try:
        changed = _spaced(_with_provenance(tomlkit.dumps(document), name, axis, change), text)
        faithful = tomllib.loads(changed) == expected
    except (Rejected, ValueError):  # the result is no TOML
        changed, faithful = text, False
    if not faithful:
        why = "its layout is too unusual to be edited in place; write the values by hand, or one table below the other"
        raise Rejected([Problem(name, 0, axis or change.kind, why)])
    _check(text, changed, name)
    return changed.replace("\n", "\r\n") if windows else changed


def with_own_hysteresis(text: str, name: str) -> str:
    """Return the text with a hysteresis table of y that names its model itself, where y has that of x by ``like``.

    An operator is that of the axis that was measured. So y keeps what it had before x gets one: the model and branches
    that it shared, or no compensation where there was none.

    Raises
    ------
    Rejected
        If the text is no TOML, or cannot be edited in place.
    """
    values, document = parse_toml(text, name)
    y = values.get("y")
    if not isinstance(y, dict) or y.get("like") != "x":
        return text
    own: Any = y.get("hysteresis", {})
    shared: Any = inherited(values, document)[0]["y"].get("hysteresis", {}) if "x" in values else {}
    if not isinstance(own, dict) or not isinstance(shared, dict) or "model" in own:
        return text
    change = Change(
        "hysteresis",
        {"model": shared.get("model", UNCOMPENSATED)},
        branches=[] if "branches" in own else shared.get("branches", []),
    )
    return updated(text, name, "y", change)


def _put(document: tomlkit.TOMLDocument, before: Mapping[str, Any], axis: str, change: Change, name: str) -> None:
    """Put the values into the parsed document."""
    outer = before.get(axis, {}) if axis else before
    inner = outer.get(change.kind, {}) if isinstance(outer, Mapping) else {}
    for path, value in ((axis, outer), (_path(axis, change), inner)):
        if not isinstance(value, Mapping):
            raise Rejected([Problem(name, 0, path, "is not a table")])
    if axis and axis not in document:
        document[axis] = tomlkit.table(is_super_table=True)
    parent: Any = document[axis] if axis else document
    if change.kind not in parent:
        parent[change.kind] = tomlkit.inline_table() if isinstance(parent, InlineTable) else tomlkit.table()
    table: Any = parent[change.kind]
    if isinstance(table, Table) and table.is_super_table():  # its header takes the next table's comment
        table.trivia.comment_ws = table.trivia.comment = ""
    for key in change.removed:
        table.pop(key, None)
    for key, value in change.values.items():
        _set(table, key, _rows_of_tables(value) if isinstance(value, list) else value)
    if change.branches:
        _put_branches(table, change.branches)


def _path(axis: str, change: Change) -> str:
    return f"{axis}.{change.kind}" if axis else change.kind


def _put_branches(table: Any, branches: Sequence[Mapping[str, Any]]) -> None:
    if "branches" not in table:
        table["branches"] = tomlkit.array() if isinstance(table, InlineTable) else tomlkit.aot()
    entries: Any = table["branches"]
    for branch in branches:
        same = [
            i for i, entry in enumerate(entries) if abs(_number(entry.get("turn")) - branch["turn"]) < TURN_TOLERANCE
        ]
        if not same:
            entry: Any = tomlkit.table() if isinstance(entries, AoT) else tomlkit.inline_table()
            entries.append(entry)
            entry = entries[len(entries) - 1]
        else:
            entry = entries[same[0]]
        for key, value in branch.items():
            if not isinstance(value, Mapping):
                _set(entry, key, value)
                continue
            # A branch has either the keys of the law or measured points.
            old = {*LAW} if {*MEASURED} & {*value} else {*MEASURED}
            present = entry.get(key)
            if not isinstance(present, Mapping) or (isinstance(present, InlineTable) and old & {*present}):
                entry[key] = tomlkit.inline_table()
            for other in old:
                entry[key].pop(other, None)
            for inner_key, inner in value.items():
                _set(entry[key], inner_key, _rows_of_tables(inner) if inner_key in MEASURED else inner)


def _rows_of_tables(rows: Sequence[Mapping[str, Any]]) -> Any:
    """Format a table with one row a line."""
    array = tomlkit.array()
    for row in rows:
        table = tomlkit.inline_table()
        table.update(row)
        array.append(table)
    return array.multiline(True)


def _set(table: Any, key: str, value: Any) -> None:
    """Put a value, unless it is there; a comment behind it stays in its column."""
    if table.get(key) == value:
        return
    before: Any = table.item(key) if isinstance(table, Table) and key in table else None
    table[key] = value
    if before is not None and before.trivia.comment:
        after: Any = table.item(key)
        room = len(before.trivia.comment_ws) + len(before.as_string()) - len(after.as_string())
        after.trivia.comment_ws = " " * max(room, 1)


def _with_provenance(text: str, name: str, axis: str, change: Change) -> str:
    """Replace the comments above the tables, those of an earlier calibration, by the new ones."""
    for index, lines in enumerate(change.provenance):
        key, turn = _path(axis, change), None
        if change.branches:
            turn = change.branches[index]["turn"]
            key = _entry(text, key, turn)
        at = parse_toml(text, name)[1].line_of(key) - 1
        rows = text.split("\n")
        first, end = _old(rows, at, change.kind, turn)
        indent = rows[at][: len(rows[at]) - len(rows[at].lstrip())]
        title = f"{_PROVENANCE_MARK}{change.kind}" + ("" if turn is None else f", turn {turn:g}")
        rows[first:end] = [f"{indent}{title}: {lines[0]}", *(f"{indent}# {line}" for line in lines[1:])]
        text = "\n".join(rows)
    return text


def _spaced(text: str, before: str) -> str:
    """Put a blank line above the tables that are new, as between the others."""
    old_pairs = set(pairwise(before.split("\n")))
    rows: list[str] = []
    for row in text.split("\n"):
        starts = row.startswith(("[", _PROVENANCE_MARK))
        if starts and rows and rows[-1] and not rows[-1].startswith("#") and (rows[-1], row) not in old_pairs:
            rows.append("")
        rows.append(row)
    return "\n".join(rows)


def _old(rows: list[str], at: int, kind: str, turn: float | None) -> tuple[int, int]:
    """Return the bounds of an earlier calibration's comment above a line; without one, nothing just above it."""
    end = at
    while end > 0:
        first = end
        while first > 0 and _FILE_MARK.match(rows[first - 1].strip()):
            first -= 1
        mark = _FIRST_MARK.match(rows[first - 1].strip()) if first > 0 else None
        if not mark:
            break
        if mark[1] == kind and (turn is None or (mark[2] and abs(float(mark[2]) - turn) < TURN_TOLERANCE)):
            return first - 1, end
        end = first - 1
    return at, at


def _entry(text: str, key: str, turn: float) -> str:
    entries = tomllib.loads(text)
    for part in key.split("."):
        entries = entries[part]
    turns = [_number(entry.get("turn")) for entry in entries["branches"]]
    return f"{key}.branches[{min(range(len(turns)), key=lambda i: abs(turns[i] - turn))}]"


def _check(old: str, new: str, name: str) -> None:
    """Raise ``Rejected`` for faults that the new text has and the old one had not; it may be incomplete."""
    problem_lists = []
    for text in (old, new):
        problems = Problems()
        values, document = parse_toml(text, name)
        decode(Scanner, values, document, problems, lambda *_: None)
        problem_lists.append(problems.entries)
    old_faults = {(problem.key, problem.why) for problem in problem_lists[0]}
    added = [p for p in problem_lists[1] if (p.key, p.why) not in old_faults and not p.why.startswith("missing")]
    if added:  # without a line, since the new text is not in the file
        raise Rejected([Problem(name, 0, p.key, f"{p.why}; nothing was written") for p in added])


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else -1.0
