"""The tables that an axis of a scan at an angle could have: as data, for the terminal, and as a chart."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from msgspec import structs

from tablegen.base.figures import at_least
from tablegen.charts.chart import Chart, DrawnCurve, Mark
from tablegen.config.load import Setup
from tablegen.config.schema import Cost, Table
from tablegen.emit.constants import storage_bits
from tablegen.fixedpoint.frame_program import RATIO_BITS, SECOND_BITS
from tablegen.fixedpoint.frame_words import FrameShape
from tablegen.fixedpoint.spline import WORDS_BEHIND
from tablegen.planning.frame_tables import CostLimit
from tablegen.planning.played_table import PROCESSORS
from tablegen.planning.table_choice import allowed_lsb
from tablegen.planning.turned_plan import TurnedAxis, TurnedPlan, frame_table_search, played_frame, shape_costs

_GAIN_STORAGE_BITS = 32  # of a knot of the gain in C
_HIGHEST = 4.0  # times the allowed error, in the chart
_TABLES = "     fast, second      slow  bits     packed       in C   error [LSB] "
_UNITS = "          [words]   [words]           [bits]     [bits]     max    rms"
_HEAD = (f"{_TABLES}        instructions", f"{_UNITS}      M4    M0+   RV32")
_HEAD_OF_ONE = (f"{_TABLES} instructions", f"{_UNITS}{{:>15}}")


@dataclass(frozen=True)
class TurnedTableRow:
    """Tables of an axis with their errors over a frame, in LSB of the converter, rounded codes as in the certificate.

    ``memory_bits`` are all words of the fast, the second and the slow table, gains and ratios, packed; ``stored_bits``
    those in C, with the memory for the table of a line. ``instructions`` are those for a sample in C by processor, with
    its share of what a line takes; of a scan file with a processor those of this one beside the other axis.
    ``smallest`` marks the least memory within the allowed error, ``planned`` what the build takes.
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
            "instructions": self.instructions,
            "chosen": self.smallest,
            "planned": self.planned,
        }


@dataclass(frozen=True)
class TurnedTables:
    """The tables of one axis of a scan at an angle by memory; ``knots`` are those of gain and ratio.

    ``shaped`` is true if the output is; the build then keeps the tables that it has by default. ``cost`` is that of the
    scan file,
    if it has one.
    """

    axis: Literal["x", "y"]
    harmonics: int
    slow_harmonics: int
    ticks: int
    knots: int
    max_error_lsb: float
    rows: tuple[TurnedTableRow, ...]
    shaped: bool
    cost: Cost | None = None

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
            **({} if self.cost is None else {"cost": structs.asdict(self.cost)}),
            "tables": [row.record() for row in self.rows],
        }

    def text(self) -> Iterator[str]:
        """Yield a title, a line per row, and the keys for the scan file."""
        yield (
            f"{self.axis}: {self.harmonics} harmonics over the line and {self.slow_harmonics} over the frame, "
            f"{self.ticks} ticks, {self.knots} knots"
        )
        cost = self.cost
        yield from _HEAD if cost is None else (line.format(cost.processor) for line in _HEAD_OF_ONE)
        yield from map(_row, self.rows)
        yield f"     (all tables are cubic; words of the second one have {SECOND_BITS} bits; cells were not measured)"
        yield ""
        yield from self._choice()
        if not self.planned.smallest:
            yield "= the tables of the build"

    def _choice(self) -> Iterator[str]:
        """Yield what the least memory is, and the keys for it."""
        limit = None if self.cost is None else self.cost.max_instructions
        within, affordable = f"{self.max_error_lsb:g} LSB", list(self.rows)
        if self.cost is not None and limit is not None:
            within += f" and {limit:g} instructions on {self.cost.processor}"
            affordable = [row for row in self.rows if row.instructions[self.cost.processor] <= limit]
        any_within, error = any(row.smallest for row in self.rows), f"{self.max_error_lsb:g}"
        if any_within:
            text = f"* the least memory within {within}"
        elif affordable:
            error = at_least(min(row.max_error_lsb for row in affordable))
            text = f"No tables keep {within}; {error} LSB can be kept"
        else:
            cheapest = min(takes for row in self.rows for takes in row.instructions.values())
            yield f"No tables keep {within}; those that take least here take {cheapest:g}"
            return
        yield text + ("; with shaped output the build keeps its own" if self.shaped else ". In the scan file:")
        if not self.shaped:
            yield f"  [{self.axis}.table]"
            yield '  mode = "auto"'
            yield f"  max_error_lsb = {error}"

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
    """List the tables of a planned axis of a scan at an angle, by memory; with a cost beside the other axis."""
    table, cost = setup.scan.x.table if axis.axis == "x" else setup.scan.y.table, setup.scan.cost
    line, other = (plan.straight.x, plan.y) if axis.axis == "x" else (plan.straight.y, plan.x)
    search, most = frame_table_search(setup, plan, axis), allowed_lsb(table, setup.scan.limits, shaped=False)
    shapes = search.shapes(Table())
    planned = FrameShape(len(axis.program.fast.words), axis.program.fast.bits, len(axis.program.slow.words))
    beside = None if cost is None else played_frame(setup, plan.straight, other)
    costs = {
        name: shape_costs(setup, line, search, [*shapes, planned], name, beside)
        for name in (PROCESSORS if cost is None else (cost.processor,))
    }
    allowed = shapes
    if cost is not None and cost.max_instructions is not None:
        allowed = CostLimit(cost.processor, cost.max_instructions, costs[cost.processor]).within(shapes)
    smallest = search.smallest(allowed, most)
    rated = {one.shape: one for one in search.front(shapes, most)}
    for one in (smallest, search.rated(planned)):
        if one is not None:
            rated[one.shape] = one
    rows = [
        TurnedTableRow(
            one.shape,
            one.memory_bits,
            _stored_bits(one.shape, len(axis.program.gains.words)),
            one.max_error_lsb,
            one.rms_error_lsb,
            {name: takes[one.shape] for name, takes in costs.items()},
            one == smallest,
            one.shape == planned,
        )
        for one in sorted(rated.values(), key=lambda one: (one.memory_bits, one.max_error_lsb))
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
        cost=cost,
    )


def _stored_bits(shape: FrameShape, knots: int) -> int:
    """Return the memory of an axis in C: arrays, and the table that is mixed for a line."""
    words = 2 * (shape.length + WORDS_BEHIND) + shape.slow_length + WORDS_BEHIND
    return words * storage_bits(shape.bits) + shape.length * SECOND_BITS + knots * (_GAIN_STORAGE_BITS + RATIO_BITS)


def _row(row: TurnedTableRow) -> str:
    shape, takes = row.shape, row.instructions
    mark = "*" if row.smallest else "=" if row.planned else " "
    counts = (
        f"{takes['cortex-m4']:>8.1f}{takes['cortex-m0plus']:>7.1f}{takes['riscv32']:>7.1f}"
        if len(takes) > 1
        else "".join(f"{count:>15.1f}" for count in takes.values())
    )
    return (
        f"  {mark}  {shape.length:>12}{shape.slow_length:>10}{shape.bits:>6}{row.memory_bits:>11}{row.stored_bits:>11}"
        f"{row.max_error_lsb:>8.3f}{row.rms_error_lsb:>7.3f}{counts}"
    )
