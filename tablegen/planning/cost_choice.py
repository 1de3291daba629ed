"""The choice of a table within the instructions of a processor, and what both axes of a plan take."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from tablegen.base.input_errors import Unphysical
from tablegen.config.load import Setup
from tablegen.config.schema import Cost
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.table_shape import TableShape
from tablegen.planning.played_table import PROCESSORS, PlayedTable
from tablegen.planning.table_choice import choose
from tablegen.planning.table_costs import sample_costs

if TYPE_CHECKING:
    from tablegen.planning.table_maker import TableMaker
    from tablegen.planning.table_search import TableSearch


def played_table(program: Program, steepest: float) -> PlayedTable:
    """Return what decides the cost of a planned axis; ``steepest`` is its largest step of a tick, in codes."""
    shape = TableShape(program.mode, len(program.words), program.bits)
    return PlayedTable(shape, program.phase.ticks, program.hold, program.output, steepest)


def remedy_for_runs(setup: Setup, played: Mapping[str, PlayedTable]) -> str:
    """Say which axis moves too far for runs, where, and what gives it some; empty where none does.

    Without ``[cost]`` that is said of all processors.
    """
    cost = setup.scan.cost
    names = PROCESSORS if cost is None else (cost.processor,)
    for axis, table in played.items():
        without = [name for name in names if not table.keeps_window(name, table.run.table_storage_bits)]
        if not without:
            continue
        where = "" if len(without) == len(names) else f" on {' and '.join(without)}"
        ticks = table.block(without[0], table.run.table_storage_bits, table.step)
        moved = f"{ticks * table.steepest:.0f}"
        return (
            f"{axis} has no runs{where}: it moves {moved} codes in {ticks} ticks; a lower line rate or a smaller size "
            f"gives it some"
        )
    return ""


def costs_of(
    shapes: list[TableShape], maker: "TableMaker", cost: Cost, beside: PlayedTable | None
) -> dict[TableShape, float]:
    """Return the instructions for a sample of an axis with each table, in order of the shapes.

    ``maker`` has the slew guard of the axis. ``beside`` is the table of the other axis: where its words are wide, or
    where it has no runs, those of this axis take more. With None it takes nothing.
    """
    others = [] if beside is None else [beside]
    return {shape: sample_costs([made_table(maker, shape), *others], cost.processor)[0] for shape in shapes}


def made_table(maker: "TableMaker", shape: TableShape) -> PlayedTable:
    """Return what decides the cost of an axis with a table of a shape."""
    return PlayedTable(shape, maker.phase.ticks, maker.hold, maker.scaled(shape), maker.steepest)


def choose_within(
    search: "TableSearch", costs: Mapping[TableShape, float], max_error_lsb: float, cost: Cost, remedy: str
) -> TableShape:
    """Return the table of least memory that keeps an error and takes no more than ``cost.max_instructions``.

    ``remedy`` is said where none does: what gives the axis runs, or nothing.

    Raises
    ------
    Unphysical
        If none does; the message has the cheapest table that keeps the error, or the least error of any table.
    """
    most = cost.max_instructions
    if most is None:
        return choose(search, [*costs], max_error_lsb)
    smallest = search.smallest([shape for shape, takes in costs.items() if takes <= most], max_error_lsb)
    if smallest is not None:
        return smallest
    for takes in sorted({takes for takes in costs.values() if takes > most}):
        cheapest = search.smallest([shape for shape, its in costs.items() if its == takes], max_error_lsb)
        if cheapest is not None:
            raise Unphysical(
                f"no table keeps {max_error_lsb:g} LSB within the {most:g} instructions for a sample on "
                f"{cost.processor} of cost.max_instructions; the cheapest, {cheapest}, takes {takes:g}; allow that "
                f"many, or a larger error{remedy and f'; {remedy}'}"
            )
    return choose(search, [*costs], max_error_lsb)
