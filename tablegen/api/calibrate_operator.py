"""Calibrate an operator of the piezo by traces of a sensor, or by images, and write it beside the scanner file."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from tablegen.api.calibrate import Axis, known_scanner
from tablegen.api.calibrated_operator import CalibratedOperator
from tablegen.api.calibrated_records import records_in_time
from tablegen.api.image_input import IMAGE_OPTIONS, acquisition_of, check_names, sample_image, sample_of
from tablegen.api.known_scanner import KnownScanner
from tablegen.api.measured import Measured, measured_list, table_of
from tablegen.base.blas_threads import one_blas_thread
from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.image_sizes import SampleImage
from tablegen.calibration.operator.advice import check_scans, next_trace
from tablegen.calibration.operator.bias_memory_fit import BiasMemoryFit, fit_bias_memory, stretches
from tablegen.calibration.operator.delay import fit_delay
from tablegen.calibration.operator.fit import LEAST_LINES, fit_operator, sweep_loss_of
from tablegen.calibration.operator.imaged_line import imaged_line
from tablegen.calibration.operator.periodic_line import PeriodicLine, periodic_line
from tablegen.calibration.operator.plausible import Unsettled
from tablegen.calibration.operator.response_check import response_remarks
from tablegen.calibration.operator.units import check_size
from tablegen.calibration.record_checks import trace_remarks
from tablegen.calibration.tables.columns import DISPLACEMENT, DRIVE, TIME, TRACE
from tablegen.calibration.tables.recorder import Columns, Recorder
from tablegen.calibration.tables.table import MeasuredTable
from tablegen.calibration.tables.traces import split_traces, trace_name
from tablegen.compensation.offset import OffsetLaw
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.transient import SLOWEST_HZ
from tablegen.fitting.estimate import Estimate
from tablegen.images.files import ScanImage
from tablegen.numerics.driver import Driver

_NEEDED = [TIME, DRIVE, DISPLACEMENT]


@one_blas_thread
def calibrate_operator(
    traces: Measured | Sequence[Measured] = (),
    *,
    axis: Axis,
    images: Sequence[tuple[Any, ...]] = (),
    scanner: str | Path | None = None,
    v_max: float | None = None,
    v_min: float = 0.0,
    delay_s: float | Literal["fit"] = 0.0,
    columns: Columns | None = None,
    drive_gain: float | None = None,
    drive_offset: float | None = None,
    scans: Sequence[tuple[float, float]] = (),
    steps: Measured | Sequence[Measured] = (),
    progress: Callable[[str], object] = lambda _: None,
    **how: Any,
) -> CalibratedOperator:
    """Fit an operator of the piezo, for all sizes and offsets, to traces of a sensor, to images, or to both.

    Parameters
    ----------
    traces : path, mapping of arrays, or a sequence of them
        Settled periods as ``time_s`` in s, ``drive_v`` in V at the piezo, ``displacement_nm`` in nm, (n,) each; six
        sizes or more at one offset, and two at one on either side. Where one is no settled period, or there are fewer
        than three, all are fitted in time: records of any drive.
    axis : {"x", "y"}
        Axis that was measured.
    images : sequence of (volts, offset_v, rate_hz, trace) or (volts, offset_v, rate_hz, trace, retrace)
        Scan voltage peak to peak and offset in V, line rate in Hz, and images of a sample of known constant.
    scanner, v_max, v_min : optional
        Scanner file, whose resonance and offset laws are used; or the range of the driver in V.
    delay_s : float or "fit"
        Delay of the sensor against the drive in s.
    columns : str or mapping, optional
        Which column of ``traces`` is which, by number from 1 or by name: ``"time=3,drive=2,position=1:um"``.
    drive_gain, drive_offset : float, optional
        V at the piezo for a recorded V, and V at the piezo for 0 V: of a recorder at the controller's output.
    scans : sequence of (volts, offset_v), optional
        Scans that the next trace is to help, in V peak to peak and V; without any, all that a build serves.
    steps : path, mapping of arrays, or a sequence of them, optional
        Records of a running scan through changes of its offset, columns as ``traces``: they show whether the
        sensitivity follows the offset late.
    progress : callable
        Called with a text for each stage.
    **how : optional
        Of images: ``lattice_nm``, ``lattice``, ``cell``, ``pitch_nm``, ``angle_deg``, ``aspect``, ``turn``, ``window``,
        ``retrace_mirrored``, ``delay_pixels``, ``channel``, ``retrace_channel``, ``frame``.

    Returns
    -------
    CalibratedOperator
        Errors of every trace, in the fit and left out; ``write`` puts it beside the scanner file. A
        ``CalibratedRecords`` where records were fitted in time.

    Raises
    ------
    Rejected
        A file or the scanner file is wrong.
    Unphysical
        The traces are too few, too noisy, or not of a scanner; the message names the trace.

    Examples
    --------
    >>> laboratory = tablegen.Laboratory()
    >>> traces = [laboratory.trace("x", v, 50.0, 100.0, samples=200) for v in (10, 25, 45, 65, 82, 97)]
    >>> operator = tablegen.calibrate_operator(traces, axis="x", v_max=100.0)
    >>> max(one.rms for one in operator.left) < 1.0  # percent of the line
    True
    """
    check_names(how, IMAGE_OPTIONS)
    measured = measured_list(traces)
    if not measured and not images:
        raise TypeError("give traces, or images of a sample of known constant")
    if not measured and delay_s == "fit":
        raise TypeError('delay_s="fit" is for traces of a sensor; images have delay_pixels')
    recorder = Recorder(columns, drive_gain, drive_offset)
    tables = [table_of(one, _NEEDED, [TRACE], recorder) for one in measured]
    step_tables = [table_of(one, _NEEDED, [TRACE], recorder) for one in measured_list(steps)]
    pairs = [sample_image(v, at, pair[0], pair[1] if pair[1:] else None, how) for v, at, _, *pair in images]
    prior = known_scanner(scanner, axis, v_max, v_min)
    check_scans(scans, prior.driver)
    sources: tuple[MeasuredTable | ScanImage, ...] = (*tables, *(one for _, files in pairs for one in files))
    known = prior.known(recorder, None if delay_s == "fit" else float(delay_s), absolute=True)
    response, offset_law = prior.axis_laws()
    remarks = trace_remarks(tables, replace(known, response=response), axis) if tables else ()
    try:
        lines = _sensor_lines(tables, prior.driver)
        remarks += response_remarks(lines, response)
        if not pairs and len(lines) < LEAST_LINES:
            raise Unsettled(f"{len(lines)} settled traces are not enough for fields over size and offset")
        delay = fit_delay(lines, sweep_loss_of(lines, response)[1]) if delay_s == "fit" else Estimate(float(delay_s))
        lines = [line.earlier(delay.value) for line in lines]
        lines += _image_lines([(image, row[2]) for (image, _), row in zip(pairs, images, strict=True)], prior, how)
        if (k := prior.number("size", "k_nm_per_v")) is not None:
            check_size(lines, k * prior.driver.span, f"k_nm_per_v = {k:g} of {prior.path}")
        progress("fitting the families, with and without each trace")
        fit = fit_operator(lines, response, lambda centre: offset_law.factor(2.0 * centre - 1.0))
    except Unsettled as reason:
        if pairs or step_tables:
            raise
        progress("fitting in time")
        return records_in_time(tables, prior, None if delay_s == "fit" else float(delay_s), remarks, str(reason), scans)
    except _NamedUnphysical:
        raise
    except Unphysical as reason:
        raise Unphysical(f"{', '.join(one.file for one in sources)}: {reason}") from None
    further = next_trace(fit, lines, prior.driver, scans)
    late = None
    if step_tables:
        progress("fitting the memory of the bias")
        late = _bias_memory(step_tables, fit.operator, prior.driver, offset_law)
        fit = replace(fit, operator=replace(fit.operator, bias_memory=late.memory))
        sources += tuple(step_tables)
    return CalibratedOperator(fit, axis, tuple(lines), prior.driver, delay, further, sources, remarks, late)


def _bias_memory(
    tables: Sequence[MeasuredTable], operator: Operator, driver: Driver, offset_law: OffsetLaw
) -> BiasMemoryFit:
    """Fit the memory of the bias to records of scans whose offset changes."""
    records = []
    for table in tables:
        for trace in split_traces(table):
            try:
                records.append(stretches(trace, driver))
            except Unphysical as reason:
                raise Unphysical(f"{trace_name(table, trace)}: {reason}") from None
    late = replace(operator, creep=operator.creep.down_to(SLOWEST_HZ))

    def factor_at(centre: float) -> float:
        return offset_law.factor(2.0 * centre - 1.0) / offset_law.factor(2.0 * operator.centre - 1.0)

    try:
        return fit_bias_memory(records, late, factor_at)
    except Unphysical as reason:
        raise Unphysical(f"{', '.join(one.file for one in tables)}: {reason}") from None


class _NamedUnphysical(Unphysical):
    """The message names the trace or the image already."""


class _NamedUnsettled(Unsettled, _NamedUnphysical):
    """A trace that is no settled line, by its name."""


def _sensor_lines(tables: Sequence[MeasuredTable], driver: Driver) -> list[PeriodicLine]:
    lines = []
    for table in tables:
        for trace in split_traces(table):
            try:
                lines.append(periodic_line(trace, driver))
            except Unsettled as reason:
                raise _NamedUnsettled(f"{trace.name}: {reason}") from None
            except Unphysical as reason:
                raise _NamedUnphysical(f"{trace_name(table, trace)}: {reason}") from None
    return lines


def _image_lines(
    images: Sequence[tuple[SampleImage, float]], prior: KnownScanner, how: dict[str, Any]
) -> list[PeriodicLine]:
    lines = []
    for image, rate_hz in images:
        try:
            lines.append(imaged_line(image, rate_hz, prior.driver, sample_of(how), acquisition_of(how))[0])
        except Unphysical as reason:
            raise _NamedUnphysical(f"{image.name}: {reason}") from None
    return lines
