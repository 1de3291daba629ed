"""Result of an operator's calibration: its errors of every trace, and the files that it is written to."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from msgspec.structs import asdict

from tablegen.api.result import Result
from tablegen.base.data_files import Source
from tablegen.base.reading import CONFIGURATION, read_text
from tablegen.base.warnings import Finding, Remark, of_remarks, worst_first
from tablegen.calibration.operator.advice import NextTrace
from tablegen.calibration.operator.bias_memory_fit import BiasMemoryFit
from tablegen.calibration.operator.file_of_fit import MODEL, operator_file
from tablegen.calibration.operator.fit import OperatorFit
from tablegen.calibration.operator.loop_errors import LineErrors
from tablegen.calibration.operator.periodic_line import PeriodicLine
from tablegen.calibration.scanner_file import Change, new_file, updated, with_own_hysteresis
from tablegen.calibration.tables.table import MeasuredTable
from tablegen.charts.picture_file import PlottedCharts
from tablegen.compensation.operator.sweep_loss import SweepLoss
from tablegen.emit.write import write_files
from tablegen.fitting.estimate import Estimate
from tablegen.images.files import ScanImage
from tablegen.images.scan_angle import angle_remarks
from tablegen.numerics.driver import Driver

_MEASURES = "    rms   scaling  mismatch"


@dataclass(frozen=True, eq=False, repr=False)
class CalibratedOperator(Result):
    """An operator of one axis, its errors of every trace, and the files that it is written to.

    ``fit`` has the operator and its residuals, ``lines`` the traces as one settled period each, ``delay`` that of the
    sensor in s, ``next_trace`` the measurement that helps most, ``measured`` the tables and images, ``bias_memory`` the
    fit to records through a change of offset, where there were any.
    """

    fit: OperatorFit
    axis: str
    lines: tuple[PeriodicLine, ...]
    driver: Driver
    delay: Estimate
    next_trace: NextTrace
    measured: tuple[MeasuredTable | ScanImage, ...]
    record_remarks: tuple[Remark, ...] = ()
    bias_memory: BiasMemoryFit | None = None

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
        error, further, sweep = self.delay.standard_error, self.next_trace, self.fit.operator.sweep
        return {
            "kind": MODEL,
            "axis": self.axis,
            "family": self.fit.family,
            "candidates_percent": dict(self.fit.candidates),
            "creep_loss_per_decade": self.fit.operator.creep.loss_per_decade,
            **_bias_record(self.bias_memory),
            "response_loss": None if sweep is None else {"deg": 360.0 * sweep.loss_turns, "creep": bool(sweep.creep)},
            "delay_s": {"value": self.delay.value, "standard_error": error if isfinite(error) else None},
            "traces": traces,
            "remarks": list(self.remarks),
            "findings": [one.record() for one in self.findings()],
            "next_trace": further.record,
            "sources": [{"file": one.source.name, "sha256": one.source.sha256} for one in self.measured],
        }

    @property
    def _origin(self) -> str:
        return f"{len(self.fit.operator.lines)} traces"

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
            *_sweep_text(self.fit.operator.sweep),
            *delay_text(self.delay),
            *_bias_text(self.bias_memory),
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
        sweep = self.fit.operator.sweep
        if further.rate_hz is not None and not (sweep and sweep.creep):
            rate = f"{further.rate_hz:.3g}" if further.rate_hz < 999.5 else f"{further.rate_hz:.0f}"
            text.append(f"next rate: a trace at {rate} Hz would separate creep from hysteresis")
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
        summary = f"operator of {self._origin}, family {self.family}"
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


def _bias_record(fit: BiasMemoryFit | None) -> dict[str, Any]:
    """Return the memory of the bias as plain data; nothing without a record of a change."""
    if fit is None:
        return {}
    return {
        "bias_memory": None if fit.memory is None else asdict(fit.memory),
        "bias_memory_rms_nm": fit.rms_nm,
        "creep_alone_rms_nm": fit.without_nm,
    }


def _bias_text(fit: BiasMemoryFit | None) -> list[str]:
    """Return a line on the memory of the bias; none without a record of a change."""
    if fit is None:
        return []
    if fit.memory is None:
        return [f"bias     no memory: creep alone leaves {fit.without_nm:.2g} nm rms of the lines after the change"]
    late = fit.memory
    return [
        f"bias     {100.0 * late.rise_share:.3g} % of a step up follow with {late.rise_time_s:.3g} s, "
        f"{100.0 * late.fall_share:.3g} % of one down with {late.fall_time_s:.3g} s; leaves {fit.rms_nm:.2g} nm rms, "
        f"creep alone {fit.without_nm:.2g} nm"
    ]


def _sweep_text(sweep: SweepLoss | None) -> list[str]:
    """Return a line on what the response of the scanner file contains beside dynamics; none where it is nothing."""
    if sweep is None:
        return []
    creep = "this creep and " if sweep.creep else ""
    return [f"response without {creep}a lag of {360.0 * sweep.loss_turns:.2g} degrees, which the operator has itself"]


def delay_text(delay: Estimate, *, with_error: bool = True) -> list[str]:
    """Return a line on the delay in s, in us or from 1 ms on in ms; none for a delay of 0 that was given."""
    per_s, unit = (1e3, "ms") if abs(delay.value) >= 1e-3 else (1e6, "us")
    text = f"delay    {per_s * delay.value:.3g} {unit} of the sensor"
    if not isfinite(delay.standard_error):
        return [f"{text}, as given"] if delay.value else []
    return [f"{text}, fitted" + (f", +- {per_s * delay.standard_error:.2g} {unit}" if with_error else "")]
