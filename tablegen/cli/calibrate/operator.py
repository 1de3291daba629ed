"""``tablegen calibrate operator``: fit an operator of the piezo to sensor traces or images."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tablegen.base.reading import CONFIGURATION, read_text
from tablegen.cli.calibrate.options import delay_of, delay_option, recorder_options, refuse_recorder
from tablegen.cli.calibrate.run import Common, ended_by_input, plot_fit, scanner_options, shared_options
from tablegen.cli.images.samples import (
    PAIR_NAME,
    CommandOfOperatorPairs,
    check_sample,
    image_option,
    named_images,
    refuse_sample,
    sample_options,
)
from tablegen.cli.shared.common import written
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.progress import Progress

if TYPE_CHECKING:
    from tablegen.api.calibrated_operator import CalibratedOperator
    from tablegen.calibration.tables.recorder import Recorder


@click.command(cls=CommandOfOperatorPairs, short_help="Fit an operator of the piezo to sensor traces or images.")
@shared_options
@recorder_options
@click.argument("data", type=click.Path(path_type=Path), metavar="[DATA.CSV]...", nargs=-1)
@delay_option
@image_option(
    "VOLTS OFFSET_V RATE_HZ",
    3,
    "Scan voltage and offset at the piezo in volts, line rate in Hz, and two images of a sample of known constant, "
    "scanned with a triangle. Omit RETRACE if the first file has both. Repeat the option for each scan.",
    (PAIR_NAME,),
)
@sample_options
@click.option(
    "--for",
    "scans",
    type=(float, float),
    multiple=True,
    metavar="VOLTS OFFSET_V",
    help="Scan that the next trace is to help: its voltage peak to peak and its offset, in volts at the piezo. Repeat "
    "the option for each scan.  [default: all that a build serves]",
)
@click.option(
    "--step",
    "steps",
    type=click.Path(path_type=Path),
    multiple=True,
    metavar="STEP.CSV",
    help="Record of a running scan through a change of its offset, with the columns of the traces: shows whether the "
    "sensitivity follows the offset late, and how the image drifts then. Repeat the option for each record.",
)
def operator(
    common: Common,
    recorder: "Recorder",
    data: tuple[Path, ...],
    delay_s: str,
    images: tuple[tuple[float, float, float, Path, Path], ...],
    scans: tuple[tuple[float, float], ...],
    steps: tuple[Path, ...],
    **sample: Any,
) -> int:
    """Fit an operator, a model of the piezo at every size and offset, to sensor traces, to images, or to both.

    Builds then invert this operator, and `show` prints the errors to expect on the scanner. The laws (1) to (23) stay
    in the scanner file: m of (1) gives the size at offsets without a trace.

    Record three settled periods or more of ten lines at three offsets: six sizes, from 10 % of v_max to its full range,
    at the offset that you use most, and two at an offset on either side, a small one and the largest that fits there.
    Traces at one offset do not show how the piezo's loop changes with it. Each period must have one rise and one fall;
    shape, rate and turn are free.

    \b
    Columns: time_s, drive_v, displacement_nm. A file with several traces also has the column
    trace, a number for each trace; without it, a new trace starts where time_s goes back.

    Records that are no settled periods, of any drive, are fitted in time, and so are fewer than three traces: the last
    part of each record is predicted from the part before it.

    A pair of images can replace a trace (--pair): of a lattice or a grating of known constant, scanned with a triangle,
    from turn to turn.

    Calibrate `resonance` and `offset` first: the command reads them from the scanner file. `--delay-s fit` needs drives
    with sharp turns, such as triangles.

    \b
    Examples:
      tablegen calibrate operator --axis x *v_at_*v.csv --scanner scanner.toml --write
    """
    from tablegen.api.calibrate_operator import calibrate_operator

    delay = delay_of(delay_s)
    if not data and not images:
        raise click.UsageError("give traces, DATA.CSV..., or images with --pair VOLTS OFFSET_V RATE_HZ TRACE RETRACE")
    if not data:
        refuse_recorder(recorder)
    if not data and delay is None:
        raise click.UsageError("--delay-s fit is for traces of a sensor; images have --delay-pixels")
    if images:
        check_sample(sample)
    else:
        refuse_sample(sample)
    rows = named_images(images)
    with ended_by_input(), Progress() as progress:
        progress.now("reading the measurements")
        fit = calibrate_operator(
            data,
            axis=common.axis,
            images=rows,
            delay_s="fit" if delay is None else delay,
            columns=recorder.columns,
            drive_gain=recorder.drive_gain,
            drive_offset=recorder.drive_offset,
            scans=scans,
            steps=steps,
            progress=progress.now,
            **scanner_options(common),
            **sample,
        )
    if common.as_json:
        click.echo(fit.to_json())
    else:
        click.echo(fit.summary())
    plot_fit(common, fit.charts)
    if common.report is not None:
        written(common.report.parent, {common.report.name: fit.page()})
    if common.write:
        _write(common, fit)
    return ExitStatus.OK


def _write(common: Common, fit: "CalibratedOperator") -> None:
    """Write the operator's file, then the scanner file that names it."""
    from tablegen.calibration.scanner_file import with_own_hysteresis

    assert common.scanner is not None
    name, path = str(common.scanner), common.scanner.resolve()
    with ended_by_input():
        text = read_text(path, CONFIGURATION) if path.exists() and common.axis == "x" else ""
        keeps_y = bool(text) and with_own_hysteresis(text, name) != text
        (beside, operator), (own, scanner) = fit.content(common.scanner).items()
    changed = written(common.scanner.parent, {beside: operator})
    changed += written(path.parent, {own: scanner})
    state = "written" if changed else "up to date"
    click.echo(f"{name}: {common.axis}.hysteresis and {beside} {state}", err=common.as_json)
    if keeps_y:
        click.echo(f"{name}: y.hysteresis keeps the model that it had by like", err=common.as_json)
