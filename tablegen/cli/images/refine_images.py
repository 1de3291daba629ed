"""Options of ``tablegen refine --images``."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

import click

from tablegen.cli.calibrate.options import mirrored_option
from tablegen.cli.images.pairs import channel_option, frame_option, require_readers, retrace_channel_option
from tablegen.cli.images.samples import NO_RETRACE, check_sample, constant_options
from tablegen.cli.shared.common import finite

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True)
class ImageArguments:
    """Values of ``--images`` and the options that belong to it."""

    pairs: tuple[tuple[Path, Path], ...]
    retrace_mirrored: bool
    delay_pixels: float | None
    channel: str | None
    retrace_channel: str | None
    frame: int | None
    mismatch: bool
    constant: dict[str, Any]

    @property
    def names(self) -> str:
        """Names of the files for messages."""
        files = dict.fromkeys(path for pair in self.pairs for path in pair if path != NO_RETRACE)
        return " and ".join(map(str, files))

    @property
    def knows_constant(self) -> bool:
        """True if the constant of the sample was given."""
        return any(self.constant[name] is not None for name in ("lattice_nm", "cell", "pitch_nm", "angle_deg"))

    def check(self, trace: Path | None, of_traces: Sequence[str]) -> None:
        """Check that there is a trace or images, with their own options.

        Raises
        ------
        click.UsageError
            If options contradict each other.
        """
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
            "--delay-pixels": self.delay_pixels,
            "--mismatch": self.mismatch or None,
        }
        option = next((name for name, value in of_images.items() if value is not None), None)
        if trace is not None and option is not None:
            raise click.UsageError(f"{option} is for --images")
        if self.mismatch and self.knows_constant:
            raise click.UsageError("--mismatch is for a sample without a period; it has no constant")

    def keywords(self) -> dict[str, Any]:
        """Return the keywords of ``tablegen.refine`` for the images."""
        if self.knows_constant:
            check_sample(self.constant)
        require_readers({path for pair in self.pairs for path in pair} - {NO_RETRACE})
        return {
            "images": [(trace,) if retrace == NO_RETRACE else (trace, retrace) for trace, retrace in self.pairs],
            "retrace_mirrored": self.retrace_mirrored,
            "delay_pixels": self.delay_pixels,
            "channel": self.channel,
            "retrace_channel": self.retrace_channel,
            "frame": self.frame,
            "mismatch": self.mismatch,
            **self.constant,
        }


_OPTIONS: tuple[Callable[[Any], Any], ...] = (
    click.option(
        "--images",
        "pairs",
        type=(click.Path(path_type=Path), click.Path(path_type=Path)),
        metavar="TRACE [RETRACE]",
        multiple=True,
        help="Images of the running scan, in place of TRACE.CSV: a grating or a lattice, of any constant. Omit "
        "RETRACE if the first file has both. Repeat the option for frames that follow each other without a pause.",
    ),
    constant_options,
    mirrored_option,
    click.option(
        "--delay-pixels",
        type=float,
        callback=finite,
        metavar="N",
        help="Delay of the images relative to the drive in pixels; give 0 if it is known that they are not late.  "
        "[default: 0, but not known]",
    ),
    channel_option,
    retrace_channel_option,
    frame_option,
    click.option(
        "--mismatch",
        is_flag=True,
        help="The sample has no period: correct only the difference of trace and retrace.",
    ),
)
_CONSTANT = ("lattice_nm", "lattice", "cell", "pitch_nm", "angle_deg")
_NAMES = ("pairs", "retrace_mirrored", "delay_pixels", "channel", "retrace_channel", "frame", "mismatch")


def image_options(command: F) -> F:
    """Add the options of images, which the command takes as ``images``."""

    @wraps(command)
    def gathered(**options: Any) -> Any:
        constant = {name: options.pop(name) for name in _CONSTANT}
        images = ImageArguments(**{name: options.pop(name) for name in _NAMES}, constant=constant)
        return command(images=images, **options)

    decorated: Any = gathered
    for option in reversed(_OPTIONS):
        decorated = option(decorated)
    with_options: F = decorated
    return with_options
