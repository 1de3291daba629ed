"""Check and thin one record in time, of a drive of any shape, before an operator is fitted to it."""

from dataclasses import dataclass, replace

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.spans import check_spans
from tablegen.compensation.operator.in_time import turns_of
from tablegen.numerics.arrays import Floats
from tablegen.numerics.driver import Driver

LEAST_SAMPLES = 40
_MOST_SAMPLES = 6000  # of a record that are fitted; of longer ones every k-th sample, and the turns
_BEYOND = 0.02  # of the driver's range
_LEAST_STROKE = 0.02  # of the driver's range
_AT_REST = 1e-3  # of the drive's span: what moves by less is at rest
_MOVED_AT_REST = 0.3  # of the displacement's span, while the drive is at an end of its range
_RELAXED = 0.5  # share of that movement within the first half of the rest: creep and dynamics do more than this


@dataclass(frozen=True, eq=False)
class TimeRecord:
    """Times in s, drives in shares of the driver's range, displacements in nm: shape (samples,) each."""

    name: str
    time_s: Floats
    drive: Floats
    displacement_nm: Floats

    @property
    def span_nm(self) -> float:
        """The stroke of the displacement, peak to peak."""
        return float(np.ptp(self.displacement_nm))

    @property
    def stroke(self) -> float:
        """The stroke of the drive, peak to peak, of the driver's range."""
        return float(np.ptp(self.drive))

    @property
    def turns(self) -> list[int]:
        """The first sample, each turn of the drive, and the last sample."""
        return turns_of(self.drive)

    @property
    def rate_hz(self) -> float:
        """The rate of the sweeps between turns: half of one over their median length."""
        times = np.diff(self.time_s[self.turns])
        moves = np.abs(np.diff(self.drive[self.turns])) > 0.2 * self.stroke
        return 0.5 / float(np.median(times[moves] if np.any(moves) else times))

    def earlier(self, delay_s: float) -> "TimeRecord":
        """Return the record with the displacement of a sensor that is ``delay_s`` behind the drive."""
        if not delay_s:
            return self
        ahead = np.interp(self.time_s + delay_s, self.time_s, self.displacement_nm)
        inside = (self.time_s + delay_s <= self.time_s[-1]) & (self.time_s + delay_s >= self.time_s[0])
        return TimeRecord(self.name, self.time_s[inside], self.drive[inside], ahead[inside])

    def since(self, first: int) -> "TimeRecord":
        """Return the record from a sample on."""
        return TimeRecord(self.name, self.time_s[first:], self.drive[first:], self.displacement_nm[first:])


def time_record(trace: Trace, driver: Driver | float) -> TimeRecord:
    """Check a trace: times ascending in s, drive at the piezo in V, displacement in nm; thin a long one.

    Raises
    ------
    Unphysical
        If the record holds no hysteresis, or is faulty; the message leaves the trace's name to the caller.
    """
    time, volts, moved = trace.time_s, trace.drive_v, trace.displacement_nm
    if len(time) < LEAST_SAMPLES:
        raise Unphysical(f"has {len(time)} samples; {LEAST_SAMPLES} or more are needed, over a rise and a fall")
    for name, values in (("time", time), ("drive", volts), ("displacement", moved)):
        missing = np.flatnonzero(~np.isfinite(values))
        if len(missing):
            raise Unphysical(f"the {name} of sample {missing[0] + 1} is {values[missing[0]]:g}; leave such samples out")
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if len(back):
        row = int(back[0]) + 1
        raise Unphysical(
            f"the time of sample {row + 1}, {time[row]:g} s, does not come after {time[row - 1]:g} s: the counter "
            "wrapped, or rows are out of order; give ascending times, or a column trace where a new record begins"
        )
    check_spans(time, moved, volts)
    for name, values in (("drive", volts), ("displacement", moved)):
        if not float(np.ptp(values)) > 0.0:
            raise Unphysical(f"the {name} does not move; record a drive that rises and falls")
    driver = Driver.of(driver)
    u = driver.share(volts)
    if np.min(u) < -_BEYOND or np.max(u) > 1.0 + _BEYOND:
        low, high = float(np.min(volts)), float(np.max(volts))
        raise Unphysical(f"a drive of {low:.4g}..{high:.4g} V is outside the driver's {driver}")
    if float(np.ptp(u)) < _LEAST_STROKE:
        raise Unphysical(
            f"the drive moves by {100.0 * float(np.ptp(u)):.2g} % of the driver's range; at least "
            f"{100.0 * _LEAST_STROKE:g} % are needed. Is it in volts at the piezo?"
        )
    if len(turns_of(u)) < 3:
        raise Unphysical("the drive never turns, so that the record holds no hysteresis; record a rise and a fall")
    _refuse_clipped_drive(u, moved)
    sign = -1.0 if np.corrcoef(u, moved)[0, 1] < 0.0 else 1.0
    return _thinned(TimeRecord(trace.name, time - time[0], u, sign * moved))


def _refuse_clipped_drive(u: Floats, moved: Floats) -> None:
    """Refuse a drive that rests at an end of its range while the piezo goes on with a sweep and comes back."""
    span = float(np.ptp(u))
    for end, at in (("largest", float(np.max(u))), ("least", float(np.min(u)))):
        still = np.abs(u - at) <= _AT_REST * span
        edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8)))
        for begin, stop in edges.reshape(-1, 2).tolist():
            part = moved[begin:stop]
            if len(part) < 6 or float(np.ptp(part)) < _MOVED_AT_REST * float(np.ptp(moved)):
                continue
            there_and_back = float(np.ptp(part)) - abs(float(part[-1] - part[0]))
            if there_and_back > _RELAXED * float(np.ptp(part)):
                raise Unphysical(
                    f"the drive stays at its {end} value while the displacement moves by "
                    f"{100.0 * float(np.ptp(part)) / float(np.ptp(moved)):.2g} % of its stroke and back: the input of "
                    "the recorder was clipped; record the drive with more range"
                )


def _thinned(record: TimeRecord) -> TimeRecord:
    """Return a record with at most about ``_MOST_SAMPLES`` samples, all turns among them."""
    count = len(record.time_s)
    every = -(-count // _MOST_SAMPLES)
    if every == 1:
        return record
    rows = np.unique(np.concatenate([np.arange(0, count, every), record.turns])) if count else np.arange(0)
    if len(rows) > 2 * _MOST_SAMPLES:  # the noise of the drive makes turns of its own
        rows = np.arange(0, count, every)
    return replace(
        record,
        time_s=record.time_s[rows],
        drive=record.drive[rows],
        displacement_nm=record.displacement_nm[rows],
    )
