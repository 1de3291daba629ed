"""``tablegen correct``: correct existing images by the scanner file, or by a fit to the image."""

import json
import os
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from tablegen.cli.images.pairs import frames_option
from tablegen.cli.shared.common import check_place, fail, finite, require, written
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.plot import PlottingCommand, check_plot, plot_option, show_plot
from tablegen.cli.shared.progress import Progress
from tablegen.cli.shared.progress_bar import Bar

if TYPE_CHECKING:
    from tablegen.api.correct import Corrected

F = TypeVar("F", bound=Callable[..., Any])
_OUTPUTS = (".gwy", ".tif", ".tiff", ".npy", ".png")
_POSITIVE = click.FloatRange(min=0.0, min_open=True)


def _number(name: str, metavar: str, text: str, kind: Any = _POSITIVE, **more: Any) -> Callable[[F], F]:
    return click.option(name, type=kind, callback=finite, metavar=metavar, help=text, **more)


@click.command(
    cls=PlottingCommand,
    short_help="Correct existing images.",
    epilog="""\b
Examples:
  tablegen correct old.gwy --scanner scanner.toml --size-v 90 --offset-v 50 --rate-hz 2
  tablegen correct trace.npy retrace.npy --scanner scanner.toml --size-v 90 --rate-hz 2 -o straight.gwy
  tablegen correct old.ibw --fit --lattice-nm 18.5 -o straight.tif --plot straight.png
  tablegen correct atoms.sxm --fit --affine --lattice-nm 0.246 --lattice hexagonal -o straight.gwy
  tablegen correct *.ibw --each --scanner scanner.toml --size-v 90 --rate-hz 2 -o straight

\b
Exit status: 0 done, 2 wrong input, 4 cannot write, 6 a library is missing, 130 interrupted.""",
)
@click.argument("images", type=click.Path(path_type=Path), metavar="IMAGE [RETRACE]", nargs=-1, required=True)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE|DIRECTORY",
    help="Corrected image: .gwy, .tif, .npy or .png. With --each or --pairs a directory. "
    "Without this option, no file is written.",
)
@click.option("--scanner", type=click.Path(path_type=Path), metavar="FILE", help="Scanner file of the instrument.")
@click.option(
    "--scan",
    type=click.Path(path_type=Path),
    metavar="SCAN.TOML",
    help="Scan file that the image was taken with, for its drive.",
)
@click.option("--fit", is_flag=True, help="Fit a periodic sample in the image; no scanner file is needed.")
@_number("--pitch-nm", "NM", "With --fit: pitch of the grating, for the size.")
@_number("--lattice-nm", "NM", "With --fit: constant of a hexagonal or square lattice, for size, height and shear.")
@click.option(
    "--lattice",
    type=click.Choice(["hexagonal", "square"]),
    help="Kind of the lattice of --lattice-nm.  [default: hexagonal, or square if this makes the frame straight]",
)
@click.option(
    "--affine",
    is_flag=True,
    help="With --fit and --lattice: correct height and shear alone, and with --lattice-nm the width, by the cell of "
    "the lattice. For images of few periods, or with too much beside the lattice for a displacement.",
)
@_number("--size-v", "V", "Scan voltage of the fast axis at the piezo, peak to peak.")
@_number("--size-nm", "NM", "Instead of --size-v: scan size by the size calibration of the scanner file.")
@_number(
    "--offset-v",
    "V",
    "Offset voltage of the fast axis.  [default: the middle of the driver's range]",
    click.FloatRange(-1e5, 1e5),
)
@_number("--rate-hz", "HZ", "Line rate; forward and backward make one line.  [default: that of the file]")
@click.option(
    "--lines",
    type=click.IntRange(1, 1 << 20),
    metavar="N",
    help="Lines in a period of the slow axis.  [default: by the rows, --slow-turn and --slow-window]",
)
@_number(
    "--turn",
    "FRACTION",
    "Turn of the fast axis: forward fraction of the line.  [default: that of the file, else 0.5]",
    click.FloatRange(0.0, 1.0, min_open=True),
)
@click.option(
    "--window",
    type=(float, float),
    metavar="LOW HIGH",
    help="Part of each sweep that the columns span.  [default: that of the file, else 0 1]",
)
@_number("--slow-size-v", "V", "Scan voltage of the slow axis.  [default: as the fast axis]")
@_number("--slow-size-nm", "NM", "Instead of --slow-size-v: its size by the size calibration.")
@_number(
    "--slow-offset-v", "V", "Offset voltage of the slow axis.  [default: as the fast axis]", click.FloatRange(-1e5, 1e5)
)
@_number(
    "--slow-turn",
    "FRACTION",
    "Turn of the slow axis; 0.5 scans up, then down.",
    click.FloatRange(0.0, 1.0, min_open=True),
    default=0.5,
    show_default=True,
)
@click.option(
    "--slow-window",
    type=(float, float),
    default=(0.0, 1.0),
    show_default=True,
    metavar="LOW HIGH",
    help="Part of the slow sweep that the rows span.",
)
@click.option("--slow-back", is_flag=True, help="The rows were scanned while the slow axis moved back.")
@_number(
    "--delay-pixels", "N", "Delay of the images relative to the drive in pixels.", float, default=0.0, show_default=True
)
@click.option(
    "--channel",
    metavar="NAME|N",
    help="Channel to fit and to compare; all channels are corrected.  [default: the height, if the file names one]",
)
@click.option("--retrace-channel", metavar="NAME|N", help="Retrace of that channel.  [default: by its name]")
@click.option(
    "--retrace-mirrored",
    is_flag=True,
    help="The retrace is stored in order of time: its left pixel is the right end of the line.",
)
@click.option("--frame", type=click.IntRange(min=0), metavar="N", help="Frame of a movie, from 0.")
@frames_option
@click.option("--each", is_flag=True, help="Correct each IMAGE by itself, into the directory -o.")
@click.option(
    "--pairs",
    is_flag=True,
    help="The images are pairs, each a trace and then its retrace; correct each pair, into the directory -o.",
)
@click.option(
    "--format",
    "suffix",
    type=click.Choice([suffix[1:] for suffix in _OUTPUTS]),
    default="gwy",
    show_default=True,
    help="With --each or --pairs: format of the corrected images.",
)
@plot_option("the image before and after, and the remaining difference,")
@click.option("--force", is_flag=True, help="Replace existing files.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def correct(images: tuple[Path, ...], **options: Any) -> int:
    """Correct existing images in x and y: by the scanner file, or by a fit to the image itself.

    All channels of the file are resampled once, with cubic splines, onto a regular grid of as many pixels. Pixels that
    were not imaged are masked. The output contains a record of the correction, with the SHA-256 of the files.

    \b
    By a scanner file:  give the drive of the image: --size-v, --offset-v, --rate-hz; or --scan.
    By a fit (--fit):   trace and retrace of a grating or a lattice, three periods or more in the
                        line, better ten. A lattice gives both axes, a grating the fast one.
                        With --affine height and shear alone, and with --lattice-nm the width.

    A file may have trace and retrace as channels; otherwise give both files. The command prints their difference before
    and after, which shows whether the correction is right.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    _check_usage(images, options)
    several = options["each"] or options["pairs"]
    suffix = f".{options['suffix']}" if several else (options["output"].suffix.lower() if options["output"] else None)
    _require(images, suffix)
    check_plot(options["plot"], options["as_json"])
    jobs = _jobs(images, options)
    targets = _targets(jobs, options, suffix)
    if options["output"] is not None:
        check_place(options["output"] / "image" if several else options["output"])
    records: list[dict[str, Any]] = []
    refused: list[object] = []  # the other images of a batch are still corrected
    bar = Bar(unit="images") if several else None
    for number, (trace, retrace) in enumerate(jobs):
        if bar is not None:
            bar(number, len(jobs))
        try:
            with nullcontext() if bar is not None else Progress() as progress:
                if progress is not None:
                    progress.now(f"correcting {trace.name}")
                corrected = _corrected(trace, retrace, options)
            if bar is not None:
                bar.hide()
            records.append(_output(corrected, targets[number], suffix, options))
        except _Refused as reason:
            refused += reason.lines
    if bar is not None:
        bar.close()
    if options["as_json"] and records:
        click.echo(json.dumps(records if several else records[0], indent=2, allow_nan=False))
    if refused:
        fail(refused, ExitStatus.WRONG_INPUT)
    return ExitStatus.OK


class _Refused(Exception):
    """The input is wrong; ``lines`` has the reasons."""

    def __init__(self, lines: Sequence[object]) -> None:
        super().__init__()
        self.lines = lines


def _check_usage(images: tuple[Path, ...], options: dict[str, Any]) -> None:
    several = options["each"] or options["pairs"]
    wrong = None
    if options["each"] and options["pairs"]:
        wrong = "--each and --pairs: keep one of the two"
    elif options["pairs"] and len(images) % 2:
        wrong = f"--pairs: {len(images)} images are no pairs"
    elif not several and len(images) > 2:
        wrong = "more than two images: give --each, or --pairs for a trace and a retrace by turns"
    elif several and options["output"] is None:
        wrong = "--each and --pairs need a directory, -o DIRECTORY"
    elif several and options["plot"] is not None:
        wrong = "--plot is for one scan"
    elif options["frames"] is not None and (
        options["frame"] is not None or options["each"] or options["pairs"] or len(images) > 1
    ):
        wrong = "--frames is for one movie, without --frame, --each and --pairs"
    else:
        wrong = _wrong_way(options)
    for axis in ("", "slow_"):
        if options[f"{axis}size_v"] and options[f"{axis}size_nm"]:
            name = f"--{axis.replace('_', '-')}size"
            wrong = f"{name}-v and {name}-nm: keep one of the two"
    if options["output"] is not None and not several and options["output"].suffix.lower() not in _OUTPUTS:
        wrong = f"-o {options['output']}: the name has to end in {', '.join(_OUTPUTS)}"
    if options["plot"] in images:
        wrong = f"--plot {options['plot']}: is an image to correct"
    if wrong:
        raise click.UsageError(wrong)


def _wrong_way(options: dict[str, Any]) -> str | None:
    """Return the contradiction of the options that choose the way of correction; None without one."""
    files = options["scanner"] is not None or options["scan"] is not None
    if not options["fit"]:
        if not files:
            return "give --scanner FILE, or --scan SCAN.TOML, or --fit for a periodic sample"
        if options["pitch_nm"] or options["lattice_nm"] or options["lattice"] or options["affine"]:
            return "--pitch-nm, --lattice-nm, --lattice and --affine are for --fit"
    elif files:
        return "--fit needs no scanner file; keep one of the two"
    elif options["affine"]:
        if options["pitch_nm"] or not options["lattice"]:
            return "--affine needs --lattice, the kind of the lattice; --lattice-nm for the size too; and no --pitch-nm"
    elif options["lattice"] and not options["lattice_nm"]:
        return "--lattice is the kind of the lattice of --lattice-nm; without it, --affine corrects the shape alone"
    elif options["pitch_nm"] and options["lattice_nm"]:
        return "--pitch-nm and --lattice-nm: keep one of the two"
    return None


def _require(images: Sequence[Path], suffix: str | None) -> None:
    """Require the libraries of all files, or end with advice."""
    from tablegen.correction.output_files import MODULES as WRITERS
    from tablegen.images.files import MODULES as READERS

    needed = {READERS.get(path.suffix.lower()) for path in images} | {WRITERS.get(suffix or "")} | {"scipy"}
    require(*sorted(filter(None, needed)), extra="images")


def _jobs(images: tuple[Path, ...], options: dict[str, Any]) -> list[tuple[Path, Path | None]]:
    if options["each"]:
        return [(path, None) for path in images]
    if options["pairs"]:
        return list(zip(images[::2], images[1::2], strict=True))
    return [(images[0], images[1] if len(images) == 2 else None)]


def _targets(
    jobs: Sequence[tuple[Path, Path | None]], options: dict[str, Any], suffix: str | None
) -> list[tuple[Path, str] | None]:
    """Return folder and name without the ending of each output; None where nothing is written."""
    output: Path | None = options["output"]
    if output is None:
        return [None] * len(jobs)
    if not (options["each"] or options["pairs"]):
        return [(output.parent, output.name[: -len(output.suffix)])]
    names = [trace.stem for trace, _ in jobs]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        fail(
            [f"{twice[0]}: two images of this name would be one file; correct them one by one"], ExitStatus.WRONG_INPUT
        )
    return [(output, name) for name in names]


_OPTIONS_OF_OUTPUT = ("output", "each", "pairs", "suffix", "plot", "force", "as_json")


def _corrected(trace: Path, retrace: Path | None, options: dict[str, Any]) -> "Corrected":
    from tablegen.api.correct import correct as put_straight
    from tablegen.base.input_errors import Rejected, Unphysical

    names = str(trace) if retrace is None else f"{trace}, {retrace}"
    try:
        how = {name: value for name, value in options.items() if name not in _OPTIONS_OF_OUTPUT}
        return put_straight(trace, retrace, **how)
    except Rejected as rejected:
        raise _Refused(rejected.problems) from None
    except Unphysical as reason:
        raise _Refused([f"{names}: {reason}"]) from None
    except OSError as error:
        raise _Refused([f"{error.filename or names}: {error.strerror or error}"]) from None


def _output(
    corrected: "Corrected", target: tuple[Path, str] | None, suffix: str | None, options: dict[str, Any]
) -> dict[str, Any]:
    """Print, draw and write one scan; return its record."""
    from tablegen.correction.output_files import files_of

    files: dict[str, bytes] = {}
    if target is not None:
        assert suffix is not None
        files = files_of(corrected.scan, target[1], suffix)
        sources = {(Path(options["scanner"] or ".")).resolve()}
        for name in files:
            path = target[0] / name
            if path.exists() and not options["force"]:
                raise _Refused([f"{path}: is there already; give --force to replace it"])
            if path.resolve() in sources:
                raise _Refused([f"{path}: is the scanner file"])
    if not options["as_json"]:
        click.echo(corrected.summary())
    show_plot(options["plot"], corrected.charts)
    if target is not None:
        written(target[0], files)
        for name in files:
            click.echo(f"{target[0] / name} written", err=options["as_json"])
    return corrected.record
