"""Write docs/configuration.md from the schema, so that the page and the program cannot differ.

Usage: python docs/make_configuration.py
"""

from pathlib import Path
from textwrap import fill

import msgspec.inspect as types

from tablegen.compensation import models
from tablegen.compensation.model import Hysteresis
from tablegen.config.describe import model_fields, purposes
from tablegen.config.scanner import Scanner
from tablegen.config.schema import Scan

PAGE = Path(__file__).with_name("configuration.md")
INTRODUCTION = """\
# The two input files

This page lists all keys of the scan file and the scanner file. It is for everybody who writes these files. Start with
the commented pair that `tablegen init` writes; [calibration](calibration.md) explains how to measure the values of the
scanner file. `tablegen schema scan` and `tablegen schema scanner` print JSON Schema for editors.
`python docs/make_configuration.py` writes this page from the types of both files. Converter and amplifier can stand in
either file, for both axes or for one: [hardware](hardware.md) says which key counts.

Voltages are at the piezo unless a key says otherwise. Units are part of every key. A key without a default may be left
out if its meaning names an alternative ("or give"). Unknown keys are errors. In addition to the ranges below, a build
checks that the drive stays within the range of the driver and the converter, and the slew rate within that of the
amplifier. It also checks that a line and a table can carry the harmonics, and that the hysteresis is in the range in
which its model holds. Numbers in parentheses, such as (17), are equations of the paper.
"""


def page() -> str:
    """The whole page."""
    parts = [INTRODUCTION]
    for title, kind in (("Scan file", Scan), ("Scanner file", Scanner)):
        parts += [f"## {title}\n", *_tables(types.type_info(kind), "", {})]
    return "\n".join(parts)


def _tables(kind: types.Type, path: str, written: dict[type, str]) -> list[str]:
    """The table of a struct and of what it holds; a struct that was written before is referred to."""
    assert isinstance(kind, types.StructType)
    written[kind.cls] = path.strip("[]")
    name = f"`[{path}]`: " if path else ""
    path = path.strip("[]")
    heading = fill(f"{name}{_summary(kind)}", 120, break_long_words=False, break_on_hyphens=False)
    rows = [f"{heading}\n", "| key | accepts | default | meaning |", "|---|---|---|---|"]
    inner_tables = []
    fields = [(field, "") for field in kind.fields]
    if kind.cls is Hysteresis:
        names = ", ".join(f'`"{name}"`' for name in models.names())
        rows.append(f'| `model` | {names} | `"{models.DEFAULT}"` | {purposes()} |')
        fields = model_fields()
    for field, takers in fields:
        inner, description = _plain(field.type)
        description = takers + description
        child = f"{path}.{field.encode_name}" if path else field.encode_name
        accepts = None
        if isinstance(inner, types.ListType):
            inner, child, accepts = _plain(inner.item_type)[0], f"[{child}]", "array of tables"
            if not isinstance(inner, types.StructType):
                accepts = f"array: {_accepts(inner)}"
        if isinstance(inner, types.StructType):
            before = written.get(inner.cls)
            description = description or (f"As `[{before}]`." if before else _summary(inner))
            accepts = accepts or "table"
            if not before:
                inner_tables += _tables(inner, child, written)
        rows.append(f"| `{field.encode_name}` | {accepts or _accepts(inner)} | {_default(field)} | {description} |")
    return [*rows, "", *inner_tables]


def _summary(kind: types.StructType) -> str:
    return (kind.cls.__doc__ or "").strip().splitlines()[0]


def _plain(kind: types.Type) -> tuple[types.Type, str]:
    description = ""
    while isinstance(kind, types.Metadata | types.UnionType):
        if isinstance(kind, types.Metadata):
            description = (kind.extra_json_schema or {}).get("description", description)
            kind = kind.type
        else:
            some = [t for t in kind.types if not isinstance(t, types.NoneType)]
            if len(some) > 1:
                break
            kind = some[0]
    return kind, description.replace("|", "\\|")


def _accepts(kind: types.Type) -> str:
    match kind:
        case types.FloatType() | types.IntType():
            word = "number" if isinstance(kind, types.FloatType) else "whole number"
            low = (
                f"from {kind.ge:.12g}"
                if kind.ge is not None
                else f"above {kind.gt:.12g}"
                if kind.gt is not None
                else ""
            )
            high = (
                f"to {kind.le:.12g}" if kind.le is not None else f"below {kind.lt:.12g}" if kind.lt is not None else ""
            )
            return " ".join(filter(None, [word, low, high]))
        case types.LiteralType():
            return ", ".join(f'`"{value}"`' for value in kind.values)
        case types.UnionType():
            return ", ".join(_accepts(_plain(t)[0]) for t in kind.types)
        case types.StrType():
            return "text"
        case types.BoolType():
            return "`true`, `false`"
        case types.TupleType():
            return f"[{', '.join(_accepts(_plain(t)[0]) for t in kind.item_types)}]"
    raise NotImplementedError(kind)


def _default(field: types.Field) -> str:
    if field.required:
        return "required"
    value = field.default
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, str):
        return f'`"{value}"`'
    if isinstance(value, tuple):
        return f"`[{', '.join(map(str, value))}]`"
    return f"`{value:g}`" if isinstance(value, int | float) else ""


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
