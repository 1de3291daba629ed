"""Options of trace and retrace images: two files, or one that has both."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tablegen.cli.shared.common import require

if TYPE_CHECKING:
    from collections.abc import Iterable

_PAIR = "--pair"


class _Frames(click.ParamType["tuple[int, int]"]):
    """The first frame of a movie and the one after the last, as A:B."""

    name = "A:B"

    def convert(self, value: Any, parameter: click.Parameter | None, context: click.Context | None) -> tuple[int, int]:
        """Return both numbers; a usage error shows the form."""
        match = re.fullmatch(r"(\d{1,6}):(\d{1,6})", value) if isinstance(value, str) else None
        if match is None or not int(match[1]) < int(match[2]):
            self.fail(f"'{value}' is not A:B, such as 0:8 for the frames 0 to 7.", parameter, context)
        return int(match[1]), int(match[2])


pair_option = click.option(
    _PAIR,
    "pairs",
    type=(click.FloatRange(min=0.0, min_open=True), click.Path(path_type=Path), click.Path(path_type=Path)),
    metavar="VOLTS TRACE RETRACE",
    multiple=True,
    required=True,
    help="Scan voltage at the piezo in volts, peak to peak, and its two images. Omit RETRACE if the first file has "
    "both. Repeat the option for each amplitude.",
)
channel_option = click.option(
    "--channel",
    metavar="NAME|N",
    help="Data channel, for image files with several channels. `tablegen channels FILE` lists them. A name without "
    "the direction, such as Height, selects trace and retrace.  [default: the height, if the file names one]",
)
retrace_channel_option = click.option(
    "--retrace-channel",
    metavar="NAME|N",
    help="Data channel of the retrace image.  [default: the retrace of --channel]",
)
frame_option = click.option(
    "--frame", type=click.IntRange(min=0), metavar="N", help="Image of a movie, counted from 0; for .asd files."
)
frames_option = click.option(
    "--frames", type=_Frames(), metavar="A:B", help="Frames A to B - 1 of a movie: registered and averaged."
)


class CommandOfPairs(click.Command):
    """A command with ``--pair``, whose RETRACE may be omitted if TRACE has both."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Repeat the file of TRACE where RETRACE is omitted."""
        words: list[str] = []
        for at, word in enumerate(args):
            words.append(word)
            if at >= 2 and args[at - 2] == _PAIR and (at + 1 == len(args) or args[at + 1].startswith("--")):
                words.append(word)
        return super().parse_args(ctx, words)


def require_readers(paths: "Iterable[Path]") -> None:
    """End the command if a library that reads one of these images is missing."""
    from tablegen.images.files import MODULES

    needed = {MODULES.get(path.suffix.lower()) for path in paths} - {None}
    require(*sorted(filter(None, needed)), extra="images")
