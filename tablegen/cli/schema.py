"""``tablegen schema``: print the JSON Schema for editors."""

import click


@click.command(short_help="Print the JSON Schema of a scan or scanner file.")
@click.argument("kind", type=click.Choice(["scan", "scanner"]), default="scan")
def schema(kind: str) -> None:
    """Print the JSON Schema (2020-12) of scan files (the default) or scanner files.

    Editors use the schema to complete and check keys. For taplo and Even Better TOML, save the schema and make this
    the first line of the scan file:

    \b
      #:schema ./scan.schema.json

    \b
    Examples:
      tablegen schema > scan.schema.json
      tablegen schema scanner > scanner.schema.json
    """
    import json

    from tablegen.config.describe import json_schema
    from tablegen.config.scanner import Scanner
    from tablegen.config.schema import WrittenScan

    described = json_schema(WrittenScan if kind == "scan" else Scanner)
    described = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"tablegen {kind}",
        **described,
    }
    click.echo(json.dumps(described, indent=2))
