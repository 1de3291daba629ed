"""What all calibrations of the command line share: options, reading, and what is done with a fit."""

import json
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from tablegen.cli.shared.common import OutputFile, fail, require, written
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.plot import check_plot, plot_option, put_plot
from tablegen.cli.shared.progress import Progress

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tablegen.api.calibrate import Calibrated
    from tablegen.calibration.tables.columns import Column
    from tablegen.calibration.tables.table import MeasuredTable
    from tablegen.charts.picture_file import PlottedCharts
    from tablegen.compensation.dynamics import Response
    from tablegen.compensation.offset import OffsetLaw
    from tablegen.compensation.size import SizeLaw
    from tablegen.fitting.estimate import Fit
    from tablegen.images.files import ScanImage
    from tablegen.numerics.driver import Driver

F = TypeVar("F", bound=Callable[..., Any])
_REQUIRED_MODULES = ("scipy", "tomlkit")


@dataclass(frozen=True)
class Common:
    """The options that all calibrations share."""

    axis: str
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
    """Add the options that all calibrations share, as ``common``."""
    options = [
        click.option("--axis", type=click.Choice(("x", "y")), required=True, help="The axis that was measured."),
        click.option(
            "--scanner",
            type=OutputFile(),
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
        click.option("--force", is_flag=True, help="With --write, write a fit even if it is meaningless."),
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
        axis: str,
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
        if write and scanner is None:
            raise click.UsageError("--write needs --scanner FILE")
        if force and not write:
            raise click.UsageError("--force is for --write")
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the fits are small, and its threads would only spin
        require(*_REQUIRED_MODULES, extra="calibrate")
        check_plot(plot, as_json)
        common = Common(axis, scanner, v_max, v_min, write, force, plot, no_plot, report, as_json)
        return command(common=common, **rest)

    run.__doc__, run.__name__ = command.__doc__, command.__name__
    for option in reversed(options):
        run = option(run)
    run.__click_params__ += getattr(command, "__click_params__", [])  # type: ignore[attr-defined]
    return run  # type: ignore[return-value]


def read_columns(path: Path, needed: "Sequence[Column]", optional: "Sequence[Column]" = ()) -> "MeasuredTable":
    """A CSV with these columns; what is wrong with it ends the command."""
    from tablegen.base.input_errors import Rejected
    from tablegen.calibration.tables.table import read_table

    try:
        with Progress() as progress:
            progress.now("reading the measurements")
            return read_table(path, needed, optional)
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)


def within(table: "MeasuredTable", from_hz: float, to_hz: float) -> "MeasuredTable":
    """The rows from one frequency to the other; none ends the command."""
    from dataclasses import replace

    from tablegen.calibration.tables.columns import FREQUENCY

    kept = (table[FREQUENCY] >= from_hz) & (table[FREQUENCY] <= to_hz)
    if not kept.any():
        fail([f"{table.file}: no row is between {from_hz:g} and {to_hz:g} Hz"], ExitStatus.WRONG_INPUT)
    return replace(
        table, columns={name: values[kept] for name, values in table.columns.items()}, lines=table.lines[kept]
    )


def _scanner_values(common: Common) -> dict[str, Any]:
    """What the scanner file says now; nothing where it is to be made."""
    from tablegen.base.input_errors import Rejected
    from tablegen.base.toml import read_toml
    from tablegen.config.like import inherited

    if common.scanner is None or (common.write and not common.scanner.exists()):
        return {}
    try:
        return inherited(*read_toml(common.scanner, str(common.scanner)))[0]
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)


def driver_of(common: Common) -> "Driver":
    """The range of the scanner file, or as given where there is none."""
    from tablegen.numerics.driver import Driver

    values = _scanner_values(common)
    found = values.get("v_max")
    if isinstance(found, int | float) and not isinstance(found, bool) and found > 0.0:
        if common.v_max is not None and common.v_max != found:
            fail([f"{common.scanner}: v_max: {found:g} there, and --v-max {common.v_max:g}"], ExitStatus.WRONG_INPUT)
        low = values.get("v_min", 0.0)
        if isinstance(low, bool) or not isinstance(low, int | float) or not low <= 0.0:
            fail([f"{common.scanner}: v_min: not a voltage of 0 or less"], ExitStatus.WRONG_INPUT)
        if common.v_min not in (0.0, low):
            fail([f"{common.scanner}: v_min: {low:g} there, and --v-min {common.v_min:g}"], ExitStatus.WRONG_INPUT)
        return Driver(float(found), float(low))
    if values:
        fail([f"{common.scanner}: v_max: missing, or not a voltage"], ExitStatus.WRONG_INPUT)
    if common.v_max is None:
        raise click.UsageError("give --scanner FILE, or --v-max V, the driver's maximum output")
    return Driver(common.v_max, common.v_min)


def in_file(common: Common, kind: str, key: str) -> float | None:
    """A number of the scanner file as it is, or None; no length or frequency is 0 or less."""
    values: Any = _scanner_values(common)
    for name in (common.axis, kind, key):
        values = values.get(name) if isinstance(values, dict) else None
    return float(values) if isinstance(values, int | float) and values > 0.0 else None


def size_law(common: Common, driver: "Driver", source: str) -> "SizeLaw":
    """The size law of the scanner file, for ``source`` of scan voltages; the rest of the file may be incomplete."""
    from tablegen.base.input_errors import Unphysical
    from tablegen.planning.laws import size_law_of

    path = f"{common.axis}.size"
    if in_file(common, "size", "k_nm_per_v") is None:
        fail([f"{source} takes {path} of --scanner FILE; calibrate the size first"], ExitStatus.WRONG_INPUT)
    try:
        return size_law_of(_tables(common, "size")[path], driver)
    except Unphysical as reason:
        fail([f"{common.scanner}: {path}: {reason}"], ExitStatus.WRONG_INPUT)


def _tables(common: Common, *names: str) -> dict[str, Any]:
    """These tables of the axis as the scanner file has them, by path; a fault in one of them ends the command."""
    from tablegen.api.calibrate import scanner_tables

    assert common.scanner is not None
    tables, problems = scanner_tables(common.scanner)
    found = [problem for problem in problems if problem.key.startswith(f"{common.axis}.")]
    used = [problem for problem in found if problem.key.split(".")[1] in names]
    if used:
        fail(used, ExitStatus.WRONG_INPUT)
    return tables


def scanner_axis(common: Common, driver: "Driver") -> "tuple[Response | None, OffsetLaw]":
    """The dynamics of the scanner file, and its offset law for small scans; without them, none and a constant."""
    from tablegen.base.input_errors import Unphysical
    from tablegen.compensation.offset import OffsetLaw
    from tablegen.compensation.size import SizeLaw
    from tablegen.planning.laws import dynamics_of, offset_surface, size_law_of

    if common.scanner is None or not common.scanner.exists():
        return None, OffsetLaw()
    tables = _tables(common, "offset", "resonance")
    resonance, offset, size = (tables.get(f"{common.axis}.{name}") for name in ("resonance", "offset", "size"))
    try:
        response = None if resonance is None else dynamics_of(resonance, common.scanner.parent)
        law = SizeLaw(1.0, 0.0, 1.0) if size is None else size_law_of(size, driver)
        return response, OffsetLaw() if offset is None else offset_surface(offset, driver, law).small
    except Unphysical as reason:
        fail([f"{common.scanner}: {common.axis}: {reason}"], ExitStatus.WRONG_INPUT)


def finish(
    common: Common, tables: "Sequence[MeasuredTable | ScanImage]", run: "Callable[[], Fit]", points: bool = False
) -> int:
    """Fit, print, draw and write; with ``points`` hysteresis, or a response, as measured.

    A fit that says nothing is printed with its doubts, and not written unless forced.
    """
    from tablegen.api.calibrate import Calibrated
    from tablegen.base.input_errors import Unphysical
    from tablegen.calibration.fit_warnings import fit_findings
    from tablegen.cli.calibrate.text import calibration_text
    from tablegen.images.scan_angle import angle_remarks

    try:
        with Progress() as progress:
            progress.now("fitting")
            fit = run()
            remarks = angle_remarks(tables, common.axis)
            fit = replace(fit, remarks=(*remarks, *fit.remarks)) if remarks else fit
    except Unphysical as reason:
        fail([f"{', '.join(dict.fromkeys(table.file for table in tables))}: {reason}"], ExitStatus.WRONG_INPUT)
    sources = list(dict.fromkeys(table.source for table in tables))  # images may stand in one file
    found = Calibrated(fit, common.axis, tuple(sources), points)
    if common.as_json:
        click.echo(json.dumps(found.record, indent=2, allow_nan=False))
    else:
        click.echo("\n".join(calibration_text(fit, common.axis, tables)))
    plot_fit(common, lambda: _charts(fit, common.axis))
    places = [_place(fit, tables[0], tables[0].file, at) for at in fit.outliers]
    if not common.as_json:
        for finding in fit_findings(fit, places, points):
            click.echo(finding.line)
    if common.report is not None:
        from tablegen.report.fitted import fit_page

        names = [_place(fit, tables[0], tables[0].source.name, at) for at in fit.outliers]
        written(common.report.parent, {common.report.name: fit_page(fit, common.axis, sources, names, points)})
    if common.write:
        meaningless = found.doubts
        if meaningless and not common.force:
            where = f"{common.scanner}: {common.axis}"
            advice = "nothing was written; correct the measurement, or write it all the same with --force"
            fail([*(f"{where}: {doubt}" for doubt in meaningless), f"{where}: {advice}"], ExitStatus.WRONG_INPUT)
        _write(common, found)
    return ExitStatus.OK


def plot_fit(common: Common, charts: "Callable[[], PlottedCharts]") -> None:
    """Draw as the options say."""
    put_plot(common.plot, charts, by_default=not (common.as_json or common.no_plot))


def _charts(fit: "Fit", axis: str) -> "PlottedCharts":
    from tablegen.report.fitted import fit_charts

    return fit_charts(fit, axis)


def _place(fit: "Fit", table: "MeasuredTable | ScanImage", name: str, at: int) -> str:
    """File, as it is called, and line of a point, or its image."""
    from tablegen.calibration.tables.table import MeasuredTable

    if fit.images:
        return fit.images[at].name
    return f"{name}:{table.lines[at]}" if isinstance(table, MeasuredTable) else name


def _write(common: Common, found: "Calibrated") -> None:
    from tablegen.base.input_errors import Rejected, Unphysical

    assert common.scanner is not None
    name = str(common.scanner)
    path = common.scanner.resolve()
    try:
        driver = None if path.exists() else driver_of(common)
        files = found.content(common.scanner, driver, force=True)
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)
    except Unphysical as reason:
        fail([f"--points: {reason}"], ExitStatus.WRONG_INPUT)
    except UnicodeDecodeError:
        fail([f"{name}: is not UTF-8"], ExitStatus.WRONG_INPUT)
    except OSError as error:
        fail([f"{error.filename or name}: {error.strerror or error}"], ExitStatus.WRONG_INPUT)
    *beside, own = files
    changed = written(common.scanner.parent, {one: files[one] for one in beside}) if beside else []  # it is named
    changed += written(path.parent, {own: files[own]})
    click.echo(f"{name}: {common.axis}.{found.kind} {'written' if changed else 'up to date'}", err=common.as_json)
