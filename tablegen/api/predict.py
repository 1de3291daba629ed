"""Predict the position of an axis for any drive, on the operator of its scanner file."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, sqrt
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tablegen.api.result import Result
from tablegen.base.input_errors import Problem, Rejected, Unphysical
from tablegen.calibration.tables.columns import DISPLACEMENT, DRIVE, TIME
from tablegen.calibration.tables.recorder import Columns, Recorder
from tablegen.calibration.tables.table import MeasuredTable
from tablegen.charts.chart import Chart, DrawnCurve
from tablegen.charts.picture_file import PlottedCharts
from tablegen.compensation.operator.in_time import OperatorInTime, Start, mean_of, repeated_samples
from tablegen.compensation.operator.operator import STROKE_REACH
from tablegen.compensation.operator.prediction_uncertainty import possible_prediction_errors
from tablegen.numerics.arrays import Floats
from tablegen.planning.known_axis import KnownAxis

_LEAST_SAMPLES = 3
_LEAST_STROKE = 0.005  # of the driver's range
_BEYOND = 1e-3  # of the driver's range, for the rounding of a recorder


def predict(
    scanner: str | Path,
    drive: str | Path,
    *,
    axis: Literal["x", "y"],
    against: str | Path | None = None,
    start: Literal["settled", "line", "rest"] = "rest",
    delay_s: float = 0.0,
    columns: Columns | None = None,
    drive_gain: float | None = None,
    drive_offset: float | None = None,
) -> "Predicted":
    """Predict the position of an axis for a drive of any shape.

    Parameters
    ----------
    scanner : str or Path
        Scanner file whose ``[axis.hysteresis]`` has ``model = "operator"``.
    drive : str or Path
        Table with time and drive, evenly sampled or not.
    axis : str
        "x" or "y".
    against : str or Path, optional
        Table with time and displacement that were measured; it may be the same file.
    start : str
        State at the first sample: "rest", at the first voltage after v_min; "line", after many repetitions of the
        first line of the record; or "settled", after many repetitions of the record.
    delay_s : float
        Delay of the measurement against the drive in s, as ``calibrate operator`` took or fitted it.
    columns : str or dict, optional
        Which column is which, as ``--columns``.
    drive_gain, drive_offset : float, optional
        V at the piezo = gain x recorded V + offset.

    Returns
    -------
    Predicted
        ``time_s``, ``volts``, ``position_nm``, ``sweep_uncertainty_nm``, ``uncertainty_nm``; ``error_nm`` with
        ``against``.

    Raises
    ------
    Rejected
        A file is faulty, the axis has no operator, or the drive leaves what the operator knows.
    ValueError
        ``axis`` or ``start`` has another value, or the delay, gain or offset is none.

    Examples
    --------
    >>> import numpy, shutil
    >>> laboratory = tablegen.Laboratory(like="scanner.toml")
    >>> traces = [laboratory.trace("x", v, 50.0, 100.0, samples=200) for v in (10, 25, 45, 65, 82, 97)]
    >>> copy = shutil.copy("scanner.toml", "own.toml")
    >>> written = tablegen.calibrate_operator(traces, axis="x", scanner="scanner.toml").write("own.toml")
    >>> numpy.savez("drive.npz", **traces[2])
    >>> predicted = tablegen.predict("own.toml", "drive.npz", axis="x")
    >>> len(predicted.position_nm) == len(traces[2]["time_s"])
    True
    """
    if axis not in ("x", "y"):
        raise ValueError(f"axis {axis!r} is not x or y")
    state = Start(start)
    if not isfinite(delay_s):
        raise ValueError(f"a delay of {delay_s} s is none")
    recorder = Recorder(columns, drive_gain, drive_offset)
    known = KnownAxis.read(Path(scanner), axis)
    table = recorder.read(Path(drive), [TIME, DRIVE], [DISPLACEMENT])
    time_s, volts = table[TIME], table[DRIVE]
    _check_times(table)
    low, high = float(np.min(volts)), float(np.max(volts))
    beyond = np.maximum(known.driver.v_min - volts, volts - known.driver.v_max)
    at = int(np.argmax(beyond))
    if known.driver.beyond(low, high) > _BEYOND * known.driver.span:
        why = (
            f"{volts[at]:.6g} V is outside the driver's {known.driver}; if a controller's output before the amplifier "
            "was recorded, give --drive-gain and --drive-offset"
        )
        raise Rejected([Problem(table.file, int(table.lines[at]), DRIVE.name, why)])
    u = known.driver.share(volts)
    stroke = (high - low) / known.driver.span
    largest = max(line.stroke for line in known.operator.lines)
    problem = ""
    if stroke < _LEAST_STROKE:
        problem = f"the drive moves by {high - low:.4g} V; {_LEAST_STROKE * known.driver.span:.4g} V or more are needed"
    elif stroke > largest + STROKE_REACH:
        problem = (
            f"the drive spans {high - low:.4g} V, and the operator's largest trace {largest * known.driver.span:.4g}"
            " V; identify it with a larger one"
        )
    if problem:
        raise Rejected([Problem(table.file, 0, DRIVE.name, problem)])
    operator = known.operator_of(time_s, u)
    in_time = OperatorInTime(operator, known.factor, known.response)
    try:
        repeated_samples(time_s, u, state)
    except Unphysical as reason:
        raise Rejected([Problem(table.file, 0, DRIVE.name, str(reason))]) from None
    try:
        position = in_time.position(time_s, u, state)
    except Unphysical as reason:
        raise Rejected([Problem(str(scanner), 0, f"{axis}.hysteresis.file", str(reason))]) from None
    measured = None
    if against is not None:
        # What an amplifier does to the drive is no matter of a file of positions.
        other = Recorder(columns).read(Path(against), [TIME, DISPLACEMENT], [DRIVE])
        _check_times(other)
        if other[TIME][0] > time_s[0] + 1e-9 or other[TIME][-1] < time_s[-1] - 1e-9:
            why = (
                f"has {other[TIME][0]:g} to {other[TIME][-1]:g} s, the drive {time_s[0]:g} to {time_s[-1]:g} s; "
                "both need one clock, and the measurement the whole of the drive"
            )
            raise Rejected([Problem(other.file, 0, TIME.name, why)])
        measured = np.interp(time_s + delay_s, other[TIME], other[DISPLACEMENT])
    bounds = possible_prediction_errors(operator, u, position, state)
    return Predicted(axis, state, time_s, volts, position, bounds, measured)


def _check_times(table: MeasuredTable) -> None:
    """Refuse times that do not ascend, and tables of next to nothing."""
    time_s = table[TIME]
    if len(time_s) < _LEAST_SAMPLES:
        raise Rejected([Problem(table.file, 0, "", f"has {len(time_s)} samples; {_LEAST_SAMPLES} or more are needed")])
    back = np.flatnonzero(np.diff(time_s) <= 0.0)
    if len(back):
        row = int(back[0]) + 1
        why = f"{time_s[row]:g} s does not come after {time_s[row - 1]:g} s; give one record with ascending times"
        raise Rejected([Problem(table.file, int(table.lines[row]), TIME.name, why)])


@dataclass(frozen=True, eq=False, repr=False)
class Predicted(Result):
    """Predicted positions of an axis; ``measured_nm`` is None without a measurement.

    Arrays have the shape (samples,). ``sweep_uncertainty_nm`` is, for the samples of each sweep, the rms error below
    which 90 % of predictions stay, without the mean of the whole record. Positions count from the lower turn of the
    widest loop.
    """

    axis: str
    start: Start
    time_s: Floats
    volts: Floats
    position_nm: Floats
    sweep_uncertainty_nm: Floats
    measured_nm: Floats | None

    @property
    def uncertainty_nm(self) -> float:
        """The rms error of the whole record below which 90 % of predictions stay."""
        return sqrt(mean_of(self.time_s, self.sweep_uncertainty_nm**2))

    @property
    def extent_nm(self) -> float:
        """The stroke of the position, peak to peak."""
        return float(np.max(self.position_nm) - np.min(self.position_nm))

    @property
    def error_nm(self) -> Floats | None:
        """Predicted less measured position, without its mean, since a sensor's zero is anywhere."""
        if self.measured_nm is None:
            return None
        error = self.position_nm - self.measured_nm
        centred: Floats = error - np.mean(error)
        return centred

    @property
    def errors_percent(self) -> tuple[float, float] | None:
        """The rms and the largest error, in percent of the measured stroke."""
        error = self.error_nm
        if error is None or self.measured_nm is None:
            return None
        stroke = float(np.max(self.measured_nm) - np.min(self.measured_nm))
        return 100.0 * float(np.sqrt(np.mean(error * error))) / stroke, 100.0 * float(np.max(np.abs(error))) / stroke

    @property
    def record(self) -> dict[str, Any]:
        """The figures as plain data, as ``tablegen predict --json`` prints them."""
        errors = self.errors_percent
        return {
            "axis": self.axis,
            "start": self.start.value,
            "samples": len(self.time_s),
            "duration_s": float(self.time_s[-1] - self.time_s[0]),
            "stroke_nm": self.extent_nm,
            "uncertainty_nm": self.uncertainty_nm,
            "rms_error_percent": None if errors is None else errors[0],
            "worst_error_percent": None if errors is None else errors[1],
        }

    def csv(self) -> bytes:
        """Return the table that ``-o`` writes."""
        names = ["time_s", "drive_v", "displacement_nm", "uncertainty_nm"]
        columns = [self.time_s, self.volts, self.position_nm, self.sweep_uncertainty_nm]
        if self.measured_nm is not None and self.error_nm is not None:
            names, columns = [*names, "measured_nm", "error_nm"], [*columns, self.measured_nm, self.error_nm]
        rows = (
            ",".join(f"{value:.10g}" for value in row) for row in zip(*(one.tolist() for one in columns), strict=True)
        )
        return ("\n".join([",".join(names), *rows]) + "\n").encode("ascii")

    def summary(self) -> str:
        """Return what ``tablegen predict`` prints."""
        return "\n".join(self._lines())

    def charts(self) -> PlottedCharts:
        """Return the position over time, and the error where there is a measurement."""
        curves = [DrawnCurve("predicted", "other", self.time_s, self.position_nm)]
        charts = [Chart("position", "position", "time [s]", "position [nm]", tuple(curves))]
        if self.error_nm is not None:
            error = DrawnCurve("error", "other", self.time_s, self.error_nm)
            charts.append(Chart("error", "predicted less measured", "time [s]", "error [nm]", (error,)))
        return PlottedCharts(f"prediction of {self.axis}", tuple(charts))

    def _lines(self) -> Sequence[str]:
        span_s = float(self.time_s[-1] - self.time_s[0])
        first = f"prediction of {self.axis}: {len(self.time_s)} samples, {span_s:.4g} s, start {self.start.value}"
        lines = [first, f"stroke {self.extent_nm:.6g} nm, rms error below {self.uncertainty_nm:.2g} nm (90 %)"]
        errors = self.errors_percent
        if errors is not None:
            lines.append(f"measured: rms error {errors[0]:.3g} %, worst {errors[1]:.3g} % of the stroke")
        return lines
