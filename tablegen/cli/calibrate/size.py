"""``tablegen calibrate size``: fit (6)-(12) to actual and set scan sizes, or to images."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from tablegen.cli.calibrate.options import optional_data, recorder_options, refuse_recorder
from tablegen.cli.calibrate.run import (
    Common,
    check_measurements,
    driver_of,
    finish,
    in_file,
    of_sample_images,
    read_columns,
    shared_options,
)
from tablegen.cli.images.samples import (
    CommandOfImages,
    image_option,
    refuse_sample,
    sample_options,
)
from tablegen.cli.shared.common import fail
from tablegen.cli.shared.exit_status import ExitStatus

if TYPE_CHECKING:
    from tablegen.calibration.tables.recorder import Recorder


@click.command(cls=CommandOfImages, short_help="Fit k_nm_per_v, beta, v_threshold to actual scan sizes.")
@shared_options
@recorder_options
@optional_data
@image_option(
    "VOLTS",
    1,
    "In place of DATA.CSV: scan voltage at the piezo in volts, peak to peak, and an image of a sample of known "
    "constant, scanned with a triangle. Without RETRACE, the retrace is that of the first file, if it has one. Repeat "
    "the option for each size.",
)
@sample_options
@click.option(
    "--k",
    type=click.FloatRange(min=1e-6),
    metavar="NM/V",
    help="Linear constant of the controller that converted nominal_nm to volts, in nm/V.",
)
@click.option(
    "--base-nm",
    type=click.FloatRange(min=1e-6),
    metavar="NM",
    help="Base size in nm, at which k_nm_per_v applies.  [default: base_nm of the scanner file, or 200]",
)
@click.option(
    "--threshold",
    type=float,
    metavar="V/V_MAX",
    help="Fix v_threshold at this fraction of v_max.  [default: fitted; 0.5 if the data do not determine it]",
)
@click.option(
    "--noise",
    type=click.Choice(("relative", "absolute")),
    default="relative",
    show_default=True,
    help="Error model of the sizes: relative to the size (images), or the same for all sizes (sensor).",
)
def size(
    common: Common,
    recorder: "Recorder",
    data: Path | None,
    images: tuple[tuple[float, Path, Path], ...],
    k: float | None,
    base_nm: float | None,
    threshold: float | None,
    noise: Literal["relative", "absolute"],
    **sample: Any,
) -> int:
    """Fit k_nm_per_v, beta and v_threshold, equations (6)-(12), to actual scan sizes at several drives.

    \b
    Columns: drive_v (scan voltage at the piezo, peak to peak),
             or nominal_nm (size set at the controller) with the option --k;
    and      actual_nm (size measured by a sensor),
             or apparent_nm and true_nm (a lattice in the image) with nominal_nm.

    Or scan a lattice or a grating at several scan voltages, and give trace and retrace of each with --image. The sizes
    are fitted to all pixels together with the hysteresis, and have standard errors.

    \b
    Examples:
      tablegen calibrate size --axis x sizes.csv --scanner scanner.toml --write
      tablegen calibrate size --axis x --lattice-nm 17.7 --image 10 t1.npy r1.npy \\
          --image 30 t2.npy r2.npy --image 90 t3.npy r3.npy --scanner scanner.toml --write
    """
    from tablegen.calibration.laws.size import fit_size
    from tablegen.calibration.tables.columns import ACTUAL, APPARENT, DRIVE, NOMINAL, TRUE

    if images:
        if data is not None or k is not None or noise != "relative":
            raise click.UsageError("DATA.CSV, --k and --noise are for sizes in a table, and --image for images")
        refuse_recorder(recorder)
        return of_sample_images("size", common, images, {**sample, "base_nm": base_nm, "threshold": threshold})
    if data is None:
        raise click.UsageError("give DATA.CSV, or images with --image VOLTS TRACE [RETRACE]")
    refuse_sample(sample)
    table = read_columns(data, [], [DRIVE, NOMINAL, ACTUAL, APPARENT, TRUE], recorder, peak_to_peak=True)
    if DRIVE not in table and (NOMINAL not in table or k is None):
        fail([f"{table.file}: drive_v is missing; or give nominal_nm, and --k NM/V"], ExitStatus.WRONG_INPUT)
    if DRIVE in table and k is not None:
        raise click.UsageError("--k is for nominal sizes; the file has drive_v")
    if ACTUAL not in table and any(column not in table for column in (APPARENT, TRUE, NOMINAL)):
        fail(
            [f"{table.file}: actual_nm is missing; or give nominal_nm, apparent_nm and true_nm"], ExitStatus.WRONG_INPUT
        )
    actual = table[ACTUAL] if ACTUAL in table else table[NOMINAL] * table[TRUE] / table[APPARENT]
    drive = table[DRIVE] if DRIVE in table else table[NOMINAL] / (k or 1.0)
    driver = driver_of(common)
    remarks = check_measurements("size", common, [table], recorder)
    base = base_nm or in_file(common, "size", "base_nm") or 200.0
    return finish(common, [table], lambda: fit_size(drive, actual, driver, base, threshold, noise), remarks=remarks)
