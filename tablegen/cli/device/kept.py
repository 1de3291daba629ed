"""``tablegen save``, ``slots``, ``select``, ``confirm`` and ``delete``: the scans that a device has without power."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tablegen.cli.device.connection import baud_option, connected, key_option, port_option
from tablegen.cli.shared.exit_status import ExitStatus

if TYPE_CHECKING:
    from tablegen.link.device import Device
    from tablegen.link.kept import KeptPrograms, Slot
    from tablegen.link.programs import DeviceProgram

_HASH_DIGITS = 12  # digits of a hash in messages
_FIRMWARE = "firmware"
_MAX_SLOT = 14
SLOT = click.IntRange(min=0, max=_MAX_SLOT)
_slot_argument = click.argument("slot", type=SLOT, metavar="SLOT")


def _slot_or_firmware(_context: click.Context, _param: click.Parameter, value: str) -> int | None:
    """Return the number of a slot, or None for the scan of the firmware."""
    if value == _FIRMWARE:
        return None
    if not value.isascii() or not value.isdigit() or int(value) > _MAX_SLOT:
        raise click.BadParameter(f"'{value}' is neither a slot, 0 to {_MAX_SLOT}, nor the word {_FIRMWARE}")
    return int(value)


@click.command(short_help="Keep the active scan in a slot of a device, without power.")
@_slot_argument
@port_option()
@baud_option
@key_option
def save(slot: int, port: str, baud: int, key_file: Path | None) -> int:
    """Keep the active scan in a slot of the flash of a device, in place of what the slot has.

    SLOT is a number from 0; `tablegen slots` lists them. What plays after a start does not change: `tablegen select`
    chooses that. If power fails meanwhile, the slot has its old content or the new one, never a mixture.

    Most devices cannot write their flash while a scan plays; `tablegen park` ends it.

    \b
    Examples:
      tablegen save 1 --port /dev/ttyUSB0
      tablegen upload build --store 1 --port /dev/ttyUSB0      upload and save

    \b
    Exit status: 0 saved, 2 wrong usage, 6 pyserial is missing, 7 no port, 8 no answer, 9 refused,
    10 link lost or timeout, 12 invalid answers.
    """
    with connected(port, baud, key_file) as device:
        device.save(slot)
        click.echo(saved(device, slot))
    return ExitStatus.OK


def saved(device: "Device", slot: int) -> str:
    """Describe a slot that was saved to, and what comes next."""
    programs = device.slots()
    text = f"slot {slot} keeps {_scan(programs.slots[slot])}"
    if programs.selected == slot:
        return f"{text}; it plays after a start"
    return f"{text}; `tablegen select {slot}` lets it play after a start"


@click.command(short_help="List the scans that a device has without power.")
@port_option()
@baud_option
@key_option
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def slots(port: str, baud: int, key_file: Path | None, as_json: bool) -> int:
    """List the slots of a device: which scan each keeps, which one plays after a start, and whether one is on trial.

    Of a device that plays scans by number (`tablegen play`), also the numbers: of those that were compiled with its
    firmware, with their names, and of those that its slots keep.

    \b
    Examples:
      tablegen slots --port /dev/ttyUSB0
      tablegen slots --port /dev/ttyUSB0 --json | jq .selected

    \b
    Exit status: 0 done, 6 pyserial is missing, 7 no port, 8 no answer, 9 refused (the device keeps
    no scans), 10 link lost, 12 invalid answers.
    """
    from tablegen.link.messages import Feature, More

    with connected(port, baud, key_file) as device:
        numbered = device.programs() if More.PLAY in device.info.more else ()
        has_slots = Feature.STORE in device.info.features
        slots = device.slots() if has_slots or More.PLAY not in device.info.more else None
    if as_json:
        import json

        click.echo(json.dumps({"programs": _programs(numbered), **_record(slots)}, indent=2))
        return ExitStatus.OK
    parts = []
    if numbered:
        parts.append(["number  program", *map(_program, numbered)])
    if slots is not None:
        parts.append(["slot  content", *(f"{slot.number:>4}  {_scan(slot)}" for slot in slots.slots)])
        parts.append(_sentences(slots))
    click.echo("\n\n".join("\n".join(part) for part in parts))
    return ExitStatus.OK


def _program(program: "DeviceProgram") -> str:
    name = program.name if program.slot is None else _name(program.slot)
    return f"{program.number:>6}  {name}, {program.hash[:_HASH_DIGITS]}"


def _programs(programs: "tuple[DeviceProgram, ...]") -> list[dict[str, Any]]:
    return [
        {"number": each.number, "name": each.name or None, "slot": each.slot, "hash": each.hash} for each in programs
    ]


def _scan(slot: "Slot") -> str:
    if slot.image is None:
        return slot.content.name.lower()
    return f"{slot.image.hash.hex()[:_HASH_DIGITS]}, {slot.image.image_bytes} bytes"


def _name(slot: int | None) -> str:
    return "the scan of the firmware" if slot is None else f"slot {slot}"


def _sentences(programs: "KeptPrograms") -> list[str]:
    lines = [f"selected     {_name(programs.selected)}, which plays after a start"]
    if programs.trial is not None:
        if not programs.started:
            lines.append(
                f"trial        {_name(programs.trial)}, which plays after the next start, to be confirmed then"
            )
        else:
            lines.append(f"trial        {_name(programs.trial)}, over at the next start; `tablegen confirm` selects it")
    lines.append(f"this start   began with {_name(programs.start)}")
    if programs.reason:
        lines.append(f"             another scan was due, but refused ({_reason(programs.reason)})")
    lines.append(f"room         {programs.room} bytes a slot")
    return lines


def _reason(reason: int) -> str:
    from tablegen.link.messages import Reason

    return Reason(reason).name.lower() if reason in list(Reason) else str(reason)


def _record(programs: "KeptPrograms | None") -> dict[str, Any]:
    """Return all values, by the names of docs/protocol.md; null is no slot, or the firmware. Nothing without slots."""
    if programs is None:
        return {"slots": []}
    return {
        "slots": [
            {
                "slot": slot.number,
                "content": slot.content.name.lower(),
                "hash": None if slot.image is None else slot.image.hash.hex(),
                "image_bytes": None if slot.image is None else slot.image.image_bytes,
                "image_crc": None if slot.image is None else slot.image.image_crc,
            }
            for slot in programs.slots
        ],
        "selected": programs.selected,
        "trial": programs.trial,
        "started": programs.started,
        "start": programs.start,
        "reason": _reason(programs.reason) if programs.reason else None,
        "room": programs.room,
        "while_playing": programs.while_playing,
    }


@click.command(short_help="Choose the kept scan that plays after a start of a device.")
@click.argument("slot", callback=_slot_or_firmware, metavar=f"SLOT|{_FIRMWARE}")
@port_option()
@baud_option
@key_option
@click.option(
    "--trial",
    is_flag=True,
    help="Play it after the next start only. If it is not confirmed by then (`tablegen confirm`), the start after that "
    "plays the selected scan again.",
)
def select(slot: int | None, port: str, baud: int, key_file: Path | None, trial: bool) -> int:
    """Choose the slot whose scan a device plays after a start; `firmware` is the scan of its firmware.

    At a start the device checks the scan as it checks an upload, and parks; `tablegen trigger` starts it. A scan that
    it refuses then, for example after an update of the firmware, does not play: `tablegen slots` has the reason.

    Choose with --trial if a scan could make the device unusable: switch it off and on, and the old choice is back.

    \b
    Examples:
      tablegen select 1 --port /dev/ttyUSB0
      tablegen select 2 --trial --port /dev/ttyUSB0
      tablegen select firmware --port /dev/ttyUSB0

    \b
    Exit status: 0 done, 2 wrong usage, 6 pyserial is missing, 7 no port, 8 no answer, 9 refused,
    10 link lost or timeout, 12 invalid answers.
    """
    if slot is None and trial:
        raise click.UsageError("--trial needs the number of a slot")
    with connected(port, baud, key_file) as device:
        device.select(slot, trial)
    if trial:
        click.echo(f"{_name(slot)} plays after the next start, as a trial: run `tablegen confirm` then to select it")
    else:
        click.echo(f"{_name(slot)} plays after a start")
    return ExitStatus.OK


@click.command(short_help="Select the scan on trial, which the device started with.")
@port_option()
@baud_option
@key_option
def confirm(port: str, baud: int, key_file: Path | None) -> int:
    """Select the scan on trial. Without this the next start of the device plays the selected scan again.

    \b
    Example:
      tablegen select 2 --trial --port COM3                    then switch the device off and on
      tablegen confirm --port COM3

    \b
    Exit status: 0 done, 6 pyserial is missing, 7 no port, 8 no answer, 9 refused (there is no
    started trial), 10 link lost or timeout, 12 invalid answers.
    """
    with connected(port, baud, key_file) as device:
        device.confirm()
        selected = device.slots().selected
    click.echo(f"{_name(selected)} plays after a start")
    return ExitStatus.OK


@click.command(short_help="Empty a slot of a device.")
@_slot_argument
@port_option()
@baud_option
@key_option
def delete(slot: int, port: str, baud: int, key_file: Path | None) -> int:
    """Empty a slot of a device. If it was selected, the scan of the firmware plays after a start.

    A scan that plays goes on.

    \b
    Example:
      tablegen delete 1 --port /dev/ttyUSB0

    \b
    Exit status: 0 done, 2 wrong usage, 6 pyserial is missing, 7 no port, 8 no answer, 9 refused
    (the slot is empty already), 10 link lost or timeout, 12 invalid answers.
    """
    with connected(port, baud, key_file) as device:
        before = device.slots().selected
        device.delete(slot)
    click.echo(f"slot {slot} is empty" + (f"; {_name(None)} plays after a start" if before == slot else ""))
    return ExitStatus.OK
