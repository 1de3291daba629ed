"""``tablegen calibrate resonance``: fit a resonance to gain and phase, or store the response itself."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tablegen.cli.calibrate.options import columns_only, data_argument, from_hz_option, to_hz_option
from tablegen.cli.calibrate.run import Common, finish, read_columns, shared_options, within
from tablegen.cli.shared.plot import PlottingCommand

if TYPE_CHECKING:
    from tablegen.calibration.tables.recorder import Recorder


@click.command(cls=PlottingCommand, short_help="Fit resonance frequency, quality and delay to a response.")
@shared_options
@columns_only
@data_argument
@from_hz_option
@to_hz_option
@click.option(
    "--points",
    is_flag=True,
    help="With --write, write the measured response as a CSV file beside the scanner file, and name it there, instead "
    "of the fitted resonance.",
)
def resonance(common: Common, recorder: "Recorder", data: Path, from_hz: float, to_hz: float, points: bool) -> int:
    """Fit frequency_hz, quality and delay_s to a frequency response that covers the resonance.

    \b
    Columns: frequency_hz; gain or gain_db; optionally phase_deg or phase_rad, for delay_s.

    \b
    Example:
      tablegen calibrate resonance --axis x response.csv --scanner scanner.toml --write
    """
    from tablegen.calibration.laws.resonance import fit_resonance
    from tablegen.calibration.tables.columns import FREQUENCY, GAIN, PHASE

    table = within(read_columns(data, [FREQUENCY, GAIN], [PHASE], recorder), from_hz, to_hz)
    phase = table.columns.get(PHASE.name)
    return finish(common, [table], lambda: fit_resonance(table[FREQUENCY], table[GAIN], phase), points, table.remarks)
