"""``tablegen refine --images``: its options, and the round that trace and retrace of the running scan give."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import click

from tablegen.base.reading import CONFIGURATION, read_text
from tablegen.cli.calibrate.options import delay_pixels_option, mirrored_option
from tablegen.cli.images.pairs import channel_option, frame_option, read_both, retrace_channel_option
from tablegen.cli.images.samples import NO_RETRACE, constant_options, sample_of
from tablegen.cli.shared.common import fail
from tablegen.cli.shared.exit_status import ExitStatus

if TYPE_CHECKING:
    from tablegen.api.refine import RefinedScan
    from tablegen.refinement.round import Options, Round

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True)
class ImageArguments:
    """What was given of ``--images`` and the options that go with it."""

    pairs: tuple[tuple[Path, Path], ...]
    retrace_mirrored: bool
    delay_pixels: float
    channel: str | None
    retrace_channel: str | None
    frame: int | None
    mismatch: bool
    constant: dict[str, Any]

    @property
    def names(self) -> str:
        """The files, as messages call them."""
        files = dict.fromkeys(path for pair in self.pairs for path in pair if path != NO_RETRACE)
        return " and ".join(map(str, files))

    @property
    def knows_constant(self) -> bool:
        """Whether the constant of the sample was given."""
        return any(self.constant[name] is not None for name in ("lattice_nm", "cell", "pitch_nm", "angle_deg"))

    def check(self, trace: Path | None, of_traces: Sequence[str]) -> None:
        """A trace or images, with their own options. Raises ``click.UsageError``."""
        if (trace is None) == (not self.pairs):
            raise click.UsageError("give TRACE.CSV of a sensor, or --images TRACE RETRACE, one of them")
        if self.pairs and of_traces:
            raise click.UsageError(f"{of_traces[0]} is for the trace of a sensor, not for --images")
        of_images = {
            "--lattice-nm, --cell, --pitch-nm or --angle-deg": True if self.knows_constant else None,
            "--channel": self.channel,
            "--retrace-channel": self.retrace_channel,
            "--frame": self.frame,
            "--retrace-mirrored": self.retrace_mirrored or None,
            "--delay-pixels": self.delay_pixels or None,
            "--mismatch": self.mismatch or None,
        }
        given = next((name for name, value in of_images.items() if value is not None), None)
        if trace is not None and given is not None:
            raise click.UsageError(f"{given} is for --images")
        if self.mismatch and self.knows_constant:
            raise click.UsageError("--mismatch is for a sample without a period; it has no constant")

    def learn(self, scan: Path, axis: Literal["x", "y"], options: "Options") -> "RefinedScan":
        """The round; what is wrong ends the command."""
        from tablegen.api.refine import RefinedScan
        from tablegen.base.input_errors import Rejected, Unphysical
        from tablegen.config.load import load
        from tablegen.images.scan_angle import running_scan_remarks
        from tablegen.refinement.image_round import refine_images, refine_mismatch
        from tablegen.refinement.lattice_line import ImageOptions

        sample = sample_of(self.constant) if self.knows_constant else None
        read = [
            read_both(
                trace, trace if retrace == NO_RETRACE else retrace, self.channel, self.retrace_channel, self.frame
            )
            for trace, retrace in self.pairs
        ]
        heights = [(trace.heights, retrace.heights) for trace, retrace in read]
        sources = [image.source for pair in read for image in pair]
        taken = ImageOptions(self.retrace_mirrored, self.delay_pixels)
        found: Round
        try:
            setup = load(scan)
            if setup.scan.y.off:
                raise Rejected([setup.scan_file.problem("y.motion", "'off' makes a line scan, which takes no images")])
            text = read_text(scan, CONFIGURATION)
            if self.mismatch:
                found = refine_mismatch(setup, axis, heights, options, taken)
            else:
                found = refine_images(setup, axis, heights, options, taken, sample)
        except Rejected as rejected:
            fail(rejected.problems, ExitStatus.WRONG_INPUT)
        except Unphysical as reason:
            fail([f"{self.names}: {reason}"], ExitStatus.WRONG_INPUT)
        except OSError as error:
            fail([f"{scan}: {error.strerror or error}"], ExitStatus.WRONG_INPUT)
        remarks = running_scan_remarks(image for pair in read for image in pair)
        found = replace(found, remarks=(*remarks, *found.remarks))
        return RefinedScan(found, tuple(sources), scan, text)


_OPTIONS: tuple[Callable[[Any], Any], ...] = (
    click.option(
        "--images",
        "pairs",
        type=(click.Path(path_type=Path), click.Path(path_type=Path)),
        metavar="TRACE [RETRACE]",
        multiple=True,
        help="Images of the running scan, in place of TRACE.CSV: a grating or a lattice, of any constant. RETRACE is "
        "left out if the first file has both. Repeat the option for frames that follow each other without a pause.",
    ),
    constant_options,
    mirrored_option,
    delay_pixels_option,
    channel_option,
    retrace_channel_option,
    frame_option,
    click.option(
        "--mismatch",
        is_flag=True,
        help="The sample has no period: correct only what trace and retrace differ by.",
    ),
)
_CONSTANT = ("lattice_nm", "lattice", "cell", "pitch_nm", "angle_deg")
_NAMES = ("pairs", "retrace_mirrored", "delay_pixels", "channel", "retrace_channel", "frame", "mismatch")


def image_options(command: F) -> F:
    """The options of images, given to the command as ``images``."""

    @wraps(command)
    def gathered(**given: Any) -> Any:
        constant = {name: given.pop(name) for name in _CONSTANT}
        return command(images=ImageArguments(**{name: given.pop(name) for name in _NAMES}, constant=constant), **given)

    decorated: Any = gathered
    for option in reversed(_OPTIONS):
        decorated = option(decorated)
    found: F = decorated
    return found
