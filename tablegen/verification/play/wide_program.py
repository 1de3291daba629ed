"""Programs that fill registers of the Verilog: a register that is too narrow shows within a few ticks.

The model plays a program of a few lines that begins in the same way, and ends after what is played of it.
"""

from dataclasses import dataclass
from typing import Literal

from msgspec.structs import replace

from tablegen.device.dual_program import DualProgram
from tablegen.device.registers import SCAN_WORDS, program_words
from tablegen.device.schedule import Window
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Program

Part = Literal["line", "frame"]
WIDE: tuple[Part, ...] = ("line", "frame")
_MODEL_TICKS, _MODEL_LINES = 64, 64
_FIRST = 3  # of a window, which a narrow register would end, or begin, some ticks later
_SETTLE = 1 << 7
_TICK, _LINE = 1 << 23, 1 << 15  # the highest bits of counters of ticks and lines


@dataclass(frozen=True)
class WideProgram:
    """A program of the model, and the words that a device gets."""

    program: DualProgram
    words: list[int]


def wide_program(part: Part, like: DualProgram) -> WideProgram:
    """Return a program like another one whose line, or whose frame, is as long as can be."""
    schedule = like.schedule
    if part == "line":
        ticks, lines, whole = _MODEL_TICKS, 2, Window(_FIRST, _MODEL_TICKS - _FIRST)
        schedule = replace(schedule, ticks=ticks, lines=lines, pixels=whole.count, settle_lines=_SETTLE)
        schedule = replace(schedule, turn_tick=ticks - 1, forward=whole, backward=Window(ticks - 1, 1))
        schedule = replace(schedule, up=Window(0, 2), down=Window(0, 0))
        count = _TICK + _FIRST + 1
        highest = {"line_ticks": _TICK + 12, "turn_tick": _TICK + 8, "forward_count": count, "pixels": count}
        highest |= {"backward_first": _TICK + 20, "backward_count": count}  # it has a tick for each pixel, too
    else:
        ticks, lines = schedule.ticks, _MODEL_LINES
        schedule = replace(schedule, lines=lines, settle_lines=0, up=Window(1, lines - 1), down=Window(lines - 1, 1))
        highest = {"frame_lines": _LINE + 2, "up_count": _LINE, "down_first": _LINE}
    x, y = _longer(like.x, RationalPhase(ticks), 1), _longer(like.y, RationalPhase(lines), ticks)
    words = program_words(schedule, x, y)
    for name, word in highest.items():
        words[SCAN_WORDS.index(name)] = word
    return WideProgram(DualProgram(x, y, schedule), words)


def _longer(like: Program, phase: RationalPhase, hold: int) -> Program:
    """Return an axis of another period whose guard allows half of the converter's codes in a step (highest bit)."""
    output = like.output
    return replace(like, phase=phase, hold=hold, output=replace(output, max_step=1 << (output.dac_bits - 1)))
