"""Average one trace to one settled period: drive and displacement on an even grid of phases, without drift."""

from dataclasses import dataclass, replace

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.calibration.laws.hysteresis import Trace
from tablegen.calibration.operator.plausible import Unsettled, check_record, check_repeats
from tablegen.compensation.dynamics import Response
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.numerics.arrays import Bools, Floats
from tablegen.numerics.driver import Driver

PHASES = 1024  # of the grid
_MIN_SAMPLES = 40  # samples a period
_MAX_DRIFT_ORDER = 3
# Share of a period that may be missing: a record of whole periods ends a sample before their end. It is not a sample
# of a round number of samples, where the last bit of the period would decide.
_MISSING = 1.5e-3
_LEVEL = 0.25  # of the drive's span: distance from the middle that a crossing has to reach
_RESONANCE_SHARE = 0.3  # dynamics are removed up to this share of the resonance; above it is noise
_BACKWARDS = 0.02  # of the span: how far a sweep may go back by noise


@dataclass(frozen=True, eq=False)
class PeriodicLine:
    """One period of a settled line, from the minimum of the drive on; arrays have ``PHASES`` values.

    ``drive`` is normalised to v_max, ``displacement_nm`` a mean over ``periods``; ``noise_nm`` is the standard
    deviation of that mean, and ``drift_nm`` the drift over the record, which is removed. ``samples`` is the number of
    samples a period of the record.
    """

    name: str
    rate_hz: float
    periods: int
    drive: Floats
    displacement_nm: Floats
    noise_nm: float
    drift_nm: float
    samples: float = _MIN_SAMPLES

    @property
    def low(self) -> float:
        """The least normalised drive."""
        return float(np.min(self.drive))

    @property
    def high(self) -> float:
        """The largest normalised drive."""
        return float(np.max(self.drive))

    @property
    def span_nm(self) -> float:
        """The stroke of the displacement, peak to peak."""
        return float(np.ptp(self.displacement_nm))

    @property
    def stroke(self) -> float:
        """Peak to peak, of v_max."""
        return self.high - self.low

    @property
    def centre(self) -> float:
        """The middle between the turns, of v_max."""
        return 0.5 * (self.low + self.high)

    @property
    def mean(self) -> float:
        """The mean of the drive over the period, of v_max, on which the sensitivity depends."""
        return float(np.mean(self.drive))

    @property
    def rising(self) -> Bools:
        """Phases at which the drive is on its way from its minimum to its maximum.

        Returns
        -------
        Bools
            Shape (PHASES,).
        """
        return np.arange(PHASES) < int(np.argmax(self.drive))

    def highest_corrected_hz(self, response: Response) -> float:
        """Return the frequency up to which dynamics are removed."""
        return _RESONANCE_SHARE * response.resonance_hz

    def earlier(self, delay_s: float) -> "PeriodicLine":
        """Return the line with the displacement of a sensor that is ``delay_s`` behind the drive."""
        n = np.arange(PHASES // 2 + 1)
        ahead = np.exp(2j * np.pi * (n * self.rate_hz * delay_s))
        return replace(self, displacement_nm=np.fft.irfft(np.fft.rfft(self.displacement_nm) * ahead, PHASES))

    def without(self, response: Response | None, creep: LogarithmicCreep | None) -> "PeriodicLine":
        """Return the line without the dynamics and the creep, which act on the displacement after the hysteresis."""
        n = np.arange(PHASES // 2 + 1, dtype=np.float64)
        spectrum = np.fft.rfft(self.displacement_nm)
        f_hz: Floats = n * self.rate_hz
        if response is not None:
            inside = f_hz <= self.highest_corrected_hz(response)
            real, imaginary = response.inverse(f_hz[inside])
            spectrum[inside] = spectrum[inside] * (real + 1j * imaginary)
        if creep is not None:
            real, imaginary = creep.response(f_hz[1:])
            spectrum[1:] = spectrum[1:] / (real + 1j * imaginary)
        values = np.fft.irfft(spectrum, PHASES)
        return replace(self, displacement_nm=values)


def periodic_line(trace: Trace, driver: Driver | float) -> PeriodicLine:
    """Average the periods of a trace: times ascending in s, drive at the piezo in V, displacement in nm.

    The first of three periods or more is not used.

    Raises
    ------
    Unphysical
        If the record is no settled line; the message leaves the trace's name to the caller.
    """
    check_record(trace)
    driver = Driver.of(driver)
    time, drive = trace.time_s, driver.share(trace.drive_v)
    if len(time) < _MIN_SAMPLES or not np.all(np.diff(time) > 0.0):
        raise Unphysical(f"{len(time)} samples whose times ascend are needed, at least {_MIN_SAMPLES} a period")
    if np.min(drive) < -0.02 or np.max(drive) > 1.02:
        low, high = float(np.min(trace.drive_v)), float(np.max(trace.drive_v))
        raise Unphysical(f"a drive of {low:.4g}..{high:.4g} V is outside the driver's {driver}")
    period = _period(time, drive)
    # Whole periods from the first sample on; the grid then begins at a minimum.
    periods = int((time[-1] - time[0]) / period + _MISSING)
    if periods < 1:
        raise Unsettled(f"{(time[-1] - time[0]) / period:.3g} of a period are recorded; at least one is needed")
    if len(time) / ((time[-1] - time[0]) / period) < _MIN_SAMPLES:
        raise Unsettled(f"fewer than {_MIN_SAMPLES} samples a period")
    settle = 1 if periods >= 3 else 0
    start = float(time[0]) + settle * period
    grid = start + period * (np.arange((periods - settle) * PHASES) / PHASES)
    rows = [np.interp(grid, time, values).reshape(-1, PHASES) for values in (drive, trace.displacement_nm)]
    settled = periods - settle
    check_repeats(rows[0])
    centres = np.arange(settled) - 0.5 * (settled - 1)
    means = rows[1].mean(axis=1)
    order = min(settled - 1, _MAX_DRIFT_ORDER)
    drift = np.polynomial.Polynomial.fit(centres, means, order) if order else np.polynomial.Polynomial([means[0]])
    at = centres[:, None] + (np.arange(PHASES) / PHASES - 0.5)[None, :]
    level = rows[1] - drift(at)
    displacement, shape = level.mean(axis=0), rows[0].mean(axis=0)
    spread = float(np.sqrt(np.mean((level - displacement) ** 2) / max(settled - 1, 1))) if settled > 1 else 0.0
    begin = int(np.argmin(shape))
    shape, displacement = np.roll(shape, -begin), np.roll(displacement, -begin)
    if np.corrcoef(shape, displacement)[0, 1] < 0.0:
        displacement = -displacement
    _check_sweeps(shape)
    return PeriodicLine(
        trace.name,
        1.0 / period,
        settled,
        shape,
        displacement,
        spread,
        float(np.ptp(drift(at))) if order else 0.0,
        len(time) * period / float(time[-1] - time[0]),
    )


def _period(time: Floats, drive: Floats) -> float:
    """Return the period in s, from all rises and falls of the record through the middle."""
    middle = 0.5 * (float(np.max(drive)) + float(np.min(drive)))
    level = (drive - middle) / float(np.ptp(drive))
    side = np.where(level > _LEVEL, 1, np.where(level < -_LEVEL, -1, 0))
    outside = np.flatnonzero(side)
    rises = outside[1:][(side[outside[1:]] > 0) & (side[outside[:-1]] < 0)]
    falls = outside[1:][(side[outside[1:]] < 0) & (side[outside[:-1]] > 0)]
    crossings = []
    for edges, sign in ((rises, 1.0), (falls, -1.0)):
        at = []
        for edge in edges.tolist():
            before = outside[np.searchsorted(outside, edge) - 1]
            part = slice(int(before), edge + 1)
            slope, offset = np.polyfit(time[part] - time[before], level[part] * sign, 1)
            at.append(float(time[before]) - offset / slope)
        crossings.append(np.array(at))
    several = [at for at in crossings if len(at) >= 2]
    if several:
        slopes = [float(np.polyfit(np.arange(len(at)), at, 1)[0]) for at in several]
        return float(np.mean(slopes))
    raise Unsettled("no whole period: the drive has to rise and to fall, at least one and a half times")


def _check_sweeps(drive: Floats) -> None:
    """Raise ``Unphysical`` unless the drive rises and falls once: other waveforms have inner loops."""
    top = int(np.argmax(drive))
    span = float(np.ptp(drive))
    for sweep in (drive[: top + 1], -drive[top:]):
        back = float(np.max(np.maximum.accumulate(sweep) - sweep)) if len(sweep) else 0.0
        if back > _BACKWARDS * span:
            raise Unsettled(
                f"the drive goes back by {100.0 * back / span:.2g} % in the middle of a sweep; only one rise and "
                "one fall a period are supported"
            )
