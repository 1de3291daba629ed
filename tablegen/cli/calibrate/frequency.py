"""``tablegen calibrate frequency``: fit (23) to gains at several frequencies."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tablegen.cli.calibrate.options import columns_only, data_argument, from_hz_option, to_hz_option
from tablegen.cli.calibrate.run import Common, finish, in_file, read_columns, shared_options, within
from tablegen.cli.shared.plot import PlottingCommand

_REFERENCE_HELP = (
    "Frequency in Hz at which the size was calibrated.  [default: reference_hz of the scanner file, or the lowest "
    "frequency in DATA.CSV]"
)


if TYPE_CHECKING:
    from tablegen.calibration.tables.recorder import Recorder


@click.command(cls=PlottingCommand, short_help="Fit alpha to gains at several frequencies.")
@shared_options
@columns_only
@data_argument
@click.option("--reference-hz", type=click.FloatRange(min=1e-6), metavar="HZ", help=_REFERENCE_HELP)
@from_hz_option
@to_hz_option
def frequency(
    common: Common, recorder: "Recorder", data: Path, reference_hz: float | None, from_hz: float, to_hz: float
) -> int:
    """Fit alpha, equation (23), to gains at several frequencies below a tenth of the resonance frequency.

    \b
    Columns: frequency_hz; gain or gain_db.

    \b
    Example:
      tablegen calibrate frequency --axis x gains.csv --scanner scanner.toml --write
    """
    from tablegen.calibration.laws.frequency import fit_frequency
    from tablegen.calibration.tables.columns import FREQUENCY, GAIN

    table = within(read_columns(data, [FREQUENCY, GAIN], (), recorder), from_hz, to_hz)
    reference = reference_hz or in_file(common, "frequency", "reference_hz")
    return finish(
        common, [table], lambda: fit_frequency(table[FREQUENCY], table[GAIN], reference), remarks=table.remarks
    )
