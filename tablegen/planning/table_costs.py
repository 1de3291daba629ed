"""The cost of an axis sample on a device, by processor, mode, width, coding and shaping: measured, and read here.

``python benchmarks/tables.py --costs`` measures it and writes ``table_costs.json``.
"""

import json
from collections.abc import Sequence
from functools import cache
from math import ceil
from pathlib import Path
from typing import Any, NamedTuple, get_args

from tablegen.config.schema import ProcessorName
from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.program import Mode
from tablegen.fixedpoint.table_shape import TableShape

FILE = Path(__file__).with_name("table_costs.json")
PROCESSORS: tuple[ProcessorName, ...] = get_args(ProcessorName)
_NARROW_BITS = 16
_LEAST_SHAPED_WINDOW = 15  # codes: what is fed back may leave half of a smaller one
_LARGEST = (1 << 31) - 1  # of a gain with 32 fraction bits
_RUN = 16  # ticks with one check of clamp and slew guard in the C
LEAST_BLOCK = 4  # the same of lines that move too far in 16, with products of 32 bits
_RAMP = 4  # codes of a tick for which a window has room
_NARROW = 32  # windows of this check in the range of a converter, at least
_WIDE = 4  # the same with long products, where the slew guard cannot act


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

        The rules are those of ``allow_runs`` in dac_program.c, which tests compare on random programs. Codes near a
        limit have no runs either, with any table.
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
            return _RUN
        ticks, moved = _RUN, _RUN * step + 2 * self._aside
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
        up = (25 - bits - guard_bits(bits) if wide else 16 - bits) if wide or self.output.shaping.order else 0
        fine = 5 if wide else 0
        spread = min(30 + fine - (gain << up).bit_length(), 19 + fine)
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
        """Return the codes of this window, around the code before; ``step`` is the most that a tick moves, in codes.

        The rule is that of ``allow_runs`` in dac_program.c.
        """
        output, widest = self.output, self.output.code_max - self.output.code_min
        window = _power_within(min(widest // _NARROW, output.max_step))
        if step > self._allowed:
            return window
        block = _RUN * (step + _RAMP * self.ramps) + 2 * self._aside
        most = _power_within(widest // (_WIDE if _multiplies_long(processor, table_storage_bits) else _NARROW))
        return max(window, min(1 << (2 * block - 1).bit_length(), most))


class SampleCount(NamedTuple):
    """Instructions for an axis sample.

    In runs; tick by tick, where a program has no runs; where it has, but moves so fast that each is refused; and in
    runs whose blocks have the least ticks.
    """

    in_runs: float
    by_tick: float
    refused: float
    in_blocks: float

    def of_block(self, ticks: int) -> float:
        """Return the instructions in runs whose blocks have so many ticks, 4 to 16: what a block takes is shared."""
        part = (_RUN / ticks - 1.0) / (_RUN / LEAST_BLOCK - 1.0)
        return self.in_runs + part * (self.in_blocks - self.in_runs)


_IN_RUNS, _BY_TICK, _REFUSED = range(3)


def _multiplies_long(processor: ProcessorName, table_storage_bits: int) -> bool:
    """Return the default of DAC_LONG_MULTIPLY in dac_config.h."""
    return processor == "cortex-m4" or (processor == "riscv32" and table_storage_bits > _NARROW_BITS)


def _power_within(step: int) -> int:
    """Return the largest power of two of codes in which no two differ by more than a step."""
    return 1 << (step + 1).bit_length() - 1


def _storage(bits: int) -> int:
    """Return the bits in which the C holds a word of so many bits."""
    return _NARROW_BITS if bits <= _NARROW_BITS else 32


def _loop(mode: Mode) -> Mode:
    """Return the mode whose instructions are measured: the loop of lines plays direct tables too."""
    return "cubic" if mode == "cubic" else "interpolated"


class PlayedTogether(NamedTuple):
    """How a table is played beside others: what is measured of it, in runs or not, and the ticks of a block."""

    run: MeasuredRun
    column: int
    block: int

    @property
    def in_runs(self) -> bool:
        """True if it is played in runs."""
        return self.column == _IN_RUNS

    def instructions(self, count: SampleCount) -> float:
        """Return the instructions for a sample."""
        return count.of_block(self.block) if self.in_runs else count[self.column]


def sample_costs(tables: Sequence[PlayedTable], processor: ProcessorName) -> list[float]:
    """Return the instructions for a sample of each of the tables that are played together."""
    return [
        round(played.instructions(counts()[played.run][_loop(table.shape.mode)][processor]), 1)
        for table, played in zip(tables, played_together(tables, processor), strict=True)
    ]


def played_together(tables: Sequence[PlayedTable], processor: ProcessorName) -> list[PlayedTogether]:
    """Return how each table is played beside the others.

    Words of all tables have the width of the widest, likewise those of the converters, and a run is one of all axes.
    """
    runs = [table.run for table in tables]
    table_bits = max(run.table_storage_bits for run in runs)
    output_bits = max(run.output_storage_bits for run in runs)
    if not all(table.has_runs(processor, table_bits) for table in tables):
        column = _BY_TICK
    else:
        narrow = all(table.keeps_window(processor, table_bits) for table in tables)
        column = _IN_RUNS if narrow else _REFUSED
    return [
        PlayedTogether(
            run._replace(table_storage_bits=table_bits, output_storage_bits=output_bits),
            column,
            table.block(processor, table_bits, table.step),
        )
        for table, run in zip(tables, runs, strict=True)
    ]


Counts = dict[MeasuredRun, dict[Mode, dict[ProcessorName, SampleCount]]]


@cache
def counts() -> Counts:
    """Return the instructions for a sample of one axis of the example, gcc -O2."""
    by_run: Counts = {}
    for row in measured()["instructions"]:
        run = MeasuredRun(*(row[name] for name in MeasuredRun._fields))
        by_run.setdefault(run, {})[row["mode"]] = {name: SampleCount(*row[name]) for name in PROCESSORS}
    return by_run


def cells() -> dict[Mode, int]:
    """Return the cells of one axis in Verilog on an iCE40 HX8K, a sample a clock, of a cubic table one in 11."""
    by_mode: dict[Mode, int] = measured()["cells"]
    return by_mode


@cache
def measured() -> dict[str, Any]:
    """Return the content of the file: compilers, a digest of the C, cells and instructions."""
    content: dict[str, Any] = json.loads(FILE.read_text("utf-8"))
    return content
