"""Calibrate an operator by records of any drive, fitted in time, where there are no settled lines."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np

from tablegen.api.calibrated_operator import CalibratedOperator, delay_text
from tablegen.api.known_scanner import KnownScanner
from tablegen.base.input_errors import Unphysical
from tablegen.base.warnings import Remark, spoils
from tablegen.calibration.operator.advice import next_trace
from tablegen.calibration.operator.file_of_fit import MODEL
from tablegen.calibration.operator.record_fit import COMPLEXITIES, RecordsFit, fit_records
from tablegen.calibration.operator.time_record import LEAST_SAMPLES, TimeRecord, time_record
from tablegen.calibration.operator.units import check_size
from tablegen.calibration.tables.columns import TIME, TRACE
from tablegen.calibration.tables.table import MeasuredTable
from tablegen.calibration.tables.traces import split_traces, trace_name
from tablegen.charts.chart import Chart, DrawnCurve, Mark
from tablegen.charts.picture_file import PlottedCharts

_DELAY_GAIN = 0.1  # share of the rms that a delay has to take away to be worth a remark


def records_in_time(
    tables: Sequence[MeasuredTable],
    prior: KnownScanner,
    delay_s: float | None,
    remarks: Sequence[Remark],
    reason: str,
    scans: Sequence[tuple[float, float]] = (),
) -> "CalibratedRecords":
    """Fit the records of all tables in time.

    Parameters
    ----------
    delay_s
        Delay of the sensor in s; None if it is fitted.
    reason
        Why they are no settled lines.
    scans
        Scan voltages and offsets, in V, that the next trace is to help; all that a build serves by default.

    Raises
    ------
    Unphysical
        If a record is faulty, or records contradict each other.
    """
    records = [one for table in tables for one in _records(table, prior)]
    response, offset_law = prior.axis_laws()
    if (k := prior.number("size", "k_nm_per_v")) is not None:
        check_size(records, k * prior.driver.span, f"k_nm_per_v = {k:g} of {prior.path}", "records")
    fit = fit_records(records, response, lambda centre: offset_law.factor(2.0 * centre - 1.0), delay_s)
    further = next_trace(fit, fit.operator.lines, prior.driver, scans)
    every = (*remarks, *_delay_remarks(fit))
    return CalibratedRecords(
        fit, prior.axis, (), prior.driver, fit.delay, further, tuple(tables), every, reason=reason, in_time=fit
    )


def _records(table: MeasuredTable, prior: KnownScanner) -> list[TimeRecord]:
    traces = split_traces(table)
    if TRACE not in table and len(traces) > 1 and min(len(one.time_s) for one in traces) < LEAST_SAMPLES:
        row = int(np.flatnonzero(np.diff(table[TIME]) < 0.0)[0]) + 1
        raise Unphysical(
            f"{table.file}:{int(table.lines[row])}: the time goes back from {table[TIME][row - 1]:g} to "
            f"{table[TIME][row]:g} s after {row} samples: the counter wrapped, or rows are out of order; give "
            "ascending times, or a column trace where a new record begins"
        )
    out = []
    for trace in traces:
        try:
            out.append(time_record(trace, prior.driver))
        except Unphysical as reason:
            raise Unphysical(f"{trace_name(table, trace)}: {reason}") from None
    return out


def _delay_remarks(fit: RecordsFit) -> tuple[Remark, ...]:
    if isfinite(fit.delay.standard_error) or fit.delay_gain < _DELAY_GAIN:
        return ()
    seconds = fit.best_delay_s
    side = "after" if seconds > 0.0 else "before"
    text = (
        f"the displacement follows {abs(seconds):.3g} s {side} the drive: with that as the delay of sensor and "
        f"amplifier the fit leaves {100.0 * fit.delay_gain:.0f} % less. Give --delay-s fit, or --delay-s {seconds:.3g}"
    )
    return (spoils(text, 100.0 * fit.delay_gain, "sensor-delay"),)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class CalibratedRecords(CalibratedOperator):
    """An operator of one axis by records of any drive, fitted in time.

    ``in_time`` has the errors of each record, in the fit and where its last part is predicted; ``reason`` is why the
    records are no settled lines; ``left`` and ``left_out`` are the errors of the sweeps that the records have.
    """

    reason: str
    in_time: RecordsFit

    @property
    def record(self) -> dict[str, Any]:
        """The fit as plain data, as ``tablegen calibrate operator --json`` prints it."""
        error, further = self.delay.standard_error, self.next_trace
        records = [
            {
                "name": one.record.name,
                "rate_hz": one.record.rate_hz,
                "size_share": one.record.stroke,
                "begin": one.begin.value,
                "skipped_s": one.skipped_s,
                "left": {"rms_percent": one.rms, "worst_percent": one.worst},
                "predicted": {
                    "from_s": one.predicted_from_s,
                    "rms_percent": one.predicted_rms,
                    "worst_percent": one.predicted_worst,
                },
            }
            for one in self.in_time.errors
        ]
        return {
            "kind": MODEL,
            "axis": self.axis,
            "family": self.family,
            "in_time": self.reason,
            "candidates_percent": dict(self.fit.candidates),
            "weights": self.in_time.weights,
            "samples": self.in_time.samples,
            "creep_loss_per_decade": self.fit.operator.creep.loss_per_decade,
            "delay_s": {"value": self.delay.value, "standard_error": error if isfinite(error) else None},
            "records": records,
            "remarks": list(self.remarks),
            "findings": [one.record() for one in self.findings()],
            "next_trace": further.record,
            "sources": [{"file": one.source.name, "sha256": one.source.sha256} for one in self.measured],
        }

    @property
    def _origin(self) -> str:
        count = len(self.in_time.errors)
        return f"{count} records in time" if count > 1 else "1 record in time"

    def summary(self) -> str:
        """Return the model, the errors of every record, the trace to measure next, and warnings."""
        fit = self.in_time
        scores = ", ".join(f"{name} {score:.3g} %" for name, score in fit.candidates.items())
        out = [
            f"operator of {self.axis} from {self._origin}",
            f"not of settled lines: {self.reason}",
            "",
            f"model    {self.family}, {fit.weights} weights for {fit.samples} samples"
            f"  (rms of the last parts, predicted: {scores})",
            f"creep    {100.0 * fit.operator.creep.loss_per_decade:.2g} % a decade",
            *delay_text(self.delay, with_error=False),  # its error is the last step of a search
            "",
            f"{'':43}in the fit      last part predicted",
            "size [V]  offset [V]  rate [Hz]  begins         rms  worst     from [s]    rms  worst  record",
        ]
        for one in fit.errors:
            record = one.record
            centre = 0.5 * (float(np.min(record.drive)) + float(np.max(record.drive)))
            out.append(
                f"{record.stroke * self.driver.span:8.4g}  {self.driver.volts(centre):10.4g}  {record.rate_hz:9.4g}  "
                f"{one.begin.value:<14}{one.rms:4.2f}  {one.worst:5.2f}  {one.predicted_from_s:11.4g}  "
                f"{one.predicted_rms:5.2f}  {one.predicted_worst:5.2f}  {record.name}"
            )
        out.append("percent of the record's stroke, without the mean; the last part is predicted from the part before")
        out += [
            f"{one.record.name}: the first {one.skipped_s:.3g} s are left out, as in no state of the model"
            for one in fit.errors
            if one.skipped_s
        ]
        if len(fit.candidates) < len(COMPLEXITIES) or "full" not in self.family:
            out.append(self._little())
        return "\n".join([*out, "", *self._advice(), *(finding.line for finding in self.findings())])

    def _little(self) -> str:
        models = len(self.in_time.candidates)
        if models < len(COMPLEXITIES):
            return f"a simpler model than usual: {self.in_time.samples} samples carry no more weights"
        return "a simpler model than usual: more weights do not predict the last parts better"

    def _lines(self) -> Sequence[str]:
        worst = max(one.predicted_rms for one in self.in_time.errors)
        creep = 100.0 * self.fit.operator.creep.loss_per_decade
        return (
            f"operator of {self.axis} from {self._origin}: {self.family}, creep {creep:.2g} % a decade",
            f"the last part of a record is predicted within {worst:.2g} % rms of its stroke",
            self._advice()[0],
        )

    def charts(self) -> PlottedCharts:
        """Return the charts that ``tablegen calibrate operator --plot`` draws: the errors of each record over time."""
        charts = []
        for number, one in enumerate(self.in_time.errors, 1):
            record = one.record
            inside, predicted = (
                100.0 * (record.displacement_nm - moved - np.mean(record.displacement_nm - moved)) / record.span_nm
                for moved in (one.displacement_nm, one.predicted_nm)
            )
            begin = record.time_s >= one.skipped_s
            later = record.time_s >= one.predicted_from_s
            curves = (
                DrawnCurve("in the fit", "before", record.time_s[begin], inside[begin], faint=True),
                DrawnCurve("predicted", "other", record.time_s[later], predicted[later]),
            )
            charts.append(
                Chart(
                    f"record-{number}",
                    f"{record.name}: {one.predicted_rms:.2g} % rms predicted",
                    "time [s]",
                    "error [% of the stroke]",
                    curves,
                    marks=(Mark(0.0, "", "y"),),
                )
            )
        return PlottedCharts(f"operator of {self.axis}", tuple(charts))

    def page(self) -> bytes:
        """Return the HTML page that ``tablegen calibrate operator --report`` writes."""
        from tablegen.html_report.fitted import records_page

        rows = [
            (
                one.record.name,
                (
                    one.record.stroke * self.driver.span,
                    one.record.rate_hz,
                    one.rms,
                    one.worst,
                    one.predicted_from_s,
                    one.predicted_rms,
                    one.predicted_worst,
                ),
            )
            for one in self.in_time.errors
        ]
        advice = self._advice()[0].removeprefix("next trace: ")
        return records_page(
            self.axis,
            self.family,
            [*self.fit.candidates.items()],
            rows,
            self.charts().charts,
            f"a trace of {advice}",
            list(self.sources),
        )
