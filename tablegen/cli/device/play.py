"""``tablegen play``: play a scan that a device has itself."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tablegen.cli.device.connection import (
    baud_option,
    connected,
    key_option,
    port_option,
    swap_option,
    timeout_option,
)
from tablegen.cli.shared.common import fail
from tablegen.cli.shared.exit_status import ExitStatus

if TYPE_CHECKING:
    from tablegen.link.device import Device

_HASH_DIGITS = 12  # digits of a hash in messages
_NUMBER_DIGITS = 5  # at most; 12 or more digits are those of a hash


@click.command(short_help="Play a scan that a device has itself.")
@click.argument("program", metavar="NUMBER|NAME|HASH")
@port_option()
@baud_option
@key_option
@swap_option
@timeout_option("Stop after S seconds.  [default: 60; 600 with --swap frame]")
def play(program: str, port: str, baud: int, key_file: Path | None, swap: str, timeout: float | None) -> int:
    """Play a scan that a device has itself: one that was compiled with its firmware, or one that a slot keeps.

    `tablegen slots` lists them with their numbers. HASH are the first 12 or more digits of a hash. The device makes the
    same checks as of an upload, and plays its old scan until the first line of the new one. What plays after a start
    does not change: `tablegen select` chooses that.

    \b
    Examples:
      tablegen play 3 --port /dev/ttyUSB0
      tablegen play annexin_size_nm_40 --port COM4
      tablegen play 3 --swap keep --port COM4                  the frame goes on

    \b
    Exit status: 0 the scan is active, 2 wrong usage, 6 pyserial is missing, 7 no port, 8 no answer,
    9 refused, 10 link lost or timeout, 12 invalid answers.
    """
    from tablegen.device.commit_mode import CommitMode
    from tablegen.link.messages import DeviceState

    with connected(port, baud, key_file, goes_on="with its old scan") as device:
        number = _number(device, program)
        result = device.play(number, swap=CommitMode[swap.upper()], timeout_s=timeout)
        status = device.status()
        click.echo(f"program {number} ({status.hash.hex()[:_HASH_DIGITS]}) is active, generation {result.generation}")
        if status.state == DeviceState.PARKED:
            click.echo("the device is parked; start the scan with `tablegen trigger`")
    return ExitStatus.OK


def _number(device: "Device", program: str) -> int:
    """Return the number of a program that is named by its number, its name or its hash."""
    from tablegen.link.programs import named

    if program.isascii() and program.isdigit() and len(program) <= _NUMBER_DIGITS:
        return int(program)
    entry = named(device.programs(), program)
    if entry is None:
        fail([f"the device has no program '{program}'; `tablegen slots` lists those that it has"], ExitStatus.REFUSED)
    return entry.number
