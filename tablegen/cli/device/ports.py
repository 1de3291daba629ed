"""``tablegen ports``: list the serial ports of this machine."""

import click

from tablegen.base.installation import install_advice
from tablegen.cli.shared.common import fail
from tablegen.cli.shared.exit_status import ExitStatus


@click.command(short_help="List the serial ports of this machine.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def ports(as_json: bool) -> int:
    """List the serial ports of this machine, with their descriptions.

    \b
    Example:
      tablegen ports

    Exit status: 0 done, 6 pyserial is missing, 7 this machine has no serial port.
    """
    try:
        from serial.tools.list_ports import comports
    except ImportError:
        fail([f"pyserial is missing; {install_advice('serial')}"], ExitStatus.TOOL_MISSING)
    serial_ports = sorted(comports(), key=lambda port: port.device)
    if as_json:
        import json

        click.echo(
            json.dumps([{"port": p.device, "description": p.description, "id": p.hwid} for p in serial_ports], indent=2)
        )
    width = max((len(port.device) for port in serial_ports), default=0)
    for port in [] if as_json else serial_ports:
        description = "" if port.description in (None, "n/a") else port.description
        click.echo(f"{port.device:<{width}}  {description}".rstrip())
    if not serial_ports:
        fail(
            ["this machine has no serial port; is the cable connected? URLs like socket://host:port work as well"],
            ExitStatus.NO_PORT,
        )
    return ExitStatus.OK
