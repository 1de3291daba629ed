"""``tablegen refine``: correct the model's remaining error by iterative learning from the running scan."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from tablegen.cli.calibrate.options import recorder_options, refuse_recorder
from tablegen.cli.images.refine_images import ImageArguments, image_options
from tablegen.cli.images.samples import CommandOfRunningImages
from tablegen.cli.shared.common import OutputFile, check_place, fail, finite, require, scan_argument, written
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.plot import check_plot, plot_option, show_plot
from tablegen.cli.shared.progress import Progress

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from tablegen.api.refine import RefinedScan
    from tablegen.api.refine_turned import RefinedTurned
    from tablegen.calibration.tables.recorder import Recorder


@click.command(
    cls=CommandOfRunningImages,
    short_help="Correct remaining scan errors from a sensor trace or images.",
    epilog="""\b
Examples:
  tablegen refine scan.toml trace.csv --axis x            print the errors; write nothing
  tablegen refine scan.toml trace.csv --axis x --write    write the correction to scan.toml
  tablegen refine scan.toml --images t.gwy r.gwy --axis x --write

Exit status: 0 done, 2 wrong input, 4 cannot write, 6 a library is missing.""",
)
@scan_argument
@click.argument("trace", type=click.Path(path_type=Path), metavar="[TRACE.CSV]", required=False)
@click.option("--axis", type=click.Choice(("x", "y")), required=True, help="The axis that was measured.")
@image_options
@recorder_options
@click.option("--write", is_flag=True, help="Write the correction to SCAN.TOML.")
@click.option(
    "--gain",
    type=click.FloatRange(0.0, 2.0, min_open=True, max_open=True),
    default=0.7,
    show_default=True,
    callback=finite,
    metavar="GAIN",
    help="Fraction of the measured error that this round corrects.",
)
@click.option(
    "--harmonics",
    type=click.IntRange(1, 512),
    metavar="N",
    help="Highest harmonic to correct.  [default: 16, or fewer if more might not converge]",
)
@click.option(
    "--triggered",
    is_flag=True,
    help="The trace has no drive_v: its time 0 is a line start (x) or a frame start (y).",
)
@click.option(
    "--period-s",
    type=click.FloatRange(min=0.0, min_open=True),
    callback=finite,
    metavar="S",
    help="With --triggered: period of a line (x) or frame (y) in seconds by the clock of the recorder.  [default: the "
    "period of the scan]",
)
@click.option(
    "--delay-s",
    type=float,
    default=0.0,
    callback=finite,
    show_default=True,
    metavar="S",
    help="Delay of the sensor relative to the drive in seconds.",
)
@click.option(
    "--settle",
    type=click.IntRange(min=0),
    metavar="N",
    help="Ignore the first N periods.  [default: 1 if the trace has three periods or more, otherwise 0]",
)
@click.option(
    "--drift",
    type=click.IntRange(0, 5),
    metavar="N",
    help="Order of the polynomial that describes drift.  [default: 0 to 3, more with more periods]",
)
@click.option(
    "--force",
    is_flag=True,
    help="Use the trace even if its error is larger than before, or if it was used already.",
)
@plot_option("measured and predicted errors, and the correction,", by_default=True)
@click.option("--report", type=OutputFile(), metavar="FILE", help="Write the results to FILE as an HTML page.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of text.")
def refine(
    scan: Path,
    trace: Path | None,
    axis: Literal["x", "y"],
    images: "ImageArguments",
    recorder: "Recorder",
    write: bool,
    gain: float,
    harmonics: int | None,
    triggered: bool,
    period_s: float | None,
    delay_s: float,
    settle: int | None,
    drift: int | None,
    force: bool,
    plot: Path | None,
    no_plot: bool,
    report: Path | None,
    as_json: bool,
) -> int:
    """Correct the scan errors that the scanner model leaves, by iterative learning from the running scan.

    \b
    1. Record several periods of the running scan with a displacement sensor in TRACE.CSV.
       Columns: time_s, displacement_nm, drive_v. A .npz file has one array for each column.
       Or take trace and retrace images of a grating or a lattice: --images.
    2. Run this command with --write. It writes the correction to [AXIS.refinement] of SCAN.TOML.
    3. Build, upload, and record again. Two or three rounds are usually enough.

    At an angle: --triggered, and whole frames from a frame start on.
    """
    of_traces = [
        name
        for name, value in (
            ("--triggered", triggered),
            ("--period-s", period_s),
            ("--delay-s", delay_s),
            ("--settle", settle is not None),
            ("--drift", drift is not None),
        )
        if value
    ]
    images.check(trace, of_traces)
    if period_s is not None and not triggered:
        raise click.UsageError("--period-s is for --triggered; otherwise drive_v has the period")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    require("scipy", "tomlkit", extra="calibrate")
    check_plot(plot, as_json)
    if write:
        check_place(scan.resolve() if scan.is_symlink() else scan)
    files = images.names if trace is None else str(trace)
    turned = _is_turned(scan)
    if turned:
        _check_turned(files, trace is None, {"--report": report, "--drift": drift}, triggered)
    with Progress() as progress:
        progress.now("reading and learning")
        if trace is None:
            refuse_recorder(recorder)
            refined = _learn(scan, files, axis=axis, gain=gain, harmonics=harmonics, **images.keywords())
        else:
            how: dict[str, Any] = {"trace": trace, "gain": gain, "harmonics": harmonics, "columns": recorder.columns}
            how.update(period_s=period_s, delay_s=delay_s, settle_periods=settle)
            if turned:
                refined = _learn_turned(scan, files, axis=axis, **how)
            else:
                how.update(drift_order=drift, drive_gain=recorder.drive_gain, drive_offset=recorder.drive_offset)
                refined = _learn(scan, files, axis=axis, triggered=triggered, **how)
    if as_json:
        click.echo(refined.to_json())
    else:
        click.echo("\n".join(refined.table()))
    show_plot(plot, refined.charts, by_default=not (as_json or no_plot))
    if not as_json:
        for finding in refined.findings():
            click.echo(finding.line)
    refused = refined.refused
    _write_report(report, refined)
    if refused and not force:
        fail([f"{files}: {refused}"], ExitStatus.WRONG_INPUT)
    if refined.stopped and not force:
        click.echo(f"{files}: {refined.stopped}", err=True)
    if write:
        _write(scan, axis, refined, force, as_json)
    return ExitStatus.OK


def _write_report(report: Path | None, refined: "RefinedScan | RefinedTurned") -> None:
    from tablegen.api.refine import RefinedScan

    if report is not None and isinstance(refined, RefinedScan):
        written(report.parent, {report.name: refined.page()})


def _is_turned(scan: Path) -> bool:
    """Return True if the scan is at an angle, on coupled axes or with drift; a wrong file ends the command."""
    from tablegen.base.input_errors import Rejected
    from tablegen.config.load import load

    try:
        return load(scan).mixes_motions
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)
    except OSError as error:
        fail([f"{scan}: {error.strerror or error}"], ExitStatus.WRONG_INPUT)


def _check_turned(files: str, of_images: bool, options: "Mapping[str, object]", triggered: bool) -> None:
    """End the command if a scan at an angle cannot be refined in this way."""
    if of_images:
        why = "images do not show what one axis does at an angle; give a trace of the axis, with --triggered"
        fail([f"{files}: {why}"], ExitStatus.WRONG_INPUT)
    for name, value in options.items():
        if value is not None:
            raise click.UsageError(f"{name} is for scans at 0 degrees, without coupling and drift")
    if not triggered:
        raise click.UsageError("a scan at an angle is refined from a trace whose time 0 is a frame start: --triggered")


def _learn(scan: Path, files: str, **how: Any) -> "RefinedScan | RefinedTurned":
    """Refine the scan; wrong input ends the command."""
    from tablegen.api.refine import refine as learn

    return _learnt(learn, scan, files, how)


def _learn_turned(scan: Path, files: str, **how: Any) -> "RefinedScan | RefinedTurned":
    """Refine a scan at an angle; wrong input ends the command."""
    from tablegen.api.refine_turned import refine_turned

    return _learnt(refine_turned, scan, files, how)


def _learnt(
    learn: "Callable[..., RefinedScan | RefinedTurned]", scan: Path, files: str, how: dict[str, Any]
) -> "RefinedScan | RefinedTurned":
    from tablegen.base.input_errors import Rejected, Unphysical

    try:
        return learn(scan, **how)
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)
    except Unphysical as reason:
        fail([f"{files}: {reason}"], ExitStatus.WRONG_INPUT)
    except OSError as error:
        fail([f"{scan}: {error.strerror or error}"], ExitStatus.WRONG_INPUT)


def _write(scan: Path, axis: str, refined: "RefinedScan | RefinedTurned", force: bool, quiet: bool) -> None:
    from tablegen.base.input_errors import Rejected

    try:
        path = scan.resolve()
        content = refined.content(force)
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)
    if not content:
        click.echo(f"{scan}: not changed", err=quiet)
        return
    written(path.parent, {path.name: content})
    if refined.stopped and not force:
        click.echo(f"{scan}: {axis}.refinement written, with the best layer; build and upload", err=quiet)
    else:
        click.echo(f"{scan}: {axis}.{refined.key} written; build, upload and record again", err=quiet)
