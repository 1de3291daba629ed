"""``tablegen calibrate size``: actual against set scan sizes, or images, to (6)-(12)."""

from pathlib import Path
from typing import Literal

import click

from tablegen.cli.calibration_options import data_argument
from tablegen.cli.calibration_run import Common, finish, full_scale, in_file, read_columns, shared_options
from tablegen.cli.common import fail
from tablegen.cli.exit_status import ExitStatus


@click.command(short_help="Fit k_nm_per_v, beta, v_threshold to actual scan sizes.")
@shared_options
@data_argument
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
    data: Path,
    k: float | None,
    base_nm: float | None,
    threshold: float | None,
    noise: Literal["relative", "absolute"],
) -> int:
    """Fit k_nm_per_v, beta and v_threshold, equations (6)-(12), to actual scan sizes at several drives.

    \b
    Columns: drive_v (scan voltage at the piezo, peak to peak),
             or nominal_nm (size set at the controller) with the option --k;
    and      actual_nm (size measured by a sensor),
             or apparent_nm and true_nm (a lattice in the image) with nominal_nm.

    \b
    Example:
      tablegen calibrate size --axis x sizes.csv --scanner scanner.toml --write
    """
    from tablegen.calibration.columns import ACTUAL, APPARENT, DRIVE, NOMINAL, TRUE
    from tablegen.calibration.size import fit_size

    table = read_columns(data, [], [DRIVE, NOMINAL, ACTUAL, APPARENT, TRUE])
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
    v_max = full_scale(common)
    base = base_nm or in_file(common, "size", "base_nm") or 200.0
    return finish(common, [table], lambda: fit_size(drive, actual, v_max, base, threshold, noise))
