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
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.program import Mode
from tablegen.fixedpoint.table_shape import TableShape

FILE = Path(__file__).with_name("table_costs.json")
PROCESSORS: tuple[ProcessorName, ...] = get_args(ProcessorName)
_NARROW_BITS = 16
_LEAST_SHAPED_WINDOW = 15  # codes: what is fed back may leave half of a smaller one
_LARGEST = (1 << 31) - 1  # of a gain with 32 fraction bits
_RUN = 16  # ticks with one check of clamp and slew guard in the C
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
    tick, in codes, without rounding: 0 where an advance takes several ticks, since it then moves in one of many.
    """

    shape: TableShape
    period: int
    hold: int
    output: Output
    steepest: float

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
        """Return True if no 16 ticks leave the window in which the C checks clamp and slew guard for all of them."""
        return _RUN * self.steepest <= self.window(processor, table_storage_bits, ceil(self.steepest) + 1) // 2

    def window(self, processor: ProcessorName, table_storage_bits: int, step: int) -> int:
        """Return the codes of this window, around the code before; ``step`` is the most that a tick moves, in codes.

        The rule is that of ``allow_runs`` in dac_program.c without a slow part, whose windows have room for a ramp too.
        """
        output, widest = self.output, self.output.code_max - self.output.code_min
        order, zero = output.shaping.order, output.shaping.zero
        aside = order if order < 2 else 2 + -(-zero // 64)
        window = _power_within(min(widest // _NARROW, output.max_step))
        if step > output.max_step - 2 * aside:
            return window
        block = _RUN * step + 2 * aside
        most = _power_within(widest // (_WIDE if _multiplies_long(processor, table_storage_bits) else _NARROW))
        return max(window, min(1 << (2 * block - 1).bit_length(), most))


class SampleCount(NamedTuple):
    """Instructions for an axis sample.

    In runs; tick by tick, where a program has no runs; and where it has, but moves so fast that each is refused.
    """

    in_runs: float
    by_tick: float
    refused: float


IN_RUNS, _BY_TICK, _REFUSED = range(len(SampleCount._fields))


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


def sample_costs(tables: Sequence[PlayedTable], processor: ProcessorName) -> list[float]:
    """Return the instructions for a sample of each of the tables that are played together."""
    runs, column = played_together(tables, processor)
    return [counts()[run][_loop(table.shape.mode)][processor][column] for table, run in zip(tables, runs, strict=True)]


def played_together(tables: Sequence[PlayedTable], processor: ProcessorName) -> tuple[list[MeasuredRun], int]:
    """Return what is measured of each table beside the others, and the index of the number of a ``SampleCount``.

    Words of all tables have the width of the widest, likewise those of the converters, and a run is one of all axes.
    """
    runs = [table.run for table in tables]
    table_bits = max(run.table_storage_bits for run in runs)
    output_bits = max(run.output_storage_bits for run in runs)
    widened = [run._replace(table_storage_bits=table_bits, output_storage_bits=output_bits) for run in runs]
    if not all(table.has_runs(processor, table_bits) for table in tables):
        return widened, _BY_TICK
    kept = all(table.keeps_window(processor, table_bits) for table in tables)
    return widened, IN_RUNS if kept else _REFUSED


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
