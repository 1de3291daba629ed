"""``tablegen show``: what would be built."""

import sys
from pathlib import Path

import click

from tablegen.cli.common import format_option, planned, rendered, scan_argument
from tablegen.cli.terminal import tell


@click.command(short_help="Show drive, rates, accuracy and plots of a scan.")
@scan_argument
@click.option("--json", "as_json", is_flag=True, help="Print manifest.json instead of text.")
@format_option
@click.option("--plot/--no-plot", default=True, show_default=True, help="Plot one period of the drive of each axis.")
def show(scan: Path, as_json: bool, formats: tuple[str, ...], plot: bool) -> None:
    """Show drive, rates, accuracy and plots of a scan. Writes no file.

    Under each plot, > and < mark the imaging windows of the forward and backward lines.

    \b
    Examples:
      tablegen show annexin_200nm.toml
      tablegen show annexin_200nm.toml --json > manifest.json

    Exit status: 0 done, 2 wrong input, 3 a limit of the certificate is exceeded.
    """
    built = planned(scan, list(formats) or None)
    if as_json:
        click.echo(rendered(built)["manifest.json"], nl=False)
        return
    from tablegen.cli.tables import plots

    plan = built.plan
    tell(f"{plan.name} on {plan.scanner!r}", bold=True)
    for text in built.summary.splitlines():
        tell(text, bold=bool(text) and not text.startswith(" "))
    if plot:
        unicode = "utf" in (getattr(sys.stdout, "encoding", None) or "").lower()
        for line in plan.moving:
            click.echo()
            click.echo("\n".join(plots(line, unicode)))
    click.echo()
    for choice in built.choices:
        click.echo(f"chosen: {choice}")
    for note in built.notes:
        click.echo(f"note: {note}")
