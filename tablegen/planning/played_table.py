"""How ``fill`` of the C plays a table: in runs or tick by tick, and in which blocks and windows.

The rules are those of ``allow_runs`` in dac_program.c, which tests compare on random programs.
"""

from math import ceil
from typing import NamedTuple, get_args

import numpy as np
from msgspec.structs import replace

from tablegen.config.schema import ProcessorName
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.spline import SPLINE_UNIT
from tablegen.fixedpoint.table_shape import TableShape

PROCESSORS: tuple[ProcessorName, ...] = get_args(ProcessorName)
RUN = 16  # ticks with one check of clamp and slew guard
LEAST_BLOCK = 4  # the same of lines that move too far in 16, with products of 32 bits
_NARROW_BITS = 16
_LEAST_SHAPED_WINDOW = 15  # codes: what is fed back may leave half of a smaller one
_LARGEST = (1 << 31) - 1  # of a gain with 32 fraction bits
_RAMP = 4  # codes of a tick for which a window has room
_NARROW = 32  # windows in the range of a converter, at least
_WIDE = 4  # the same with long products, where the slew guard cannot act
# Products of 32 bits: what a gain, and samples on a line with a ramp, may differ by.
_FINE_BITS = 5  # of a product of wide words that are kept apart
_WIDE_SAMPLE_BITS = 25
_GAIN_AND_SPREAD_BITS = 30
_MOST_SPREAD_BITS = 19


class MeasuredRun(NamedTuple):
    """Conditions of the instruction counts besides the mode: word memory, the converter, and shaping."""

    table_storage_bits: int  # 16, or 32 if a table of either axis has words of more than 16 bits
    output_storage_bits: int  # 16, or 32 if a converter's word has more than 16 bits, or shapes with other than 16
    coded: bool  # two's complement or left-aligned: each code takes a step more
    shaping_order: int = 0


class PlayedTable(NamedTuple):
    """A table and the axis that plays it, as far as they decide what a sample takes.

    ``period`` is that of the phase, in advances; ``hold`` the ticks of an advance; ``steepest`` the largest step of a
    tick, in codes, without rounding: 0 where an advance takes several ticks, since it then moves in one of many. With
    ``ramps`` it is the table over the line of an axis with a slow part, whose output has the largest gain of a line,
    and whose words, on any line, move a code by at most ``moves`` in a tick.
    """

    shape: TableShape
    period: int
    hold: int
    output: Output
    steepest: float
    ramps: bool = False
    moves: int = 0

    @property
    def run(self) -> MeasuredRun:
        """The conditions under which its instructions were measured, unless the other axis has wider words."""
        output = self.output
        shifted = output.align == "left" and output.word_bits > output.dac_bits
        coded = shifted or output.coding == "twos-complement"
        order, wide = output.shaping.order, _storage(output.word_bits)
        if order and output.dac_bits != 16:  # shaped as in wide words, in a loop for converters of any bits
            wide = 32
        return MeasuredRun(_storage(self.shape.bits), wide, coded, order)

    def has_runs(self, processor: ProcessorName, table_storage_bits: int) -> bool:
        """Return True if ``fill`` of the C can play runs of it; else each tick is played by itself.

        Codes near a limit have none either, with any table.
        """
        shape, output = self.shape, self.output
        if ((1 << 32) - 1) // self.period <= 2:
            return False
        if shape.mode == "cubic" and self.hold == 1 and self.period <= 2 * shape.length:
            return False
        if not _multiplies_long(processor, table_storage_bits):
            window = min((output.code_max - output.code_min) // 32, output.max_step)
            return not output.shaping.order or window >= _LEAST_SHAPED_WINDOW
        if output.shaping.order:
            up = 29 - shape.bits
            most = 1 << (31 - up if up > 14 else 17)
            return table_storage_bits > _NARROW_BITS or -most <= output.gain_word < most
        left = 32 - output.gain_q
        return 0 <= left <= 30 and abs(output.gain_word) <= _LARGEST >> left

    def keeps_window(self, processor: ProcessorName, table_storage_bits: int) -> bool:
        """Return True if no block leaves the window in which the C checks clamp and slew guard for all of its ticks."""
        block = self.block(processor, table_storage_bits, self.step)
        return block * self.steepest <= self.window(processor, table_storage_bits, self.step) // 2

    @property
    def step(self) -> int:
        """The most that a tick moves, in codes: what the C finds in the words, or a little more."""
        return max(self.moves, ceil(self.steepest) + 1)

    def block(self, processor: ProcessorName, table_storage_bits: int, step: int) -> int:
        """Return the ticks that one check of the C covers, where ``step`` is the most that a tick moves, in codes."""
        if _multiplies_long(processor, table_storage_bits) or self.hold > 1 or step > self._allowed:
            return RUN
        ticks, moved = RUN, RUN * step + 2 * self._aside
        while moved > self._reach(table_storage_bits, self.window(processor, table_storage_bits, step)):
            if ticks == LEAST_BLOCK:
                break
            ticks, moved = ticks // 2, moved // 2 + 1
        return ticks

    def _reach(self, table_storage_bits: int, window: int) -> int:
        """Return the codes that a block may move by with products of 32 bits; on a ramp samples may differ less."""
        if not self.ramps:
            return window // 2
        wide, gain, bits = table_storage_bits > _NARROW_BITS, abs(self.output.gain_word), self.shape.bits
        up = (_WIDE_SAMPLE_BITS - guard_bits(bits) if wide else _NARROW_BITS) - bits  # by which the gain is scaled
        if not wide and not self.output.shaping.order:
            up = 0
        fine = _FINE_BITS if wide else 0
        spread = min(_GAIN_AND_SPREAD_BITS + fine - (gain << up).bit_length(), _MOST_SPREAD_BITS + fine)
        return min(gain << spread >> self.output.gain_q, window // 2)

    @property
    def _aside(self) -> int:
        """The most that a code is away from the value before its shaping."""
        order, zero = self.output.shaping.order, self.output.shaping.zero
        return order if order < 2 else 2 + -(-zero // 64)

    @property
    def _allowed(self) -> int:
        """The most that a tick may move before its shaping, so that the slew guard cannot act."""
        return self.output.max_step - 2 * self._aside

    def window(self, processor: ProcessorName, table_storage_bits: int, step: int) -> int:
        """Return the codes of this window, around the code before; ``step`` is the most that a tick moves, in codes."""
        output, widest = self.output, self.output.code_max - self.output.code_min
        window = _power_within(min(widest // _NARROW, output.max_step))
        if step > self._allowed:
            return window
        block = RUN * (step + _RAMP * self.ramps) + 2 * self._aside
        most = _power_within(widest // (_WIDE if _multiplies_long(processor, table_storage_bits) else _NARROW))
        return max(window, min(1 << (2 * block - 1).bit_length(), most))


def played_frame_table(program: FrameProgram, max_step: int, steepest: float) -> PlayedTable:
    """Return the table over the line of an axis with a slow part and a second table, whose slew guard is given.

    ``max_step`` and ``steepest``, the largest step of a tick, are in codes.
    """
    fast = program.fast
    shape = TableShape(fast.mode, len(fast.words), fast.bits)
    gain = max(abs(program.output.gain_word), int(np.max(np.abs(program.gains.words))))
    output = replace(program.output, max_step=max_step, gain_word=gain)
    return PlayedTable(shape, fast.phase.ticks, fast.hold, output, steepest, True, _moves(program, gain))


def _moves(program: FrameProgram, gain: int) -> int:
    """Return the most that the words of a line move a code by in a tick, as dac_program.c finds it."""
    fast, ratio = program.fast, int(np.max(np.abs(program.ratios.words)))
    words, second = (np.abs(np.diff(each, append=each[:1])) for each in (fast.words, program.second))
    rise = int(np.max(words + ((ratio * second) >> 12) + 1))
    unit, bits = (SPLINE_UNIT, 18) if fast.mode == "cubic" else (1 << guard_bits(fast.bits), 15)
    way = (len(fast.words) << bits) // fast.phase.ticks + 1  # from tick to tick
    return (gain * ((unit * rise * way >> bits) + 3) >> program.output.gain_q) + 1


def _multiplies_long(processor: ProcessorName, table_storage_bits: int) -> bool:
    """Return the default of DAC_LONG_MULTIPLY in dac_config.h."""
    return processor == "cortex-m4" or (processor == "riscv32" and table_storage_bits > _NARROW_BITS)


def _power_within(step: int) -> int:
    """Return the largest power of two of codes in which no two differ by more than a step."""
    return 1 << (step + 1).bit_length() - 1


def _storage(bits: int) -> int:
    """Return the bits in which the C holds a word of so many bits."""
    return _NARROW_BITS if bits <= _NARROW_BITS else 32
