"""``tablegen calibrate``: measurements to parameters of the scanner file, with standard errors."""

import json
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import click

from tablegen.cli.common import fail, written
from tablegen.cli.status import Status

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tablegen.calibration.columns import Column
    from tablegen.calibration.estimate import Fit
    from tablegen.calibration.table import Table

F = TypeVar("F", bound=Callable[..., Any])
_EXTRAS = ("scipy", "tomlkit")


@dataclass(frozen=True)
class _Common:
    """The options that all calibrations share."""

    axis: str
    scanner: Path | None
    v_max: float | None
    write: bool
    plot: Path | None
    as_json: bool


def _shared(command: F) -> F:
    """Those options, as ``common``."""
    options = [
        click.option("--axis", type=click.Choice(("x", "y")), required=True, help="Which axis was measured."),
        click.option(
            "--scanner",
            type=click.Path(path_type=Path, dir_okay=False),
            metavar="FILE",
            help="The scanner file; v_max is taken from it.",
        ),
        click.option("--v-max", type=click.FloatRange(min=1e-3, max=1e5), metavar="V", help="Without a scanner file."),
        click.option("--write", is_flag=True, help="Update FILE in place, or make it with --v-max."),
        click.option(
            "--plot", type=click.Path(path_type=Path, dir_okay=False), metavar="PNG", help="Draw it; or .svg, .pdf."
        ),
        click.option("--json", "as_json", is_flag=True, help="Plain data instead of text."),
    ]

    def run(
        axis: str,
        scanner: Path | None,
        v_max: float | None,
        write: bool,
        plot: Path | None,
        as_json: bool,
        **rest: Any,
    ) -> Any:
        if write and scanner is None:
            raise click.UsageError("--write needs --scanner FILE")
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the fits are small, and its threads would only spin
        _require(*_EXTRAS, extra="calibrate")
        if plot is not None:
            if plot.suffix not in (".png", ".svg", ".pdf"):
                raise click.UsageError(f"--plot {plot}: the name has to end in .png, .svg or .pdf")
            _require("matplotlib", extra="plot")
        return command(common=_Common(axis, scanner, v_max, write, plot, as_json), **rest)

    run.__doc__, run.__name__ = command.__doc__, command.__name__
    for option in reversed(options):
        run = option(run)
    run.__click_params__ += getattr(command, "__click_params__", [])  # type: ignore[attr-defined]
    return run  # type: ignore[return-value]


_data = click.argument("data", type=click.Path(path_type=Path), metavar="DATA.CSV")
_from_hz = click.option("--from-hz", type=float, default=0.0, metavar="HZ", help="Leave out what is below.")
_to_hz = click.option("--to-hz", type=float, default=float("inf"), metavar="HZ", help="Leave out what is above.")


@click.group(
    short_help="Measurements to a scanner file, with standard errors.",
    epilog="""\b
  tablegen calibrate offset --axis x offsets.csv --scanner scanner.toml
  tablegen calibrate offset --axis x offsets.csv --scanner scanner.toml --write
  tablegen calibrate hysteresis --axis x 30v.csv 60v.csv 100v.csv --v-max 100 --plot x.png""",
)
def calibrate() -> None:
    """Calibrate a scanner from CSV files, whose header has units in its names.

    Prints parameters with standard errors, and what they leave of the paper's errors. With --write the scanner file is
    updated in place; a comment says from which bytes. Points that do not fit are named, and never dropped.
    """


@calibrate.command(short_help="Apparent sizes at several offsets: m_minus, m_plus.")
@_shared
@_data
def offset(common: _Common, data: Path) -> int:
    """Apparent sizes of one object, or lattice constants, at three or more offset voltages.

    Columns: offset_v, apparent_nm. They give m_minus and m_plus, (1)-(4).
    """
    from tablegen.calibration.columns import APPARENT, OFFSET
    from tablegen.calibration.offset import fit_offset

    table = _read(data, [OFFSET, APPARENT])
    v_max = _v_max(common)
    return _finish(common, [table], lambda: fit_offset(table[OFFSET], table[APPARENT], v_max))


@calibrate.command(short_help="Actual scan sizes: k, beta, threshold.")
@_shared
@_data
@click.option("--k", type=click.FloatRange(min=1e-6), metavar="NM/V", help="What nominal_nm were set with.")
@click.option("--base-nm", type=click.FloatRange(min=1e-6), metavar="NM", help="Base size.  [default: FILE's, or 200]")
@click.option("--threshold", type=float, metavar="V/V_MAX", help="Keep it at this.  [default: fitted, or 0.5]")
@click.option(
    "--noise",
    type=click.Choice(("relative", "absolute")),
    default="relative",
    show_default=True,
    help="Errors in proportion to the size, as in images, or the same for all, as of a sensor.",
)
def size(
    common: _Common,
    data: Path,
    k: float | None,
    base_nm: float | None,
    threshold: float | None,
    noise: Literal["relative", "absolute"],
) -> int:
    """Actual scan sizes at several drives.

    \b
    Columns: drive_v, the scan voltage peak to peak at the piezo,
             or nominal_nm and --k, the linear constant that made it a voltage;
    and      actual_nm, from a sensor,
             or apparent_nm and true_nm of a lattice, and nominal_nm.

    They give k_nm_per_v at the base size, beta and v_threshold, (6)-(12).
    """
    from tablegen.calibration.columns import ACTUAL, APPARENT, DRIVE, NOMINAL, TRUE
    from tablegen.calibration.size import fit_size

    table = _read(data, [], [DRIVE, NOMINAL, ACTUAL, APPARENT, TRUE])
    if DRIVE not in table and (NOMINAL not in table or k is None):
        fail([f"{table.file}: drive_v is missing; or give nominal_nm, and --k NM/V"], Status.WRONG_INPUT)
    if DRIVE in table and k is not None:
        raise click.UsageError("--k is for nominal sizes; the file has drive_v")
    if ACTUAL not in table and any(column not in table for column in (APPARENT, TRUE, NOMINAL)):
        fail([f"{table.file}: actual_nm is missing; or give nominal_nm, apparent_nm and true_nm"], Status.WRONG_INPUT)
    actual = table[ACTUAL] if ACTUAL in table else table[NOMINAL] * table[TRUE] / table[APPARENT]
    drive = table[DRIVE] if DRIVE in table else table[NOMINAL] / (k or 1.0)
    v_max = _v_max(common)
    base = base_nm or _present(common, "size", "base_nm") or 200.0
    return _finish(common, [table], lambda: fit_size(drive, actual, v_max, base, threshold, noise))


@calibrate.command(short_help="Sensor traces: beta_max, rho, u_peak.")
@_shared
@click.argument("data", type=click.Path(path_type=Path), metavar="DATA.CSV...", nargs=-1, required=True)
@click.option("--rho", type=click.FloatRange(1e-6, 100.0), default=1.5, show_default=True, help="With one amplitude.")
@click.option(
    "--settle", type=click.IntRange(min=0), metavar="N", help="Periods left out.  [default: 1 of three or more]"
)
@click.option(
    "--drift", type=click.IntRange(0, 5), metavar="N", help="Order of the drift.  [default: 1 to 3, by periods]"
)
@click.option("--delay-s", default="0", show_default=True, metavar="S|fit", help="Of the sensor against the drive.")
def hysteresis(
    common: _Common, data: tuple[Path, ...], rho: float, settle: int | None, drift: int | None, delay_s: str
) -> int:
    """Displacement against a triangular drive, over one period or more, at several amplitudes.

    Columns: time_s, drive_v, displacement_nm; where a file has several traces, trace, or a time that begins anew.
    A trace an amplitude gives beta_max and rho, (22), and u_peak, (17); traces of another turn give a set of their own.
    """
    from tablegen.calibration.columns import DISPLACEMENT, DRIVE, TIME, TRACE
    from tablegen.calibration.hysteresis import fit_hysteresis
    from tablegen.calibration.traces import split_traces

    try:
        delay = None if delay_s == "fit" else float(delay_s)
    except ValueError:
        raise click.UsageError(f"--delay-s {delay_s}: seconds, or fit") from None
    tables = [_read(path, [TIME, DRIVE, DISPLACEMENT], [TRACE]) for path in data]
    v_max = _v_max(common)
    traces = [trace for table in tables for trace in split_traces(table)]
    return _finish(common, tables, lambda: fit_hysteresis(traces, v_max, rho, settle, drift, delay))


@calibrate.command(short_help="Gain against frequency: alpha.")
@_shared
@_data
@click.option("--reference-hz", type=click.FloatRange(min=1e-6), metavar="HZ", help="[default: FILE's, or the lowest]")
@_from_hz
@_to_hz
def frequency(common: _Common, data: Path, reference_hz: float | None, from_hz: float, to_hz: float) -> int:
    """Gain at several frequencies below a tenth of the resonance.

    Columns: frequency_hz, gain or gain_db. They give alpha, (23). The reference is the rate of the size calibration.
    """
    from tablegen.calibration.columns import FREQUENCY, GAIN
    from tablegen.calibration.frequency import fit_frequency

    table = _cut(_read(data, [FREQUENCY, GAIN]), from_hz, to_hz)
    reference = reference_hz or _present(common, "frequency", "reference_hz")
    return _finish(common, [table], lambda: fit_frequency(table[FREQUENCY], table[GAIN], reference))


@calibrate.command(short_help="Frequency response: resonance, quality, delay.")
@_shared
@_data
@_from_hz
@_to_hz
def resonance(common: _Common, data: Path, from_hz: float, to_hz: float) -> int:
    """Gain and phase through the resonance.

    Columns: frequency_hz, gain or gain_db, phase_deg or phase_rad. They give frequency_hz, quality and delay_s.
    """
    from tablegen.calibration.columns import FREQUENCY, GAIN, PHASE
    from tablegen.calibration.resonance import fit_resonance

    table = _cut(_read(data, [FREQUENCY, GAIN], [PHASE]), from_hz, to_hz)
    phase = table.columns.get(PHASE.name)
    return _finish(common, [table], lambda: fit_resonance(table[FREQUENCY], table[GAIN], phase))


def _require(*modules: str, extra: str) -> None:
    from importlib.util import find_spec

    missing = [module for module in modules if find_spec(module) is None]
    if missing:
        needs = " and ".join(missing)
        fail([f"{needs} is missing; install it with: pip install 'tablegen[{extra}]'"], Status.TOOL_MISSING)


def _read(path: Path, needed: "Sequence[Column]", optional: "Sequence[Column]" = ()) -> "Table":
    from tablegen.calibration.table import read_table
    from tablegen.problems import Rejected

    try:
        return read_table(path, needed, optional)
    except Rejected as rejected:
        fail(rejected.problems, Status.WRONG_INPUT)


def _cut(table: "Table", from_hz: float, to_hz: float) -> "Table":
    from dataclasses import replace

    from tablegen.calibration.columns import FREQUENCY

    kept = (table[FREQUENCY] >= from_hz) & (table[FREQUENCY] <= to_hz)
    if not kept.any():
        fail([f"{table.file}: no row lies from {from_hz:g} to {to_hz:g} Hz"], Status.WRONG_INPUT)
    return replace(
        table, columns={name: values[kept] for name, values in table.columns.items()}, lines=table.lines[kept]
    )


def _scanner_values(common: _Common) -> dict[str, Any]:
    """What the scanner file says now; nothing where it is to be made."""
    from tablegen.config.toml import read_toml
    from tablegen.problems import Rejected

    if common.scanner is None or (common.write and not common.scanner.exists()):
        return {}
    try:
        return read_toml(common.scanner, str(common.scanner))[0]
    except Rejected as rejected:
        fail(rejected.problems, Status.WRONG_INPUT)


def _v_max(common: _Common) -> float:
    values = _scanner_values(common)
    found = values.get("v_max")
    if isinstance(found, int | float) and not isinstance(found, bool) and found > 0.0:
        if common.v_max is not None and common.v_max != found:
            fail([f"{common.scanner}: v_max: {found:g} there, and --v-max {common.v_max:g}"], Status.WRONG_INPUT)
        return float(found)
    if values:
        fail([f"{common.scanner}: v_max: missing, or no voltage"], Status.WRONG_INPUT)
    if common.v_max is None:
        raise click.UsageError("give --scanner FILE, or --v-max V, the driver's maximum output")
    return common.v_max


def _present(common: _Common, kind: str, key: str) -> float | None:
    """A number of the scanner file as it is, or None."""
    values: Any = _scanner_values(common)
    for name in (common.axis, kind, key):
        values = values.get(name) if isinstance(values, dict) else None
    return float(values) if isinstance(values, int | float) and values > 0.0 else None


def _finish(common: _Common, tables: "list[Table]", run: "Callable[[], Fit]") -> int:
    """Fit, print, draw and write."""
    from tablegen.calibration.summary import record
    from tablegen.cli.calibration_text import calibration_text
    from tablegen.problems import Unphysical

    try:
        fit = run()
    except Unphysical as reason:
        fail([f"{', '.join(table.file for table in tables)}: {reason}"], Status.WRONG_INPUT)
    sources = [table.source for table in tables]
    if common.as_json:
        click.echo(json.dumps(record(fit, common.axis, sources), indent=2, allow_nan=False))
    else:
        click.echo("\n".join(calibration_text(fit, common.axis, tables)))
    if common.plot is not None:
        from tablegen.calibration.figure import draw

        kind: Any = common.plot.suffix[1:]
        written(common.plot.parent, {common.plot.name: draw(fit.curves, kind)})
    if common.write:
        _write(common, fit, tables)
    return Status.OK


def _write(common: _Common, fit: "Fit", tables: "list[Table]") -> None:
    from tablegen.calibration.scanner_file import new_file, updated
    from tablegen.calibration.summary import change
    from tablegen.problems import Rejected

    assert common.scanner is not None
    name = str(common.scanner)
    try:
        path = common.scanner.resolve()
        text = path.read_bytes().decode("utf-8") if path.exists() else new_file(path.stem, _v_max(common))
        put = change(fit, [table.source for table in tables])
        content = updated(text, name, common.axis, put).encode("utf-8")
    except Rejected as rejected:
        fail(rejected.problems, Status.WRONG_INPUT)
    except UnicodeDecodeError:
        fail([f"{name}: is not UTF-8"], Status.WRONG_INPUT)
    except OSError as error:
        fail([f"{name}: {error.strerror or error}"], Status.WRONG_INPUT)
    changed = written(path.parent, {path.name: content})
    click.echo(f"{name}: {common.axis}.{put.kind} {'written' if changed else 'up to date'}", err=common.as_json)
