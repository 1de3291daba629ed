"""``tablegen build``: the main job."""

from pathlib import Path

import click

from tablegen.cli.common import fail, planned, scan_argument, written
from tablegen.cli.status import Status


@click.command(short_help="Build C, Verilog, tables and a certificate.")
@scan_argument
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("build"),
    show_default=True,
    metavar="DIR",
    help="Where the files go; made if it is not there.",
)
@click.option("--check", "only_check", is_flag=True, help="Write nothing; exit 1 with a diff if DIR is stale.")
@click.option("-q", "--quiet", is_flag=True, help="Print no certificate.")
def build(scan: Path, output: Path, only_check: bool, quiet: bool) -> int:
    """Build a scan: NAME.h, NAME.c, NAME.vh, .mem files and manifest.json.

    The same input gives the same bytes on every machine. Files that are already right are not touched, and
    if anything is wrong nothing is written.

    \b
      tablegen build annexin_200nm.toml -o build
      tablegen build annexin_200nm.toml -o build --check     in CI: is what was committed up to date?
    """
    plan, certificates = planned(scan)
    from tablegen.emit import render

    files = render(plan, certificates)
    if only_check:
        from tablegen.cli.difference import differences

        found = differences(output, files)
        if not found:
            return Status.OK
        click.echo("\n".join(found))
        fail([f"{output} is stale; run: tablegen build {scan} -o {output}"], Status.STALE)
    changed = written(output, files)
    if not quiet:
        from tablegen.cli.report import certificate_table

        click.echo("\n".join(certificate_table(plan, certificates)))
        state = f"{len(changed)} of {len(files)} files written" if changed else f"{len(files)} files up to date"
        click.echo(f"\n{output}: {state}")
    return Status.OK
