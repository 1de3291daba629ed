"""``tablegen simulate``: what a scan would do on a virtual scanner."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click
from click.core import ParameterSource

from tablegen.cli.shared.common import OutputFile, fail, finite, require, scan_argument, written
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.plot import PlottingCommand, check_plot, plot_option, put_plot
from tablegen.cli.shared.progress import Progress

if TYPE_CHECKING:
    from tablegen.config.load import Setup
    from tablegen.virtual.parameters import Truth
    from tablegen.virtual.report import SimulationStage
    from tablegen.virtual.scanner import VirtualScanner
    from tablegen.virtual.simulation import Run

OWN, DEFAULT = "own", "default"


@click.command(cls=PlottingCommand, short_help="Simulate a scan on a virtual scanner; print its accuracy.")
@scan_argument
@click.option(
    "--scanner-truth",
    "truth_file",
    metavar="own|default|duhem|FILE",
    help="Scanner to play on. own: the operator of the scanner file, wrong by its own uncertainty, several times at "
    "random. default: built in, with a Preisach operator. duhem: built in, with another kind of hysteresis, two "
    "resonances and a memory of the offset. Both were identified on numbers of the paper, and are scaled to the "
    "drive range, the nm per V and the resonances of the scanner file. FILE: parameters as in docs/virtual.md.  "
    "[default: own if the scanner file has an operator, else default]",
)
@click.option(
    "--csv",
    "csv_file",
    type=OutputFile(),
    metavar="FILE",
    help="Write drive and displacement to FILE, for one line of x and one frame of y. Longer records than 10000 ticks "
    "are thinned.",
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
    help="Random seed of that noise, and of what own is wrong by.",
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
    the laws and the operator on scanners that depart from the operator as much as it is uncertain.

    \b
    Examples:
      tablegen simulate annexin_200nm.toml
      tablegen simulate annexin_200nm.toml --no-calibration --plot errors.png
      tablegen simulate own_scan.toml --scanner-truth default

    Exit status: 0 done, 2 wrong input, 4 cannot write, 6 a library is missing.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    check_plot(plot, as_json)
    from msgspec.structs import replace

    from tablegen.api.laboratory import Laboratory
    from tablegen.base.input_errors import Rejected
    from tablegen.config.load import load
    from tablegen.virtual import report
    from tablegen.virtual.own_run import own_axes

    try:
        setup = load(scan)
    except Rejected as faults:
        fail(faults.problems, ExitStatus.WRONG_INPUT)
    if setup.scan.y.off:
        problem = setup.scan_file.problem("y.motion", "'off' makes a line scan, and frames alone are simulated")
        fail([problem], ExitStatus.WRONG_INPUT)
    if _plays_own(context, setup, truth_file):
        _simulate_own(setup, seed, plot, as_json)
        return
    truth_file = truth_file or DEFAULT
    if calibrated:
        require("scipy", extra="calibrate", otherwise="; or give --no-calibration")
    try:
        laboratory = Laboratory(truth_file, setup.scanner)
    except Rejected as faults:
        fail(faults.problems, ExitStatus.WRONG_INPUT)
    scanner, truth = laboratory.scanner, laboratory.truth
    if laboratory.scaled:
        truth = replace(truth, name=f"{truth.name}, {laboratory.scaled}")
    with Progress() as progress:
        heading = "with the scanner file as it is"
        if own_axes(setup):
            heading += "; its operator is that of the piezo on which it was measured"
        stages = [_play("given", heading, setup, scanner, truth_file, progress)]
        if not stages[0].runs:
            fail(_reasons(stages[0]), ExitStatus.WRONG_INPUT)
        if calibrated:
            stages.append(_calibrated(setup, scanner, truth_file, noise, seed, progress))
    if csv_file is not None:
        written(csv_file.parent, {csv_file.name: report.csv(stages).encode()})
    _print_stages(setup, truth, stages, as_json)
    if plot is not None:
        from tablegen.report.simulated import stage_charts

        put_plot(plot, lambda: stage_charts(setup.scan.name, stages))


def _plays_own(context: click.Context, setup: "Setup", truth_file: str | None) -> bool:
    """Whether the operator of the scanner file is the scanner; what does not go with that is a usage error."""
    from tablegen.virtual.own_run import own_axes

    if truth_file not in (None, OWN) or not (own_axes(setup) or truth_file):
        return False
    if not own_axes(setup):
        path = setup.scanner_file.name
        raise click.UsageError(
            f"--scanner-truth {OWN}: {path} has no operator; identify one with tablegen calibrate operator"
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


def _simulate_own(setup: "Setup", seed: int, plot: Path | None, as_json: bool) -> None:
    from tablegen.base.input_errors import Rejected, Unphysical
    from tablegen.virtual import own_report
    from tablegen.virtual.own_run import own_axes, simulate_own

    try:
        with Progress() as progress:
            runs = simulate_own(setup, seed, progress.now)
    except Rejected as faults:
        fail(faults.problems, ExitStatus.WRONG_INPUT)
    except Unphysical as reason:
        fail([str(reason)], ExitStatus.WRONG_INPUT)
    found = setup.scan.name, runs, [axis for axis in ("x", "y") if axis not in own_axes(setup)]
    if as_json:
        import json

        click.echo(json.dumps(own_report.data(*found), indent=2))
    else:
        click.echo("\n".join(own_report.text(*found)))
    if plot is not None:
        from tablegen.report.simulated import own_charts

        put_plot(plot, lambda: own_charts(setup.scan.name, runs))


def _print_stages(setup: "Setup", truth: "Truth", stages: "list[SimulationStage]", as_json: bool) -> None:
    from tablegen.virtual import report

    if as_json:
        import json

        click.echo(json.dumps(report.data(setup.scan.name, truth, stages), indent=2))
    else:
        click.echo("\n".join(report.text(setup.scan.name, truth, stages)))


def _reasons(stage: "SimulationStage") -> list[str]:
    """Return why no model could be played, each reason once."""
    return list(dict.fromkeys(why for _, reasons in stage.rejected for why in reasons))


def _calibrated(
    setup: "Setup", scanner: "VirtualScanner", truth_file: str, noise: float, seed: int, progress: Progress
) -> "SimulationStage":
    """Play with parameters that were calibrated on simulated data; ``noise`` is in percent."""
    from tablegen.base.input_errors import Unphysical
    from tablegen.virtual.calibration_day import calibrate
    from tablegen.virtual.report import SimulationStage

    progress.now("calibrating")
    heading = f"with one calibrated on the virtual scanner's own data, {noise:g} % noise"
    try:
        after = calibrate(setup, scanner, 0.01 * noise, seed).setup
        return _play("calibrated", heading, after, scanner, truth_file, progress)
    except (Unphysical, ValueError) as reason:
        return SimulationStage("calibrated", heading, (), (("calibration", (str(reason),)),))


def _play(
    name: str, heading: str, setup: "Setup", scanner: "VirtualScanner", truth_file: str, progress: Progress
) -> "SimulationStage":
    """Every model that can be played, and why the others cannot."""
    from tablegen.base.input_errors import Rejected
    from tablegen.virtual.report import SimulationStage
    from tablegen.virtual.simulation import models_of, simulate

    runs: list[Run] = []
    rejected: list[tuple[str, tuple[str, ...]]] = []
    for model in models_of(setup):
        progress.now(f"playing the {model} model, scanner file as {name}")
        try:
            runs.append(simulate(setup, scanner, model))
        except Rejected as faults:
            rejected.append((model, tuple(map(str, faults.problems))))
        except ValueError as reason:
            rejected.append((model, (f"{truth_file}: {reason}",)))
    return SimulationStage(name, heading, tuple(runs), tuple(rejected))
