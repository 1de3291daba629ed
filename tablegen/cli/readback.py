"""``tablegen readback``: what a device plays, byte for byte."""

from pathlib import Path

import click

from tablegen.cli.common import fail, written
from tablegen.cli.connection import baud_option, connected, key_option, port_option, read_scan, timeout_option
from tablegen.cli.exit_status import ExitStatus


@click.command(short_help="Read back what a device plays; compare, or save it.")
@click.argument("source", type=click.Path(path_type=Path), metavar="[SCAN.TOML|DIR]", required=False)
@port_option()
@baud_option
@key_option
@click.option(
    "-o", "--output", type=click.Path(path_type=Path, dir_okay=False), metavar="FILE", help="Write the image there."
)
@timeout_option("Bounds everything.  [default: 15 s and 4 times what the line takes]")
def readback(
    source: Path | None, port: str, baud: int, key_file: Path | None, output: Path | None, timeout: float | None
) -> int:
    """Read the scan that plays out of the memory of a device, and compare it with a scan or a build, word by word.

    \b
      tablegen readback build --port /dev/ttyUSB0
      tablegen readback -o playing.bin --port /dev/ttyUSB0
    Exit status: 0 the same, 5 different (with the first difference), 9 the device does not
    hold the image, and those of `tablegen upload`.
    """
    if source is None and output is None:
        raise click.UsageError("name a scan or a build to compare with, or a file to write (-o FILE)")
    scan = None if source is None else read_scan(source)
    with connected(port, baud, key_file) as device:
        image = device.readback(timeout_s=timeout)
    if output is not None:
        written(output.parent, {output.name: image})
        click.echo(f"{output}: {len(image)} bytes")
    if scan is not None:
        from tablegen.link.difference import differences

        found = differences(scan, image)
        if found:
            more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
            fail([f"the device does not play {scan.name}: {found[0]}{more}"], ExitStatus.MISMATCH)
        click.echo(f"the device plays {scan.name} {scan.digest[:12]}: {len(image)} bytes, all the same")
    return ExitStatus.OK
