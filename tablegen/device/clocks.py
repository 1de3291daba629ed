"""The clocks that the Verilog sequencer takes from tick to tick."""

from collections.abc import Iterable

from tablegen.fixedpoint.program import Program

_CUBIC = 11
_SCANNER = 6  # shaping that feeds three remainders back


def least_clocks(programs: Iterable[Program]) -> int:
    """Return the least clocks from tick to tick with which a sequencer plays programs, without ``LOW_AREA``."""
    return max(
        _CUBIC if program.mode == "cubic" else _SCANNER if program.output.shaping.order == 3 else 1
        for program in programs
    )
