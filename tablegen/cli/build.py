"""``tablegen build``: write the files of a scan."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tablegen.cli.depfile import Depfile
from tablegen.cli.shared.common import (
    OutputFile,
    OutputFolder,
    check_place,
    fail,
    format_option,
    planned_at_any_angle,
    rendered,
    scan_argument,
    strict_option,
    written,
)
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.plot import PlottingCommand, check_plot, in_terminal, plot_option, show_plot

if TYPE_CHECKING:
    from tablegen.api.build import Build
    from tablegen.api.turned import TurnedBuild
    from tablegen.charts.picture_file import PlottedCharts

_NAMES_SHOWN = 8


@click.command(cls=PlottingCommand, short_help="Write C, Verilog, tables and manifest of a scan.")
@scan_argument
@click.option(
    "-o",
    "--output",
    type=OutputFolder(always=False),
    default=Path("build"),
    show_default=True,
    metavar="DIR",
    help="Output directory. It is created if it does not exist.",
)
@format_option
@click.option(
    "--check",
    "only_check",
    is_flag=True,
    help="Write nothing. Exit with status 1 and print a diff if the files in DIR are not up to date.",
)
@click.option(
    "--depfile",
    type=OutputFile(),
    metavar="FILE",
    help="Also write a dependency file for make, CMake or Ninja, like gcc -MD -MP. FILE is removed first and written "
    "last, so it exists only after a successful build.",
)
@click.option(
    "--depfile-target",
    metavar="NAME",
    help="Target name in the dependency file, like gcc -MT.  [default: DIR/manifest.json]",
)
@strict_option
@plot_option("drive, correction and expected error")
@click.option("-q", "--quiet", is_flag=True, help="Do not print the certificate.")
def build(
    scan: Path,
    output: Path,
    formats: tuple[str, ...],
    only_check: bool,
    depfile: Path | None,
    depfile_target: str | None,
    strict: bool,
    plot: Path | None,
    quiet: bool,
) -> int:
    """Write the tables, constants and sequencer of a scan in C and Verilog, and manifest.json with the certificate.

    The same input gives the same bytes on every machine. A file that is up to date is not written again. If the input
    has an error, no file is written. Files of an earlier build that this build no longer makes are removed.

    A scaling error above 1 %, or above that of the uncompensated line, is a warning on stderr, with its cause and with
    remedies that were tried.

    A scan at an angle, on coupled axes, with drift or with [z] is built in C, and with -f verilog in Verilog.

    \b
    Examples:
      tablegen build annexin_200nm.toml -o build            write all files to build
      tablegen build annexin_200nm.toml -o build -f c       write C only
      tablegen build annexin_200nm.toml -o build --check    for CI: check that build is up to date

    \b
    Exit status: 0 done, 1 DIR is not up to date (--check), 2 wrong input, 3 a limit of the
    certificate is exceeded (with --strict: or there is a warning), 4 cannot write.

    `tablegen paths` prints the include files that run this command from make or CMake. Compiled templates are cached in
    ~/.cache/tablegen; the output does not depend on them.
    """
    _check_usage(only_check, depfile, depfile_target, plot)
    check_plot(plot)
    if not only_check and not os.path.exists(output):
        check_place(output)
    rule = Depfile(depfile, depfile_target or str(output / "manifest.json"), scan) if depfile is not None else None
    try:
        built = planned_at_any_angle(scan, list(formats) or None, strict)
        files = rendered(built)
    except KeyboardInterrupt as interruption:
        where = f" {interruption}".rstrip()  # that of a plug-in names it
        fail([f"interrupted{where}; {output} was left as it was"], ExitStatus.INTERRUPTED)
    if only_check:
        if differences := _stale(built, files, output):
            click.echo("\n".join(differences))
            again = "".join(f" -f {name}" for name in formats)
            fail([f"{output} is stale; run: tablegen build {scan} -o {output}{again}"], ExitStatus.STALE)
        return ExitStatus.OK
    if rule is not None:
        rule.note(built.setup, built.formats)
    removed: list[str] = []
    leftovers: list[str] = []

    def outdated_now() -> list[str]:
        # The manifest that is there lists them; it is replaced after this.
        removed[:], leftovers[:] = built.outdated(output), built.leftovers(output)
        return removed

    changed = written(output, files, outdated_now)
    if rule is not None:
        rule.write()
    for name in leftovers:
        click.echo(f"note: {_leftover(output / name)}", err=True)
    if not quiet:
        _print_certificate(built)
        click.echo(f"\n{output}: {_state(built, changed)}")
        if removed:
            click.echo(f"{output}: removed files of an earlier build: {_few(removed)}")
    if plot is not None:
        show_plot(plot, lambda: _charts(built, in_terminal(plot)))
    return ExitStatus.OK


def _check_usage(only_check: bool, depfile: Path | None, depfile_target: str | None, plot: Path | None) -> None:
    """Refuse options that cannot be used together."""
    if depfile is None and depfile_target is not None:
        raise click.UsageError("--depfile-target needs --depfile FILE")
    if depfile is not None and only_check:
        raise click.UsageError("--check cannot be used with --depfile")
    if plot is not None and only_check:
        raise click.UsageError("--check cannot be used with --plot")


def _stale(built: "Build | TurnedBuild", files: dict[str, bytes], output: Path) -> list[str]:
    """Return the differences of the directory from the files of this build, a line each."""
    from tablegen.cli.shared.directory_difference import differences

    lines = differences(output, files)
    lines += [f"{output / name}: left over from an earlier build" for name in built.outdated(output)]
    return lines + [_leftover(output / name) for name in built.leftovers(output)]


def _print_certificate(built: "Build | TurnedBuild") -> None:
    """Print the certificate, the findings that impair the image, and the choices of the build."""
    from tablegen.api.build import Build
    from tablegen.cli.certificate_text import certificate_table

    click.echo("\n".join([*built.brief(), ""]))
    if isinstance(built, Build):
        click.echo("\n".join(certificate_table(built.plan, built.certificates)))
        for finding in built.findings:
            if finding.weight == "spoils":  # `show` prints the small print too
                click.echo(finding.line)
    else:
        click.echo(built.summary())
    if built.choices:
        click.echo()
    for choice in built.choices:
        click.echo(f"chosen: {choice}")


def _charts(built: "Build | TurnedBuild", brief: bool) -> "PlottedCharts":
    from tablegen.api.build import Build

    if not isinstance(built, Build):
        return built.charts()
    from tablegen.html_report.scan_charts import scan_charts

    return scan_charts(built.setup, built.plan, built.certificates, brief)


def _few(names: list[str]) -> str:
    """Return names with commas between; of many the first ones."""
    more = [f"and {len(names) - _NAMES_SHOWN} more"] if len(names) > _NAMES_SHOWN else []
    return ", ".join([*names[:_NAMES_SHOWN], *more])


def _leftover(path: Path) -> str:
    if path.name.startswith("dac_"):
        return f"{path}: is not a file of this build but matches dac_*{path.suffix}; remove it"
    return f"{path}: left over from an earlier build, and edited since; remove it"


def _state(built: "Build | TurnedBuild", changed: list[str]) -> str:
    """Describe what was written; the runtime, which changes with tablegen only, is many files and one thing."""
    runtime = built.runtime
    own, count = sum(name not in runtime for name in changed), len(built.files) - len(runtime)
    if not changed:
        return f"{count} files{' and the runtime dac_*' if runtime else ''} up to date"
    parts = [f"{own} of {count} files"] if own else []
    parts += ["the runtime dac_*"] if own < len(changed) else []
    return " and ".join(parts) + " written"
