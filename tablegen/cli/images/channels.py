"""``tablegen channels``: what the files of instruments contain."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tablegen.cli.images.pairs import require_readers
from tablegen.cli.shared.common import fail
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.terminal import tell

if TYPE_CHECKING:
    from tablegen.images.formats.channel import Channel

_ANGLE = "angle [deg]"
_HEAD = ("", "channel", "direction", "pixels", "size [nm]", "unit", "lines [Hz]", "frames", "first row")


@click.command(short_help="List the channels of image files.")
@click.argument("files", type=click.Path(path_type=Path), metavar="IMAGE...", nargs=-1, required=True)
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def channels(files: tuple[Path, ...], as_json: bool) -> int:
    """List the channels of image files, with what each file says: direction, pixels, size and unit.

    \b
    Files: .asd, .ibw, .spm and .000 to .999, .jpk, .jpk-qi-image, .sxm, .gwy,
           .npy, .tif, .png, or a matrix of numbers: .txt, .asc, .csv, .dat.

    The options --channel and --retrace-channel of other commands take the number, or the name. A name without the
    direction, such as Height, finds trace and retrace. A column is empty where a file does not say. A scan angle other
    than 0 has a column of its own: at 90 degrees the fast axis is the other piezo.

    \b
    Example:
      tablegen channels scan.sxm

    Exit status: 0 done, 2 wrong input, 6 a library is missing.
    """
    from tablegen.base.input_errors import Rejected
    from tablegen.images.files import channels_of

    require_readers(files)
    found: list[tuple[Path, list[Channel]]] = []
    for path in files:
        try:
            found.append((path, channels_of(path)))
        except Rejected as rejected:
            fail(rejected.problems, ExitStatus.WRONG_INPUT)
    if as_json:
        listed = [{"file": str(path), "channels": [_record(one) for one in here]} for path, here in found]
        click.echo(json.dumps(listed, indent=2, allow_nan=False))
        return ExitStatus.OK
    for path, here in found:
        tell(str(path), bold=True)
        rows = [_HEAD, *(_row(one) for one in here)]
        if any(one.angle_deg for one in here):
            angles = ["" if one.angle_deg is None else f"{one.angle_deg:.4g}" for one in here]
            rows = [(*row, cell) for row, cell in zip(rows, [_ANGLE, *angles], strict=True)]
        widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
        for row in rows:
            tell("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())
    return ExitStatus.OK


def _record(channel: "Channel") -> dict[str, Any]:
    """A channel as data."""
    return {
        "number": channel.number,
        "title": channel.title,
        "signal": channel.signal,
        "direction": channel.direction,
        "rows_columns": list(channel.shape),
        "width_nm": channel.width_nm,
        "height_nm": channel.height_nm,
        "unit": channel.unit,
        "line_rate_hz": channel.line_rate_hz,
        "frames": channel.frames,
        "first_row": channel.first_row,
        "scan_angle_deg": channel.angle_deg,
    }


def _row(channel: "Channel") -> tuple[str, ...]:
    """A channel as a line of the table: columns x rows, and width x height."""
    from tablegen.base.input_errors import shortened

    sides = [f"{side:.6g}" if side else "?" for side in (channel.width_nm, channel.height_nm)]
    return (
        str(channel.number),
        shortened(channel.title, 40),
        channel.direction or "",
        " x ".join(map(str, reversed(channel.shape))),
        " x ".join(sides) if sides != ["?", "?"] else "",
        shortened(channel.unit, 12),
        f"{channel.line_rate_hz:.4g}" if channel.line_rate_hz else "",
        str(channel.frames) if channel.frames > 1 else "",
        channel.first_row or "",
    )
