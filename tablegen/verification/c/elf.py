"""The parts of an executable that an emulator needs: its segments, and the addresses of its symbols."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Segment:
    """A segment: bytes and their place in memory; those after ``data`` up to ``size`` are 0.

    ``load_address`` is where they lie before start-up code has copied them.
    """

    address: int
    load_address: int
    data: bytes
    size: int


@dataclass(frozen=True)
class Executable:
    """A linked program."""

    entry: int
    segments: list[Segment]
    symbols: dict[str, int]
    sizes: dict[str, int]  # sizes of symbols in bytes


def read_executable(path: Path) -> Executable:
    """Read an ELF executable."""
    from elftools.elf.elffile import ELFFile

    symbols: dict[str, int] = {}
    sizes: dict[str, int] = {}
    with path.open("rb") as stream:
        file = ELFFile(stream)
        segments = [
            Segment(segment["p_vaddr"], segment["p_paddr"], segment.data(), segment["p_memsz"])
            for segment in file.iter_segments("PT_LOAD")
            if segment["p_memsz"]
        ]
        table = file.get_section_by_name(".symtab")
        for symbol in table.iter_symbols() if table is not None else ():
            if symbol.name and not symbol.name.startswith("$"):
                symbols[symbol.name], sizes[symbol.name] = symbol["st_value"], symbol["st_size"]
        return Executable(file["e_entry"], segments, symbols, sizes)
