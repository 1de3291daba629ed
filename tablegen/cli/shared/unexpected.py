"""Report an unexpected error: a message, its own exit status, and how to see the traceback."""

import errno
import os
import platform
import traceback
from pathlib import Path
from types import TracebackType

import click

from tablegen.base.input_errors import shortened
from tablegen.base.plugins import PluginFailed, cause, loaded, responsible
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.version import __version__

VARIABLE = "TABLEGEN_TRACEBACK"
_PACKAGE = Path(__file__).resolve().parents[2]
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_SHOW = f"set {VARIABLE}=1 and run the command again to see the traceback"


def report(error: BaseException) -> ExitStatus:
    """Print what happened and what to do, and return the exit status; the traceback too if ``VARIABLE`` is set."""
    with_traceback = os.environ.get(VARIABLE, "") not in ("", "0")
    if with_traceback:
        click.echo("".join(traceback.format_exception(error)), err=True, nl=False)
    lines, status = _explained(error)
    if not with_traceback:
        lines[-1] += f"; {_SHOW}"
    click.echo("\n".join(lines), err=True)
    return status


def _explained(error: BaseException) -> tuple[list[str], ExitStatus]:
    if isinstance(error, PluginFailed):
        return [shortened(str(error), 1000)], ExitStatus.WRONG_INPUT
    if home := responsible(error.__traceback__):
        what = f"a plug-in of {home} failed: {cause(error)}"
        return [what, f"report it to the authors of {home}, or do without its formats and models"], (
            ExitStatus.WRONG_INPUT
        )
    if isinstance(error, MemoryError):
        what = f"not enough memory: {cause(error)}{_place(error.__traceback__)}"
        return [what, "close other programs, or compute less at a time: a smaller file, or fewer --jobs"], (
            ExitStatus.UNEXPECTED
        )
    if isinstance(error, OSError):
        return _explained_os_error(error)
    what = f"internal error: {cause(error)}{_place(error.__traceback__)}"
    others = "".join(f", {name}" for name in loaded())
    versions = f"tablegen {__version__}, Python {platform.python_version()}, {platform.system()}{others}"
    return [
        what,
        "this is a fault of tablegen, not of your input; please report it with the command, its input, this message "
        f"and the traceback ({versions})",
    ], ExitStatus.UNEXPECTED


def _explained_os_error(error: OSError) -> tuple[list[str], ExitStatus]:
    """Explain an error of the system: a full disk is no fault of the program."""
    place = shortened(f"{os.fsdecode(error.filename)}: ") if isinstance(error.filename, str | bytes) else ""
    why = error.strerror or str(error) or type(error).__name__
    if error.errno in _NO_ROOM:
        return [f"{place}cannot write: {why}; make room and run the command again"], ExitStatus.CANNOT_WRITE
    what = f"{place}{why}{_place(error.__traceback__)}"
    return [what, "the system refused what the command needs; check the file, its permissions and limits"], (
        ExitStatus.UNEXPECTED
    )


def _place(trace: TracebackType | None) -> str:
    """Return the innermost line of this package that was running, as `` (cli/show.py:40)``."""
    place = ""
    while trace is not None:
        path = Path(trace.tb_frame.f_code.co_filename)
        if path.is_relative_to(_PACKAGE):
            place = f" ({path.relative_to(_PACKAGE).as_posix()}:{trace.tb_lineno})"
        trace = trace.tb_next
    return place
