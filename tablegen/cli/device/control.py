"""``tablegen park``, ``trigger`` and ``clear``: control the scan of a device."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tablegen.cli.device.connection import baud_option, connected, key_option, port_option, timeout_option
from tablegen.cli.shared.common import fail
from tablegen.cli.shared.exit_status import ExitStatus

if TYPE_CHECKING:
    from tablegen.link.device import Device
    from tablegen.link.messages import DeviceStatus

_PARK_WAIT_S = 60.0
_START_WAIT_S = 1.0
_LOOKS = 20  # times that the status is read until it shows a request, which acts on the next tick


@click.command(short_help="Stop the scan of a device and ramp to the park codes.")
@port_option()
@baud_option
@key_option
@click.option("--wait", is_flag=True, help="Wait until the outputs have reached the park codes.")
@timeout_option("With --wait: stop waiting after S seconds.  [default: 60]")
def park(port: str, baud: int, key_file: Path | None, wait: bool, timeout: float | None) -> int:
    """Stop the scan, ramp both axes to the park codes within the slew limit, and hold them.

    \b
    Example:
      tablegen park --wait --port /dev/ttyUSB0

    \b
    Exit status: 0 done, 6 pyserial is missing, 7 no port, 8 no answer, 9 refused, or the device
    still plays, 10 link lost or timeout, 12 invalid answers.
    """
    from tablegen.link.messages import DeviceState

    with connected(port, baud, key_file) as device:
        device.park()
        if wait:
            device.wait_for(DeviceState.PARKED, _PARK_WAIT_S if timeout is None else timeout)
        status = _look(device, lambda status: status.state != DeviceState.PLAYING)
    if status.state == DeviceState.PLAYING:
        fail(
            ["the device took the request to park, but still plays; see `tablegen status`, and try again"],
            ExitStatus.REFUSED,
        )
    texts = {
        DeviceState.NO_PROGRAM: "the device has no scan yet, and nothing to park",
        DeviceState.PARKED: "parked",
        DeviceState.PARKING: "ramping to the park codes",
    }
    click.echo(texts[status.state])
    return ExitStatus.OK


def _look(device: "Device", shows: "Callable[[DeviceStatus], bool]") -> "DeviceStatus":
    """Return the first status for which ``shows`` is true, or the last one after some trials."""
    status = device.status()
    for _ in range(_LOOKS):
        if shows(status):
            break
        status = device.status()
    return status


@click.command(short_help="Start the scan of a device.")
@port_option()
@baud_option
@key_option
@click.option(
    "--frames",
    type=click.IntRange(min=0, max=1 << 31),
    default=0,
    metavar="N",
    show_default=True,
    help="Number of frames to play; 0 plays until `tablegen park`.",
)
def trigger(port: str, baud: int, key_file: Path | None, frames: int) -> int:
    """Arm and trigger the device: it plays N frames of the active scan. Prints whether it plays.

    \b
    Examples:
      tablegen trigger --port /dev/ttyUSB0
      tablegen trigger --frames 10 --port /dev/ttyUSB0

    \b
    Exit status: 0 done, 6 pyserial is missing, 7 no port, 8 no answer, 9 refused, or the device
    does not play, 10 link lost, 12 invalid answers.
    """
    from tablegen.link.errors import OutOfTime
    from tablegen.link.messages import DeviceState

    with connected(port, baud, key_file) as device:
        before = device.status()
        if before.state == DeviceState.NO_PROGRAM:
            fail(["the device has no scan yet; send one with `tablegen upload`"], ExitStatus.REFUSED)
        if before.state == DeviceState.PLAYING:
            if frames:
                fail(
                    ["the device already plays, so --frames would have no effect; run `tablegen park --wait` first"],
                    ExitStatus.REFUSED,
                )
            click.echo(f"already playing, line {before.line}")
            return ExitStatus.OK
        device.arm(frames)
        device.trigger()
        try:
            device.wait_for(DeviceState.PLAYING, _START_WAIT_S)
        except OutOfTime:
            if not frames:
                fail(["triggered, but the device does not play; see `tablegen status`"], ExitStatus.REFUSED)
            click.echo(f"triggered; {_frames(frames)} over, or the scan did not start: see `tablegen status`")
            return ExitStatus.OK
    click.echo(f"plays {_frames(frames)}" if frames else "plays until it is parked")
    return ExitStatus.OK


def _frames(count: int) -> str:
    return "1 frame" if count == 1 else f"{count} frames"


def _has_faults(status: "DeviceStatus") -> bool:
    return bool(status.faults or (status.z is not None and status.z.faults))


@click.command(short_help="Clear the faults of a device.")
@port_option()
@baud_option
@key_option
def clear(port: str, baud: int, key_file: Path | None) -> int:
    """Clear the fault flags and fault counters of a device.

    The output `valid` goes high again at the next line without a fault.

    \b
    Example:
      tablegen clear --port /dev/ttyUSB0

    \b
    Exit status: 0 done, 6 pyserial is missing, 7 no port, 8 no answer, 9 refused, or the faults
    come again, 10 link lost, 12 invalid answers.
    """
    with connected(port, baud, key_file) as device:
        device.clear()
        status = _look(device, lambda status: not _has_faults(status))
    if _has_faults(status):
        fail(["the device took the request, but has faults; see `tablegen status`"], ExitStatus.REFUSED)
    click.echo("faults cleared")
    return ExitStatus.OK
