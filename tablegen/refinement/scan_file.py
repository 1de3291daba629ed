"""Writing a layer into a scan file: one table in place, comments and order preserved, with a comment on its sources."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

import tomlkit
from tomlkit.items import Array, InlineTable, Table

from tablegen.base.input_errors import Problem, Rejected
from tablegen.base.toml import parse_toml

KEY, FRAME_KEY = "refinement", "frame_refinement"
COEFFICIENTS = ("a", "b", "previous_a", "previous_b", "line_a", "line_b", "frame_a", "frame_b")
_COEFFICIENTS_PER_ROW = 6
_ROUND_MARK = re.compile(r"# refine (\d+): ")


def with_layer(text: str, name: str, axis: str, values: Mapping[str, Any], provenance: str, key: str = KEY) -> str:
    """Put ``[AXIS.refinement]``, or another table of an axis, into the text of a scan file, whose name is ``name``.

    ``provenance`` becomes a line of the comment above the table, below those of earlier rounds, numbered.

    Raises
    ------
    Rejected
        If the text is no TOML or cannot be edited in place.
    """
    parse_toml(text, name)
    windows = "\r\n" in text
    text = text.replace("\r\n", "\n")
    expected = tomllib.loads(text)
    expected[axis][key] = dict(values)
    try:
        changed = _put(text, name, axis, key, values)
        at = parse_toml(changed, name)[1].line_of(f"{axis}.{key}") - 1
        changed = _commented(changed, at, provenance)
        preserved = tomllib.loads(changed) == expected
    except (Rejected, ValueError):  # the result is no TOML
        changed, preserved = text, False
    if not preserved:
        why = f"its layout is too unusual to be edited in place; write [{axis}] as a table of its own"
        raise Rejected([Problem(name, 0, axis, why)])
    return changed.replace("\n", "\r\n") if windows else changed


def rounds_of(text: str, name: str, axis: str, key: str = KEY) -> list[str]:
    """Return the provenance of each round of ``[AXIS.refinement]``, which the text has, oldest first."""
    rows = text.split("\n")
    at = first = parse_toml(text, name)[1].line_of(f"{axis}.{key}") - 1
    while first > 0 and _ROUND_MARK.match(rows[first - 1]):
        first -= 1
    return [_ROUND_MARK.sub("", row).rstrip("\r") for row in rows[first:at]]


def _put(text: str, name: str, axis: str, key: str, values: Mapping[str, Any]) -> str:
    """Put the values of the table into the text, which may have the table already."""
    document = tomlkit.parse(text)
    parent: Any = document[axis]
    if key in parent:
        _update(parent[key], values)
    elif isinstance(parent, InlineTable):
        parent[key] = dict(values)
    else:  # a new table by hand, since tomlkit would put it between the next table and its comment
        rows = text.split("\n")
        places = parse_toml(text, name)[1].lines or {}
        lines = [line for place, line in places.items() if place.split(".")[0] == axis]
        end = next((i for i in range(max(lines), len(rows)) if rows[i].startswith("[")), len(rows))
        while end > max(lines) and (not rows[end - 1] or rows[end - 1].startswith("#")):
            end -= 1
        table = tomlkit.table()
        _update(table, values)
        header = f"[{axis}.{key}]\n{table.as_string()}".split("\n")
        return "\n".join([*rows[:end], "", *header[:-1], *(rows[end:] if any(rows[end:]) else [""])])
    return tomlkit.dumps(document)


def _update(table: Any, values: Mapping[str, Any]) -> None:
    for key in [key for key in table if key not in values]:
        table.pop(key)
    for key, value in values.items():
        before: Any = table.item(key) if isinstance(table, Table) and key in table else None
        table[key] = _rows(value) if key in COEFFICIENTS and isinstance(table, Table) else value
        if before is not None and before.trivia.comment:
            table.item(key).trivia.comment_ws = before.trivia.comment_ws


def _rows(values: Sequence[float]) -> Array:
    array = tomlkit.array()
    for first in range(0, len(values), _COEFFICIENTS_PER_ROW):
        array.add_line(*values[first : first + _COEFFICIENTS_PER_ROW], indent="    ")
    array.add_line(indent="")
    return array


def _commented(text: str, at: int, provenance: str) -> str:
    """Add a line to the comment above row ``at``, that of the table."""
    rows = text.split("\n")
    last = _ROUND_MARK.match(rows[at - 1]) if at > 0 else None
    rows.insert(at, f"# refine {int(last[1]) + 1 if last else 1}: {provenance}")
    return "\n".join(rows)
