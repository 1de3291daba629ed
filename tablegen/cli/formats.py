"""``tablegen formats``: what a build can be written as."""

import click


@click.command(short_help="List the formats that a build can be written as.")
def formats() -> None:
    """List the formats that a build can be written as: name, purpose, files.

    \b
    A scan file chooses them, or the command line:
      [emit]
      formats = ["c", "vhdl"]

      tablegen build scan.toml -f c -f vhdl

    Without a choice a build is written as c and verilog. Other packages can add formats; docs/formats.md says how.
    """
    from tablegen.emit.formats import UnknownFormat, get, names

    for name in names():
        try:
            found = get(name)
        except UnknownFormat as error:
            click.echo(f"{name:<16}cannot be used: {error}", err=True)
            continue
        click.echo(f"{click.style(f'{name:<16}', bold=True)}{found.purpose}\n{'':16}{found.file_names}")
