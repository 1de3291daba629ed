"""Memory files for ``$readmemh``: one full-width two's complement word a line, in hexadecimal."""

from collections.abc import Iterable, Mapping
from typing import Literal

from tablegen.device.registers import program_words
from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.synthesis import WORD_BITS, sine_quarter
from tablegen.numerics.arrays import Ints


def memory_file(words: Ints | Iterable[int], bits: int) -> bytes:
    """The words, each in as many hexadecimal digits as ``bits`` take."""
    digits, mask = -(-bits // 4), (1 << bits) - 1
    return "".join(f"{int(word) & mask:0{digits}x}\n" for word in words).encode("ascii")


def memory_files(
    name: str, schedule: Schedule, x: Program, y: Program, fourier: Mapping[Literal["x", "y"], Ints]
) -> dict[str, bytes]:
    """All memory files of a build by their names; ``fourier`` has the Fourier words of "x" and "y" in order.

    The registers are those for uploaded tables: a host that uploads Fourier words instead writes HARMONICS over the
    last register of their axis, which is 0 here. The quarter sine is that of the longest interpolated table, and serves
    shorter ones too; where no table is interpolated there is none.
    """
    files = {}
    programs: tuple[tuple[Literal["x", "y"], Program], ...] = (("x", x), ("y", y))
    for axis, program in programs:
        files[f"{name}_{axis}.mem"] = memory_file(program.words, program.bits)
        files[f"{name}_{axis}_fourier.mem"] = memory_file(fourier[axis], WORD_BITS)
    files[f"{name}_program.mem"] = memory_file(program_words(schedule, x, y), WORD_BITS)
    if index_bits := max(x.index_bits, y.index_bits):
        files[f"{name}_sine.mem"] = memory_file(sine_quarter(index_bits), WORD_BITS)
    return files
