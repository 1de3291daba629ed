"""Code that several commands share: from a path to a certified plan, with exit statuses and messages."""

import errno
import importlib.util
import os
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from tablegen.base.installation import install_advice
from tablegen.base.reading import other_than_file
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.progress import Progress

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from tablegen.api.build import Build
    from tablegen.api.turned import TurnedBuild
    from tablegen.config.load import Setup

scan_argument = click.argument("scan", type=click.Path(path_type=Path), metavar="SCAN.TOML")

format_option = click.option(
    "-f",
    "--format",
    "formats",
    multiple=True,
    metavar="NAME",
    help="Output format; repeat the option for several formats. `tablegen formats` lists them.  [default: emit.formats "
    "of the scan file, or c and verilog]",
)


class OutputFile(click.Path):
    """A file to write: a new one, or one that is replaced; never a pipe, a device or a directory.

    Its directory is checked before any work, unless ``always`` is false: another option then decides whether the file
    is written, and the command calls ``check_place``.
    """

    def __init__(self, always: bool = True) -> None:
        super().__init__(path_type=Path)
        self._always = always

    def convert(self, value: Any, parameter: click.Parameter | None, context: click.Context | None) -> Path:
        """Return the path; a usage error names what exists there."""
        path = Path(os.fsdecode(super().convert(value, parameter, context)))
        if other := other_than_file(path):
            self.fail(f"'{path}' is {other}, where a file has to go.", parameter, context)
        if self._always:
            check_place(path)
        return path


class OutputFolder(click.Path):
    """A directory to write into: a new one, or one that is there.

    A new one is checked before any work, unless ``always`` is false, as for ``OutputFile``. One that is there may be up
    to date.
    """

    def __init__(self, always: bool = True) -> None:
        super().__init__(path_type=Path, file_okay=False)
        self._always = always

    def convert(self, value: Any, parameter: click.Parameter | None, context: click.Context | None) -> Path:
        """Return the path; a usage error names what exists there."""
        path = Path(os.fsdecode(super().convert(value, parameter, context)))
        if (other := other_than_file(path)) not in (None, "a directory"):
            self.fail(f"'{path}' is {other}, where a directory has to go.", parameter, context)
        if self._always and not os.path.exists(path):
            check_place(path)
        return path


def check_place(path: Path) -> None:
    """End the command if no file or directory can be written at a path, whose directories may have to be made."""
    folder = next(one for one in path.absolute().parents if os.path.lexists(one))
    if not folder.is_dir():
        fail([f"{path}: {folder} is no directory"], ExitStatus.CANNOT_WRITE)
    if not os.access(folder, os.W_OK | os.X_OK):
        fail([f"{path}: nothing can be written in {folder}: {os.strerror(errno.EACCES)}"], ExitStatus.CANNOT_WRITE)


def finite(_context: click.Context, _option: click.Parameter, value: float | None) -> float | None:
    """Check that a number is finite: click's ranges contain NaN, and infinity if they are open above.

    Raises
    ------
    click.BadParameter
        If it is not.
    """
    if value is not None and not isfinite(value):
        raise click.BadParameter(f"{value} is not a finite number.")
    return value


def require(*modules: str, extra: str, otherwise: str = "") -> None:
    """End the command if modules of an extra are not installed; ``otherwise`` names an alternative."""
    missing = [module for module in modules if not _installed(module)]
    if missing:
        needs = " and ".join(missing)
        fail([f"{needs} is missing; install it with: {install_advice(extra)}{otherwise}"], ExitStatus.TOOL_MISSING)


def _installed(module: str) -> bool:
    try:
        return importlib.util.find_spec(module) is not None
    except ValueError:  # a module that was imported in an unusual way, or is blocked
        return False


class Failure(click.ClickException):
    """Lines for stderr and an exit status."""

    def __init__(self, lines: "Sequence[object]", status: ExitStatus) -> None:
        super().__init__("\n".join(map(str, lines)))
        self.status = status

    def show(self, file: object = None) -> None:
        """Print the lines as they are, without a prefix, so that editors can parse ``file:line:``."""
        click.echo(self.message, err=True)


def fail(lines: "Sequence[object]", status: ExitStatus) -> NoReturn:
    """End the command with a message and a status.

    Raises
    ------
    Failure
        Always.
    """
    raise Failure(lines, status)


strict_option = click.option(
    "--strict",
    is_flag=True,
    help="Treat warnings as errors: exit with status 3, and write nothing.",
)


def quiet_blas() -> None:
    """Limit BLAS to one thread, before numpy is imported: starting further threads is a good part of that import."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def planned(scan: "Path | Setup", formats: "Sequence[str] | None" = None, strict: bool = False) -> "Build":
    """Load, plan and certify a scan; every failure ends the command with its status.

    Warnings go to stderr; with ``strict`` they end the command too.
    """
    quiet_blas()
    from tablegen.api.build import BrokenLimit, build
    from tablegen.base.input_errors import Rejected

    try:
        with Progress() as progress:
            built = build(scan, formats=formats, progress=progress.now)
            progress.now("looking for remedies")
            warnings = built.warnings
    except BrokenLimit as broken:
        fail(broken.problems, ExitStatus.BROKEN_LIMIT)
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)
    _warn(warnings, strict)
    return built


def _warn(warnings: "Sequence[str]", strict: bool) -> None:
    """Print warnings; with ``strict`` they end the command."""
    lines = [f"warning: {warning}" for warning in warnings]
    if lines and strict:
        fail(lines, ExitStatus.BROKEN_LIMIT)
    for line in lines:
        click.echo(line, err=True)


def planned_at_any_angle(
    scan: Path, formats: "Sequence[str] | None" = None, strict: bool = False
) -> "Build | TurnedBuild":
    """Load, plan and certify a scan as ``planned`` does, also one at an angle, on coupled axes or with drift."""
    quiet_blas()
    from tablegen.base.input_errors import Rejected
    from tablegen.config.load import load

    try:
        setup = load(scan)
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)
    return _turned(setup, formats, strict) if setup.mixes_motions else planned(setup, formats, strict)


def _turned(setup: "Setup", formats: "Sequence[str] | None", strict: bool) -> "TurnedBuild":
    from tablegen.api.build import BrokenLimit
    from tablegen.api.turned import build_turned
    from tablegen.base.input_errors import Rejected

    try:
        with Progress() as progress:
            built = build_turned(setup, formats=formats, progress=progress.now)
    except BrokenLimit as broken:
        fail(broken.problems, ExitStatus.BROKEN_LIMIT)
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)
    _warn(built.warnings, strict)
    return built


def rendered(built: "Build | TurnedBuild") -> "dict[str, bytes]":
    """Return the files of a build; a scan that one of its formats cannot hold ends the command."""
    from tablegen.base.input_errors import Rejected

    try:
        with Progress() as progress:
            progress.now("writing the formats")
            return built.files
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)


def written(
    folder: Path, files: "Mapping[str, bytes]", outdated: "Sequence[str] | Callable[[], Sequence[str]]" = ()
) -> list[str]:
    """Write files and return the names of those that changed; a failure or an interruption ends the command.

    Files that are ``outdated`` are removed; a function for them is called while no other build writes.

    An interruption waits until all files are in place, so that none is left half renamed; a second one does not wait.
    """
    from tablegen.base.interruption import ENDINGS, defer_signals
    from tablegen.emit.write import CannotWrite, NoPlace, write_files

    try:
        with defer_signals(*ENDINGS) as came:
            names = write_files(folder, files, outdated)
    except NoPlace as error:
        fail([error], ExitStatus.WRONG_INPUT)
    except CannotWrite as error:
        fail([error], ExitStatus.CANNOT_WRITE)
    except OSError as error:
        fail([f"{folder}: {error.strerror or error}"], ExitStatus.CANNOT_WRITE)
    if came:
        fail([f"interrupted, after the files of {folder} had been written"], ExitStatus.INTERRUPTED)
    return names
