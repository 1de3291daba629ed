"""``tablegen simulate``: simulate a scan on a virtual scanner."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from tablegen.cli.shared.common import OutputFile, fail, finite, require, scan_argument, written
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.plot import PlottingCommand, check_plot, plot_option, show_plot
from tablegen.cli.shared.progress import Progress

if TYPE_CHECKING:
    from tablegen.api.simulate import SimulatedScan
    from tablegen.api.simulate_turned import SimulatedTurned
    from tablegen.config.load import Setup

OWN, DEFAULT = "own", "default"


@click.command(cls=PlottingCommand, short_help="Simulate a scan on a virtual scanner; print its accuracy.")
@scan_argument
@click.option(
    "--scanner-truth",
    "truth_file",
    metavar="own|default|duhem|FILE",
    help="Scanner to play on. own: the operator of the scanner file, with random errors of its own uncertainty, "
    "several times. default: built in, with a Preisach operator. duhem: built in, with another kind of hysteresis, two "
    "resonances and a memory of the offset. Both were fitted to numbers of the paper, and are scaled to the "
    "drive range, the nm per V and the resonances of the scanner file. FILE: parameters as in docs/virtual.md.  "
    "[default: own if the scanner file has an operator, else default]",
)
@click.option(
    "--csv",
    "csv_file",
    type=OutputFile(),
    metavar="FILE",
    help="Write drive and displacement to FILE, for one line of x and one frame of y. Records of more than 10000 "
    "ticks are thinned.",
)
@plot_option("residual and scaling error")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
@click.option(
    "--calibration/--no-calibration",
    "calibrated",
    default=True,
    help="Also simulate with a scanner file that was calibrated on simulated measurements of the virtual scanner.  "
    "[default: calibration]",
)
@click.option(
    "--noise",
    type=click.FloatRange(0.0, 10.0),
    callback=finite,
    default=0.2,
    show_default=True,
    metavar="PERCENT",
    help="Noise of the simulated measurements in percent, rms.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    metavar="N",
    help="Random seed of that noise, and of the errors of own.",
)
@click.pass_context
def simulate(
    context: click.Context,
    scan: Path,
    truth_file: str | None,
    csv_file: Path | None,
    plot: Path | None,
    as_json: bool,
    calibrated: bool,
    noise: float,
    seed: int,
) -> None:
    """Simulate a scan on a virtual scanner, and print the scan errors that remain.

    The virtual scanner plays the integer codes of the build. A built-in scanner has its own models of hysteresis,
    creep, resonance and sensitivity, different from the equations that a build inverts. The command plays the
    uncompensated triangle, and each hysteresis model for which the scanner file has parameters: first with the scanner
    file as it is, then with parameters calibrated on simulated sensor data.

    Where the scanner file has an operator, your own scanner is simulated: the command plays the uncompensated triangle,
    the laws and the operator on scanners that differ from the operator by its uncertainty.

    Of a scan at an angle, on coupled axes or with drift, it plays a whole frame of both axes: straight lines, and the
    emitted integers.

    \b
    Examples:
      tablegen simulate annexin_200nm.toml
      tablegen simulate annexin_200nm.toml --no-calibration --plot errors.png
      tablegen simulate own_scan.toml --scanner-truth default

    Exit status: 0 done, 2 wrong input, 4 cannot write, 6 a library is missing.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    check_plot(plot, as_json)
    from tablegen.api.simulate import simulate as simulated
    from tablegen.api.simulate_turned import simulate_turned
    from tablegen.base.input_errors import Rejected, Unphysical
    from tablegen.config.load import load

    result: SimulatedScan | SimulatedTurned
    try:
        setup = load(scan)
        own = _plays_own(context, setup, truth_file)
        if calibrated and not own:
            require("scipy", extra="calibrate", otherwise="; or give --no-calibration")
        truth = OWN if own else truth_file or DEFAULT
        play = simulate_turned if setup.mixes_motions else simulated
        with Progress() as progress:
            result = play(setup, truth, calibrated=calibrated, noise_percent=noise, seed=seed, progress=progress.now)
    except Rejected as faults:
        fail(faults.problems, ExitStatus.WRONG_INPUT)
    except Unphysical as reason:
        fail([reason], ExitStatus.WRONG_INPUT)
    if csv_file is not None:
        written(csv_file.parent, {csv_file.name: result.csv().encode()})
    click.echo(result.to_json() if as_json else result.summary())
    show_plot(plot, result.charts)


def _plays_own(context: click.Context, setup: "Setup", truth_file: str | None) -> bool:
    """Return True if the operator of the scanner file is the scanner; contradicting options are a usage error."""
    from tablegen.virtual.own_run import own_axes

    if truth_file not in (None, OWN) or not (own_axes(setup) or truth_file):
        return False
    if not own_axes(setup):
        path = setup.scanner_file.name
        raise click.UsageError(
            f"--scanner-truth {OWN}: {path} has no operator; fit one with tablegen calibrate operator"
        )
    for parameter, name in (
        ("csv_file", "--csv"),
        ("noise", "--noise"),
        ("calibrated", "--calibration"),
    ):
        if context.get_parameter_source(parameter) is not ParameterSource.DEFAULT:
            raise click.UsageError(
                f"{name} does not go with the scanner file's own operator; give --scanner-truth {DEFAULT} as well"
            )
    return True
