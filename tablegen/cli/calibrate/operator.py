"""``tablegen calibrate operator``: traces of a sensor, or images, to an operator of the piezo, in a file of its own."""

import json
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tablegen.base.reading import CONFIGURATION, read_text
from tablegen.cli.calibrate.options import delay_of, delay_option
from tablegen.cli.calibrate.run import (
    Common,
    driver_of,
    in_file,
    plot_fit,
    read_columns,
    scanner_axis,
    shared_options,
)
from tablegen.cli.images.samples import (
    PAIR_NAME,
    CommandOfOperatorPairs,
    acquisition_of,
    image_option,
    read_sample_image,
    refuse_sample,
    sample_of,
    sample_options,
)
from tablegen.cli.shared.common import fail, written
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.progress import Progress

if TYPE_CHECKING:
    from tablegen.calibration.laws.image_sizes import SampleImage
    from tablegen.calibration.operator.advice import NextTrace
    from tablegen.calibration.operator.fit import OperatorFit
    from tablegen.calibration.operator.periodic_line import PeriodicLine
    from tablegen.calibration.tables.table import MeasuredTable
    from tablegen.charts.picture_file import PlottedCharts
    from tablegen.fitting.estimate import Estimate
    from tablegen.images.files import ScanImage
    from tablegen.numerics.driver import Driver


_MEASURES = "    rms   scaling  mismatch"


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
    from tablegen.base.input_errors import Unphysical
    from tablegen.base.warnings import of_remarks, worst_first
    from tablegen.calibration.operator.advice import next_trace
    from tablegen.calibration.operator.delay import fit_delay
    from tablegen.calibration.operator.fit import fit_operator
    from tablegen.calibration.operator.periodic_line import periodic_line
    from tablegen.calibration.operator.units import check_size
    from tablegen.calibration.tables.columns import DISPLACEMENT, DRIVE, TIME, TRACE
    from tablegen.calibration.tables.traces import split_traces
    from tablegen.fitting.estimate import Estimate
    from tablegen.images.scan_angle import angle_remarks

    wanted_delay = delay_of(delay_s)
    _check_usage(bool(data), bool(images), wanted_delay, given)
    tables = [read_columns(path, [TIME, DRIVE, DISPLACEMENT], [TRACE]) for path in data]
    pairs = [read_sample_image(v, at, trace, retrace, given) for v, at, _, trace, retrace in images]
    driver = driver_of(common)
    response, offset_law = scanner_axis(common, driver)
    lines = []
    for table in tables:
        for trace in split_traces(table):
            try:
                lines.append(periodic_line(trace, driver))
            except Unphysical as reason:
                fail([f"{table.file}: {trace.name}: {reason}"], ExitStatus.WRONG_INPUT)
    sources: list[MeasuredTable | ScanImage] = [*tables, *(one for _, files in pairs for one in files)]
    try:
        delay = fit_delay(lines, response) if wanted_delay is None else Estimate(wanted_delay)
        lines = [line.earlier(delay.value) for line in lines]
        lines += _imaged(images, pairs, driver, given)
        if (k := in_file(common, "size", "k_nm_per_v")) is not None:
            check_size(lines, k * driver.span, f"k_nm_per_v = {k:g} of {common.scanner}")
        with Progress() as progress:
            progress.now("fitting the families, with and without each trace")
            fit = fit_operator(lines, response, lambda centre: offset_law.factor(2.0 * centre - 1.0))
    except Unphysical as reason:
        fail([f"{', '.join(table.file for table in sources)}: {reason}"], ExitStatus.WRONG_INPUT)
    further = next_trace(fit, lines, driver)
    if common.as_json:
        click.echo(json.dumps(_record(fit, lines, further, common.axis, sources, delay), indent=2, allow_nan=False))
    else:
        click.echo("\n".join(_text(fit, lines, further, common.axis, driver, delay)))
        for finding in worst_first(of_remarks(angle_remarks(sources, common.axis))):
            click.echo(finding.line)
    plot_fit(common, lambda: _charts(fit, lines, further, driver, common.axis))
    if common.report is not None:
        written(common.report.parent, {common.report.name: _page(fit, lines, further, common.axis, driver, sources)})
    if common.write:
        _write(common, fit, sources, driver, delay)
    return ExitStatus.OK


def _check_usage(traces: bool, images: bool, delay_s: float | None, sample: dict[str, Any]) -> None:
    """Refuse options that do not go together; a delay of None is one that has to be fitted."""
    if not traces and not images:
        raise click.UsageError("give traces, DATA.CSV..., or images with --pair VOLTS OFFSET_V RATE_HZ TRACE RETRACE")
    if not traces and delay_s is None:
        raise click.UsageError("--delay-s fit is for traces of a sensor; images have --delay-pixels")
    if not images:
        refuse_sample(sample)


def _charts(
    fit: "OperatorFit", lines: "Sequence[PeriodicLine]", further: "NextTrace", driver: "Driver", axis: str
) -> "PlottedCharts":
    from tablegen.report.operator_charts import operator_charts

    return operator_charts(fit, lines, further, driver, axis)


def _page(
    fit: "OperatorFit",
    lines: "Sequence[PeriodicLine]",
    further: "NextTrace",
    axis: str,
    driver: "Driver",
    sources: "Sequence[MeasuredTable | ScanImage]",
) -> bytes:
    """The same as a page."""
    from tablegen.report.fitted import operator_page

    traces = [
        (
            line.name,
            (
                *(
                    line.stroke * driver.span,
                    driver.volts(line.centre),
                    line.rate_hz,
                    left.rms,
                    left.scaling,
                    left.mismatch,
                ),
                *(out.rms, out.scaling, out.mismatch, out.size),
            ),
        )
        for line, left, out in zip(lines, fit.in_fit, fit.left_out, strict=True)
    ]
    advice = f"a trace of {further.size_v:.3g} V at {further.offset_v:.3g} V would help most"
    files = list(dict.fromkeys(one.source for one in sources))
    return operator_page(axis, fit.family, [*fit.candidates.items()], traces, advice, files)


def _imaged(
    images: "tuple[tuple[float, float, float, Path, Path], ...]",
    pairs: "list[tuple[SampleImage, list[ScanImage]]]",
    driver: "Driver",
    given: dict[str, Any],
) -> "list[PeriodicLine]":
    """The lines of pairs of images; what is wrong with one ends the command."""
    from tablegen.base.input_errors import Unphysical
    from tablegen.calibration.operator.imaged_line import imaged_line

    if not images:
        return []
    sample, acquisition = sample_of(given), acquisition_of(given)
    lines = []
    for (_, _, rate_hz, *_), (image, _) in zip(images, pairs, strict=True):
        try:
            lines.append(imaged_line(image, rate_hz, driver, sample, acquisition)[0])
        except Unphysical as reason:
            fail([f"{image.name}: {reason}"], ExitStatus.WRONG_INPUT)
    return lines


def _text(
    fit: "OperatorFit",
    lines: "Sequence[PeriodicLine]",
    further: "NextTrace",
    axis: str,
    driver: "Driver",
    delay: "Estimate",
) -> list[str]:
    """What was found, what it leaves of every trace, and what to measure next."""
    creep = fit.operator.creep
    pure = {name: score for name, score in fit.candidates.items() if name == fit.family or "," not in name}
    tried = ", ".join(f"{name} {score:.3g} %" for name, score in pure.items())
    out = [
        f"operator of {axis} from {len(lines)} traces",
        "",
        f"family   {fit.family}  (mean rms of a trace left out: {tried})",
        f"creep    {100.0 * creep.loss_per_decade:.2g} % a decade",
        *_delay_text(delay),
        "",
        f"{'':41}  {'in the fit':<23}   left out",
        f"size [V]  offset [V]  rate [Hz]  noise [%]{_MEASURES}  {_MEASURES}  size [%]  trace",
    ]
    for line, left, without in zip(lines, fit.in_fit, fit.left_out, strict=True):
        noise = 100.0 * line.noise_nm / float(line.displacement_nm.max() - line.displacement_nm.min())
        out.append(
            f"{line.stroke * driver.span:8.4g}  {driver.volts(line.centre):10.4g}  {line.rate_hz:9.4g}  {noise:9.2g}  "
            f"{left.rms:5.2f}  {left.scaling:8.2f}  {left.mismatch:8.2f}   {without.rms:5.2f}  {without.scaling:8.2f}  "
            f"{without.mismatch:8.2f}  {without.size:+8.2f}  {line.name}"
        )
    out += [
        "percent of the line over x = 0.1..0.9; left out: predicted from the other traces",
        "",
        f"next trace: {further.size_v:.3g} V at {further.offset_v:.3g} V would help most",
    ]
    if further.rate_hz is not None:
        out.append(f"next rate: a trace at {further.rate_hz:.3g} Hz would tell creep from hysteresis")
    return out


def _delay_text(delay: "Estimate") -> list[str]:
    """Nothing where there is none."""
    if isfinite(delay.standard_error):
        return [f"delay    {1e6 * delay.value:.3g} us of the sensor, fitted, +- {1e6 * delay.standard_error:.2g} us"]
    return [f"delay    {1e6 * delay.value:.3g} us of the sensor, as given"] if delay.value else []


def _record(
    fit: "OperatorFit",
    lines: "Sequence[PeriodicLine]",
    further: "NextTrace",
    axis: str,
    tables: "Sequence[MeasuredTable | ScanImage]",
    delay: "Estimate",
) -> dict[str, Any]:
    """The same for programs."""
    from tablegen.compensation.models.operator import OperatorModel
    from tablegen.images.scan_angle import angle_remarks

    traces = [
        {
            "name": line.name,
            "size_share": line.stroke,
            "offset_share": line.centre,
            "rate_hz": line.rate_hz,
            "left": {"rms_percent": left.rms, "scaling_percent": left.scaling, "mismatch_percent": left.mismatch},
            "left_out": {
                "rms_percent": out.rms,
                "scaling_percent": out.scaling,
                "mismatch_percent": out.mismatch,
                "size_percent": out.size,
            },
        }
        for line, left, out in zip(lines, fit.in_fit, fit.left_out, strict=True)
    ]
    return {
        "kind": OperatorModel.model(),
        "axis": axis,
        "family": fit.family,
        "candidates_percent": dict(fit.candidates),
        "creep_loss_per_decade": fit.operator.creep.loss_per_decade,
        "delay_s": {
            "value": delay.value,
            "standard_error": delay.standard_error if isfinite(delay.standard_error) else None,
        },
        "traces": traces,
        "remarks": list(angle_remarks(tables, axis)),
        "next_trace": {"size_v": further.size_v, "offset_v": further.offset_v, "rate_hz": further.rate_hz},
        "sources": [{"file": table.source.name, "sha256": table.source.sha256} for table in tables],
    }


def _write(
    common: Common,
    fit: "OperatorFit",
    tables: "Sequence[MeasuredTable | ScanImage]",
    driver: "Driver",
    delay: "Estimate",
) -> None:
    """The operator's file, then the scanner file that names it."""
    from tablegen.base.input_errors import Rejected
    from tablegen.calibration.operator.file_of_fit import operator_file
    from tablegen.calibration.scanner_file import Change, new_file, updated, with_own_hysteresis
    from tablegen.compensation.models.operator import OperatorModel

    assert common.scanner is not None
    name = str(common.scanner)
    beside = common.scanner.with_name(f"{common.scanner.stem}_{common.axis}_operator.toml")
    sources = list(dict.fromkeys(f"from {t.source.name}, sha256 {t.source.sha256}" for t in tables))
    sources += [f"delay of the sensor: {delay.value:.6g} s"] if delay.value else []
    content = operator_file(fit, common.axis, driver, sources)
    try:
        path = common.scanner.resolve()
        text = read_text(path, CONFIGURATION) if path.exists() else new_file(path.stem, driver)
        kept = with_own_hysteresis(text, name) if common.axis == "x" else text
        summary = f"operator of {len(fit.operator.lines)} traces, family {fit.family}"
        change = Change(
            "hysteresis", {"model": OperatorModel.model(), "file": beside.name}, provenance=[[summary, *sources]]
        )
        scanner = updated(kept, name, common.axis, change).encode("utf-8")
    except Rejected as rejected:
        fail(rejected.problems, ExitStatus.WRONG_INPUT)
    except UnicodeDecodeError:
        fail([f"{name}: is not UTF-8"], ExitStatus.WRONG_INPUT)
    except OSError as error:
        fail([f"{name}: {error.strerror or error}"], ExitStatus.WRONG_INPUT)
    changed = written(beside.parent, {beside.name: content})
    changed += written(path.parent, {path.name: scanner})
    done = "written" if changed else "up to date"
    click.echo(f"{name}: {common.axis}.hysteresis and {beside.name} {done}", err=common.as_json)
    if kept != text:
        click.echo(f"{name}: y.hysteresis keeps the model that it had by like", err=common.as_json)
