"""The index of a library in C99: every program by number and by name, for one ``dac_sequencer``."""

from collections.abc import Sequence
from pathlib import Path

from tablegen.base.reading import BUILD_FILE, read_text
from tablegen.emit.c_text import literal
from tablegen.emit.templates import template_text
from tablegen.fixedpoint.spline import WORDS_BEHIND
from tablegen.library.entry import Entry
from tablegen.library.sameness import words_in_memory

_FOLDER = Path(__file__).parent


def c_index(library: str, entries: Sequence[Entry], version: str) -> dict[str, bytes]:
    """``NAME_library.h`` and ``NAME_library.c``; the programs can be played by one runtime."""
    table, output = words_in_memory(entries[0])
    first = entries[0]
    behind = WORDS_BEHIND if any(axis.cubic for entry in entries for axis in entry.axes) else 1
    converters = {
        f"{name}_{key}": value
        for name, axis in (("X", first.x), ("Y", first.y))
        for key, value in {
            "DAC_BITS": axis.dac_bits,
            "DAC_WORD_BITS": axis.word_bits,
            "DAC_TWOS_COMPLEMENT": int(axis.coding == "twos-complement"),
            "DAC_LEFT_ALIGNED": int(axis.align == "left"),
        }.items()
    }
    context = {
        "version": version,
        "library": library,
        "LIBRARY": library.upper(),
        "storage": {
            "TABLE_STORAGE_BITS": table,
            "OUTPUT_STORAGE_BITS": output,
            **({"SPLINE": 1} if behind > 1 else {}),
            **({"PIXEL_TABLE": 1} if any(entry.table_pixels for entry in entries) else {}),
        },
        "shaping": max(axis.shaping_order for entry in entries for axis in entry.axes),
        "converters": converters,
        "most": {
            "X_TABLE_ROOM": max(entry.x.table_words for entry in entries) + behind,
            "Y_TABLE_ROOM": max(entry.y.table_words for entry in entries) + behind,
            "LONGEST_NAME": max(len(entry.name) for entry in entries),
        },
        "programs": [
            {"number": number, "name": entry.name, "NAME": entry.name.upper(), "told": _told(entry)}
            for number, entry in enumerate(entries)
        ],
    }
    return {
        f"{library}_library.{suffix}": template_text(_template(f"library.{suffix}.j2"), context, literal)
        for suffix in ("h", "c")
    }


def _template(name: str) -> str:
    return read_text(_FOLDER / name, BUILD_FILE)


def _told(entry: Entry) -> str:
    """Return what differs, for a comment."""
    from tablegen.emit.templates import comment_safe

    return comment_safe(", ".join(f"{key} = {value}" for key, value in entry.settings.items()))[:200]
