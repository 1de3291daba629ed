"""The cost of an axis sample on a device, by processor, mode, width, coding and shaping: measured, and read here.

``python benchmarks/tables.py --costs`` measures it and writes ``table_costs.json``.
"""

import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from tablegen.config.schema import ProcessorName
from tablegen.fixedpoint.program import Mode
from tablegen.planning.played_table import LEAST_BLOCK, PROCESSORS, RUN, MeasuredRun, PlayedTable

FILE = Path(__file__).with_name("table_costs.json")


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
        part = (RUN / ticks - 1.0) / (RUN / LEAST_BLOCK - 1.0)
        return self.in_runs + part * (self.in_blocks - self.in_runs)


_IN_RUNS, _BY_TICK, _REFUSED = range(3)


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
        inside = all(table.keeps_window(processor, table_bits) for table in tables)
        column = _IN_RUNS if inside else _REFUSED
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
