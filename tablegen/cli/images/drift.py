"""``tablegen drift``: measure the drift between images of one place."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tablegen.cli.images.pairs import channel_option, frames_option, require_readers, retrace_channel_option
from tablegen.cli.shared.common import fail, finite, quiet_blas
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.plot import PlottingCommand, check_plot, plot_option, show_result
from tablegen.cli.shared.progress import Progress

if TYPE_CHECKING:
    from tablegen.api.drift import ImageDrift


@click.command(
    cls=PlottingCommand,
    short_help="Measure the drift between images.",
    epilog="""\b
Examples:
  tablegen drift first.npy second.npy --seconds-apart 120
  tablegen drift movie.asd --channel TP --frames 0:8 --within 5 --plot drift.png
  tablegen drift first.sxm second.sxm --scan scan.toml

\b
Exit status: 0 done, 2 wrong input or not the same place, 4 cannot write, 6 a library is missing.""",
)
@click.argument("images", type=click.Path(path_type=Path), metavar="IMAGE [IMAGE ...]", nargs=-1, required=True)
@click.option(
    "--seconds-apart",
    type=click.FloatRange(min=0.0, min_open=True),
    callback=finite,
    metavar="S",
    help="Time from the start of an image to the start of the next, in s.  [default: that of the frames of a movie]",
)
@click.option(
    "--within",
    "within_nm",
    type=click.FloatRange(min=0.0, min_open=True),
    callback=finite,
    metavar="NM",
    help="Largest shift from an image to the next, in nm; a lattice needs it, below half a cell.",
)
@click.option(
    "--scan",
    type=click.Path(path_type=Path),
    metavar="SCAN.TOML",
    help="Scan file with which the images were taken, in frames that go up: also print its drift_nm_per_s, with which "
    "it follows the sample.",
)
@channel_option
@retrace_channel_option
@frames_option
@plot_option("the drift of each interval with its standard error")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def drift(images: tuple[Path, ...], plot: Path | None, as_json: bool, **how: Any) -> int:
    """Measure the drift between images of one place, along x and y in nm/s, with standard errors.

    Give two images or more in the order of time, or a movie with --frames: each is registered against the one before,
    by trace and retrace where its file has both. The drift is the motion of the sample in the image: x along the lines,
    y along the slow axis in the order of rows. The command writes nothing.

    Images that do not show the same place, or have a shift that is ambiguous, are refused with the reason.
    """
    quiet_blas()
    if how["frames"] is not None and len(images) != 1:
        raise click.UsageError("--frames is for one movie")
    if how["frames"] is None and len(images) < 2:
        raise click.UsageError("drift needs two images or more, or a movie with --frames A:B")
    require_readers(images)
    check_plot(plot, as_json)
    with Progress() as progress:
        progress.now(f"registering {images[0].name}")
        result = _result(images, how)
    show_result(result, plot, as_json)
    return ExitStatus.OK


def _result(images: tuple[Path, ...], how: dict[str, Any]) -> "ImageDrift":
    from tablegen.api.drift import drift as drift_of
    from tablegen.base.input_errors import Rejected

    try:
        return drift_of(*images, **how)
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)
