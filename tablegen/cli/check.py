"""``tablegen check``: is this scan right? Silence and a status."""

from pathlib import Path

import click

from tablegen.cli.common import planned, scan_argument


@click.command(short_help="Check a scan; silent, status only.")
@scan_argument
def check(scan: Path) -> None:
    """Check a scan and its scanner: syntax, physics, and the limits of the certificate.

    Prints nothing if all is well. Problems go to stderr as file:line: key: why, all of them at once.
    """
    planned(scan)
