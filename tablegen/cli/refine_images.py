"""``tablegen refine --images``: its options, and the round that trace and retrace of the running scan give."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import click

from tablegen.cli.common import fail, finite, require
from tablegen.cli.exit_status import ExitStatus
from tablegen.reading import CONFIGURATION, read_text

if TYPE_CHECKING:
    from tablegen.calibration.table import Source
    from tablegen.refinement.round import Options, Round

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True)
class ImageArguments:
    """What was given of ``--images`` and the options that go with it."""

    pairs: tuple[tuple[Path, Path], ...]
    channel: str | None
    retrace_channel: str | None
    retrace_mirrored: bool
    delay_pixels: float
    mismatch: bool

    @property
    def names(self) -> str:
        """The files, as messages call them."""
        return " and ".join(str(path) for path in dict.fromkeys(path for pair in self.pairs for path in pair))

    def check(self, trace: Path | None, of_traces: Sequence[str]) -> None:
        """A trace or images, with their own options. Raises ``click.UsageError``."""
        if (trace is None) == (not self.pairs):
            raise click.UsageError("give TRACE.CSV of a sensor, or --images TRACE RETRACE, one of them")
        if self.pairs and of_traces:
            raise click.UsageError(f"{of_traces[0]} is for the trace of a sensor, not for --images")
        of_images = {
            "--channel": self.channel,
            "--retrace-channel": self.retrace_channel,
            "--retrace-mirrored": self.retrace_mirrored,
            "--delay-pixels": self.delay_pixels,
            "--mismatch": self.mismatch,
        }
        given = next((name for name, value in of_images.items() if value), None)
        if trace is not None and given is not None:
            raise click.UsageError(f"{given} is for --images")

    def learn(self, scan: Path, axis: Literal["x", "y"], options: "Options") -> "tuple[Round, list[Source], str]":
        """The round, where the images came from, and the text of the scan file that was planned."""
        from tablegen.calibration.image_files import MODULES
        from tablegen.cli.calibration_run import read_heights
        from tablegen.config.load import load
        from tablegen.problems import Rejected, Unphysical
        from tablegen.refinement.image_round import refine_images, refine_mismatch
        from tablegen.refinement.lattice_line import ImageOptions

        needed = {MODULES.get(path.suffix.lower()) for pair in self.pairs for path in pair}
        require(*sorted(filter(None, needed)), extra="images")
        read = [
            (read_heights(trace, self.channel), read_heights(retrace, self.retrace_channel or self.channel))
            for trace, retrace in self.pairs
        ]
        heights = [(trace.heights, retrace.heights) for trace, retrace in read]
        sources = [image.source for pair in read for image in pair]
        try:
            setup = load(scan)
            text = read_text(scan, CONFIGURATION)
            learn_from = refine_mismatch if self.mismatch else refine_images
            found = learn_from(setup, axis, heights, options, ImageOptions(self.retrace_mirrored, self.delay_pixels))
        except Rejected as rejected:
            fail(rejected.problems, ExitStatus.WRONG_INPUT)
        except Unphysical as reason:
            fail([f"{self.names}: {reason}"], ExitStatus.WRONG_INPUT)
        except OSError as error:
            fail([f"{scan}: {error.strerror or error}"], ExitStatus.WRONG_INPUT)
        return found, sources, text


_OPTIONS = (
    click.option(
        "--images",
        "pairs",
        type=(click.Path(path_type=Path), click.Path(path_type=Path)),
        metavar="TRACE RETRACE",
        multiple=True,
        help="Images of the running scan, in place of TRACE.CSV: a grating or a lattice, of any constant. Repeat the "
        "option for frames that follow each other without a pause.",
    ),
    click.option("--channel", metavar="NAME|N", help="Data channel, for image files with several channels."),
    click.option(
        "--retrace-channel", metavar="NAME|N", help="Data channel of the retrace image.  [default: same as --channel]"
    ),
    click.option(
        "--retrace-mirrored",
        is_flag=True,
        help="The retrace image is stored in order of time: its left pixel is the right end of the line.",
    ),
    click.option(
        "--delay-pixels",
        type=float,
        default=0.0,
        callback=finite,
        show_default=True,
        metavar="N",
        help="Delay of the images relative to the drive in pixels.",
    ),
    click.option(
        "--mismatch",
        is_flag=True,
        help="The sample has no period: correct only what trace and retrace differ by.",
    ),
)
_NAMES = ("pairs", "channel", "retrace_channel", "retrace_mirrored", "delay_pixels", "mismatch")


def image_options(command: F) -> F:
    """The options of images, given to the command as ``images``."""

    @wraps(command)
    def gathered(**given: Any) -> Any:
        return command(images=ImageArguments(**{name: given.pop(name) for name in _NAMES}), **given)

    decorated: Any = gathered
    for option in reversed(_OPTIONS):
        decorated = option(decorated)
    found: F = decorated
    return found
