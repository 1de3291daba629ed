"""``tablegen readback``: read the active scan of a device, byte for byte."""

from pathlib import Path

import click

from tablegen.cli.device.connection import baud_option, connected, key_option, port_option, read_scan, timeout_option
from tablegen.cli.shared.common import OutputFile, fail, written
from tablegen.cli.shared.exit_status import ExitStatus


@click.command(short_help="Read the active scan of a device; compare or save it.")
@click.argument("source", type=click.Path(path_type=Path), metavar="[SCAN.TOML|DIR]", required=False)
@port_option()
@baud_option
@key_option
@click.option(
    "-o",
    "--output",
    type=OutputFile(),
    metavar="FILE",
    help="Write the program image of the device to FILE.",
)
@timeout_option("Stop after S seconds.  [default: 15 s plus 4 times the transfer time]")
def readback(
    source: Path | None, port: str, baud: int, key_file: Path | None, output: Path | None, timeout: float | None
) -> int:
    """Read the active scan from the memory of a device, and compare it word by word with a scan or a build.

    SCAN.TOML is a scan file; DIR is a directory that `tablegen build` wrote.

    \b
    Examples:
      tablegen readback build --port /dev/ttyUSB0
      tablegen readback -o active.bin --port /dev/ttyUSB0

    \b
    Exit status: 0 equal, 2 wrong input, 4 cannot write, 5 different (the first difference is
    printed), 6 pyserial is missing, 7 no port, 8 no answer, 9 refused or no image to read,
    10 link lost or timeout, 12 invalid answers.
    """
    if source is None and output is None:
        raise click.UsageError("give a scan or a build to compare with, or a file to write (-o FILE)")
    scan = None if source is None else read_scan(source)
    with connected(port, baud, key_file) as device:
        image = device.readback(timeout_s=timeout)
    if output is not None:
        written(output.parent, {output.name: image})
        click.echo(f"{output}: {len(image)} bytes")
    if scan is not None:
        from tablegen.link.word_difference import differences

        mismatches = differences(scan, image)
        if mismatches:
            more = f" (and {len(mismatches) - 1} more)" if len(mismatches) > 1 else ""
            fail([f"the device plays a different scan than {scan.name}: {mismatches[0]}{more}"], ExitStatus.MISMATCH)
        click.echo(f"the device plays {scan.name} {scan.digest[:12]}: {len(image)} bytes, all equal")
    return ExitStatus.OK
