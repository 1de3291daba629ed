"""``tablegen calibrate offset``: apparent sizes at several offsets, or images, to (1)-(4)."""

from pathlib import Path

import click

from tablegen.cli.calibration_options import data_argument
from tablegen.cli.calibration_run import Common, finish, full_scale, read_columns, shared_options, size_law
from tablegen.cli.common import fail
from tablegen.cli.exit_status import ExitStatus


@click.command(short_help="Fit m_minus, m_plus to apparent sizes at several offsets.")
@shared_options
@data_argument
@click.option(
    "--size-v",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="V",
    help="Scan voltage of the images in volts, peak to peak. The fit then uses the size calibration of the scanner "
    "file.",
)
def offset(common: Common, data: Path, size_v: float | None) -> int:
    """Fit m_minus and m_plus, equations (1)-(4), to apparent sizes at three or more offset voltages.

    \b
    Columns: offset_v, apparent_nm: the size in the image of one object, or of a lattice constant;
    and      size_v, optional: the scan voltage of the image, in place of --size-v.

    The scan size grows faster than the drive, (6). For exact values, calibrate the size first and give --size-v.

    With images of several scan voltages, each at three or more offsets, m is fitted for each of them. Builds then use
    m of their scan size.

    \b
    Example:
      tablegen calibrate offset --axis x offsets.csv --scanner scanner.toml --size-v 20 --write
    """
    from tablegen.calibration.columns import APPARENT, OFFSET, SIZE
    from tablegen.calibration.offset import fit_offset
    from tablegen.calibration.offset_sizes import fit_offset_sizes

    table = read_columns(data, [OFFSET, APPARENT], [SIZE])
    v_max = full_scale(common)
    if SIZE in table:
        if size_v is not None:
            raise click.UsageError(f"--size-v is for files without the column size_v; {table.file} has it")
        law = size_law(common, v_max, f"the column size_v of {table.file}")
        return finish(
            common, [table], lambda: fit_offset_sizes(table[OFFSET], table[APPARENT], table[SIZE], v_max, law)
        )
    of_file = None
    if size_v is not None:
        of_file = size_law(common, v_max, "--size-v")
        if not size_v <= v_max:
            fail([f"--size-v {size_v:g} is above v_max = {v_max:g} V"], ExitStatus.WRONG_INPUT)
    return finish(common, [table], lambda: fit_offset(table[OFFSET], table[APPARENT], v_max, of_file, size_v))
