"""The option ``--plot``: a picture into a file, or in characters into the terminal; the same of every command."""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from tablegen.cli.shared.common import OutputFile, require, written
from tablegen.cli.shared.terminal import paint

if TYPE_CHECKING:
    from tablegen.charts.picture_file import PlottedCharts

F = TypeVar("F", bound=Callable[..., Any])
TERMINAL = "-"  # in place of a file
_ENDINGS = (".png", ".svg", ".pdf")
_WITHOUT_LIBRARY = ".svg"
_NARROW = 80  # characters, where nobody says how wide the terminal is


class _Picture(OutputFile):
    """A file whose name ends as pictures do, or the terminal."""

    def convert(self, value: Any, parameter: click.Parameter | None, context: click.Context | None) -> Path:
        """The path; a usage error says what would do."""
        if value == TERMINAL:
            return Path(TERMINAL)
        path = super().convert(value, parameter, context)
        if path.suffix not in _ENDINGS:
            self.fail(f"'{path}': the name has to end in .png, .svg or .pdf.", parameter, context)
        return path


class PlottingCommand(click.Command):
    """A command with ``--plot [FILE]``; a file after it that is there and is no picture is an argument."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Say that the terminal is meant where no file of a picture follows."""
        words = []
        for at, word in enumerate(args):
            other = Path(args[at + 1] if at + 1 < len(args) else "")
            plain = word == "--plot" and other.suffix not in _ENDINGS and other.is_file()
            words.append(f"--plot={TERMINAL}" if plain else word)
        return super().parse_args(ctx, words)


def plot_option(what: str, by_default: bool = False) -> Callable[[F], F]:
    """Add ``--plot [FILE]`` to a ``PlottingCommand``; where a terminal gets it without asking, ``--no-plot`` too."""
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


def check_plot(plot: Path | None, as_json: bool = False) -> None:
    """End the command where it could not be drawn."""
    if plot is None:
        return
    if plot == Path(TERMINAL):
        if as_json:
            raise click.UsageError("--plot without FILE and --json would print over each other; give --plot FILE")
    elif plot.suffix != _WITHOUT_LIBRARY:
        require("matplotlib", extra="plot", otherwise="; or give a FILE.svg, which needs nothing")


def in_terminal(plot: Path | None) -> bool:
    """Whether no file is written."""
    return plot is None or plot == Path(TERMINAL)


def put_plot(plot: Path | None, charts: "Callable[[], PlottedCharts]", by_default: bool = False) -> None:
    """Draw into the file, or into the terminal where that was asked for or is done ``by_default``."""
    if plot is None and not by_default:
        return
    found = charts()
    if plot is not None and not in_terminal(plot):
        from tablegen.charts.picture_file import picture

        written(plot.parent, {plot.name: picture(found.charts, plot.suffix[1:], found.heading, found.columns)})
        return
    from tablegen.charts.text import text_plot

    unicode = "utf" in (getattr(sys.stdout, "encoding", None) or "").lower()
    width = _width()
    for chart in found.shown:
        for line in text_plot(chart, width, unicode):
            paint(line)
        click.echo()


def _width() -> int:
    """Characters of a line: what COLUMNS says, or the terminal; without either it is narrow."""
    said = os.environ.get("COLUMNS", "")
    if said.isdecimal() and int(said) > 0:
        return int(said)
    try:
        return os.get_terminal_size(sys.stdout.fileno()).columns or _NARROW
    except (AttributeError, OSError, ValueError):  # no terminal
        return _NARROW
