"""``tablegen init``: a commented scanner and scan to start from."""

import os
from pathlib import Path

import click

from tablegen.cli.common import OutputFolder, fail, written
from tablegen.cli.exit_status import ExitStatus

_FILES = ("scanner.toml", "annexin_200nm.toml")


@click.command(short_help="Write an example scan file and scanner file.")
@click.argument("folder", type=OutputFolder(), default=Path("."), metavar="[DIR]")
@click.option("--force", is_flag=True, help="Overwrite existing files.")
def init(folder: Path, force: bool) -> int:
    """Write an example with comments, scanner.toml and annexin_200nm.toml, to DIR.

    The default of DIR is the current directory.

    \b
    Example:
      tablegen init demo

    Exit status: 0 done, 2 a file exists already (see --force), 4 cannot write.
    """
    from tablegen.resources import resource_folder

    there = [folder / name for name in _FILES if os.path.lexists(folder / name)]
    if there and not force:
        fail([f"{path} exists; --force overwrites it" for path in there], ExitStatus.WRONG_INPUT)
    source = resource_folder("examples")
    written(folder, {name: (source / name).read_bytes() for name in _FILES})
    for name in _FILES:
        click.echo(folder / name)
    return ExitStatus.OK
