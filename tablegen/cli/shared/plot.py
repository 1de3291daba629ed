"""The option ``--plot`` of all commands: a picture in a file, or in characters in the terminal."""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from tablegen.cli.shared.common import OutputFile, require, written
from tablegen.cli.shared.terminal import paint

if TYPE_CHECKING:
    from tablegen.api.result import Result
    from tablegen.charts.picture_file import PlottedCharts

F = TypeVar("F", bound=Callable[..., Any])
TERMINAL = "-"  # in place of a file
_ENDINGS = (".png", ".svg", ".pdf")
_WITHOUT_LIBRARY = ".svg"
_NARROW = 80  # characters, if the width of the terminal is unknown


class _Picture(OutputFile):
    """A file name with the ending of a picture, or the terminal."""

    def convert(self, value: Any, parameter: click.Parameter | None, context: click.Context | None) -> Path:
        """Return the path; a usage error names the endings."""
        if value == TERMINAL:
            return Path(TERMINAL)
        path = super().convert(value, parameter, context)
        if path.suffix not in _ENDINGS:
            self.fail(f"'{path}': the name has to end in .png, .svg or .pdf.", parameter, context)
        return path


class PlottingCommand(click.Command):
    """A command with ``--plot [FILE]``; an existing file after it that is no picture is an argument."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Insert the terminal as the target where no name of a picture follows."""
        words = []
        for at, word in enumerate(args):
            other = Path(args[at + 1] if at + 1 < len(args) else "")
            plain = word == "--plot" and other.suffix not in _ENDINGS and other.is_file()
            words.append(f"--plot={TERMINAL}" if plain else word)
        return super().parse_args(ctx, words)


def plot_option(what: str, by_default: bool = False) -> Callable[[F], F]:
    """Add ``--plot [FILE]`` to a ``PlottingCommand``; if the terminal has it by default, also ``--no-plot``."""
    default = "" if not by_default else "  [default: in the terminal]"
    option = click.option(
        "--plot",
        is_flag=False,
        flag_value=TERMINAL,
        type=_Picture(),
        metavar="[FILE]",
        help=f"Plot {what} to FILE: .png, .svg or .pdf; without FILE in the terminal.{default}",
    )
    if not by_default:
        return option
    none = click.option("--no-plot", is_flag=True, help="Do not plot in the terminal.")
    return lambda command: option(none(command))


def show_result(result: "Result", plot: Path | None, as_json: bool) -> None:
    """Print a result, as JSON or in text, and draw its charts."""
    click.echo(result.to_json() if as_json else result.summary())
    show_plot(plot, result.charts)


def check_plot(plot: Path | None, as_json: bool = False) -> None:
    """Check before the work that the plot can be drawn; a missing library ends the command.

    Raises
    ------
    click.UsageError
        If text and plot would both go to the terminal with --json.
    """
    if plot is None:
        return
    if plot == Path(TERMINAL):
        if as_json:
            raise click.UsageError("--plot without FILE and --json would print over each other; give --plot FILE")
    elif plot.suffix != _WITHOUT_LIBRARY:
        require("matplotlib", extra="plot", otherwise="; or give a FILE.svg, which needs nothing")


def in_terminal(plot: Path | None) -> bool:
    """Return True if no file is written."""
    return plot is None or plot == Path(TERMINAL)


def show_plot(plot: Path | None, charts: "Callable[[], PlottedCharts]", by_default: bool = False) -> None:
    """Draw into the file, or into the terminal if the option has no file or ``by_default``."""
    if plot is None and not by_default:
        return
    plotted = charts()
    if plot is not None and not in_terminal(plot):
        from tablegen.charts.picture_file import picture

        written(plot.parent, {plot.name: picture(plotted.charts, plot.suffix[1:], plotted.heading, plotted.columns)})
        return
    from tablegen.charts.text import text_plot

    unicode = "utf" in (getattr(sys.stdout, "encoding", None) or "").lower()
    width = _width()
    for chart in plotted.shown:
        for line in text_plot(chart, width, unicode):
            paint(line)
        click.echo()


def _width() -> int:
    """Return the characters of a line: COLUMNS, or those of the terminal; without either the terminal is narrow."""
    columns = os.environ.get("COLUMNS", "")
    if columns.isdecimal() and int(columns) > 0:
        return int(columns)
    try:
        return os.get_terminal_size(sys.stdout.fileno()).columns or _NARROW
    except (AttributeError, OSError, ValueError):  # no terminal
        return _NARROW
