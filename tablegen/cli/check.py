"""``tablegen check``: is this scan right? Silence and a status."""

from pathlib import Path

import click

from tablegen.cli.common import planned, scan_argument


@click.command(short_help="Check a scan file and its scanner file.")
@scan_argument
def check(scan: Path) -> None:
    """Check a scan file and its scanner file: syntax, physical limits, and the limits of the certificate.

    Prints nothing if both are correct. Otherwise it prints all errors to stderr, each as file:line: key: why.

    \b
    Example:
      tablegen check annexin_200nm.toml

    Exit status: 0 correct, 2 wrong input, 3 a limit of the certificate is exceeded.
    """
    planned(scan)
