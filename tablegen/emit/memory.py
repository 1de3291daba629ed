"""Memory files for ``$readmemh``: one full-width two's complement word a line, in hexadecimal."""

from collections.abc import Iterable

from tablegen.fixedpoint.synthesis import WORD_BITS, sine_quarter
from tablegen.numerics.arrays import Ints
from tablegen.plan import Plan
from tablegen.registers import program_words


def memory_file(words: Ints | Iterable[int], bits: int) -> bytes:
    """The words, each in as many hexadecimal digits as ``bits`` take."""
    digits, mask = -(-bits // 4), (1 << bits) - 1
    return "".join(f"{int(word) & mask:0{digits}x}\n" for word in words).encode("ascii")


def program_file(plan: Plan) -> bytes:
    """The registers of the Verilog sequencer, for tables that are uploaded.

    A host that uploads Fourier words instead writes HARMONICS over the last register of their axis, which is 0 here.
    """
    return memory_file(program_words(plan.schedule, plan.x.program, plan.y.program), WORD_BITS)


def sine_file(plan: Plan) -> bytes | None:
    """The quarter sine of the longest interpolated table, which serves shorter ones too; None without one."""
    index_bits = max(line.program.index_bits for line in plan.lines)
    return memory_file(sine_quarter(index_bits), WORD_BITS) if index_bits else None
