"""``tablegen upload``: send a scan to a running device."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tablegen.cli.device.connection import (
    baud_option,
    connected,
    key_option,
    port_option,
    read_scan,
    source_argument,
    swap_option,
    timeout_option,
)
from tablegen.cli.device.kept import SLOT, saved
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.progress_bar import Bar

if TYPE_CHECKING:
    from tablegen.link.device import Device
    from tablegen.link.outcome import UploadResult
    from tablegen.link.prepare import Form, PreparedScan
    from tablegen.link.program_image import ProgramImage

_HASH_DIGITS = 12  # digits of a hash in messages
_BEGIN_AND_COMMIT_BYTES = 60 + 16  # bytes of BEGIN and COMMIT on the wire
_DATA_OVERHEAD_BYTES = 16  # bytes of a DATA frame beside its payload
_BITS_PER_BYTE = 10


@click.command(short_help="Send a scan to a running device over a serial port.")
@source_argument
@port_option(required=False)
@baud_option
@click.option(
    "--as",
    "form",
    type=click.Choice(("auto", "table", "fourier")),
    default="auto",
    show_default=True,
    help="Send tables, or Fourier words from which the device computes its tables. auto sends the smaller of those "
    "that the device supports, for each axis.",
)
@click.option(
    "--dry-run",
    is_flag=True,
    help="Send nothing. Print sizes and transfer times; with --port, also whether the device would accept the scan.",
)
@swap_option
@click.option(
    "--store",
    type=SLOT,
    metavar="SLOT",
    help="Then keep the scan in this slot of the flash of the device, as `tablegen save` does.",
)
@key_option
@click.option("--force", is_flag=True, help="Send the scan even if it is active already.")
@click.option(
    "--any-rate", is_flag=True, help="Accept a device whose tick rate differs from update_rate_hz of the scan."
)
@timeout_option("Stop after S seconds.  [default: 15 s plus 4 times the transfer time, plus the delay of late answers]")
def upload(
    source: Path,
    port: str | None,
    baud: int,
    form: "Form",
    dry_run: bool,
    swap: str,
    store: int | None,
    key_file: Path | None,
    force: bool,
    any_rate: bool,
    timeout: float | None,
) -> int:
    """Send a scan to a running device. The device plays its old scan until the first line of the new one starts.

    SCAN.TOML is a scan file; DIR is a directory that `tablegen build` wrote.

    Before it sends, the command checks the scan against the limits of the device; the device checks it again. An
    interrupted upload continues where it stopped. If the port disappears, the command opens it again.

    \b
    Examples:
      tablegen upload annexin_200nm.toml --port /dev/ttyUSB0
      tablegen upload build --port socket://192.168.0.7:5000
      tablegen upload build --port COM4 --swap keep            the frame goes on
      tablegen upload build --port COM4 --store 1              keep it without power
      tablegen upload build --dry-run                          print sizes and transfer times

    \b
    Exit status: 0 the scan is active, 2 wrong input, 5 the device plays a different scan,
    6 pyserial is missing, 7 no port, 8 no answer, 9 refused, 10 link lost or timeout,
    12 invalid answers.
    """
    if port is None and not dry_run:
        raise click.UsageError("--port is missing; `tablegen ports` lists those of this machine")
    scan = read_scan(source)
    if dry_run:
        click.echo("\n".join(_sizes(scan, baud)))
    if port is None:
        return ExitStatus.OK
    bar = Bar()
    from tablegen.device.commit_mode import CommitMode
    from tablegen.link.messages import DeviceState
    from tablegen.link.prepare import check

    mode = CommitMode[swap.upper()]

    with connected(port, baud, key_file, goes_on="with its old scan") as device:
        limits = device.limits()
        image = scan.image(form, device.info)
        check(scan, image, device.info, limits, any_rate, mode)
        if store is not None:
            tables = len(scan.image("table").data)
            device.slots().check(store, tables, device.status().state in (DeviceState.PLAYING, DeviceState.PARKING))
        if dry_run:
            click.echo(_verdict(device, image, force))
            return ExitStatus.OK
        try:
            result = device.upload(image, bar, force=force, timeout_s=timeout, limits=limits, swap=mode)
        finally:
            bar.close()
        click.echo(_summary(scan, image, result))
        if store is not None:
            device.save(store, result.generation)
            click.echo(saved(device, store))
        if device.hello.state == DeviceState.PARKED:
            click.echo("the device is parked; start the scan with `tablegen trigger`")
    return ExitStatus.OK


def _sizes(scan: "PreparedScan", baud: int) -> list[str]:
    """Return bytes and seconds of both forms."""
    from tablegen.link.errors import Unsuitable
    from tablegen.link.messages import DATA_BYTES

    lines = [f"{scan.name} {scan.digest[:_HASH_DIGITS]}", "", f"form       bytes  at {baud} baud"]
    forms: tuple[Form, ...] = ("table", "fourier")
    for form in forms:
        try:
            size = len(scan.image(form).data)
        except Unsuitable as error:
            lines.append(f"{form:<8}  none: {error.objections[0]}")
            continue
        wire = size + _DATA_OVERHEAD_BYTES * -(-size // DATA_BYTES) + _BEGIN_AND_COMMIT_BYTES
        seconds = f"{wire * _BITS_PER_BYTE / baud:.3f} s"
        lines.append(f"{form:<8}  {size:>6}  {seconds:>{len(f'at {baud} baud')}}")
    return lines


def _verdict(device: "Device", image: "ProgramImage", force: bool) -> str:
    """Describe the outcome of an upload; raise ``Refused`` where the device has a key and none was given."""
    status = device.hello
    if status.hash == image.info.hash and not force:
        return "\nthe scan is already active on the device"
    keyed = device.needs_key()
    text = f"\nthe device would accept the scan: {len(image.data)} bytes as {_form(image)}"
    text += ", if the key is right, which only an upload shows" if keyed else ""
    return text if status.permits else f"{text}, but its interlock is open: no upload can become active"


def _form(image: "ProgramImage") -> str:
    from tablegen.link.prepare import harmonics_of

    rendered = [harmonics > 0 for harmonics in harmonics_of(image.data)]
    return "Fourier words" if all(rendered) else "tables and Fourier words" if any(rendered) else "tables"


def _summary(scan: "PreparedScan", image: "ProgramImage", result: "UploadResult") -> str:
    name = f"{scan.name} {scan.digest[:_HASH_DIGITS]}"
    if result.already_running:
        return f"{name} is already active, generation {result.generation}: nothing sent (--force sends it again)"
    text = f"{name} is active, generation {result.generation}"
    if result.line is not None:
        text += f", after line {result.line} of the old scan"
    rate = (
        f" ({result.bytes / result.seconds / 1000.0:.1f} kB/s)" if result.seconds > 0.0 and not result.resumed else ""
    )
    text += f"\n{result.bytes} bytes as {_form(image)} in {result.seconds:.2f} s{rate}"
    if result.resumed:
        text += f"; the device already had {result.resumed} bytes"
    if result.retransmissions:
        text += f"; {result.retransmissions} frames retransmitted"
    if result.restarts:
        from tablegen.link.outcome import restart_count

        text += f"\n{restart_count(result.restarts)} It lost what it had received, and its old scan ended"
    if result.slow_baud:
        text += f"\nthe line is slow: answers come at about {result.slow_baud} baud (--baud {result.slow_baud})"
    return text
