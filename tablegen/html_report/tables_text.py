"""The tables that an axis could have, for the terminal."""

from collections.abc import Iterator

from tablegen.html_report.table_rows import AxisTables, TableRow

_TABLE = "     mode           words  bits     packed       in C   error [LSB] "
_UNITS = "                                    [bits]     [bits]     max    rms"
_HEAD = (f"{_TABLE}        instructions       cells", f"{_UNITS}      M4    M0+   RV32    HX8K")
_HEAD_OF_ONE = (f"{_TABLE} instructions   cells", f"{_UNITS}{{:>15}}    HX8K")


def tables_text(tables: AxisTables) -> Iterator[str]:
    """Yield a title, a line per table, and the keys for the scan file."""
    shaped = "; shaped: errors are those before the rounding" if tables.shaped else ""
    yield f"{tables.axis}: {tables.harmonics} harmonics, {tables.ticks} ticks{shaped}"
    cost = tables.cost
    yield from _HEAD if cost is None else (line.format(cost.processor) for line in _HEAD_OF_ONE)
    yield from (_row(row, 4 if tables.shaped else 3) for row in tables.rows)
    if tables.rendered is not None:
        into = f"rendered on the device into {tables.rendered}: {tables.rendered.memory_bits} bits"
        yield f"     {'Fourier words':<13}{2 * tables.harmonics + 1:>7}{32:>6}{tables.upload_bits:>11}  {into}"
    yield "     (cells: of words and codes of 16 bits, cubic of words of 14)"
    if tables.remedy:
        yield f"     (instructions: {tables.remedy})"
    choice = tables.chosen.shape
    yield ""
    within = f"{tables.max_error_lsb:g} LSB"
    if cost is not None and cost.max_instructions is not None:
        within += f" and {cost.max_instructions:g} instructions on {cost.processor}"
    yield f"* the least memory within {within}. In the scan file, so that each build finds it:"
    yield from _keys(tables.axis, {"mode": '"auto"', "max_error_lsb": f"{tables.max_error_lsb:g}"})
    yield "or as it is:"
    yield from _keys(tables.axis, {"mode": f'"{choice.mode}"', "length": f"{choice.length}", "bits": f"{choice.bits}"})
    if any(row.planned and not row.smallest for row in tables.rows):
        yield "= the table of the scan file"


def _keys(axis: str, keys: dict[str, str]) -> Iterator[str]:
    yield f"  [{axis}.table]"
    yield from (f"  {key} = {value}" for key, value in keys.items())


def _row(row: TableRow, digits: int) -> str:
    shape, takes = row.shape, row.instructions
    mark = "*" if row.smallest else "=" if row.planned else " "
    counts = (
        f"{takes['cortex-m4']:>8.1f}{takes['cortex-m0plus']:>7.1f}{takes['riscv32']:>7.1f}"
        if len(takes) > 1
        else "".join(f"{count:>15.1f}" for count in takes.values())
    )
    return (
        f"  {mark}  {shape.mode:<13}{shape.length:>7}{shape.bits:>6}{shape.memory_bits:>11}{row.stored_bits:>11}"
        f"{row.max_error_lsb:>8.{digits}f}{row.rms_error_lsb:>7.{digits}f}"
        f"{counts}{row.cells:>8}"
    )
