"""``tablegen formats``: list the output formats of a build."""

import click

from tablegen.cli.shared.terminal import tell


@click.command(short_help="List the output formats of build.")
def formats() -> None:
    """List the output formats of `tablegen build`: name, purpose and files.

    \b
    Choose formats in the scan file:
      [emit]
      formats = ["c", "vhdl"]

    \b
    or on the command line, which takes precedence:
      tablegen build scan.toml -f c -f vhdl

    The default is c and verilog. Other packages can add formats: see docs/formats.md.
    """
    from tablegen.emit.formats import UnknownFormat, get, names

    for name in names():
        try:
            output_format = get(name)
        except UnknownFormat as error:
            click.echo(f"{name:<16}cannot be used: {error}", err=True)
            continue
        tell(f"{name:<16}{output_format.purpose}", bold=True)
        tell(f"{'':16}{output_format.file_names}")
