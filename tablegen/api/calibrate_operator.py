"""Calibrate an operator of the piezo by traces of a sensor, or by images, and write it beside the scanner file."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Any, Literal

from tablegen.api.calibrate import Axis, known_scanner
from tablegen.api.image_input import IMAGE_OPTIONS, acquisition_of, check_names, sample_image, sample_of
from tablegen.api.known_scanner import KnownScanner
from tablegen.api.measured import Measured, measured_list, table_of
from tablegen.api.result import Result
from tablegen.base.blas_threads import one_blas_thread
from tablegen.base.data_files import Source
from tablegen.base.input_errors import Unphysical
from tablegen.base.reading import CONFIGURATION, read_text
from tablegen.base.warnings import Finding, Remark, of_remarks, worst_first
from tablegen.calibration.laws.image_sizes import SampleImage
from tablegen.calibration.operator.advice import NextTrace, next_trace
from tablegen.calibration.operator.delay import fit_delay
from tablegen.calibration.operator.file_of_fit import MODEL, operator_file
from tablegen.calibration.operator.fit import OperatorFit, fit_operator
from tablegen.calibration.operator.imaged_line import imaged_line
from tablegen.calibration.operator.loop_errors import LineErrors
from tablegen.calibration.operator.periodic_line import PeriodicLine, periodic_line
from tablegen.calibration.operator.units import check_size
from tablegen.calibration.record_checks import trace_remarks
from tablegen.calibration.scanner_file import Change, new_file, updated, with_own_hysteresis
from tablegen.calibration.tables.columns import DISPLACEMENT, DRIVE, TIME, TRACE
from tablegen.calibration.tables.recorder import Columns, Recorder
from tablegen.calibration.tables.table import MeasuredTable
from tablegen.calibration.tables.traces import split_traces
from tablegen.charts.picture_file import PlottedCharts
from tablegen.emit.write import write_files
from tablegen.fitting.estimate import Estimate
from tablegen.images.files import ScanImage
from tablegen.images.scan_angle import angle_remarks
from tablegen.numerics.driver import Driver

_MEASURES = "    rms   scaling  mismatch"
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
    progress: Callable[[str], object] = lambda _: None,
    **how: Any,
) -> "CalibratedOperator":
    """Fit an operator of the piezo, for all sizes and offsets, to traces of a sensor, to images, or to both.

    Parameters
    ----------
    traces : path, mapping of arrays, or a sequence of them
        Settled periods as ``time_s`` in s, ``drive_v`` in V at the piezo, ``displacement_nm`` in nm, (n,) each; six
        sizes or more at one offset.
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
    progress : callable
        Called with a text for each stage.
    **how : optional
        Of images: ``lattice_nm``, ``lattice``, ``cell``, ``pitch_nm``, ``angle_deg``, ``aspect``, ``turn``, ``window``,
        ``retrace_mirrored``, ``delay_pixels``, ``channel``, ``retrace_channel``, ``frame``.

    Returns
    -------
    CalibratedOperator
        Errors of every trace, in the fit and left out; ``write`` puts it beside the scanner file.

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
    pairs = [sample_image(v, at, pair[0], pair[1] if pair[1:] else None, how) for v, at, _, *pair in images]
    prior = known_scanner(scanner, axis, v_max, v_min)
    sources: tuple[MeasuredTable | ScanImage, ...] = (*tables, *(one for _, files in pairs for one in files))
    known = prior.known(recorder, None if delay_s == "fit" else float(delay_s), absolute=True)
    response, offset_law = prior.axis_laws()
    remarks = trace_remarks(tables, replace(known, response=response), axis) if tables else ()
    lines = _sensor_lines(tables, prior.driver)
    try:
        delay = fit_delay(lines, response) if delay_s == "fit" else Estimate(float(delay_s))
        lines = [line.earlier(delay.value) for line in lines]
        lines += _image_lines([(image, row[2]) for (image, _), row in zip(pairs, images, strict=True)], prior, how)
        if (k := prior.number("size", "k_nm_per_v")) is not None:
            check_size(lines, k * prior.driver.span, f"k_nm_per_v = {k:g} of {prior.path}")
        progress("fitting the families, with and without each trace")
        fit = fit_operator(lines, response, lambda centre: offset_law.factor(2.0 * centre - 1.0))
    except _NamedUnphysical:
        raise
    except Unphysical as reason:
        raise Unphysical(f"{', '.join(one.file for one in sources)}: {reason}") from None
    return CalibratedOperator(
        fit, axis, tuple(lines), prior.driver, delay, next_trace(fit, lines, prior.driver, scans), sources, remarks
    )


class _NamedUnphysical(Unphysical):
    """The message names the trace or the image already."""


def _sensor_lines(tables: Sequence[MeasuredTable], driver: Driver) -> list[PeriodicLine]:
    lines = []
    for table in tables:
        for trace in split_traces(table):
            try:
                lines.append(periodic_line(trace, driver))
            except Unphysical as reason:
                raise _NamedUnphysical(f"{table.file}: {trace.name}: {reason}") from None
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


@dataclass(frozen=True, eq=False, repr=False)
class CalibratedOperator(Result):
    """An operator of one axis, its errors of every trace, and the files that it is written to.

    ``fit`` has the operator and its residuals, ``lines`` the traces as one settled period each, ``delay`` that of the
    sensor in s, ``next_trace`` the measurement that helps most, ``measured`` the tables and images.
    """

    fit: OperatorFit
    axis: str
    lines: tuple[PeriodicLine, ...]
    driver: Driver
    delay: Estimate
    next_trace: NextTrace
    measured: tuple[MeasuredTable | ScanImage, ...]
    record_remarks: tuple[Remark, ...] = ()

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Remarks on the scan angles of images, and on traces that look wrong."""
        return (*angle_remarks(self.measured, self.axis), *self.record_remarks)

    @property
    def family(self) -> str:
        """Name of the family of hysteresis that predicts traces best that were left out."""
        return self.fit.family

    @property
    def left(self) -> tuple[LineErrors, ...]:
        """Errors of each trace in the fit: ``rms``, ``scaling``, ``mismatch`` in percent of the line."""
        return self.fit.in_fit

    @property
    def left_out(self) -> tuple[LineErrors, ...]:
        """Errors of each trace when it is predicted from the others, and the error of its ``size``."""
        return self.fit.left_out

    @property
    def sources(self) -> tuple[Source, ...]:
        """Names of the files with their SHA-256, each once."""
        return tuple(dict.fromkeys(one.source for one in self.measured))

    @property
    def record(self) -> dict[str, Any]:
        """The fit as plain data, as ``tablegen calibrate operator --json`` prints it."""
        traces = [
            {
                "name": line.name,
                "size_share": line.stroke,
                "offset_share": line.centre,
                "rate_hz": line.rate_hz,
                "left": {
                    "rms_percent": fit.rms,
                    "scaling_percent": fit.scaling,
                    "mismatch_percent": fit.mismatch,
                },
                "left_out": {
                    "rms_percent": out.rms,
                    "scaling_percent": out.scaling,
                    "mismatch_percent": out.mismatch,
                    "size_percent": out.size,
                },
            }
            for line, fit, out in zip(self.lines, self.fit.in_fit, self.fit.left_out, strict=True)
        ]
        error, further = self.delay.standard_error, self.next_trace
        return {
            "kind": MODEL,
            "axis": self.axis,
            "family": self.fit.family,
            "candidates_percent": dict(self.fit.candidates),
            "creep_loss_per_decade": self.fit.operator.creep.loss_per_decade,
            "delay_s": {"value": self.delay.value, "standard_error": error if isfinite(error) else None},
            "traces": traces,
            "remarks": list(self.remarks),
            "next_trace": {
                "size_v": further.size_v,
                "offset_v": further.offset_v,
                "rate_hz": further.rate_hz,
                "uncertainty_left_share": further.left,
            },
            "sources": [{"file": one.source.name, "sha256": one.source.sha256} for one in self.measured],
        }

    def findings(self) -> list[Finding]:
        """Return warnings about traces and images to read before the operator is trusted, the worst first."""
        return worst_first(of_remarks(self.remarks))

    def summary(self) -> str:
        """Return the parameters, the errors of every trace, the trace to measure next, and warnings."""
        creep = self.fit.operator.creep
        pure = {name: score for name, score in self.fit.candidates.items() if name == self.family or "," not in name}
        scores = ", ".join(f"{name} {score:.3g} %" for name, score in pure.items())
        out = [
            f"operator of {self.axis} from {len(self.lines)} traces",
            "",
            f"family   {self.family}  (mean rms of a trace left out: {scores})",
            f"creep    {100.0 * creep.loss_per_decade:.2g} % a decade",
            *_delay_text(self.delay),
            "",
            f"{'':41}  {'in the fit':<23}   left out",
            f"size [V]  offset [V]  rate [Hz]  noise [%]{_MEASURES}  {_MEASURES}  size [%]  trace",
        ]
        for line, inside, without in zip(self.lines, self.fit.in_fit, self.fit.left_out, strict=True):
            noise = 100.0 * line.noise_nm / float(line.displacement_nm.max() - line.displacement_nm.min())
            out.append(
                f"{line.stroke * self.driver.span:8.4g}  {self.driver.volts(line.centre):10.4g}  {line.rate_hz:9.4g}  "
                f"{noise:9.2g}  {inside.rms:5.2f}  {inside.scaling:8.2f}  {inside.mismatch:8.2f}   {without.rms:5.2f}  "
                f"{without.scaling:8.2f}  {without.mismatch:8.2f}  {without.size:+8.2f}  {line.name}"
            )
        out += ["percent of the line over x = 0.1..0.9; left out: predicted from the other traces", ""]
        return "\n".join([*out, *self._advice(), *(finding.line for finding in self.findings())])

    def _advice(self) -> list[str]:
        further = self.next_trace
        text = [
            f"next trace: {further.size_v:.3g} V at {further.offset_v:.3g} V would help most; "
            f"it leaves {100.0 * further.left:.0f} % of the uncertainty"
        ]
        if further.rate_hz is not None:
            text.append(f"next rate: a trace at {further.rate_hz:.3g} Hz would separate creep from hysteresis")
        return text

    def _lines(self) -> Sequence[str]:
        worst = max(one.rms for one in self.fit.left_out)
        creep = 100.0 * self.fit.operator.creep.loss_per_decade
        return (
            f"operator of {self.axis} from {len(self.lines)} traces: {self.family}, creep {creep:.2g} % a decade",
            f"left out, a trace is predicted within {worst:.2g} % rms of the line",
            self._advice()[0],
        )

    def charts(self) -> PlottedCharts:
        """Return the charts that ``tablegen calibrate operator --plot`` draws."""
        from tablegen.html_report.operator_charts import operator_charts

        return operator_charts(self.fit, self.lines, self.next_trace, self.driver, self.axis)

    def page(self) -> bytes:
        """Return the HTML page that ``tablegen calibrate operator --report`` writes."""
        from tablegen.html_report.fitted import operator_page

        def figures(line: PeriodicLine, inside: LineErrors, out: LineErrors) -> tuple[float, ...]:
            drive = line.stroke * self.driver.span, self.driver.volts(line.centre), line.rate_hz
            return *drive, inside.rms, inside.scaling, inside.mismatch, out.rms, out.scaling, out.mismatch, out.size

        rows = zip(self.lines, self.fit.in_fit, self.fit.left_out, strict=True)
        traces = [(line.name, figures(line, inside, out)) for line, inside, out in rows]
        advice = self._advice()[0].removeprefix("next trace: ")
        candidates = [*self.fit.candidates.items()]
        return operator_page(self.axis, self.family, candidates, traces, f"a trace of {advice}", list(self.sources))

    def content(self, scanner: str | Path) -> dict[str, bytes]:
        """Return names and contents of the operator's file and of the scanner file, the last; nothing is written.

        Raises
        ------
        Rejected
            If the scanner file cannot take it.
        """
        scanner = Path(scanner)
        name, path = str(scanner), scanner.resolve()
        beside = scanner.with_name(f"{scanner.stem}_{self.axis}_operator.toml")
        origin = [f"from {one.name}, sha256 {one.sha256}" for one in self.sources]
        origin += [f"delay of the sensor: {self.delay.value:.6g} s"] if self.delay.value else []
        text = read_text(path, CONFIGURATION) if path.exists() else new_file(path.stem, self.driver)
        own = with_own_hysteresis(text, name) if self.axis == "x" else text
        summary = f"operator of {len(self.fit.operator.lines)} traces, family {self.family}"
        values = {"model": MODEL, "file": beside.name}
        change = Change("hysteresis", values, provenance=[[summary, *origin]])
        return {
            beside.name: operator_file(self.fit, self.axis, self.driver, origin),
            path.name: updated(own, name, self.axis, change).encode("utf-8"),
        }

    def write(self, scanner: str | Path) -> list[str]:
        """Write the operator's file, then the scanner file that names it, and return the names that changed.

        A scanner file that is missing is begun.

        Raises
        ------
        Rejected
            As ``content``.
        CannotWrite
            If a file cannot be written.
        """
        scanner = Path(scanner)
        (beside, operator), (own, text) = self.content(scanner).items()
        changed = write_files(scanner.parent, {beside: operator})
        return changed + write_files(scanner.resolve().parent, {own: text})


def _delay_text(delay: Estimate) -> list[str]:
    """Return a line on the delay; none for a delay of 0."""
    if isfinite(delay.standard_error):
        return [f"delay    {1e6 * delay.value:.3g} us of the sensor, fitted, +- {1e6 * delay.standard_error:.2g} us"]
    return [f"delay    {1e6 * delay.value:.3g} us of the sensor, as given"] if delay.value else []
