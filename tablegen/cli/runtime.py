"""``tablegen runtime``: write the options of one C runtime for several builds."""

from pathlib import Path

import click

from tablegen.cli.shared.common import OutputFile, fail, written
from tablegen.cli.shared.exit_status import ExitStatus


@click.command(short_help="Write the options of one C runtime that plays several builds.")
@click.argument("folders", type=click.Path(path_type=Path, file_okay=False), metavar="DIR...", nargs=-1, required=True)
@click.option(
    "-o",
    "--output",
    type=OutputFile(),
    metavar="FILE",
    help="Write the header to FILE, unless it is up to date.  [default: print it]",
)
@click.option("-q", "--quiet", is_flag=True, help="Do not print whether FILE was written.")
def runtime(folders: tuple[Path, ...], output: Path | None, quiet: bool) -> int:
    """Write the options of one C runtime that plays all scans built in the DIRs, as a header.

    Each scan needs options of the runtime: the widths of its words in memory, and whether its tables are cubic, its
    output shaped, its axes turned. The header has the highest of each. A table of 16 bits then takes 32-bit words if
    another scan has wider ones; what it plays is the same.

    Compile all files with -DDAC_CONFIG_FILE='"FILE"', and the dac_*.c of one DIR only. An option that the compiler gets
    with -D takes precedence. A scan that needs more than the options does not compile.

    \b
    Example:
      tablegen build survey.toml -o build/survey
      tablegen build detail.toml -o build/detail
      tablegen runtime build/survey build/detail -o build/dac_options.h

    tablegen_runtime() of the make include and of the CMake module does all of this: see docs/build_step.md.

    Exit status: 0 done, 2 a DIR contains no build in C, or two have the same name, 4 cannot write.
    """
    from tablegen.emit.runtime_config import config_header, options_of_builds
    from tablegen.manifest.read import NotABuild

    try:
        content = config_header(options_of_builds(list(folders)))
    except NotABuild as error:
        fail([error], ExitStatus.WRONG_INPUT)
    if output is None:
        click.echo(content, nl=False)
        return ExitStatus.OK
    changed = written(output.parent, {output.name: content})
    if not quiet:
        click.echo(f"{output}: {'written' if changed else 'up to date'}")
    return ExitStatus.OK
