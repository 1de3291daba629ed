"""Code that the commands of a device share: options, the connection, and the exit statuses of its errors."""

import binascii
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from tablegen.base.reading import KEY, read_text
from tablegen.cli.shared.common import fail, planned_at_any_angle
from tablegen.cli.shared.exit_status import ExitStatus

if TYPE_CHECKING:
    from tablegen.link.device import Device
    from tablegen.link.prepare import PreparedScan

Command = TypeVar("Command", bound=Callable[..., Any])
_KEY_BYTES = range(16, 33)
_OF_SLOTS = ("SAVE", "SELECT", "CONFIRM", "DELETE")
_OF_OTHERS = 0o077  # permissions of a group and of others

baud_option = click.option(
    "--baud",
    type=click.IntRange(min=300, max=100_000_000),
    default=115200,
    show_default=True,
    envvar="TABLEGEN_BAUD",
    show_envvar=True,
    metavar="RATE",
    help="Baud rate of the serial line in bit/s. For socket:// it only sets timeouts.",
)
key_option = click.option(
    "--key-file",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="File with the key of the device, 16 to 32 bytes in hexadecimal. Needed if the device has a key.",
)
source_argument = click.argument("source", type=click.Path(path_type=Path), metavar="SCAN.TOML|DIR")


def port_option(required: bool = True) -> Callable[[Command], Command]:
    """Return the option ``--port``."""
    return click.option(
        "--port",
        required=required,
        envvar="TABLEGEN_PORT",
        show_envvar=True,
        metavar="URL",
        help="Serial port or pyserial URL of the device: /dev/ttyUSB0, COM3, socket://host:port, rfc2217://host:port. "
        "`tablegen ports` lists the serial ports of this machine.",
    )


def timeout_option(what: str) -> Callable[[Command], Command]:
    """Return the option ``--timeout``; ``what`` names what it limits, and its default."""
    return click.option("--timeout", type=click.FloatRange(min=0.1, max=1e6), metavar="S", help=what)


swap_option = click.option(
    "--swap",
    type=click.Choice(("line", "keep", "frame")),
    default="line",
    show_default=True,
    help="When a running device starts the new scan. line: at the next line start, from the first line of a frame. "
    "keep: at the next line start, and the frame goes on with its next line. frame: at the next frame start.",
)


@contextmanager
def connected(port: str, baud: int, key_file: Path | None, goes_on: str = "as before") -> "Iterator[Device]":
    """Connect to a device until the end of the block; an error in the block ends the command with its status.

    ``goes_on`` says how a device continues that got no request before the command was interrupted.
    """
    key = None if key_file is None else _read_key(key_file)
    from tablegen.link import errors
    from tablegen.link.device import Device

    # The first kind that matches counts.
    statuses = (
        (errors.SerialMissing, ExitStatus.TOOL_MISSING),
        (errors.NoPort, ExitStatus.NO_PORT),
        (errors.NoAnswer, ExitStatus.NO_ANSWER),
        (errors.NotUnderstood, ExitStatus.INVALID_ANSWER),
        (errors.Refused, ExitStatus.REFUSED),
        (errors.Unsuitable, ExitStatus.REFUSED),
        (errors.NotPlaying, ExitStatus.MISMATCH),
        (errors.LinkError, ExitStatus.LINK_LOST),
    )
    open_device: Device | None = None
    try:
        with Device(port, baud=baud, key=key) as device:
            open_device = device
            yield device
    except errors.LinkError as error:
        fail([error], next(status for kind, status in statuses if isinstance(error, kind)))
    except KeyboardInterrupt:
        fail([f"interrupted; {_interrupted_state(open_device, goes_on)}"], ExitStatus.INTERRUPTED)


def _interrupted_state(device: "Device | None", goes_on: str) -> str:
    """Describe the state of a device when a command is interrupted."""
    from tablegen.link.messages import Request

    upload = None if device is None else device.upload_state
    if upload is not None and upload.committed:
        return "everything was sent, and the new scan may become active: see `tablegen status`"
    if upload is not None and upload.confirmed:
        return (
            f"the device plays its old scan and keeps {upload.confirmed} of {upload.total} bytes: run the same command "
            "to continue the upload"
        )
    acts = [] if device is None else [act.name for act in device.acts if act != Request.COMMIT]
    if acts:
        look = "slots" if any(act in _OF_SLOTS for act in acts) else "status"
        return f"the device may have carried out {' and '.join(dict.fromkeys(acts))}: see `tablegen {look}`"
    return f"the device continues {goes_on}"


def _read_key(path: Path) -> bytes:
    try:
        key = binascii.unhexlify("".join(read_text(path, KEY, "ascii").split()))
        mode = path.stat().st_mode
    except OSError as error:
        fail([f"{path}: cannot be read: {error.strerror or error}"], ExitStatus.WRONG_INPUT)
    except ValueError:  # also raised for text that is not ASCII
        fail([f"{path}: the file must contain 32 to 64 hexadecimal digits and nothing else"], ExitStatus.WRONG_INPUT)
    if len(key) not in _KEY_BYTES:
        fail([f"{path}: the key has {len(key)} bytes; 16 to 32 are needed"], ExitStatus.WRONG_INPUT)
    if os.name == "posix" and mode & _OF_OTHERS:
        click.echo(
            f"warning: {path}: others can read the key (mode {mode & 0o777:04o}): run `chmod 600 {path}`, and give "
            "device and host a new key if somebody may have read this one",
            err=True,
        )
    return key


def read_scan(source: Path) -> "PreparedScan":
    """Read the scan of a TOML file, or of a directory that ``tablegen build`` wrote."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from tablegen.link.errors import Unsuitable
    from tablegen.link.prepare import PreparedScan
    from tablegen.manifest.read import NotABuild

    try:
        if not source.is_dir():
            return planned_at_any_angle(source).prepared
        return PreparedScan.of_build(source)
    except (NotABuild, Unsuitable) as error:
        fail([error], ExitStatus.WRONG_INPUT)
