"""Options of images of a sample of known constant: the sample, and the acquisition of the images."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from tablegen.cli.calibrate.options import delay_pixels_option, mirrored_option, turn_option, window_option
from tablegen.cli.images.pairs import channel_option, frame_option, require_readers, retrace_channel_option
from tablegen.cli.shared.plot import PlottingCommand

F = TypeVar("F", bound=Callable[..., Any])
IMAGE_NAMES = ("--image", "--images")
PAIR_NAME = "--pair"
NO_RETRACE = Path()  # an omitted RETRACE
_POSITIVE = click.FloatRange(min=0.0, min_open=True)


def image_option(metavar: str, volts: int, text: str, names: tuple[str, ...] = IMAGE_NAMES) -> Callable[[F], F]:
    """Return ``--image`` with a number of voltages before the files."""
    kinds: tuple[Any, ...] = (_POSITIVE, float, _POSITIVE)[:volts]
    files = click.Path(path_type=Path), click.Path(path_type=Path)
    return click.option(
        *names, "images", type=(*kinds, *files), metavar=f"{metavar} TRACE [RETRACE]", multiple=True, help=text
    )


class CommandOfImages(PlottingCommand):
    """A command with options of voltages and two files, the second of which may be omitted: (name, voltages)."""

    images = (*((name, 1) for name in IMAGE_NAMES),)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Insert ``NO_RETRACE`` where no second file is named."""
        words: list[str] = []
        for at, word in enumerate(args):
            words.append(word)
            ends = at + 1 == len(args) or args[at + 1].startswith("--")
            if ends and any(at > volts and args[at - volts - 1] == name for name, volts in self.images):
                words.append(str(NO_RETRACE))
        return super().parse_args(ctx, words)


class CommandOfOperatorPairs(CommandOfImages):
    """``--pair`` with a scan voltage, an offset and a rate before the files."""

    images = ((PAIR_NAME, 3),)


class CommandOfRunningImages(CommandOfImages):
    """``--images`` without a voltage: the scan file has it."""

    images = (("--images", 0),)


class CommandOfOffsetImages(CommandOfImages):
    """``--image`` with a scan voltage and an offset before the files."""

    images = (*((name, 2) for name in IMAGE_NAMES),)


_CONSTANTS = [
    click.option(
        "--lattice-nm", type=_POSITIVE, metavar="NM", help="Lattice constant of the sample in the images, in nm."
    ),
    click.option(
        "--lattice",
        type=click.Choice(("hexagonal", "square")),
        default="hexagonal",
        show_default=True,
        help="Kind of the lattice of --lattice-nm.",
    ),
    click.option(
        "--cell",
        type=(_POSITIVE, _POSITIVE, click.FloatRange(20.0, 160.0)),
        metavar="A B GAMMA",
        help="Any other lattice: the sides of its cell in nm, and the angle between them in degrees.",
    ),
    click.option(
        "--pitch-nm",
        type=_POSITIVE,
        metavar="NM",
        help="Pitch of a grating, in nm. With --lattice-nm, images may be of either.",
    ),
    click.option(
        "--angle-deg",
        type=(float, click.FloatRange(min=0.0)),
        metavar="DEG ERROR",
        help="Angle between the fast axis and the normal of a grating's bars, and its standard error, in degrees.  "
        "[default: from the rows]",
    ),
]


def constant_options(command: F) -> F:
    """Add the options of the sample; ``sample_of`` reads them."""
    for option in reversed(_CONSTANTS):
        command = option(command)
    return command


def sample_options(command: F) -> F:
    """Add the options of the sample and the images; ``sample_of`` and ``acquisition_of`` read them."""
    options = [
        *_CONSTANTS,
        click.option(
            "--aspect",
            type=click.FloatRange(0.02, 50.0),
            metavar="RATIO",
            help="Height of the frame, of all rows, over the length of the line from turn to turn.  [default: from "
            "the file, else square pixels]",
        ),
        mirrored_option,
        window_option,
        turn_option,
        delay_pixels_option,
        channel_option,
        retrace_channel_option,
        frame_option,
    ]
    for option in reversed(options):
        command = option(command)
    return command


def check_sample(options: dict[str, Any]) -> None:
    """Check that the options describe one sample.

    Raises
    ------
    click.UsageError
        If they contradict each other, or none is given.
    """
    constant, cell, pitch, angle = (options[name] for name in ("lattice_nm", "cell", "pitch_nm", "angle_deg"))
    if constant is None and cell is None and pitch is None:
        raise click.UsageError("images need the constant of their sample: --lattice-nm NM, --cell, or --pitch-nm NM")
    if constant is not None and cell is not None:
        raise click.UsageError("--lattice-nm and --cell are two lattices; give one")
    if angle is not None and pitch is None:
        raise click.UsageError("--angle-deg is for a grating, of --pitch-nm; a lattice shows its angle")


def refuse_sample(options: dict[str, Any]) -> None:
    """Check that no option of images is given without images.

    Raises
    ------
    click.UsageError
        If one is given.
    """
    for name in ("lattice_nm", "cell", "pitch_nm", "angle_deg", "aspect"):
        if options[name] is not None:
            raise click.UsageError(f"--{name.replace('_', '-')} is for images, of --image")


def named_images(rows: Sequence[tuple[Any, ...]]) -> list[tuple[Any, ...]]:
    """Return the images of ``--image``, without an omitted RETRACE; a missing library ends the command."""
    require_readers({path for *_, trace, retrace in rows for path in (trace, retrace)} - {NO_RETRACE})
    return [row[:-1] if row[-1] == NO_RETRACE else row for row in rows]
