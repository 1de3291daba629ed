"""The tables that an axis could have, and the Pareto front of memory and error among them."""

from dataclasses import dataclass

from tablegen.base.input_errors import Problems
from tablegen.config.load import Setup
from tablegen.config.schema import FastAxis, Table
from tablegen.fixedpoint.table_shape import TableShape
from tablegen.planning.cost_choice import choose_within, costs_of, made_table, remedy_for_runs
from tablegen.planning.feasibility import Feasibility
from tablegen.planning.line_plan import LinePlan
from tablegen.planning.other_table import maker_of, shape_of
from tablegen.planning.played_table import PlayedTable
from tablegen.planning.table_choice import allowed_lsb, choose, possible_shapes
from tablegen.planning.table_search import TableSearch

_TIMES = 8.0  # tables with more than this multiple of the allowed error are not listed


@dataclass(frozen=True)
class TableFront:
    """Tables of an axis by their memory.

    ``chosen`` is the least memory within ``max_error_lsb``, and within the instructions that the scan file allows;
    ``planned`` is the table that the axis has. Both are among ``shapes``. Of the others none is larger than one that is
    as simple to play and errs less than 5 % more. ``rendered`` is the least memory of those that a device renders from
    Fourier words.
    """

    max_error_lsb: float
    shapes: tuple[TableShape, ...]
    chosen: TableShape
    rendered: TableShape | None
    planned: TableShape


def table_front(setup: Setup, line: LinePlan, beside: PlayedTable | None = None) -> TableFront:
    """Return the tables of a planned axis; ``beside`` is that of the other axis, for a limit of instructions.

    Raises
    ------
    Unphysical
        If no table keeps the error that its scan file requests.
    """
    scan: FastAxis = getattr(setup.scan, line.axis)
    maker, feasible = maker_of(line), Feasibility(setup, line.axis, Problems())
    candidates = possible_shapes(Table(), line.program.phase.ticks, line.series.harmonics)
    shapes = feasible.fitting(candidates, line.drive, line.converter, maker)
    search, most = TableSearch(maker), allowed_lsb(scan.table, setup.scan.limits, line.program.output.shaping.order > 0)
    listed = {one.shape for one in search.front(shapes, _TIMES * most)}
    cost = setup.scan.cost
    if cost is None or cost.max_instructions is None:
        chosen = choose(search, shapes, most)
    else:
        costs = costs_of(shapes, maker, cost, beside)
        remedy = remedy_for_runs(setup, {line.axis: made_table(maker, shape_of(line))})
        chosen = choose_within(search, costs, most, cost, remedy)
        shapes = [shape for shape, takes in costs.items() if takes <= cost.max_instructions]
    rendered = search.smallest((shape for shape in shapes if shape.mode != "direct"), most)
    listed |= {chosen, shape_of(line)}
    return TableFront(most, tuple(sorted(listed, key=lambda one: one.order)), chosen, rendered, shape_of(line))
