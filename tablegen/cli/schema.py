"""``tablegen schema``: JSON Schema for editors."""

import click


@click.command(short_help="Print the JSON Schema of the input files.")
@click.argument("kind", type=click.Choice(["scan", "scanner"]), default="scan")
def schema(kind: str) -> None:
    """Print the JSON Schema (2020-12) of a scan file, or of a scanner file.

    \b
    Editors that know TOML take it, for instance taplo and Even Better TOML
    with this as the first line:
      #:schema ./scan.schema.json
    """
    import json

    from msgspec.json import schema as schema_of

    from tablegen.config.schema import Scan, Scanner

    described = schema_of(Scan if kind == "scan" else Scanner)
    described = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"tablegen {kind}",
        **described,
    }
    click.echo(json.dumps(described, indent=2))
