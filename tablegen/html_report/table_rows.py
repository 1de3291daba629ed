"""The tables that an axis could have, with error and cost of each: as data, for text, JSON and a chart."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import sqrt
from typing import Any, Literal

import numpy as np
from msgspec import structs

from tablegen.certificate.line_errors import EmittedPeriod
from tablegen.config.load import Setup
from tablegen.config.schema import Cost
from tablegen.emit.constants import storage_bits
from tablegen.fixedpoint.spline import WORDS_BEHIND
from tablegen.fixedpoint.synthesis import WORD_BITS
from tablegen.fixedpoint.table_shape import TableShape
from tablegen.planning.cost_choice import played_table, remedy_for_runs
from tablegen.planning.line_plan import LinePlan
from tablegen.planning.other_table import with_table
from tablegen.planning.played_table import PROCESSORS
from tablegen.planning.table_costs import cells, sample_costs
from tablegen.planning.table_front import table_front
from tablegen.waveform.sampler import Sampler

_CHUNK_TICKS = 1 << 16  # that are evaluated at a time


@dataclass(frozen=True)
class TableRow:
    """A table with its errors over all ticks, in LSB of the converter; of shaped output before the rounding.

    ``stored_bits`` is its memory in C: in words of 16 or 32 bits, with the first ones repeated behind the last.
    ``smallest`` marks the least memory within the requested error. ``instructions`` are those for a sample in C by
    processor, if no word of the other axis is wider; of a scan file with a processor those of this one beside the
    table of the other axis.
    """

    shape: TableShape
    max_error_lsb: float
    rms_error_lsb: float
    stored_bits: int
    smallest: bool
    planned: bool
    instructions: dict[str, float]

    @property
    def cells(self) -> int:
        """Cells of one axis in Verilog."""
        return cells()[self.shape.mode]


@dataclass(frozen=True)
class AxisTables:
    """The tables of one axis by memory, and one that a device renders from Fourier words.

    ``rendered`` is None where no table that a device renders keeps the error. ``shaped`` is true if the output is.
    ``remedy`` says what gives the axis runs, where it moves too far for them.
    """

    axis: Literal["x", "y"]
    harmonics: int
    ticks: int
    max_error_lsb: float
    rows: tuple[TableRow, ...]
    rendered: TableShape | None
    shaped: bool
    cost: Cost | None = None
    remedy: str = ""

    @property
    def chosen(self) -> TableRow:
        """The table with the least memory within the error."""
        return next(row for row in self.rows if row.smallest)

    @property
    def brief(self) -> str:
        """The table with the least memory within the error, in words."""
        shape = self.chosen.shape
        return (
            f"{shape.mode}, {shape.length} words of {shape.bits} bits, error up to {self.chosen.max_error_lsb:.3g} LSB"
        )

    @property
    def upload_bits(self) -> int:
        """The bits of the Fourier words."""
        return (2 * self.harmonics + 1) * WORD_BITS

    def record(self) -> dict[str, Any]:
        """Return the tables as plain data, for JSON."""
        fourier = None
        if self.rendered is not None:
            fourier = {"upload_bits": self.upload_bits, "rendered": _shape(self.rendered)}
        return {
            "axis": self.axis,
            "harmonics": self.harmonics,
            "ticks": self.ticks,
            "max_error_lsb": self.max_error_lsb,
            "shaped": self.shaped,
            **({} if self.cost is None else {"cost": structs.asdict(self.cost)}),
            "tables": [
                {
                    **_shape(row.shape),
                    "stored_bits": row.stored_bits,
                    "max_error_lsb": float(f"{row.max_error_lsb:.6g}"),
                    "rms_error_lsb": float(f"{row.rms_error_lsb:.6g}"),
                    "instructions": row.instructions,
                    "hx8k_cells": row.cells,
                    "chosen": row.smallest,
                    "planned": row.planned,
                }
                for row in self.rows
            ],
            "fourier_words": fourier,
        }


def _shape(shape: TableShape) -> dict[str, Any]:
    return {"mode": shape.mode, "length": shape.length, "bits": shape.bits, "memory_bits": shape.memory_bits}


def _behind(shape: TableShape) -> int:
    """Return the number of words behind the last one in C."""
    return WORDS_BEHIND if shape.mode == "cubic" else 1


def axis_tables(setup: Setup, line: LinePlan, other: LinePlan | None = None) -> AxisTables:
    """List the tables of a planned axis; beside the one of the ``other`` axis if the scan file names a processor.

    Raises
    ------
    Unphysical
        If none keeps the requested error.
    """
    cost = setup.scan.cost
    beside = None if other is None or cost is None else played_table(other.program, other.steepest)
    front = table_front(setup, line, beside)
    processors = PROCESSORS if cost is None else (cost.processor,)

    def instructions(its: LinePlan) -> dict[str, float]:
        played = [played_table(its.program, its.steepest), *([] if beside is None else [beside])]
        return {name: sample_costs(played, name)[0] for name in processors}

    def rows() -> Iterator[TableRow]:
        for shape in front.shapes:
            its = with_table(line, shape)
            yield TableRow(
                shape,
                *_errors(its),
                (shape.length + _behind(shape)) * storage_bits(shape.bits),
                shape == front.chosen,
                shape == front.planned,
                instructions(its),
            )

    return AxisTables(
        line.axis,
        line.series.harmonics,
        line.program.ticks,
        front.max_error_lsb,
        tuple(rows()),
        front.rendered,
        line.program.output.shaping.order > 0,
        cost,
        remedy_for_runs(setup, {line.axis: played_table(line.program, line.steepest)}),
    )


def _errors(line: LinePlan) -> tuple[float, float]:
    """Return the largest and the rms error; of shaped output before rounding, which is not the table's error."""
    program = line.program
    if not program.output.shaping.order:
        played = EmittedPeriod(line)
        return played.largest_error(), sqrt(played.error_moments()[1])
    sampler, largest, squares = Sampler(line.series, program.phase.ticks), 0.0, 0.0
    for first in range(0, program.ticks, _CHUNK_TICKS):
        k = np.arange(first, min(first + _CHUNK_TICKS, program.ticks), dtype=np.int64)
        error = program.output.unrounded(program.samples(k)) - line.float_codes(sampler.at(k // program.hold))
        largest, squares = max(largest, float(np.max(np.abs(error)))), squares + float(np.sum(error * error))
    return largest, sqrt(squares / program.ticks)
