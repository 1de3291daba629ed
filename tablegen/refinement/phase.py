"""The phase of each sample of a trace, in periods of the scan: from the recorded drive, or from a trigger."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, pi

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.fitting.least_squares import solve
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan
from tablegen.waveform.series import FourierSeries

MIN_SAMPLES_PER_PERIOD = 40  # samples per period
_MOST_AT_ONCE = 1 << 18  # samples
_GRID_POINTS = 1 << 16  # points per period, between which the known waveform is linear
_MAX_CLOCK_DIFFERENCE = 0.01  # relative difference allowed between the clocks of generator and recorder
_MAX_DRIVE_DIFFERENCE = 0.05  # difference allowed between recorded drive and plan, share of the amplitude
_MAX_DRIVE_DEPARTURE = (
    0.005  # rms departure of the drive from the plan's waveform, of its amplitude, averaged over periods
)
_BINS_PER_PERIOD = 64  # bins per period for that
_MAX_LAYER_MISSING = 0.5  # share of the layer


@dataclass(frozen=True)
class Phase:
    """The times of the samples; ``turns`` are periods since a line start, (samples,), by the recorder's clock.

    ``drive`` is the recorded drive's amplitude relative to the plan's, and its rms departure from the plan's waveform
    relative to that; None without a recorded drive.
    """

    turns: Floats
    period_s: float
    drive: tuple[float, float] | None


def phase_by_trigger(line: LinePlan, time_s: Floats, period_s: float | None, delay_s: float) -> Phase:
    """Compute the phase of a trace whose time 0 is a line start (of y: a frame start).

    Parameters
    ----------
    time_s
        Times in s, ascending, shape (samples,).
    period_s
        Period by the recorder's clock in s; the plan's if None.
    delay_s
        Delay of the sensor in s.

    Raises
    ------
    Unphysical
        If the trace has too few samples, less than a period, or times that do not ascend.
    """
    period = 1.0 / float(line.rate) if period_s is None else period_s
    _check_times(time_s, period)
    return Phase((time_s - delay_s) / period, period, None)


def phase_by_drive(line: LinePlan, time_s: Floats, drive_v: Floats, delay_s: float) -> Phase:
    """Fit period and start of the recorded drive by the waveform that the plan's codes make there.

    The output of the converter is that waveform, with ripple at the update rate: a code stands for the middle of its
    tick, and periods are counted from the beginning of tick 0, as by a trigger.

    Parameters
    ----------
    time_s, drive_v
        Times in s, ascending, and the drive at the piezo in V, shape (samples,) each.
    delay_s
        Delay of the sensor against the drive, in s.

    Raises
    ------
    Unphysical
        If the trace is too short or too sparse, or the drive is not that of the plan.
    """
    nominal = 1.0 / float(line.rate)
    _check_times(time_s, nominal)
    period, start = _first_guess(line.drive_series, time_s, drive_v, nominal)
    w, slope = _tabled(line.drive_series, 0), _tabled(line.drive_series, 1)
    amplitude, middle = line.drive.v_amplitude, line.drive.v_offset

    def turns(x: Floats, rows: slice = slice(None)) -> Floats:
        t = time_s[rows] - float(x[1])
        t /= float(x[0])  # in place: a long trace is hundreds of megabytes
        return t

    def residuals(x: Floats, rows: slice = slice(None)) -> Floats:
        residual: Floats = float(x[2]) + float(x[3]) * (_at(w, turns(x, rows)) - 0.5) - drive_v[rows]
        return residual / amplitude

    def jacobian(x: Floats, rows: slice = slice(None)) -> Floats:
        t = turns(x, rows)
        steep = float(x[3]) * _at(slope, t) / float(x[0])
        return np.column_stack([-steep * t, -steep, np.ones_like(t), _at(w, t) - 0.5]) / amplitude

    first = [period, start, float(np.mean(drive_v)), float(np.ptp(drive_v))]
    scales = [0.01 * nominal, 0.05 * nominal, amplitude, amplitude]
    few = slice(None, None, ceil(len(time_s) / _MOST_AT_ONCE))
    fit = solve(
        lambda x: residuals(x, few),
        first,
        ("period", "start", "middle", "amplitude"),
        scales,
        jacobian=lambda x: jacobian(x, few),
    )
    x, residual = fit.values, fit.residuals
    if len(residual) < len(time_s):  # so near the minimum, one step with all samples reaches it
        x = x - _step(residuals, jacobian, x, np.array(scales), len(time_s))
        residual = np.empty(len(time_s))
        for rows in _parts(len(time_s)):
            residual[rows] = residuals(x, rows)
    relative, t = float(x[3]) / amplitude, turns(x)
    departure = _averaged(t, residual) / max(abs(relative), 1e-9)
    if abs(float(x[0]) / nominal - 1.0) > _MAX_CLOCK_DIFFERENCE:
        raise Unphysical(
            f"the recorded drive has a period of {x[0]:.6g} s, this scan {nominal:.6g} s; is time_s in seconds?"
        )
    if abs(relative - 1.0) > _MAX_DRIVE_DIFFERENCE or abs(float(x[2]) - middle) > _MAX_DRIVE_DIFFERENCE * amplitude:
        raise Unphysical(
            f"the recorded drive is {x[3]:.4g} V about {x[2]:.4g} V, this scan {amplitude:.4g} V about {middle:.4g} V; "
            f"drive_v is the voltage at the piezo, behind the amplifier, of the axis that is named"
        )
    if departure > _MAX_DRIVE_DEPARTURE:
        raise Unphysical(
            f"the recorded drive departs from this scan's by {100.0 * departure:.2g} % rms; record the scan as it is "
            f"built from this file"
        )
    _check_layer(line, t[few], -residual[few] / relative)
    t -= delay_s / float(x[0])
    return Phase(t, float(x[0]), (relative, departure))


def _step(
    residuals: Callable[[Floats, slice], Floats],
    jacobian: Callable[[Floats, slice], Floats],
    x: Floats,
    scales: Floats,
    samples: int,
) -> Floats:
    """Return the Gauss-Newton step of all samples."""
    normal, right = np.zeros((len(x), len(x))), np.zeros(len(x))
    for rows in _parts(samples):
        j = jacobian(x, rows) * scales
        normal += j.T @ j
        right += j.T @ residuals(x, rows)
    return np.asarray(scales * np.linalg.solve(normal, right), dtype=np.float64)


def _parts(samples: int) -> list[slice]:
    """Split a long trace into parts that fit into memory with their derivatives."""
    return [slice(first, first + _MOST_AT_ONCE) for first in range(0, samples, _MOST_AT_ONCE)]


def _check_times(time_s: Floats, period_s: float) -> None:
    if len(time_s) < MIN_SAMPLES_PER_PERIOD:
        raise Unphysical(
            f"{len(time_s)} samples are not enough for a trace; at least {MIN_SAMPLES_PER_PERIOD} a period are needed"
        )
    if not np.all(np.diff(time_s) > 0.0):
        at = int(np.argmin(np.diff(time_s) > 0.0))
        raise Unphysical(f"time does not ascend after {time_s[at]:g} s; a file holds one trace")
    periods = float(time_s[-1] - time_s[0]) * (1.0 + 1.0 / (len(time_s) - 1)) / period_s
    if periods < 0.99:
        raise Unphysical(f"{periods:.3g} of a period of {period_s:.6g} s are recorded; record one or more, best five")
    if len(time_s) < MIN_SAMPLES_PER_PERIOD * periods:
        raise Unphysical(
            f"{len(time_s) / periods:.3g} samples a period are too few; {MIN_SAMPLES_PER_PERIOD} are needed"
        )


def _first_guess(series: FourierSeries, time_s: Floats, drive_v: Floats, nominal_s: float) -> tuple[float, float]:
    """Return period and a line start, from the angle of the fundamental in pieces of one nominal period each."""
    if not float(np.ptp(drive_v)) > 0.0:
        raise Unphysical("the drive does not move")
    turns = time_s - time_s[0]
    turns /= nominal_s
    pieces = max(int(np.floor(turns[-1] + 0.02)), 1)
    angles = []
    edges = np.searchsorted(turns, np.arange(pieces + 1.0))
    for first, stop in pairwise(edges.tolist()):
        wave = np.exp(-2j * pi * turns[first:stop])
        basis = np.column_stack([np.ones(len(wave)), wave.real, wave.imag])
        c = np.linalg.lstsq(basis, drive_v[first:stop], rcond=None)[0]
        angles.append(np.angle(c[1] + 1j * c[2]))  # angle of exp(2 pi i turns)
    # The drive is cos(2 pi (turns + angle)): a clock that is off lets the angle grow.
    angle = np.unwrap(angles) / (2.0 * pi)
    growth = float(np.polyfit(np.arange(pieces) + 0.5, angle, 1)[0]) if pieces > 1 else 0.0
    period = nominal_s / (1.0 + growth)
    own = float(np.angle(series.a[0] - 1j * series.b[0])) / (2.0 * pi)
    middle = float(np.mean(angle)) + growth * (0.0 - 0.5 * pieces)  # the angle at the first sample
    return period, float(time_s[0]) - (middle - own) * period


def _tabled(series: FourierSeries, derivative: int) -> Floats:
    count = _GRID_POINTS
    spectrum = 0.5 * (series.a - 1j * series.b) * (2j * pi * np.arange(1, series.harmonics + 1)) ** derivative
    whole = np.concatenate([[series.a0 if derivative == 0 else 0.0], spectrum])
    values = np.fft.irfft(whole, count) * count
    return np.append(values, values[0])


def _at(table: Floats, turns: Floats) -> Floats:
    place = (turns - np.floor(turns)) * _GRID_POINTS
    k = np.minimum(place.astype(np.int64), _GRID_POINTS - 1)
    value: Floats = table[k] + (place - k) * (table[k + 1] - table[k])
    return value


def _averaged(turns: Floats, residuals: Floats) -> float:
    """Return the rms of the residuals, averaged over the periods in bins, less the share of noise.

    Noise is estimated from the difference of neighbouring readings: in a short trace a bin has few readings.
    """
    count, total = np.zeros(_BINS_PER_PERIOD), np.zeros(_BINS_PER_PERIOD)
    for rows in _parts(len(turns)):
        place = ((turns[rows] - np.floor(turns[rows])) * _BINS_PER_PERIOD).astype(np.int64)
        place = np.minimum(place, _BINS_PER_PERIOD - 1)
        count += np.bincount(place, minlength=_BINS_PER_PERIOD)
        total += np.bincount(place, residuals[rows], minlength=_BINS_PER_PERIOD)
    readings = count[count > 0]
    mean = total[count > 0] / readings
    noise = 0.5 * sum(float(np.sum(np.diff(residuals[rows]) ** 2)) for rows in _parts(len(residuals))) / len(residuals)
    return float(np.sqrt(max(float(np.mean(mean**2)) - noise * float(np.mean(1.0 / readings)), 0.0)))


def _check_layer(line: LinePlan, turns: Floats, residuals: Floats) -> None:
    """Check that the drive has the layer of the file: a trace of an older build would be learnt twice."""
    if line.layer is None:
        return
    low, high = line.band_limit.window
    t, turn = turns - np.floor(turns), line.drive.turn
    x = np.where(t < turn, t / turn, (1.0 - t) / (1.0 - turn))
    inside = (x >= low) & (x <= high) & ((t < turn) | (line.band_limit.directions == "both"))
    columns = np.column_stack(
        # Offset, amplitude and start were fitted, and took a part of it.
        [_at(_tabled(line.layer, 0), t), np.ones_like(t), *(_at(_tabled(line.drive_series, n), t) for n in (0, 1))],
    )[inside]
    coefficients, left_over, rank, _ = np.linalg.lstsq(columns, residuals[inside], rcond=None)
    if rank < 4 or not len(left_over):
        return
    inverse = np.linalg.inv(columns.T @ columns)
    error = float(np.sqrt(inverse[0, 0] * left_over[0] / max(len(columns) - 4, 1)))
    if float(coefficients[0]) < -_MAX_LAYER_MISSING and error < 0.2 * _MAX_LAYER_MISSING:
        share = min(-float(coefficients[0]), 1.0)
        raise Unphysical(
            f"the recorded drive lacks {ceil(100.0 * share - 0.5)} % of the layer that the scan file has; "
            f"build, upload and record again"
        )
