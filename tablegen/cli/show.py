"""``tablegen show``: show drive, rates, accuracy and plots of a scan."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tablegen.cli.shared.common import format_option, planned_at_any_angle, rendered, require, scan_argument
from tablegen.cli.shared.plot import PlottingCommand, check_plot, in_terminal, plot_option, show_plot
from tablegen.cli.shared.terminal import tell

if TYPE_CHECKING:
    from tablegen.api.build import Build
    from tablegen.api.turned import TurnedBuild
    from tablegen.charts.picture_file import PlottedCharts


@click.command(cls=PlottingCommand, short_help="Show drive, rates, accuracy and plots of a scan.")
@scan_argument
@click.option("--json", "as_json", is_flag=True, help="Print manifest.json instead of text.")
@format_option
@plot_option("drive, correction and expected error", by_default=True)
@click.option(
    "--optimum",
    is_flag=True,
    help="Add the least peak acceleration that any waveform of this scaling error could have. Needs scipy.",
)
@click.option("--all", "complete", is_flag=True, help="Print factors, words of tables and equations too.")
def show(
    scan: Path,
    as_json: bool,
    formats: tuple[str, ...],
    plot: Path | None,
    no_plot: bool,
    optimum: bool,
    complete: bool,
) -> None:
    """Show drive, rates, accuracy and plots of a scan. Writes no file.

    It begins with the error of each axis and the time of an image. With --all it prints factors, tables and the whole
    certificate as well.

    In the plots, > is forward and < is backward; a double axis marks the imaged part.

    \b
    Examples:
      tablegen show annexin_200nm.toml
      tablegen show annexin_200nm.toml --all
      tablegen show annexin_200nm.toml --plot annexin.png
      tablegen show annexin_200nm.toml --json > manifest.json

    Exit status: 0 done, 2 wrong input, 3 a limit of the certificate is exceeded.
    """
    check_plot(plot, as_json)
    if optimum:
        if as_json:
            raise click.UsageError("The manifest has no optimum: leave out --json or --optimum.")
        require("scipy", extra="calibrate")
    from tablegen.api.build import Build

    built = planned_at_any_angle(scan, list(formats) or None)
    if as_json:
        click.echo(rendered(built)["manifest.json"], nl=False)
        show_plot(plot, lambda: _charts(built, plot))
        return
    if not isinstance(built, Build):
        if optimum:
            raise click.UsageError("A scan at an angle has no optimum: leave out --optimum.")
        for text in built.summary().splitlines():
            tell(text)
        click.echo()
        show_plot(plot, built.charts, by_default=not no_plot)
        for choice in built.choices:
            click.echo(f"chosen: {choice}")
        return
    plan = built.plan
    lines = (built.summary() if complete else built.overview()).splitlines()
    if optimum:
        from tablegen.certificate.certificate import Certificate
        from tablegen.certificate.optimum import with_optimum
        from tablegen.certificate.summary import summary

        certificates: dict[str, Certificate] = {
            line.axis: with_optimum(line, built.certificates[line.axis]) for line in plan.lines
        }
        title = f"{plan.name} on {plan.scanner!r}"
        lines = [*built.brief(), "", title, *summary(plan, certificates)]
    for text in lines:
        tell(text, bold=bool(text) and not text.startswith(" "))
    click.echo()
    show_plot(plot, lambda: _charts(built, plot), by_default=not no_plot)
    for choice in built.choices:
        click.echo(f"chosen: {choice}")
    for finding in built.findings:
        click.echo(finding.line)


def _charts(built: "Build | TurnedBuild", plot: Path | None) -> "PlottedCharts":
    from tablegen.api.build import Build

    if not isinstance(built, Build):
        return built.charts()
    from tablegen.html_report.scan_charts import scan_charts

    return scan_charts(built.setup, built.plan, built.certificates, in_terminal(plot))
