"""``tablegen check``: check a scan, and write nothing."""

from pathlib import Path

import click

from tablegen.cli.shared.common import planned_at_any_angle, scan_argument, strict_option


@click.command(short_help="Check a scan file and its scanner file.")
@scan_argument
@strict_option
def check(scan: Path, strict: bool) -> None:
    """Check a scan file and its scanner file: syntax, physical limits, and the limits of the certificate.

    If both are correct it says so, with the error of each axis and the time of an image, as `tablegen show` does.
    Otherwise it prints all errors to stderr, each as file:line: key: why. A scaling error above 1 %, or above that of
    the uncompensated line, is a warning, with remedies that were tried; so is a pixel whose positions in trace and
    retrace differ by more than a quarter of a pixel.

    \b
    Example:
      tablegen check annexin_200nm.toml

    Exit status: 0 correct, 2 wrong input, 3 a limit of the certificate is exceeded, or, with
    --strict, there is a warning.
    """
    built = planned_at_any_angle(scan, strict=strict)
    count = len(built.warnings)
    result = f"{scan}: correct" + (f", with {count} warning{'s' if count > 1 else ''}" if count else "")
    click.echo("\n".join([*built.brief(), result]))
