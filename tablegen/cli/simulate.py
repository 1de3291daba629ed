"""``tablegen simulate``: what a scan would do on a virtual scanner."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tablegen.cli.common import fail, scan_argument, written
from tablegen.cli.progress import Progress
from tablegen.cli.status import Status

if TYPE_CHECKING:
    from tablegen.virtual.simulation import Run


@click.command(short_help="Play a scan on a virtual scanner: what accuracy to expect.")
@scan_argument
@click.option(
    "--scanner-truth",
    "truth_file",
    metavar="default|FILE",
    default="default",
    show_default=True,
    help="The virtual scanner; the default one was identified from the paper's figures. Format: docs/virtual.md.",
)
@click.option(
    "--csv",
    "csv_file",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Drive and displacement of a line of x and of a frame of y, tick by tick up to 10000 ticks, thinned beyond.",
)
@click.option(
    "--plot", "plot_file", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE.png", help="A figure."
)
@click.option("--json", "as_json", is_flag=True, help="Plain data instead of text.")
def simulate(scan: Path, truth_file: str, csv_file: Path | None, plot_file: Path | None, as_json: bool) -> None:
    """Play the emitted integers of a scan on a virtual scanner, and print what it does. This is a simulation.

    The scan is played as a triangle, and with each hysteresis model for which the scanner file has parameters. The
    virtual scanner has hysteresis of another kind, creep, a resonance and a sensitivity of its own: none of the
    equations that a build inverts.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from tablegen.config.load import load
    from tablegen.problems import Rejected
    from tablegen.virtual import report
    from tablegen.virtual.parameters import load_truth
    from tablegen.virtual.scanner import VirtualScanner
    from tablegen.virtual.simulation import models_of
    from tablegen.virtual.simulation import simulate as play

    if plot_file is not None:
        _need_matplotlib()
    runs: list[Run] = []
    rejected: list[tuple[str, str]] = []
    problems: list[object] = []
    try:
        setup = load(scan)
        truth = load_truth(None if truth_file == "default" else truth_file)
    except Rejected as faults:
        fail(faults.problems, Status.WRONG_INPUT)
    scanner = VirtualScanner.of(truth)
    with Progress() as progress:
        for model in models_of(setup):
            progress.now(f"playing the {model} model")
            try:
                runs.append(play(setup, scanner, model))
            except Rejected as faults:
                rejected.append((model, "; ".join(map(str, faults.problems))))
                problems += faults.problems
            except ValueError as reason:
                problems.append(f"{truth_file}: {reason}")
    if not runs:
        fail(list(dict.fromkeys(map(str, problems))), Status.WRONG_INPUT)
    if csv_file is not None:
        written(csv_file.parent, {csv_file.name: report.csv(runs).encode()})
    if plot_file is not None:
        written(plot_file.parent, {plot_file.name: report.figure(f"{setup.scan.name}: {report.LABEL}", runs)})
    if as_json:
        import json

        click.echo(json.dumps(report.data(setup.scan.name, truth.name, runs, rejected), indent=2))
        return
    for line in report.text(setup.scan.name, truth.name, runs, rejected):
        click.echo(line)


def _need_matplotlib() -> None:
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        fail(["--plot needs matplotlib: pip install 'tablegen[plot]'"], Status.TOOL_MISSING)
