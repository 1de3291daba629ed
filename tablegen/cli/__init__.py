"""The command line. Results go to stdout, messages to stderr; ``shared/exit_status.py`` has the exit statuses.

Commands import what they need when they run, so that ``--version`` and ``--help`` answer at once.
"""

import errno
import gc
import sys
from importlib import import_module
from typing import IO

import click

from tablegen.base.interruption import endings_interrupt
from tablegen.cli.shared.common import Failure
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.terminal import guard_streams
from tablegen.version import __version__

# Python searches for cycles of objects whenever there are 700 more, which takes nearly a tenth of a build, though
# almost all objects belong to modules and stay. The garbage of this many objects between two searches is small.
_OBJECTS_BETWEEN_SEARCHES = 50_000

# Commands by name: the module in this folder, and the command in it.
_COMMANDS = {
    "build": ("build", "build"),
    "sweep": ("sweep", "sweep"),
    "check": ("check", "check"),
    "show": ("show", "show"),
    "tables": ("tables", "tables"),
    "report": ("report", "report"),
    "compare": ("compare", "compare"),
    "calibrate": ("calibrate.group", "calibrate"),
    "channels": ("images.channels", "channels"),
    "lattice": ("images.lattice", "lattice"),
    "drift": ("images.drift", "drift"),
    "simulate": ("simulate", "simulate"),
    "predict": ("predict", "predict"),
    "refine": ("images.refine", "refine"),
    "correct": ("images.correct", "correct"),
    "verify": ("verify", "verify"),
    "upload": ("device.upload", "upload"),
    "live": ("device.live", "live"),
    "status": ("device.status", "device_status"),
    "readback": ("device.readback", "readback"),
    "park": ("device.control", "park"),
    "trigger": ("device.control", "trigger"),
    "clear": ("device.control", "clear"),
    "save": ("device.kept", "save"),
    "slots": ("device.kept", "slots"),
    "select": ("device.kept", "select"),
    "confirm": ("device.kept", "confirm"),
    "delete": ("device.kept", "delete"),
    "play": ("device.play", "play"),
    "ports": ("device.ports", "ports"),
    "init": ("init", "init"),
    "runtime": ("runtime", "runtime"),
    "formats": ("formats", "formats"),
    "paths": ("paths", "paths"),
    "schema": ("schema", "schema"),
}


class _Commands(click.Group):
    """Commands that are imported on demand: a build is called often, and needs one of them."""

    def list_commands(self, _context: click.Context) -> list[str]:
        return sorted(_COMMANDS)

    def get_command(self, _context: click.Context, name: str) -> click.Command | None:
        if name not in _COMMANDS:
            return None
        module, command = _COMMANDS[name]
        imported: click.Command = getattr(import_module(f"tablegen.cli.{module}"), command)
        return imported

    def invoke(self, context: click.Context) -> object:
        """Run a command; click takes every broken pipe for that of stdout, and ends without a message.

        Raises
        ------
        OSError
            If the command raises it, but for a broken pipe that is not stdout.
        """
        try:
            return super().invoke(context)
        except OSError as error:
            if error.errno == errno.EPIPE and not _of_stdout(error):
                raise _OtherPipe from error
            raise


class _OtherPipe(Exception):
    """A broken pipe that is not stdout: of a process that a command started."""


@click.group(
    cls=_Commands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="""\b
First steps:
  tablegen init demo                               write an example: scanner.toml and a scan
  tablegen show demo/annexin_200nm.toml            show drive, rates and accuracy; write nothing
  tablegen build demo/annexin_200nm.toml -o build  write C, Verilog, tables and manifest.json
  tablegen verify build                            simulate the Verilog and check every sample
  tablegen upload build --port COM3                send the scan to a running instrument

\b
Exit status of all commands:
    0 done
    1 output is stale (build --check), or A and B differ (compare)
    2 wrong input or wrong usage
    3 a limit of the certificate is exceeded
    4 cannot write
    5 a build fails verification, or the device plays a different scan
    6 a simulator, compiler or library is missing
    7 no port: the serial port cannot be opened
    8 no answer from the device
    9 refused by the device
   10 link lost, or timeout
   11 some scans of a sweep could not be built; the others were
   12 invalid answers of the device
   70 unexpected error; the message says what to report
  130 interrupted, by Ctrl-C, SIGTERM or SIGHUP""",
)
@click.version_option(__version__, prog_name="tablegen", message="%(prog)s %(version)s")
def cli() -> None:
    """Compute scan waveforms that compensate the errors of a piezo scanner, and write them as C and Verilog.

    The input is a scan file (SCAN.TOML): what to image. It names a scanner file: the calibrated parameters of one
    scanner. Names of quantities contain the unit, such as size_nm. All voltages are voltages at the piezo.

    `tablegen COMMAND --help` explains each command.

    TABLEGEN_TRACEBACK=1 in the environment shows the traceback of an unexpected error.
    """


def main() -> None:
    """Run the command line and exit with its status."""
    gc.set_threshold(_OBJECTS_BETWEEN_SEARCHES)
    status = _run()
    gc.freeze()  # memory goes with the process: a search for cycles would take a tenth of a build
    sys.exit(status)


def _run() -> int:
    guard_streams()
    stdout = sys.stdout
    try:
        with endings_interrupt():
            result = cli.main(standalone_mode=False)
        if sys.stdout is not None:  # it is None where the caller closed it
            sys.stdout.flush()
        return int(result or 0)
    except BaseException as error:
        return _ended(error, stdout)


def _ended(error: BaseException, stdout: IO[str] | None) -> int:
    """Explain what ended a command, and return its status; ``stdout`` is the stream from before it ran."""
    if isinstance(error, click.ClickException):
        error.show()
        return error.status if isinstance(error, Failure) else error.exit_code
    if isinstance(error, click.Abort | KeyboardInterrupt):
        return _interrupted(error)
    if isinstance(error, _OtherPipe) and error.__cause__ is not None:
        return _unexpected(error.__cause__)
    if isinstance(error, SystemExit):
        return _exited(error, stdout)
    if isinstance(error, OSError) and _of_stdout(error):
        if isinstance(error, BrokenPipeError):
            return _closed_pipe()
        sys.stdout = None
        click.echo(f"cannot write to stdout: {error.strerror or error}", err=True)
        return ExitStatus.CANNOT_WRITE
    return _unexpected(error)


def _interrupted(error: BaseException) -> int:
    if isinstance(error.__cause__, EOFError):  # click takes it for an end of input; there is no prompt here
        return _unexpected(error.__cause__)
    where = str(error.__cause__ or "") or str(error)  # an interruption of a plug-in names it
    click.echo(f"interrupted {where}".rstrip(), err=True)
    return ExitStatus.INTERRUPTED


def _exited(end: SystemExit, stdout: IO[str] | None) -> int:
    """Return the status of an exit by click: after a broken pipe, where it replaces stdout, or after completion."""
    if sys.stdout is not stdout:
        return _closed_pipe()
    if isinstance(end.code, int) and _raised_in(end, "click"):
        return end.code
    return _unexpected(end)


def _of_stdout(error: OSError) -> bool:
    """Return True if text for stdout or stderr could not be written, and not a file or another pipe."""
    return error.filename is None and _raised_in(error, "click", "tablegen.cli")


def _raised_in(error: BaseException, *packages: str) -> bool:
    """Return True if the innermost frame of an exception is of a module of one of these packages."""
    trace, name = error.__traceback__, ""
    while trace is not None:
        name = str(trace.tb_frame.f_globals.get("__name__", ""))
        trace = trace.tb_next
    return any(name == package or name.startswith(f"{package}.") for package in packages)


def _unexpected(error: BaseException) -> int:
    """Explain an unexpected error; a traceback of Python would end with status 1, which means something else."""
    try:
        from tablegen.cli.shared.unexpected import report

        return report(error)
    except Exception:  # an installation that lacks what the report needs
        click.echo(f"internal error: {type(error).__name__}: {error}", err=True)
        return ExitStatus.UNEXPECTED


def _closed_pipe() -> int:
    """Return the status after the reader of a pipe closed it; Python's own flush at exit must not complain."""
    sys.stdout = None
    return ExitStatus.OK
