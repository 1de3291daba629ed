"""``tablegen show``: what would be built."""

import sys
from pathlib import Path

import click

from tablegen.cli.common import format_option, planned, rendered, scan_argument


@click.command(short_help="Show what would be built: drive, rates, certificate, plot.")
@scan_argument
@click.option("--json", "as_json", is_flag=True, help="The manifest instead of text.")
@format_option
@click.option("--plot/--no-plot", default=True, show_default=True, help="Draw the drive of one period.")
def show(scan: Path, as_json: bool, formats: tuple[str, ...], plot: bool) -> None:
    """Show what a build of a scan would make, and write nothing.

    Under each plot, > and < mark where the forward and the backward image are taken.
    """
    built = planned(scan, list(formats) or None)
    if as_json:
        click.echo(rendered(built)["manifest.json"], nl=False)
        return
    from tablegen.cli.report import plots

    plan = built.plan
    click.echo(click.style(f"{plan.name} on {plan.scanner!r}", bold=True))
    for text in built.summary.splitlines():
        heading = text and not text.startswith(" ")
        click.echo(click.style(text, bold=True) if heading else text)
    if plot:
        unicode = "utf" in (getattr(sys.stdout, "encoding", None) or "").lower()
        for line in plan.lines:
            click.echo()
            click.echo("\n".join(plots(line, unicode)))
    click.echo()
    for note in built.notes:
        click.echo(f"note: {note}")
