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
from tablegen.config.schema import WrittenScan

PAGE = Path(__file__).with_name("configuration.md")
INTRODUCTION = """\
# The two input files

This page lists all keys of the scan file and the scanner file. It is for everybody who writes these files. Begin with
the commented pair that `tablegen init` writes; [calibration](calibration.md) explains how to measure the values of the
scanner file. `tablegen schema scan` and `tablegen schema scanner` print JSON Schema for editors.
`python docs/make_configuration.py` writes this page from the types of both files. Converter and amplifier can stand in
either file, for both axes or for one: [hardware](hardware.md) says which key counts.

Voltages are at the piezo unless a key says otherwise. Units are part of every key. A key without a default may be left
out if its description names an alternative ("or give"). Unknown keys are errors. In addition to the ranges below, a
build checks that the drive stays within the range of the driver and the converter, and the slew rate within that of the
amplifier. It also checks that a line and a table can carry the harmonics, and that the hysteresis is in the range in
which its model holds. Numbers in parentheses, such as (17), are equations of the paper.

## An image in words

A scan of 512 x 512 pixels over 2 um, at one line per second:

```toml
name = "two_um"
scanner = "scanner.toml"
image_um = 2.0                   # or image_nm; or [x, y]

[timing]
pixels = 512
image_lines = 512
frame = "flyback"                # or "up-down"
line_rate_hz = 1.0               # or frame_rate_hz, speed_um_per_s, speed_mm_per_s

[x]
offset_v = 50.0

[y]
like = "x"
```

tablegen computes the sizes and periods of both axes. `build` and `show` print its choices, in lines that begin with
`chosen:`.

- `image_nm` is the size of the imaging windows. The lines are longer by their turnarounds: 2 um in a window of 0.1 to
  0.9 need lines of 2.5 um. Unless `[x.band_limit] window` is given, each end of the window of x moves by up to 0.025,
  so that a pixel is a whole number of ticks at the requested line rate.
- `image_lines` is the number of lines in the image. The line periods in which y turns and flies back are added to it:
  about a tenth of the way up, and with `"flyback"` another twentieth of the frame. `lines` counts line periods instead:
  with 512 of them, `turn = 0.5` and a window of 0.1 to 0.9, 204 lines are imaged on the way up and 204 on the way down.
- `frame = "flyback"`: every image goes up, and y flies back. `frame = "up-down"`: images are taken on the way up and on
  the way down, each with all `image_lines`. Without `frame`, `turn` and `directions` of y hold; their defaults are
  those of `"up-down"`. The first lines that a command prints say which:
  `30 s an image, two images a frame: up and down`.
- A frame is one period of y. With `"up-down"` it has two images, so `frame_rate_hz = 1` gives two images a second.
- `speed_um_per_s` and `speed_mm_per_s` are the speed of the tip along the forward line, inside the window.
- Keys with `um` are those with `nm`, in micrometres: 0.3 um is exactly 300 nm.

Two keys that set the same quantity are refused: the message names both keys, their lines and the remedy.

```text
scan.toml:23: x.size_nm: image_nm on line 3 sets the size of both axes already, as that of the imaging windows; leave
out one of the two
```

**`[y] like = "x"`** gives y all keys of x, in the scan file and in the scanner file. Keys in `[y]` take precedence,
also if they set the same quantity in another way: with `size_v` in `[y]`, y does not take `size_nm` of x.
`[x.refinement]` is not taken, and with `frame` the turn and directions of x are not either. An error in a key that y
has from x is reported at the line in `[x]`.

**A line scan** has `motion = "off"` in `[y]`: x runs, and y rests at its `offset_v` or `offset_nm`. All lines of a
frame are imaged, and y has no size, turn, band limit or table. `verify`, `upload` and the sequencers treat it as any
other scan: the table of y holds zeros. `simulate` does not play line scans.
"""


def page() -> str:
    """The whole page."""
    parts = [INTRODUCTION]
    for title, kind in (("Scan file", WrittenScan), ("Scanner file", Scanner)):
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
        case types.ListType():
            count = kind.min_length if kind.min_length == kind.max_length else None
            inner = _accepts(_plain(kind.item_type)[0])
            return f"[{', '.join([inner] * count)}]" if count else f"array: {inner}"
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
