"""The clocks that the Verilog sequencer takes from tick to tick."""

from collections.abc import Iterable

from tablegen.device.dual_program import ScanProgram
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.interpolation import index_bits_of
from tablegen.fixedpoint.program import Program

_CUBIC = 11
_SCANNER = 6  # shaping that feeds three remainders back
_SLOW_CUBIC, _SLOW_LINES = 93, 44  # with SLOW_PART, by the tables of x and y
_SLOW_SHAPING = 2  # more, where the sequencer shapes
_ENGINE_TICK = 2  # clocks of a tick in which no line is worked out
_ENGINE_AXIS, _ENGINE_KNOT, _ENGINE_SLOW_BIT, _ENGINE_WORD = 463, 2, 2, 11
_ENGINE_ENDS = 8  # clocks from the tick that begins a line until the work does, and back


def least_clocks(programs: Iterable[Program]) -> int:
    """Return the least clocks from tick to tick with which a sequencer plays programs, without ``LOW_AREA``."""
    return max(
        _CUBIC if program.mode == "cubic" else _SCANNER if program.output.shaping.order == 3 else 1
        for program in programs
    )


def slow_line_clocks(program: ScanProgram) -> int:
    """Return the most clocks in which a sequencer with ``SLOW_PART`` works out a line, beside those of its ticks."""
    clocks = _ENGINE_ENDS
    for axis in (program.x, program.y):
        assert isinstance(axis, FrameProgram)
        clocks += _ENGINE_AXIS + _ENGINE_KNOT * (len(axis.gains.words) - 2)
        clocks += _ENGINE_SLOW_BIT * index_bits_of(len(axis.slow.words)) + _ENGINE_WORD * len(axis.fast.words)
    return clocks


def least_slow_clocks(program: ScanProgram, *, shaping: bool | None = None) -> int:
    """Return the least clocks from tick to tick with ``SLOW_PART``: each line is worked out while the last one plays.

    Parameters
    ----------
    program
        One whose axes both have a slow part.
    shaping
        True if the sequencer has ``SHAPING``, which a program without shaping may play on too; that of the program
        unless given.
    """
    shapes = program.shaping_order > 0 if shaping is None else shaping
    cubic = any(isinstance(axis, FrameProgram) and axis.fast.mode == "cubic" for axis in (program.x, program.y))
    each_tick = -(-slow_line_clocks(program) // program.schedule.ticks) + _ENGINE_TICK
    return max((_SLOW_CUBIC if cubic else _SLOW_LINES) + (_SLOW_SHAPING if shapes else 0), each_tick)
