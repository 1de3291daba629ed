"""``tablegen predict``: predict the position of an axis for any drive."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from tablegen.cli.calibrate.options import recorder_options
from tablegen.cli.calibrate.run import ended_by_input
from tablegen.cli.shared.common import OutputFile, quiet_blas, written
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.plot import PlottingCommand, check_plot, plot_option, show_plot

if TYPE_CHECKING:
    from tablegen.calibration.tables.recorder import Recorder

_path = click.Path(path_type=Path)


@click.command(
    cls=PlottingCommand,
    short_help="Predict the position of an axis for any drive.",
    epilog="""\b
Examples:
  tablegen predict scanner.toml drive.csv --axis x -o predicted.csv
  tablegen predict scanner.toml record.csv --axis x --against record.csv

\b
Exit status: 0 done, 2 wrong input, 4 cannot write, 6 a library is missing.""",
)
@click.argument("scanner", type=_path, metavar="SCANNER.TOML")
@click.argument("drive", type=_path, metavar="DRIVE.CSV")
@click.option("--axis", type=click.Choice(["x", "y"]), required=True, help="The axis that is driven.")
@click.option("-o", "--output", type=OutputFile(), metavar="FILE", help="Write the predicted positions as CSV.")
@click.option("--against", type=_path, metavar="FILE", help="Measured positions; print the error of the prediction.")
@click.option(
    "--start",
    type=click.Choice(["rest", "line", "settled"]),
    default="rest",
    show_default=True,
    help="State at the first sample: at rest after v_min, or after many repetitions of the first line or of all.",
)
@click.option(
    "--delay-s",
    type=float,
    default=0.0,
    show_default=True,
    metavar="S",
    help="Delay of the measurement against the drive, as `calibrate operator` took or fitted it.",
)
@recorder_options
@plot_option("positions and errors over time")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def predict(
    scanner: Path,
    drive: Path,
    axis: Literal["x", "y"],
    output: Path | None,
    against: Path | None,
    start: Literal["settled", "line", "rest"],
    delay_s: float,
    recorder: "Recorder",
    plot: Path | None,
    as_json: bool,
) -> int:
    """Predict the position of an axis with an operator, for a drive of any shape.

    DRIVE.CSV has the columns time_s and drive_v, in the order of time, at even or uneven steps. The scanner file has
    `model = "operator"` in the hysteresis table of the axis (`tablegen calibrate operator`).

    Hysteresis depends on the turning points of the drive; creep and dynamics depend on time too. The sensitivity is
    that at the mean of the drive, or follows its running mean where `calibrate operator --step` measured how. The mean
    of the error is subtracted, because the zero of a sensor is arbitrary.
    """
    quiet_blas()
    check_plot(plot, as_json)
    from tablegen.api.predict import predict as predicted_of

    with ended_by_input():
        predicted = predicted_of(
            scanner,
            drive,
            axis=axis,
            against=against,
            start=start,
            delay_s=delay_s,
            columns=recorder.columns,
            drive_gain=recorder.drive_gain,
            drive_offset=recorder.drive_offset,
        )
    if output is not None:
        written(output.parent, {output.name: predicted.csv()})
    click.echo(predicted.to_json() if as_json else predicted.summary())
    show_plot(plot, predicted.charts)
    return ExitStatus.OK
