"""``tablegen calibrate offset``: fit (1)-(4) to apparent sizes at several offsets, or to images."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tablegen.cli.calibrate.options import optional_data, recorder_options, refuse_recorder
from tablegen.cli.calibrate.run import (
    Common,
    check_measurements,
    driver_of,
    finish,
    of_sample_images,
    read_columns,
    shared_options,
    size_law,
)
from tablegen.cli.images.samples import (
    CommandOfOffsetImages,
    image_option,
    refuse_sample,
    sample_options,
)
from tablegen.cli.shared.common import fail
from tablegen.cli.shared.exit_status import ExitStatus

if TYPE_CHECKING:
    from tablegen.calibration.tables.recorder import Recorder


@click.command(cls=CommandOfOffsetImages, short_help="Fit m_minus, m_plus to apparent sizes at several offsets.")
@shared_options
@recorder_options
@optional_data
@image_option(
    "VOLTS OFFSET_V",
    2,
    "In place of DATA.CSV: scan voltage and offset at the piezo in volts, and an image of a sample of known constant, "
    "scanned with a triangle. Without RETRACE, the retrace is that of the first file, if it has one. Repeat the option "
    "for each offset.",
)
@sample_options
@click.option(
    "--size-v",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="V",
    help="Scan voltage of the images in volts, peak to peak. The fit then uses the size calibration of the scanner "
    "file.",
)
def offset(
    common: Common,
    recorder: "Recorder",
    data: Path | None,
    images: tuple[tuple[float, float, Path, Path], ...],
    size_v: float | None,
    **sample: Any,
) -> int:
    """Fit m_minus and m_plus, equations (1)-(4), to apparent sizes at three or more offset voltages.

    \b
    Columns: offset_v, apparent_nm: the size in the image of one object, or of a lattice constant;
    and      size_v, optional: the scan voltage of the image, in place of --size-v.

    The scan size grows faster than the drive, (6). For exact values, calibrate the size first and give --size-v.

    With images of several scan voltages, each at three or more offsets, m is fitted for each of them. Builds then use
    m of their scan size.

    Or scan a lattice or a grating at each offset, and give trace and retrace with --image; the command uses the size
    calibration of the scanner file.

    \b
    Examples:
      tablegen calibrate offset --axis x offsets.csv --scanner scanner.toml --size-v 20 --write
      tablegen calibrate offset --axis x --lattice-nm 17.7 --image 13 7 t1.npy r1.npy \\
          --image 13 50 t2.npy r2.npy --image 13 93 t3.npy r3.npy --scanner scanner.toml --write
    """
    from tablegen.calibration.laws.offset import fit_offset
    from tablegen.calibration.laws.offset_sizes import fit_offset_sizes
    from tablegen.calibration.tables.columns import APPARENT, OFFSET, SIZE

    if images:
        if data is not None or size_v is not None:
            raise click.UsageError("DATA.CSV and --size-v are for sizes in a table, and --image for images")
        refuse_recorder(recorder)
        return of_sample_images("offset", common, images, sample)
    if data is None:
        raise click.UsageError("give DATA.CSV, or images with --image VOLTS OFFSET_V TRACE [RETRACE]")
    refuse_sample(sample)
    table = read_columns(data, [OFFSET, APPARENT], [SIZE], recorder)
    driver = driver_of(common)
    remarks = check_measurements("offset", common, [table], recorder)
    if SIZE in table:
        if size_v is not None:
            raise click.UsageError(f"--size-v is for files without the column size_v; {table.file} has it")
        law = size_law(common, f"the column size_v of {table.file}")
        return finish(
            common,
            [table],
            lambda: fit_offset_sizes(table[OFFSET], table[APPARENT], table[SIZE], driver, law),
            remarks=remarks,
        )
    of_file = None
    if size_v is not None:
        of_file = size_law(common, "--size-v")
        if not size_v <= driver.span:
            fail([f"--size-v {size_v:g} is above {driver.full_scale}"], ExitStatus.WRONG_INPUT)
    return finish(
        common, [table], lambda: fit_offset(table[OFFSET], table[APPARENT], driver, of_file, size_v), remarks=remarks
    )
