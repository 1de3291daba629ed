"""From the waveform of an axis to the integers that play it: the table, gain, offset and limits."""

from typing import TYPE_CHECKING

from msgspec import Struct

from tablegen.base.input_errors import Problems
from tablegen.config.load import Setup
from tablegen.config.schema import FastAxis
from tablegen.fixedpoint.converter import Converter, make_output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.synthesis import FourierWords
from tablegen.fixedpoint.table_shape import TableShape
from tablegen.planning.drive import Drive
from tablegen.planning.feasibility import Feasibility
from tablegen.planning.shaping_choice import chosen_shaping
from tablegen.planning.table_choice import TableRequest, choose, possible_shapes, table_request, written_shape
from tablegen.planning.table_maker import TableMaker
from tablegen.planning.timing import AxisTiming
from tablegen.waveform.series import FourierSeries

if TYPE_CHECKING:
    from tablegen.planning.played_table import PlayedTable


class AxisTable(Struct, frozen=True, eq=False):
    """The integers of one axis, and the request for its table where the build chose it."""

    converter: Converter
    scale: float
    fourier: FourierWords
    program: Program
    request: TableRequest | None


def make_table(
    setup: Setup,
    axis: str,
    timing: AxisTiming,
    drive: Drive,
    series: FourierSeries,
    feasible: Feasibility,
    problems: Problems,
    beside: "PlayedTable | None" = None,
) -> AxisTable | None:
    """Quantise a waveform; None where ``problems`` grew: converter, amplifier, driver or table cannot hold it.

    ``beside`` is the table of the other axis, where a limit of instructions has to count with it.
    """
    before = len(problems.entries)
    scan: FastAxis = getattr(setup.scan, axis)
    hardware = setup.hardware(axis)
    converter = Converter.of(hardware.dac, hardware.amplifier)
    shaping = chosen_shaping(setup, axis, drive, problems)
    park_v = drive.v_offset if scan.park_v is None else scan.park_v
    maker = TableMaker(
        series=series,
        amplitude=0.5 * drive.v_amplitude / converter.v_per_code,
        offset=converter.code(drive.v_offset),
        phase=RationalPhase(timing.period),
        hold=timing.hold,
        output=make_output(hardware.dac, converter, drive.driver, park_v, shaping),
    )
    feasible.check_words(maker.original)
    feasible.check_range(drive, converter, *maker.original.reach, shaping)
    request = table_request(scan.table, setup.scan.limits, shaping.order > 0, setup.scan.cost)
    shape = written_shape(scan.table, timing.period)
    if request is not None and len(problems.entries) == before:
        shape = _chosen(setup, axis, timing, request, shape, maker, drive, converter, feasible, problems, beside)
    stored = maker.stored(shape)
    if shape.mode == "cubic" and len(problems.entries) == before:
        feasible.check_words(stored)
        feasible.check_gain(maker.gain(shape)[0])
    max_step = feasible.max_step(drive, converter, stored, float(timing.rate), timing.period, shape, shaping)
    if len(problems.entries) > before:
        return None
    table = maker.limited(max_step).quantise(shape)
    return AxisTable(converter, table.scale, table.fourier, table.program, request)


def _chosen(
    setup: Setup,
    axis: str,
    timing: AxisTiming,
    request: TableRequest,
    shape: TableShape,
    maker: TableMaker,
    drive: Drive,
    converter: Converter,
    feasible: Feasibility,
    problems: Problems,
    beside: "PlayedTable | None",
) -> TableShape:
    """Return the table of least memory that keeps the requested error; ``shape`` where none does."""
    from tablegen.planning.table_search import TableSearch  # here: most tables are written

    table = getattr(setup.scan, axis).table
    key = f"{axis}.table.{'mode' if table.max_error_lsb is None else 'max_error_lsb'}"
    with problems.at(setup.scan_file, key):
        candidates = possible_shapes(table, timing.period, maker.series.harmonics)
        shapes = feasible.fitting(candidates, drive, converter, maker)
        if request.cost is None:
            return choose(TableSearch(maker), shapes, request.max_error_lsb)
        from tablegen.planning.cost_choice import (  # here: most scans have no limit
            choose_within,
            costs_of,
            made_table,
            remedy_for_runs,
        )

        guard = feasible.expected_guard(drive, converter, maker.series, timing.period)
        guarded = maker.limited(guard)
        costs = costs_of(shapes, guarded, request.cost, beside)
        remedy = remedy_for_runs(setup, {axis: made_table(guarded, shape)})
        return choose_within(TableSearch(maker), costs, request.max_error_lsb, request.cost, remedy)
    return shape
