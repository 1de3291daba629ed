"""``tablegen lattice``: find the lattice of an image."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tablegen.cli.images.pairs import channel_option, frames_option, require_readers, retrace_channel_option
from tablegen.cli.shared.common import fail, finite, quiet_blas
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.plot import PlottingCommand, check_plot, plot_option, show_result
from tablegen.cli.shared.progress import Progress

if TYPE_CHECKING:
    from tablegen.api.lattice import ImageLattice


@click.command(
    cls=PlottingCommand,
    short_help="Find the lattice of an image.",
    epilog="""\b
Examples:
  tablegen lattice scan.sxm --channel Z
  tablegen lattice trace.npy retrace.npy --lattice hexagonal
  tablegen lattice movie.asd --frames 0:8 --lattice-nm 17.7 --plot cell.png

\b
Exit status: 0 done, 2 wrong input or no lattice, 4 cannot write, 6 a library is missing.""",
)
@click.argument("images", type=click.Path(path_type=Path), metavar="IMAGE [RETRACE]", nargs=-1, required=True)
@click.option(
    "--lattice",
    type=click.Choice(("hexagonal", "square", "oblique", "grating")),
    help="Kind of the lattice.  [default: any of two dimensions]",
)
@click.option(
    "--lattice-nm",
    type=click.FloatRange(min=0.0, min_open=True),
    callback=finite,
    metavar="NM",
    help="Lattice constant of the sample, or pitch of the grating, in nm; the lattice is hexagonal without --lattice. "
    "It selects the cell if cells of several sizes are possible.",
)
@channel_option
@retrace_channel_option
@frames_option
@plot_option("the image and its autocorrelation with the cell, and the spectrum with its spots")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def lattice(images: tuple[Path, ...], plot: Path | None, as_json: bool, **how: Any) -> int:
    """Find the lattice of an image, and print its cell: both sides and the angle, with standard errors.

    The cell is the smallest one that explains all significant spots of the spectrum. It is that of the image as it is,
    with the scanner's distortion. With a retrace, the command prints its cell and its shift too. It writes nothing.

    An image without a lattice, with too few periods, or with more than one possible cell is refused with the reason.
    """
    quiet_blas()
    if len(images) > 2:
        raise click.UsageError("more than two images: give one, or a trace and its retrace")
    if len(images) == 2 and how["frames"] is not None:
        raise click.UsageError("--frames is for one movie")
    if how["lattice"] == "oblique" and how["lattice_nm"] is not None:
        raise click.UsageError(
            "--lattice-nm is the constant of a hexagonal or square lattice, or the pitch of a grating"
        )
    require_readers(images)
    check_plot(plot, as_json)
    with Progress() as progress:
        progress.now(f"searching {images[0].name}")
        result = _result(images, how)
    show_result(result, plot, as_json)
    return ExitStatus.OK


def _result(images: tuple[Path, ...], how: dict[str, Any]) -> "ImageLattice":
    from tablegen.api.lattice import lattice as lattice_of
    from tablegen.base.input_errors import Rejected, Unphysical

    try:
        return lattice_of(*images, **how)
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)
    except Unphysical as reason:
        fail([f"{', '.join(map(str, images))}: {reason}"], ExitStatus.WRONG_INPUT)
