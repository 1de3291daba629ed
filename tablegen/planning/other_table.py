"""A planned axis with another table: the same waveform and limits, other integers."""

from msgspec.structs import replace

from tablegen.fixedpoint.table_shape import TableShape
from tablegen.planning.line_plan import LinePlan
from tablegen.planning.table_maker import TableMaker


def maker_of(line: LinePlan) -> TableMaker:
    """Return the maker of the tables of a planned axis."""
    return TableMaker(
        series=line.series,
        amplitude=0.5 * line.codes_per_unit,
        offset=line.converter.code(line.drive.v_offset),
        phase=line.program.phase,
        hold=line.program.hold,
        output=line.program.output,
    )


def with_table(line: LinePlan, shape: TableShape) -> LinePlan:
    """Return the axis with a table of another shape; its limits, the slew guard too, stay as they are."""
    table = maker_of(line).quantise(shape)
    return replace(line, program=table.program, fourier=table.fourier, scale=table.scale)


def shape_of(line: LinePlan) -> TableShape:
    """Return the shape of the table of an axis."""
    return TableShape(line.program.mode, len(line.program.words), line.program.bits)
