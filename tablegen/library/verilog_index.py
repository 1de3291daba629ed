"""The index of a library in Verilog: constants, and one memory of all programs for ``dac_library``.

The memory has words of 32 bits: first the address of each record, by number, then the records. A record is the number
of words of x and of y, with bit 31 set where they are Fourier words; 48 words of the program; the words of x and y,
sign-extended; and the CRC-32 of all of these, of their bytes from the lowest. Where the program has a table of pixels,
the number of words of y has the pixels of a sweep from bit 17 on, and the ticks of each stand behind the words of y.
"""

import zlib
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from tablegen.base.reading import BUILD_FILE, read_bytes, read_text
from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS
from tablegen.emit.constants import DEGREES, pixel_index_bits
from tablegen.emit.templates import template_text
from tablegen.emit.verilog_text import literal, value_range
from tablegen.library.entry import AxisEntry, Entry
from tablegen.library.sameness import MOST_PIXELS

MODULE = "dac_library.v"
FOURIER = 1 << 31
PIXELS_SHIFT = 17  # in the number of words of y
_COUNT = (1 << PIXELS_SHIFT) - 1
_FOLDER = Path(__file__).parent
_HARMONICS = AXIS_WORDS.index("harmonics")


Contents = Callable[[str, str], bytes]
"""What the file of a program holds, by the name of the program and its own."""


def verilog_index(library: str, entries: Sequence[Entry], content: Contents, version: str) -> dict[str, bytes]:
    """``NAME_library.vh``, its memories, and the module that reads them; programs that one sequencer can play.

    Words are those of the ``.mem`` files of the programs.
    """
    files = {f"{library}_library_tables.mem": _memory(entries, content, fourier=False)}
    rendered = all(axis.interpolated for entry in entries for axis in entry.axes)
    if rendered:
        files[f"{library}_library_fourier.mem"] = _memory(entries, content, fourier=True)
        longest = max(entries, key=lambda entry: max(axis.index_bits for axis in entry.axes))
        files[f"{library}_library_sine.mem"] = content(longest.name, f"{longest.name}_sine.mem")
    context = {
        "version": version,
        "library": library,
        "LIBRARY": library.upper(),
        "constants": _constants(entries),
        "files": {
            name.removesuffix(".mem").removeprefix(f"{library}_library_").upper(): (name, text.count(b"\n"))
            for name, text in files.items()
        },
        "programs": [(entry.name.upper(), number) for number, entry in enumerate(entries)],
    }
    header = template_text(read_text(_FOLDER / "library.vh.j2", BUILD_FILE), context, literal, range=value_range)
    return {f"{library}_library.vh": header, **files, MODULE: read_bytes(_FOLDER / MODULE, BUILD_FILE)}


def _constants(entries: Sequence[Entry]) -> dict[str, int]:
    """Return the parameters of a ``dac_sequencer`` that plays all programs."""
    constants = {"PROGRAMS": len(entries), "DAC_BITS": entries[0].x.dac_bits}
    for letter, axes in (("X", [entry.x for entry in entries]), ("Y", [entry.y for entry in entries])):
        constants |= {
            f"{letter}_INTERPOLATED": DEGREES["cubic"] if axes[0].cubic else int(axes[0].interpolated),
            f"{letter}_INDEX_BITS": max(_index_bits(axis) for axis in axes),
            f"{letter}_WORD_BITS": axes[0].table_bits,
        }
    constants |= {key: max(entry.widths[key] for entry in entries) for key in entries[0].widths}
    constants["HARMONICS"] = max(axis.harmonics for entry in entries for axis in entry.axes)
    constants["SHAPING"] = max(axis.shaping_order for entry in entries for axis in entry.axes)
    constants["PIXEL_INDEX_BITS"] = pixel_index_bits(max(entry.table_pixels for entry in entries))
    return constants


def _index_bits(axis: AxisEntry) -> int:
    """Of a bank that holds the table."""
    return axis.index_bits if axis.interpolated else max((axis.table_words - 1).bit_length(), 2)


def _memory(entries: Sequence[Entry], content: Contents, fourier: bool) -> bytes:
    records = [_record(entry, content, fourier) for entry in entries]
    starts = np.cumsum([len(entries), *(len(record) for record in records)])
    words = np.concatenate([starts[:-1].astype(np.uint32), *records])
    return "".join(f"{word:08x}\n" for word in words.tolist()).encode("ascii")


def _record(entry: Entry, content: Contents, fourier: bool) -> "np.ndarray[tuple[int], np.dtype[np.uint32]]":
    """Return a record as words."""
    kind = "_fourier" if fourier else ""
    program = _words(content(entry.name, f"{entry.name}_program.mem"), 32)
    axes = [
        _words(content(entry.name, f"{entry.name}_{name}{kind}.mem"), 32 if fourier else axis.table_bits)
        for name, axis in (("x", entry.x), ("y", entry.y))
    ]
    if fourier:
        for page, axis in ((1, entry.x), (2, entry.y)):
            program[page * PAGE_WORDS + _HARMONICS] = axis.harmonics
    counts = np.array([len(words) | (FOURIER if fourier else 0) for words in axes], dtype=np.uint32)
    counts[1] |= entry.table_pixels << PIXELS_SHIFT
    pixels = _words(content(entry.name, f"{entry.name}_pixels.mem"), 32) if entry.table_pixels else axes[0][:0]
    record = np.concatenate([counts, program, *axes, pixels])
    return np.append(record, np.uint32(zlib.crc32(record.astype("<u4").tobytes())))


def words_before_crc(x_count: int, y_count: int) -> int:
    """Return the number of words of a record before its CRC, from the first two of them."""
    pixels = y_count >> PIXELS_SHIFT & MOST_PIXELS
    return 2 + 3 * PAGE_WORDS + (x_count & _COUNT) + (y_count & _COUNT) + 2 * pixels


def _words(memory: bytes, bits: int) -> "np.ndarray[tuple[int], np.dtype[np.uint32]]":
    """Read the words of a memory file, sign-extended to 32 bits."""
    words = np.array([int(word, 16) for word in memory.split()], dtype=np.int64)
    return (words - ((words >> (bits - 1)) << bits)).astype(np.uint32)
