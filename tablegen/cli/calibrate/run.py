"""Code that all calibration commands share: options, reading of tables, output of a fit."""

import os
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import click

from tablegen.cli.images.samples import check_sample, named_images
from tablegen.cli.shared.common import OutputFile, check_place, fail, require, written
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.plot import check_plot, plot_option, show_plot
from tablegen.cli.shared.progress import Progress

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from tablegen.api.calibrate import Calibrated, Kind
    from tablegen.api.known_scanner import KnownScanner
    from tablegen.base.warnings import Remark
    from tablegen.calibration.tables.columns import Column
    from tablegen.calibration.tables.recorder import Recorder
    from tablegen.calibration.tables.table import MeasuredTable
    from tablegen.charts.picture_file import PlottedCharts
    from tablegen.compensation.size import SizeLaw
    from tablegen.fitting.estimate import Fit
    from tablegen.images.files import ScanImage
    from tablegen.numerics.driver import Driver

F = TypeVar("F", bound=Callable[..., Any])
_NO_RANGE = "give --scanner FILE, or --v-max V, the driver's maximum output"
_REQUIRED_MODULES = ("scipy", "tomlkit")


@dataclass(frozen=True)
class Common:
    """Options that all calibrations share."""

    axis: Literal["x", "y"]
    scanner: Path | None
    v_max: float | None
    v_min: float
    write: bool
    force: bool
    plot: Path | None
    no_plot: bool
    report: Path | None
    as_json: bool


def shared_options(command: F) -> F:
    """Add the options that all calibrations share, as ``common``.

    Raises
    ------
    click.UsageError
        When the command runs, if these options contradict each other.
    """
    options = [
        click.option("--axis", type=click.Choice(("x", "y")), required=True, help="The axis that was measured."),
        click.option(
            "--scanner",
            type=OutputFile(always=False),
            metavar="FILE",
            help="Scanner file. The command reads v_max and v_min from it.",
        ),
        click.option(
            "--v-max",
            type=click.FloatRange(min=1e-3, max=1e5),
            metavar="V",
            help="Full-scale voltage of the piezo driver in volts. Required without a scanner file.",
        ),
        click.option(
            "--v-min",
            type=click.FloatRange(min=-1e5, max=0.0),
            default=0.0,
            metavar="V",
            help="Minimum output of the piezo driver in volts, if it is below 0.",
        ),
        click.option(
            "--write",
            is_flag=True,
            help="Update the scanner file. With --v-max, create it if it does not exist.",
        ),
        click.option("--force", is_flag=True, help="With --write, also write an insignificant fit."),
        plot_option("the data and the fit", by_default=True),
        click.option(
            "--report",
            type=OutputFile(),
            metavar="FILE",
            help="Write parameters, standard errors, outliers and plots to FILE as an HTML page.",
        ),
        click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text."),
    ]

    def run(
        axis: Literal["x", "y"],
        scanner: Path | None,
        v_max: float | None,
        v_min: float,
        write: bool,
        force: bool,
        plot: Path | None,
        no_plot: bool,
        report: Path | None,
        as_json: bool,
        **rest: Any,
    ) -> Any:
        """Check the shared options and run the command.

        Raises
        ------
        click.UsageError
            If they contradict each other.
        """
        if write and scanner is None:
            raise click.UsageError("--write needs --scanner FILE")
        if force and not write:
            raise click.UsageError("--force is for --write")
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the fits are small, and further threads would only spin
        require(*_REQUIRED_MODULES, extra="calibrate")
        check_plot(plot, as_json)
        if write and scanner is not None:
            check_place(scanner.resolve() if scanner.is_symlink() else scanner)
        common = Common(axis, scanner, v_max, v_min, write, force, plot, no_plot, report, as_json)
        return command(common=common, **rest)

    run.__doc__, run.__name__ = command.__doc__, command.__name__
    for option in reversed(options):
        run = option(run)
    run.__click_params__ += getattr(command, "__click_params__", [])  # type: ignore[attr-defined]
    return run  # type: ignore[return-value]


def read_columns(
    path: Path,
    needed: "Sequence[Column]",
    optional: "Sequence[Column]" = (),
    recorder: "Recorder | None" = None,
    peak_to_peak: bool = False,
) -> "MeasuredTable":
    """Read a CSV with these columns, voltages at the piezo; a fault ends the command."""
    from tablegen.base.input_errors import Rejected
    from tablegen.calibration.tables.recorder import AS_WRITTEN

    try:
        with Progress() as progress:
            progress.now("reading the measurements")
            return (recorder or AS_WRITTEN).read(path, needed, optional, peak_to_peak)
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)


def check_measurements(
    kind: "Kind",
    common: Common,
    tables: "Sequence[MeasuredTable]",
    recorder: "Recorder",
    delay_s: float | None = 0.0,
) -> "tuple[Remark, ...]":
    """Return remarks on measurements that look wrong; one that would make the fit wrong ends the command."""
    from tablegen.api.calibrate import measurement_remarks

    scanner_file = known_scanner(common)
    with ended_by_input():
        return measurement_remarks(kind, tables, scanner_file, recorder, delay_s)


def within(table: "MeasuredTable", from_hz: float, to_hz: float) -> "MeasuredTable":
    """Return the rows from one frequency to the other; no row ends the command."""
    from dataclasses import replace

    from tablegen.calibration.tables.columns import FREQUENCY

    rows = (table[FREQUENCY] >= from_hz) & (table[FREQUENCY] <= to_hz)
    if not rows.any():
        fail([f"{table.file}: no row is between {from_hz:g} and {to_hz:g} Hz"], ExitStatus.WRONG_INPUT)
    return replace(
        table, columns={name: values[rows] for name, values in table.columns.items()}, lines=table.lines[rows]
    )


def scanner_options(common: Common) -> dict[str, Any]:
    """Return the keywords of a calibrating function that describe the scanner.

    Raises
    ------
    click.UsageError
        If nothing gives the range of the driver.
    """
    begun = common.scanner is None or (common.write and not common.scanner.exists())
    if begun and common.v_max is None:
        raise click.UsageError(_NO_RANGE)
    # A file that is missing and is not begun is reported when it is read.
    has_range = begun or (common.scanner is not None and common.scanner.exists())
    return {"scanner": common.scanner, "v_max": common.v_max if has_range else None, "v_min": common.v_min}


@contextmanager
def ended_by_input() -> "Iterator[None]":
    """End the command if the input is wrong, or is of no scanner; messages name the file.

    Raises
    ------
    click.UsageError
        If nothing gives the range of the driver.
    """
    from tablegen.api.known_scanner import NoRange
    from tablegen.base.input_errors import Rejected, Unphysical

    try:
        yield
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)
    except Unphysical as reason:
        fail([reason], ExitStatus.WRONG_INPUT)
    except NoRange:
        raise click.UsageError(_NO_RANGE) from None
    except OSError as error:
        fail([f"{error.filename}: {error.strerror or error}"], ExitStatus.WRONG_INPUT)


def known_scanner(common: Common) -> "KnownScanner":
    """Read the scanner file as it is, with the range of the driver; a fault ends the command."""
    from tablegen.api.known_scanner import KnownScanner

    with ended_by_input():
        return KnownScanner.read(common.scanner, common.axis, common.v_max, common.v_min, common.write)


def driver_of(common: Common) -> "Driver":
    """Return the range of the scanner file, or that of the options without a file."""
    scanner_file = known_scanner(common)
    with ended_by_input():
        return scanner_file.driver


def in_file(common: Common, kind: str, key: str) -> float | None:
    """Return a number of the scanner file as it is, or None; no length or frequency is 0 or less."""
    return known_scanner(common).number(kind, key)


def size_law(common: Common, source: str) -> "SizeLaw":
    """Return the size law of the scanner file, for ``source`` of scan voltages; other tables may be incomplete."""
    with ended_by_input():
        return known_scanner(common).size_law(source)


def finish(
    common: Common,
    tables: "Sequence[MeasuredTable | ScanImage]",
    run: "Callable[[], Fit]",
    points: bool = False,
    remarks: "Sequence[Remark]" = (),
) -> int:
    """Fit, print, draw and write; with ``points`` hysteresis, or a response, as measured.

    ``remarks`` are on the measurements, and come before those of the fit.
    """
    from tablegen.api.calibrate import Calibrated, with_remarks
    from tablegen.base.input_errors import Unphysical

    try:
        with Progress() as progress:
            progress.now("fitting")
            fit = with_remarks(run(), remarks)
    except Unphysical as reason:
        fail([f"{', '.join(dict.fromkeys(table.file for table in tables))}: {reason}"], ExitStatus.WRONG_INPUT)
    return output_fit(common, Calibrated(fit, common.axis, tuple(tables), points))


def of_sample_images(
    kind: 'Literal["size", "offset"]', common: Common, images: "Sequence[tuple[Any, ...]]", options: dict[str, Any]
) -> int:
    """Fit sizes, or sizes at several offsets, to images of a sample of known constant; continue as ``output_fit``."""
    from tablegen.api.calibrate import calibrate

    check_sample(options)
    rows = named_images(images)
    with ended_by_input(), Progress() as progress:
        progress.now("fitting")
        fit = calibrate(kind, axis=common.axis, images=rows, **options, **scanner_options(common))
    return output_fit(common, fit)


def output_fit(common: Common, fit: "Calibrated") -> int:
    """Print, draw and write a fit; a meaningless one is printed with its doubts, and written only by --force."""
    if common.as_json:
        click.echo(fit.to_json())
        plot_fit(common, fit.charts)
    else:
        click.echo("\n".join(fit.table()))
        plot_fit(common, fit.charts)
        for finding in fit.findings():
            click.echo(finding.line)
    if common.report is not None:
        written(common.report.parent, {common.report.name: fit.page()})
    if common.write:
        meaningless = fit.doubts
        if meaningless and not common.force:
            where = f"{common.scanner}: {common.axis}"
            advice = "nothing was written; correct the measurement, or write it with --force"
            fail([*(f"{where}: {doubt}" for doubt in meaningless), f"{where}: {advice}"], ExitStatus.WRONG_INPUT)
        _write(common, fit)
    return ExitStatus.OK


def plot_fit(common: Common, charts: "Callable[[], PlottedCharts]") -> None:
    """Draw the charts as the options require."""
    show_plot(common.plot, charts, by_default=not (common.as_json or common.no_plot))


def _write(common: Common, fit: "Calibrated") -> None:
    from tablegen.base.input_errors import Rejected, Unphysical

    assert common.scanner is not None
    name = str(common.scanner)
    path = common.scanner.resolve()
    try:
        driver = None if path.exists() else driver_of(common)
        files = fit.content(common.scanner, driver, force=True)
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)
    except Unphysical as reason:
        fail([f"--points: {reason}"], ExitStatus.WRONG_INPUT)
    except UnicodeDecodeError:
        fail([f"{name}: is not UTF-8"], ExitStatus.WRONG_INPUT)
    except OSError as error:
        fail([f"{error.filename or name}: {error.strerror or error}"], ExitStatus.WRONG_INPUT)
    *beside, own = files
    changed = written(common.scanner.parent, {one: files[one] for one in beside}) if beside else []
    changed += written(path.parent, {own: files[own]})
    click.echo(f"{name}: {common.axis}.{fit.kind} {'written' if changed else 'up to date'}", err=common.as_json)
