"""The tables that an axis of a scan at an angle could have: as data, for the terminal, and as a chart."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from tablegen.base.figures import at_least
from tablegen.charts.chart import Chart, DrawnCurve, Mark
from tablegen.config.load import Setup
from tablegen.config.schema import Table
from tablegen.emit.constants import storage_bits
from tablegen.fixedpoint.frame_program import RATIO_BITS, SECOND_BITS, FrameProgram
from tablegen.fixedpoint.frame_words import FrameShape
from tablegen.fixedpoint.spline import WORDS_BEHIND
from tablegen.planning.cost_choice import played_table
from tablegen.planning.frame_tables import RatedFrameTables
from tablegen.planning.table_choice import allowed_lsb
from tablegen.planning.table_costs import PROCESSORS, sample_costs
from tablegen.planning.turned_plan import TurnedAxis, TurnedPlan, frame_table_search

_GAIN_STORAGE_BITS = 32  # of a knot of the gain in C
_HIGHEST = 4.0  # times the allowed error, in the chart
_HEAD = (
    "     fast, second      slow  bits     packed       in C   error [LSB]    instructions from",
    "          [words]   [words]           [bits]     [bits]     max    rms      M4    M0+   RV32",
)


@dataclass(frozen=True)
class TurnedTableRow:
    """Tables of an axis with their errors over a frame, in LSB of the converter, rounded codes as in the certificate.

    ``memory_bits`` are all words of the fast, the second and the slow table, gains and ratios, packed; ``stored_bits``
    those in C, with the memory for the table of a line. ``instructions`` are those of the fast table alone by
    processor: a sample with a slow part takes more. ``smallest`` marks the least memory within the allowed error,
    ``planned`` what the build takes.
    """

    shape: FrameShape
    memory_bits: int
    stored_bits: int
    max_error_lsb: float
    rms_error_lsb: float
    instructions: dict[str, float]
    smallest: bool
    planned: bool

    def record(self) -> dict[str, Any]:
        """Return the row as plain data, for JSON."""
        shape = self.shape
        return {
            "mode": "cubic",
            "length": shape.length,
            "slow_length": shape.slow_length,
            "bits": shape.bits,
            "second_bits": SECOND_BITS,
            "memory_bits": self.memory_bits,
            "stored_bits": self.stored_bits,
            "max_error_lsb": float(f"{self.max_error_lsb:.6g}"),
            "rms_error_lsb": float(f"{self.rms_error_lsb:.6g}"),
            "fast_instructions": self.instructions,
            "chosen": self.smallest,
            "planned": self.planned,
        }


@dataclass(frozen=True)
class TurnedTables:
    """The tables of one axis of a scan at an angle by memory; ``knots`` are those of gain and ratio.

    ``shaped`` is true if the output is; the build then keeps the tables that it has by default.
    """

    axis: Literal["x", "y"]
    harmonics: int
    slow_harmonics: int
    ticks: int
    knots: int
    max_error_lsb: float
    rows: tuple[TurnedTableRow, ...]
    shaped: bool

    @property
    def chosen(self) -> TurnedTableRow:
        """The tables with the least memory within the error; where none keeps it, those that the build takes."""
        return next((row for row in self.rows if row.smallest), self.planned)

    @property
    def planned(self) -> TurnedTableRow:
        """The tables that the build takes."""
        return next(row for row in self.rows if row.planned)

    @property
    def brief(self) -> str:
        """The tables of least memory within the error, in words."""
        row = self.chosen
        return f"{row.shape}, error up to {row.max_error_lsb:.3g} LSB"

    def record(self) -> dict[str, Any]:
        """Return the tables as plain data, for JSON."""
        return {
            "axis": self.axis,
            "harmonics": self.harmonics,
            "slow_harmonics": self.slow_harmonics,
            "ticks": self.ticks,
            "knots": self.knots,
            "max_error_lsb": self.max_error_lsb,
            "shaped": self.shaped,
            "tables": [row.record() for row in self.rows],
        }

    def text(self) -> Iterator[str]:
        """Yield a title, a line per row, and the keys for the scan file."""
        yield (
            f"{self.axis}: {self.harmonics} harmonics over the line and {self.slow_harmonics} over the frame, "
            f"{self.ticks} ticks, {self.knots} knots"
        )
        yield from _HEAD
        yield from map(_row, self.rows)
        yield (
            f"     (all tables are cubic; a word of the second one has {SECOND_BITS} bits. Instructions are those of "
            "the fast table"
        )
        yield "     alone: ramp and mixing of a slow part are not measured by table, nor are its cells)"
        yield ""
        within = f"{self.max_error_lsb:g} LSB"
        any_within = any(row.smallest for row in self.rows)
        error = f"{self.max_error_lsb:g}" if any_within else at_least(min(row.max_error_lsb for row in self.rows))
        yield (
            f"* the least memory within {within}" if any_within else f"No tables keep {within}; {error} LSB can be kept"
        ) + ("; with shaped output the build keeps its own" if self.shaped else ". In the scan file:")
        if not self.shaped:
            yield f"  [{self.axis}.table]"
            yield '  mode = "auto"'
            yield f"  max_error_lsb = {error}"
        if not self.planned.smallest:
            yield "= the tables of the build"

    def chart(self) -> Chart:
        """Draw memory against error: a curve for each length of the slow table, and the chosen tables."""
        most, curves = _HIGHEST * self.max_error_lsb, []
        lengths = sorted({row.shape.slow_length for row in self.rows})
        for length in lengths:
            rows = [row for row in self.rows if row.shape.slow_length == length and row.max_error_lsb <= most]
            if rows:
                memory = np.array([float(row.memory_bits) for row in rows])
                errors = np.array([row.max_error_lsb for row in rows])
                curves.append(DrawnCurve(f"{length} words over the frame", "other", memory, errors))
        row = self.chosen
        at = np.array([float(row.memory_bits)]), np.array([row.max_error_lsb])
        curves.append(DrawnCurve(f"chosen: {row.shape}", "before", *at, kind="points"))
        return Chart(
            f"tables-{self.axis}",
            f"{self.axis}: the largest error of a code against memory",
            "memory [bits]",
            "error [LSB]",
            tuple(curves),
            marks=(Mark(self.max_error_lsb, "asked", "y"),),
            log_x=True,
            y_range=(0.0, most),
        )


def turned_tables(setup: Setup, plan: TurnedPlan, axis: TurnedAxis) -> TurnedTables:
    """List the tables of a planned axis of a scan at an angle, by memory."""
    table = setup.scan.x.table if axis.axis == "x" else setup.scan.y.table
    search, most = frame_table_search(setup, plan, axis), allowed_lsb(table, setup.scan.limits, shaped=False)
    shapes = search.shapes(Table())
    planned = FrameShape(len(axis.program.fast.words), axis.program.fast.bits, len(axis.program.slow.words))
    smallest = search.smallest(shapes, most)
    rated = {one.shape: one for one in search.front(shapes, most)}
    for one in (smallest, search.rated(planned)):
        if one is not None:
            rated[one.shape] = one
    rows = [
        _table_row(one, program, one == smallest, one.shape == planned)
        for one in sorted(rated.values(), key=lambda one: (one.memory_bits, one.max_error_lsb))
        if (program := search.program(one.shape)) is not None
    ]
    drive, ticks = axis.drive, plan.schedule.ticks
    return TurnedTables(
        axis=axis.axis,
        harmonics=drive.fast.harmonics,
        slow_harmonics=drive.slow.harmonics,
        ticks=ticks,
        knots=len(drive.gains),
        max_error_lsb=most,
        rows=tuple(rows),
        shaped=axis.program.output.shaping.order > 0,
    )


def _table_row(rated: RatedFrameTables, program: FrameProgram, smallest: bool, planned: bool) -> TurnedTableRow:
    fast = played_table(program.fast)
    return TurnedTableRow(
        rated.shape,
        rated.memory_bits,
        _stored_bits(rated.shape, len(program.gains.words)),
        rated.max_error_lsb,
        rated.rms_error_lsb,
        {name: sample_costs([fast], name)[0] for name in PROCESSORS},
        smallest,
        planned,
    )


def _stored_bits(shape: FrameShape, knots: int) -> int:
    """Return the memory of an axis in C: arrays, and the table that is mixed for a line."""
    words = 2 * (shape.length + WORDS_BEHIND) + shape.slow_length + WORDS_BEHIND
    return words * storage_bits(shape.bits) + shape.length * SECOND_BITS + knots * (_GAIN_STORAGE_BITS + RATIO_BITS)


def _row(row: TurnedTableRow) -> str:
    shape, takes = row.shape, row.instructions
    mark = "*" if row.smallest else "=" if row.planned else " "
    counts = f"{takes['cortex-m4']:>8.1f}{takes['cortex-m0plus']:>7.1f}{takes['riscv32']:>7.1f}"
    return (
        f"  {mark}  {shape.length:>12}{shape.slow_length:>10}{shape.bits:>6}{row.memory_bits:>11}{row.stored_bits:>11}"
        f"{row.max_error_lsb:>8.3f}{row.rms_error_lsb:>7.3f}{counts}"
    )
