"""Whether programs can be played by one runtime: one sequencer is compiled, or placed, for one kind of them."""

from collections.abc import Callable, Sequence
from typing import Any

from tablegen.emit.constants import storage_bits
from tablegen.library.entry import AxisEntry, Entry

MOST_PIXELS = (1 << 14) - 1  # of a sweep, whose ticks a record of dac_library has

_OUTPUT: dict[str, Callable[[AxisEntry], Any]] = {
    "dac.bits": lambda axis: axis.dac_bits,
    "dac.word_bits": lambda axis: axis.word_bits,
    "dac.coding": lambda axis: axis.coding,
    "dac.align": lambda axis: axis.align,
    "dac.output": lambda axis: axis.channel,
}
_VERILOG: dict[str, Callable[[AxisEntry], Any]] = {
    "dac.bits": lambda axis: axis.dac_bits,
    "dac.output": lambda axis: axis.channel,
    "table.mode": lambda axis: "cubic" if axis.cubic else "interpolated" if axis.interpolated else "direct",
    "table.bits": lambda axis: axis.table_bits,
    "table.length": lambda axis: axis.table_words if axis.interpolated else None,
}


def words_in_memory(entry: Entry) -> tuple[int, int]:
    """Bits in memory of a table word and of a converter word of the C of one program."""
    table = max(axis.table_bits for axis in entry.axes)
    output = max(axis.word_bits for axis in entry.axes)
    return storage_bits(table), storage_bits(output)


def why_not_one_c(entries: Sequence[Entry]) -> str | None:
    """Why one C runtime cannot play all of these, or None."""
    first = entries[0]
    for entry in entries:
        if words_in_memory(entry) != words_in_memory(first):
            return _differ(first, entry, "storage of words", words_in_memory(first), words_in_memory(entry))
    return _first_difference(entries, _OUTPUT)


def why_not_one_sequencer(entries: Sequence[Entry]) -> str | None:
    """Why one Verilog sequencer cannot play all of these, or None."""
    for entry in entries:
        if entry.table_pixels > MOST_PIXELS:
            return f"{entry.name} has a table of {entry.table_pixels} pixels, dac_library writes at most {MOST_PIXELS}"
    return _first_difference(entries, _VERILOG)


def _first_difference(entries: Sequence[Entry], kinds: dict[str, Callable[[AxisEntry], Any]]) -> str | None:
    first = entries[0]
    for entry in entries[1:]:
        for name, axis, other in (("x", first.x, entry.x), ("y", first.y, entry.y)):
            for key, value in kinds.items():
                if value(axis) != value(other):
                    label = key if key.startswith("dac") else f"{name}.{key}"
                    return _differ(first, entry, label, value(axis), value(other))
    return None


def _differ(first: Entry, entry: Entry, what: str, one: Any, other: Any) -> str:
    return f"{first.name} and {entry.name} differ in {what}: {one} and {other}; set it in the scan file"
