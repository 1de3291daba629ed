"""``tablegen build``: the main job."""

from pathlib import Path

import click

from tablegen.cli.common import fail, planned, scan_argument, written
from tablegen.cli.depfile import Depfile
from tablegen.cli.exit_status import ExitStatus


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
@click.option(
    "--depfile",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="FILE",
    help="Write a rule for make, CMake or Ninja: what was read, as gcc -MD -MP does. FILE exists once the build is "
    "complete, and not after one that failed.",
)
@click.option(
    "--depfile-target", metavar="NAME", help="The target of that rule, as gcc -MT has it.  [default: DIR/manifest.json]"
)
@click.option("-q", "--quiet", is_flag=True, help="Print no certificate.")
def build(
    scan: Path, output: Path, only_check: bool, depfile: Path | None, depfile_target: str | None, quiet: bool
) -> int:
    """Build a scan: NAME.h, NAME.c, NAME.vh, .mem files, and manifest.json.

    Beside them go the sequencers that play it: in C, dac_*.c and dac_*.h, and in Verilog, dac_*.v;
    and the device's end of `tablegen upload`, dac_link*.c and program_loader.v. The same input gives the same bytes on
    every machine. Files that are already right are not touched, and if anything is wrong nothing is written.

    \b
      tablegen build annexin_200nm.toml -o build
      tablegen build annexin_200nm.toml -o build --check     in CI: is what was committed up to date?
      tablegen verify build                                  does the sequencer play it, bit for bit?

    From make and CMake it is called by what `tablegen paths` leads to.
    """
    if depfile is None and depfile_target is not None:
        raise click.UsageError("--depfile-target names the target of --depfile FILE; give that as well")
    if depfile is not None and only_check:
        raise click.UsageError("--check writes nothing; leave out --depfile")
    rule = Depfile(depfile, depfile_target or str(output / "manifest.json"), scan) if depfile is not None else None
    setup, plan, certificates = planned(scan)
    from tablegen.emit.render import render

    files = render(plan, certificates)
    if only_check:
        from tablegen.cli.difference import differences

        found = differences(output, files)
        if not found:
            return ExitStatus.OK
        click.echo("\n".join(found))
        fail([f"{output} is stale; run: tablegen build {scan} -o {output}"], ExitStatus.STALE)
    if rule is not None:
        rule.note(setup.files)
    changed = written(output, files)
    if rule is not None:
        rule.write()
    if not quiet:
        from tablegen.cli.report import certificate_table

        click.echo("\n".join(certificate_table(plan, certificates)))
        click.echo(f"\n{output}: {_state(files, changed)}")
    return ExitStatus.OK


def _state(files: dict[str, bytes], changed: list[str]) -> str:
    """What was written; the runtime, which changes with tablegen only, is many files and one thing."""
    from tablegen.emit.render import runtime_files

    runtime = runtime_files()
    own, count = sum(name not in runtime for name in changed), len(files) - len(runtime)
    if not changed:
        return f"{count} files and the runtime dac_* up to date"
    parts = [f"{own} of {count} files"] if own else []
    parts += ["the runtime dac_*"] if own < len(changed) else []
    return " and ".join(parts) + " written"
