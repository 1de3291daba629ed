"""``tablegen simulate``: what a scan would do on a virtual scanner."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tablegen.cli.common import OutputFile, fail, finite, require, scan_argument, written
from tablegen.cli.exit_status import ExitStatus
from tablegen.cli.progress import Progress

if TYPE_CHECKING:
    from tablegen.config.load import Setup
    from tablegen.virtual.report import SimulationStage
    from tablegen.virtual.scanner import VirtualScanner
    from tablegen.virtual.simulation import Run


@click.command(short_help="Simulate a scan on a virtual scanner; print its accuracy.")
@scan_argument
@click.option(
    "--scanner-truth",
    "truth_file",
    metavar="default|duhem|FILE",
    default="default",
    show_default=True,
    help="The virtual scanner: default has a Preisach operator, duhem another kind of hysteresis, two resonances and a "
    "memory of the offset; both were identified on numbers of the paper. docs/virtual.md describes a FILE.",
)
@click.option(
    "--csv",
    "csv_file",
    type=OutputFile(),
    metavar="FILE",
    help="Write drive and displacement to FILE, for one line of x and one frame of y. Longer records than 10000 ticks "
    "are thinned.",
)
@click.option(
    "--plot",
    "plot_file",
    type=OutputFile(),
    metavar="FILE.png",
    help="Plot displacement, residual and scaling error to FILE.png.",
)
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
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, metavar="N", help="Random seed of that noise."
)
def simulate(
    scan: Path,
    truth_file: str,
    csv_file: Path | None,
    plot_file: Path | None,
    as_json: bool,
    calibrated: bool,
    noise: float,
    seed: int,
) -> None:
    """Simulate a scan on a virtual scanner, and print the scan errors that remain.

    The virtual scanner plays the integer codes of the build. It has its own models of hysteresis, creep, resonance and
    sensitivity, different from the equations that a build inverts.

    The command plays the uncompensated triangle, and each hysteresis model for which the scanner file has parameters:
    first with the scanner file as it is, then with parameters calibrated on simulated sensor data.

    \b
    Examples:
      tablegen simulate annexin_200nm.toml
      tablegen simulate annexin_200nm.toml --no-calibration --plot errors.png

    Exit status: 0 done, 2 wrong input, 4 cannot write, 6 a library is missing.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from tablegen.config.load import load
    from tablegen.problems import Rejected, Unphysical
    from tablegen.virtual import report
    from tablegen.virtual.parameters import load_truth
    from tablegen.virtual.report import SimulationStage
    from tablegen.virtual.scanner import VirtualScanner

    if plot_file is not None:
        if plot_file.suffix != ".png":
            raise click.UsageError(f"--plot {plot_file}: the name has to end in .png")
        require("matplotlib", extra="plot")
    if calibrated:
        require("scipy", extra="calibrate", otherwise="; or give --no-calibration")
    try:
        setup = load(scan)
        truth = load_truth(truth_file)
    except Rejected as faults:
        fail(faults.problems, ExitStatus.WRONG_INPUT)
    scanner = VirtualScanner.of(truth)
    with Progress() as progress:
        stages = [_play("given", "with the scanner file as it is", setup, scanner, truth_file, progress)]
        if not stages[0].runs:
            fail(
                list(dict.fromkeys(why for _, reasons in stages[0].rejected for why in reasons)), ExitStatus.WRONG_INPUT
            )
        if calibrated:
            from tablegen.virtual.laboratory import calibrate

            progress.now("calibrating")
            heading = f"with one calibrated on the virtual scanner's own data, {noise:g} % noise"
            try:
                after = calibrate(setup, scanner, 0.01 * noise, seed).setup
                stages.append(_play("calibrated", heading, after, scanner, truth_file, progress))
            except (Unphysical, ValueError) as reason:
                stages.append(SimulationStage("calibrated", heading, (), (("calibration", (str(reason),)),)))
    if csv_file is not None:
        written(csv_file.parent, {csv_file.name: report.csv(stages).encode()})
    if plot_file is not None:
        written(plot_file.parent, {plot_file.name: report.figure(f"{setup.scan.name}: {report.LABEL}", stages)})
    if as_json:
        import json

        click.echo(json.dumps(report.data(setup.scan.name, truth, stages), indent=2))
        return
    for line in report.text(setup.scan.name, truth, stages):
        click.echo(line)


def _play(
    name: str, heading: str, setup: "Setup", scanner: "VirtualScanner", truth_file: str, progress: Progress
) -> "SimulationStage":
    """Every model that can be played, and why the others cannot."""
    from tablegen.problems import Rejected
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
