"""``tablegen report``: write an HTML page of a scan or a build."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tablegen.cli.images.pairs import channel_option, require_readers
from tablegen.cli.shared.common import OutputFile, OutputFolder, fail, require, written
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.progress import Progress

if TYPE_CHECKING:
    from tablegen.api.report import ReportPage
    from tablegen.charts.chart import Chart


@click.command(short_help="Write an HTML page of a scan: errors, charts, certificate.")
@click.argument("source", type=click.Path(path_type=Path), metavar="SCAN.TOML|DIR")
@click.option(
    "-o",
    "--output",
    type=OutputFile(),
    default=Path("report.html"),
    show_default=True,
    metavar="FILE",
    help="HTML file to write.",
)
@click.option(
    "--verified",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Also show the results of `tablegen verify DIR --junit FILE`.",
)
@click.option(
    "--image",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Show this image of yours beside the prediction, with its scale and heights.",
)
@channel_option
@click.option("--svg", type=OutputFolder(), metavar="DIR", help="Also write every chart as SVG into DIR.")
@click.option("--png", type=OutputFolder(), metavar="DIR", help="Also write every chart as PNG; needs matplotlib.")
@click.option("--pdf", type=OutputFolder(), metavar="DIR", help="Also write every chart as PDF; needs matplotlib.")
@click.option(
    "--figure",
    "figures",
    multiple=True,
    metavar="NAME",
    help="Write only this chart with --svg, --png, --pdf; repeat the option for several, such as drive-x.",
)
def report(
    source: Path,
    output: Path,
    verified: Path | None,
    image: Path | None,
    channel: str | None,
    svg: Path | None,
    png: Path | None,
    pdf: Path | None,
    figures: tuple[str, ...],
) -> int:
    """Write one HTML file that shows a scan, and has all its charts.

    It shows the findings, the most serious first, the certificate with its limits, drive and position, errors before
    and after, spectrum, corrections, usable sizes, calibration, and the files.

    The file needs no network and no other file. A directory of `tablegen build` has no limits, no errors on the scanner
    and no calibration, so its page does not show them.

    The page is written even if the certificate exceeds a limit, since it shows why.

    \b
    Examples:
      tablegen report annexin_200nm.toml -o annexin.html
      tablegen report annexin_200nm.toml --image scan.sxm --channel Z
      tablegen report build --verified verify.xml
      tablegen report annexin_200nm.toml --svg charts --figure drive-x

    Exit status: 0 written, 2 wrong input, 3 written, but a limit of the certificate is exceeded, 4 cannot write, 6 a
    library is missing.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if output.suffix == ".toml":
        raise click.UsageError(f"-o {output}: the page would replace a scan or a scanner file; give a name in .html")
    if figures and not (svg or png or pdf):
        raise click.UsageError("--figure needs --svg, --png or --pdf")
    if png or pdf:
        require("matplotlib", extra="plot", otherwise="; or write --svg, which needs nothing")
    if channel is not None and image is None:
        raise click.UsageError("--channel is of --image: give both")
    if image is not None:
        require_readers([image])
    with Progress() as progress:
        page = _reported(source, verified, image, channel, progress)
    charts = _select_charts(page.figures, figures)
    written(output.parent, {output.name: page.content})
    _write_charts(charts, svg, png, pdf)
    for answer in page.answers:
        click.echo(answer)
    click.echo(f"{output}: {len(page.content) / 1000:.0f} kB")
    if page.broken:
        fail([f"{output}: the certificate exceeds a limit", *page.broken], ExitStatus.BROKEN_LIMIT)
    return ExitStatus.OK


def _reported(
    source: Path, verified: Path | None, image: Path | None, channel: str | None, progress: Progress
) -> "ReportPage":
    from tablegen.api.report import report as reported
    from tablegen.base.input_errors import Rejected
    from tablegen.manifest.read import NotABuild

    try:
        return reported(source, verified=verified, image=image, channel=channel, progress=progress.now)
    except NotABuild as error:
        fail([error], ExitStatus.WRONG_INPUT)
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)


def _select_charts(charts: "dict[str, Chart]", names: tuple[str, ...]) -> "dict[str, Chart]":
    unknown = [name for name in names if name not in charts]
    if unknown:
        raise click.UsageError(f"--figure {unknown[0]}: the page has no such chart; it has {', '.join(charts)}")
    return {name: charts[name] for name in names} if names else charts


def _write_charts(charts: "dict[str, Chart]", svg: Path | None, png: Path | None, pdf: Path | None) -> None:
    from tablegen.charts.picture_file import picture

    for folder, kind in ((svg, "svg"), (png, "png"), (pdf, "pdf")):
        if folder is not None:
            written(folder, {f"{name}.{kind}": picture([chart], kind) for name, chart in charts.items()})
