"""``tablegen calibrate operator``: traces of a sensor, or images, to an operator of the piezo, in a file of its own."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tablegen.base.reading import CONFIGURATION, read_text
from tablegen.cli.calibrate.options import delay_of, delay_option
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
    from tablegen.api.calibrate_operator import CalibratedOperator


@click.command(cls=CommandOfOperatorPairs, short_help="Identify an operator of the piezo from sensor traces or images.")
@shared_options
@click.argument("data", type=click.Path(path_type=Path), metavar="[DATA.CSV]...", nargs=-1)
@delay_option
@image_option(
    "VOLTS OFFSET_V RATE_HZ",
    3,
    "Scan voltage and offset at the piezo in volts, line rate in Hz, and two images of a sample of known constant, "
    "scanned with a triangle. RETRACE is left out if the first file has both. Repeat the option for each scan.",
    (PAIR_NAME,),
)
@sample_options
def operator(
    common: Common,
    data: tuple[Path, ...],
    delay_s: str,
    images: tuple[tuple[float, float, float, Path, Path], ...],
    **given: Any,
) -> int:
    """Identify what the piezo does at every size and offset from sensor traces, from images, or both: an operator.

    Builds then find waveforms that are straight on this operator, and `show` says what to expect on the scanner. The
    laws (1) to (23) of the scanner file stay: m of (1) gives the size at offsets without a trace.

    Record three settled periods or more, at six sizes from 10 % of v_max to its full range, all at the offset that you
    use most. Two sizes at each further offset make scans there as good. One rise and one fall a period; any shape, rate
    and turn.

    \b
    Columns: time_s, drive_v, displacement_nm. A file with several traces also has the column
    trace, a number for each trace; without it, a new trace starts where time_s goes back.

    In place of a trace, or beside traces, a pair of images of a lattice or a grating of known constant does, from turn
    to turn of a triangle: --pair.

    Calibrate `resonance` and `offset` first: their parts of the scanner file are used. `--delay-s fit` needs drives
    with sharp turns, as triangles have.

    \b
    Examples:
      tablegen calibrate operator --axis x 10v.csv 25v.csv 50v.csv 75v.csv 97v.csv --scanner scanner.toml --write
    """
    from tablegen.api.calibrate_operator import calibrate_operator

    delay = delay_of(delay_s)
    if not data and not images:
        raise click.UsageError("give traces, DATA.CSV..., or images with --pair VOLTS OFFSET_V RATE_HZ TRACE RETRACE")
    if not data and delay is None:
        raise click.UsageError("--delay-s fit is for traces of a sensor; images have --delay-pixels")
    if images:
        check_sample(given)
    else:
        refuse_sample(given)
    rows = named_images(images)
    with ended_by_input(), Progress() as progress:
        progress.now("reading the measurements")
        found = calibrate_operator(
            data,
            axis=common.axis,
            images=rows,
            delay_s="fit" if delay is None else delay,
            progress=progress.now,
            **scanner_options(common),
            **given,
        )
    if common.as_json:
        click.echo(found.to_json())
    else:
        click.echo(found.summary())
    plot_fit(common, found.charts)
    if common.report is not None:
        written(common.report.parent, {common.report.name: found.page()})
    if common.write:
        _write(common, found)
    return ExitStatus.OK


def _write(common: Common, found: "CalibratedOperator") -> None:
    """Write the operator's file, then the scanner file that names it."""
    from tablegen.calibration.scanner_file import with_own_hysteresis

    assert common.scanner is not None
    name, path = str(common.scanner), common.scanner.resolve()
    with ended_by_input():
        text = read_text(path, CONFIGURATION) if path.exists() and common.axis == "x" else ""
        keeps_y = bool(text) and with_own_hysteresis(text, name) != text
        (beside, operator), (own, scanner) = found.content(common.scanner).items()
    changed = written(common.scanner.parent, {beside: operator})
    changed += written(path.parent, {own: scanner})
    done = "written" if changed else "up to date"
    click.echo(f"{name}: {common.axis}.hysteresis and {beside} {done}", err=common.as_json)
    if keeps_y:
        click.echo(f"{name}: y.hysteresis keeps the model that it had by like", err=common.as_json)
