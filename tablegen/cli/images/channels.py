"""``tablegen channels``: list the channels of image files."""

import json
from pathlib import Path

import click

from tablegen.cli.images.pairs import require_readers
from tablegen.cli.shared.common import fail
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.terminal import tell


@click.command(short_help="List the channels of image files.")
@click.argument("files", type=click.Path(path_type=Path), metavar="IMAGE...", nargs=-1, required=True)
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def channels(files: tuple[Path, ...], as_json: bool) -> int:
    """List the channels of image files: direction, pixels, size and unit.

    \b
    Files: .asd, .ibw, .spm and .000 to .999, .jpk, .jpk-qi-image, .sxm, .gwy,
           .h5-jpk, .stp, .top, .nid, .mdt, .nc,
           .npy, .tif, .png, or a matrix of numbers: .txt, .asc, .csv, .dat.

    The options --channel and --retrace-channel of other commands take the number, or the name. A name without the
    direction, such as Height, selects trace and retrace. A column is empty if the file does not have the value. A scan
    angle other than 0 has a column of its own: at 90 degrees the fast axis is the other piezo. So have the turn, the
    share of the line period that is forward, and the window, the part of each sweep that is imaged.

    \b
    Example:
      tablegen channels scan.sxm

    Exit status: 0 done, 2 wrong input, 6 a library is missing.
    """
    from tablegen.api.read_image import Channels
    from tablegen.api.read_image import channels as channels_of
    from tablegen.base.input_errors import Rejected

    require_readers(files)
    contents: list[Channels] = []
    for path in files:
        try:
            contents.append(channels_of(path))
        except Rejected as rejected:
            fail(rejected.problems, ExitStatus.WRONG_INPUT)
    if as_json:
        click.echo(json.dumps([one.record for one in contents], indent=2, allow_nan=False))
        return ExitStatus.OK
    for one in contents:
        tell(str(one.path), bold=True)
        for row in one.rows():
            tell(row)
    return ExitStatus.OK
