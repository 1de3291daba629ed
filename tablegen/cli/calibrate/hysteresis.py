"""``tablegen calibrate hysteresis``: fit (17)-(22) to sensor traces."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tablegen.cli.calibrate.options import delay_of, delay_option, points_option, recorder_options, rho_option
from tablegen.cli.calibrate.run import Common, check_measurements, driver_of, finish, read_columns, shared_options
from tablegen.cli.shared.plot import PlottingCommand

if TYPE_CHECKING:
    from tablegen.calibration.tables.recorder import Recorder


@click.command(cls=PlottingCommand, short_help="Fit beta_max, rho, u_peak to sensor traces.")
@shared_options
@recorder_options
@click.argument("data", type=click.Path(path_type=Path), metavar="DATA.CSV...", nargs=-1, required=True)
@rho_option
@click.option(
    "--settle",
    type=click.IntRange(min=0),
    metavar="N",
    help="Ignore the first N periods of each trace.  [default: 1 if a trace has three periods or more, otherwise 0]",
)
@click.option(
    "--drift",
    type=click.IntRange(0, 5),
    metavar="N",
    help="Order of the polynomial that describes drift.  [default: 1 to 3, more with more periods]",
)
@delay_option
@points_option
def hysteresis(
    common: Common,
    recorder: "Recorder",
    data: tuple[Path, ...],
    rho: float,
    settle: int | None,
    drift: int | None,
    delay_s: str,
    points: bool,
) -> int:
    """Fit beta_max and rho, (22), and u_peak, (17), to sensor traces with a triangular drive.

    Record one period or more at each of several amplitudes.

    \b
    Columns: time_s, drive_v, displacement_nm. A file with several traces also has the column
    trace, a number for each trace; without it, a new trace starts where time_s goes back.

    Traces with different turn (the forward fraction of the period) give separate parameter sets.

    \b
    Example:
      tablegen calibrate hysteresis --axis x 30v.csv 60v.csv 100v.csv --scanner scanner.toml --write
    """
    from tablegen.calibration.laws.hysteresis import fit_hysteresis
    from tablegen.calibration.tables.columns import DISPLACEMENT, DRIVE, TIME, TRACE
    from tablegen.calibration.tables.traces import split_traces

    delay = delay_of(delay_s)
    tables = [read_columns(path, [TIME, DRIVE, DISPLACEMENT], [TRACE], recorder) for path in data]
    driver = driver_of(common)
    remarks = check_measurements("hysteresis", common, tables, recorder, delay)
    traces = [trace for table in tables for trace in split_traces(table)]
    return finish(common, tables, lambda: fit_hysteresis(traces, driver, rho, settle, drift, delay), points, remarks)
