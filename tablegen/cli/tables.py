"""``tablegen tables``: list the feasible tables of a scan."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from tablegen.cli.shared.common import fail, quiet_blas, scan_argument
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.plot import PlottingCommand, check_plot, plot_option, show_plot
from tablegen.cli.shared.progress import Progress
from tablegen.cli.shared.terminal import tell

if TYPE_CHECKING:
    from tablegen.api.tables import FeasibleTables


@click.command(
    cls=PlottingCommand,
    short_help="List the feasible tables of a scan, and the smallest.",
    epilog="""\b
Examples:
  tablegen tables annexin_200nm.toml
  tablegen tables annexin_200nm.toml --axis x --plot tables.svg
  tablegen tables annexin_200nm.toml --json

\b
Exit status: 0 done, 2 wrong input, 4 cannot write, 6 a library is missing.""",
)
@scan_argument
@click.option("--axis", type=click.Choice(["x", "y"]), help="One axis only.  [default: every axis that moves]")
@plot_option("memory and error of the tables")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def tables(scan: Path, axis: Literal["x", "y"] | None, plot: Path | None, as_json: bool) -> None:
    """List the feasible tables of a scan, and the smallest of them. Writes no file of a build.

    A table stores one period of the waveform. With more words, wider words, or more arithmetic between the words
    (mode), the emitted codes are nearer to the requested waveform. A code is rounded to a whole LSB of the converter,
    so it has an error of up to 0.5 LSB with any table.

    Each line is one table; a table is left out if a smaller one, as simple to play, is better by 5 %. The columns are
    memory in bits, the largest and the rms error of a code over all ticks, and the device resources that a sample
    takes; [cost] processor of the scan file selects one processor. * is the least memory within [x.table]
    max_error_lsb of the scan file; without that key within limits.max_error_lsb, or within 1 LSB if that is less. A
    table that some format of the scan file cannot play is marked - and not chosen.

    A scan at an angle has cubic tables over the line and over the frame; = marks those that the build takes.
    """
    check_plot(plot, as_json)
    feasible = _feasible(scan, axis)
    if as_json:
        click.echo(feasible.to_json())
    else:
        for i, lines in enumerate(feasible.texts()):
            if i:
                click.echo()
            for number, text in enumerate(lines):
                tell(text, bold=number == 0)
    show_plot(plot, feasible.charts)


def _feasible(scan: Path, axis: Literal["x", "y"] | None) -> "FeasibleTables":
    quiet_blas()
    from tablegen.api.tables import tables as feasible
    from tablegen.base.input_errors import Rejected

    try:
        with Progress() as progress:
            return feasible(scan, axis, progress=progress.now)
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)
    except ValueError as reason:
        raise click.UsageError(str(reason)) from None
