"""``tablegen compare``: compare two scans, builds or calibrations."""

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tablegen.cli.shared.common import OutputFile, fail, written
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.plot import PlottingCommand, check_plot, plot_option, show_plot
from tablegen.cli.shared.progress import Progress

if TYPE_CHECKING:
    from tablegen.api.compare import Compared

_path = click.Path(path_type=Path)


@click.command(
    cls=PlottingCommand,
    short_help="Compare two scans, builds or calibrations.",
    epilog="""\b
Examples:
  tablegen compare annexin_200nm.toml faster.toml
  tablegen compare annexin_200nm.toml build               is the build of this scan?
  tablegen compare scanner_may.toml scanner_june.toml     what has changed more than the errors?
  tablegen compare scan.toml other.toml -o compare.html --plot compare.pdf

\b
Exit status: 0 the same, 1 different, 2 wrong input, 4 cannot write, 6 a library is missing.""",
)
@click.argument("a", type=_path, metavar="A")
@click.argument("b", type=_path, metavar="B")
@click.option("--all", "everything", is_flag=True, help="Also print the quantities that are equal.")
@click.option("-o", "--output", type=OutputFile(), metavar="FILE", help="Also write an HTML page with all charts.")
@plot_option("A and B in the same charts, those that differ first,")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def compare(a: Path, b: Path, everything: bool, output: Path | None, plot: Path | None, as_json: bool) -> int:
    """Compare A and B, and print each quantity that differs, the difference, and its percentage.

    A and B are two scan files, two directories of builds, a scan file and a build, two scanner files, or two operator
    files.

    Scanner files are also compared by their standard errors, if `tablegen calibrate --write` wrote both: a parameter
    has changed if it differs by more than twice the standard error of the difference.

    A build contains neither the limits of its scan file nor the scanner file, so these are not compared with it.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if output is not None and output.suffix == ".toml":
        raise click.UsageError(f"-o {output}: the page would replace a scan or a scanner file; give a name in .html")
    check_plot(plot, as_json)
    with Progress() as progress:
        comparison = _compared(a, b, progress)
        if output is not None or plot is not None:
            progress.now("playing both and drawing")
            comparison.charts()
    if output is not None:
        written(output.parent, {output.name: comparison.page()})
    if as_json:
        click.echo(json.dumps(comparison.both.record(everything), indent=2, allow_nan=False))
    else:
        click.echo(comparison.summary(everything))
    if plot is not None and comparison.charts().charts:
        show_plot(plot, comparison.charts)
    return ExitStatus.OK if comparison.same else ExitStatus.STALE


def _compared(a: Path, b: Path, progress: Progress) -> "Compared":
    from tablegen.api.compare import compare as compared
    from tablegen.base.input_errors import Rejected, Unphysical
    from tablegen.manifest.read import NotABuild

    try:
        return compared(a, b, progress=progress.now)
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)
    except (NotABuild, Unphysical) as error:
        fail([error], ExitStatus.WRONG_INPUT)
