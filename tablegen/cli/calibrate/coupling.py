"""``tablegen calibrate coupling``: fit by how much each axis moves along the other, to images or sensors."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tablegen.cli.calibrate.options import columns_option
from tablegen.cli.calibrate.run import ended_by_input
from tablegen.cli.images.pairs import channel_option, require_readers
from tablegen.cli.shared.common import OutputFile, check_place, fail, finite, require, written
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.plot import PlottingCommand, check_plot, plot_option, show_plot
from tablegen.cli.shared.progress import Progress

if TYPE_CHECKING:
    from tablegen.api.calibrate_coupling import CalibratedCoupling, Way

_POSITIVE = click.FloatRange(min=0.0, min_open=True)


@click.command(cls=PlottingCommand, short_help="Fit the coupling of the axes to images or sensors of both.")
@click.argument("records", type=click.Path(path_type=Path), metavar="[RECORD.CSV ...]", nargs=-1)
@click.option(
    "--image",
    "images",
    type=(float, click.Choice(("up", "down")), click.Path(path_type=Path)),
    metavar="DEG up|down IMAGE",
    multiple=True,
    help="In place of records: scan angle in degrees, counterclockwise from x, the way of the frame in the image, and "
    "an image of a lattice. Repeat the option; the sample must not be turned between images.",
)
@click.option("--lattice-nm", type=_POSITIVE, metavar="NM", help="Lattice constant of the sample in the images, in nm.")
@click.option(
    "--lattice",
    type=click.Choice(("hexagonal", "square")),
    default="hexagonal",
    show_default=True,
    help="Kind of the lattice of --lattice-nm.",
)
@click.option(
    "--cell",
    type=(_POSITIVE, _POSITIVE, click.FloatRange(20.0, 160.0)),
    metavar="A B GAMMA",
    help="Any other lattice: the sides of its cell in nm, and the angle between them in degrees.",
)
@click.option(
    "--lies-deg",
    type=(float, click.FloatRange(min=0.0)),
    metavar="DEG ERROR",
    help="Direction of the first side of the cell, counterclockwise from x, and its standard error, in degrees. It "
    "tells x_per_y from y_per_x.  [default: unknown; x_per_y is the whole shear]",
)
@channel_option
@columns_option
@click.option("--scanner", type=OutputFile(always=False), metavar="FILE", help="Scanner file.")
@click.option(
    "--corrected",
    is_flag=True,
    help="The scan of the images had the coupling of the scanner file undone: what they show comes on top of it.",
)
@click.option("--write", is_flag=True, help="Update [coupling] of the scanner file.")
@click.option("--force", is_flag=True, help="With --write, also write an insignificant fit.")
@plot_option("the measured directions, or positions, and the fit")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def coupling(
    records: tuple[Path, ...],
    images: "tuple[tuple[float, Way, Path], ...]",
    scanner: Path | None,
    corrected: bool,
    write: bool,
    force: bool,
    plot: Path | None,
    as_json: bool,
    **how: Any,
) -> int:
    """Fit x_per_y and y_per_x: by how many nm each axis moves along the other, for each nm of its own.

    Columns of a record: x_nm and y_nm of sensors of both axes, and perhaps time_s, while one axis moves and the other
    is at rest. Give a second record for the other axis.

    Or give images of a lattice, which show the angle between the axes. Two frames at one scan angle, up and down, tell
    drift from coupling; so do frames at 0 and 90 degrees. With --lies-deg they show both values.

    \b
    Examples:
      tablegen calibrate coupling x_moves.csv y_moves.csv --scanner scanner.toml --write
      tablegen calibrate coupling --lattice-nm 17.7 --image 0 up a.gwy --image 0 down b.gwy \\
          --scanner scanner.toml --write
    """
    _check(records, images, how, scanner, corrected, write, force)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    require("scipy", "tomlkit", extra="calibrate")
    require_readers({path for *_, path in images})
    check_plot(plot, as_json)
    if write and scanner is not None:
        check_place(scanner.resolve() if scanner.is_symlink() else scanner)
    from tablegen.api.calibrate_coupling import calibrate_coupling, earlier_coupling

    with ended_by_input(), Progress() as progress:
        progress.now("fitting")
        earlier = earlier_coupling(scanner) if corrected and scanner is not None else None
        fit = calibrate_coupling(records, images=images, corrected=earlier, **how)
    click.echo(fit.to_json() if as_json else "\n".join(fit.table()))
    show_plot(plot, fit.charts)
    if not as_json:
        for finding in fit.findings():
            click.echo(finding.line)
    if write and scanner is not None:
        _write(scanner, fit, force, as_json)
    return ExitStatus.OK


def _check(
    records: tuple[Path, ...],
    images: "tuple[tuple[float, Way, Path], ...]",
    how: dict[str, Any],
    scanner: Path | None,
    corrected: bool,
    write: bool,
    force: bool,
) -> None:
    """Check that the options belong together.

    Raises
    ------
    click.UsageError
        If they do not.
    """
    if bool(records) == bool(images):
        raise click.UsageError("give RECORD.CSV of both sensors, or --image DEG up|down IMAGE, one of them")
    sample = [name for name in ("lattice_nm", "cell") if how[name] is not None]
    if images and len(sample) != 1:
        raise click.UsageError("images need the lattice of their sample: --lattice-nm NM, or --cell, one of them")
    of_images = [*sample, *(name for name in ("lies_deg", "channel") if how[name] is not None)]
    if records and (of_images or corrected):
        option = of_images[0].replace("_", "-") if of_images else "corrected"
        raise click.UsageError(f"--{option} is for images, of --image")
    if images and how["columns"] is not None:
        raise click.UsageError("--columns is for records, not for images")
    for option, value in (("--write", write), ("--corrected", corrected)):
        if value and scanner is None:
            raise click.UsageError(f"{option} needs --scanner FILE")
    if force and not write:
        raise click.UsageError("--force is for --write")
    for degrees, *_ in images:
        finite(None, None, degrees)  # type: ignore[arg-type]


def _write(scanner: Path, fit: "CalibratedCoupling", force: bool, quiet: bool) -> None:
    if fit.doubts and not force:
        where = f"{scanner}: coupling"
        advice = "nothing was written; write it with --force if the file has an older one"
        fail([*(f"{where}: {doubt}" for doubt in fit.doubts), f"{where}: {advice}"], ExitStatus.WRONG_INPUT)
    with ended_by_input():
        content = fit.content(scanner, force=True)
    path = scanner.resolve()
    changed = written(path.parent, {path.name: content})
    click.echo(f"{scanner}: coupling {'written' if changed else 'up to date'}", err=quiet)
