"""Simulated measurements of the virtual scanner for the calibration, by column name.

Columns have the names and units that ``tablegen.calibration`` reads. Noise depends on the seed alone.
"""

from collections.abc import Sequence
from math import ceil, exp, pi

import numpy as np

from tablegen.numerics.arrays import Floats, FloatsLike
from tablegen.virtual.line_error import ideal_triangle
from tablegen.virtual.scanner import VirtualAxis
from tablegen.virtual.sensor import Sensor

TICKS = 2000  # ticks of a triangle of which only the size is used
STEPS_PER_RING = 8  # steps of the generator per period of the resonance
RUNG_OUT = 1e-2  # share of a step's ringing that is small compared with the noise of the sensor
MAX_TICKS = 1 << 21  # beyond it steps are so small that they ring nothing


def triangle_size(axis: VirtualAxis, size_v: float, offset_v: float, rate_hz: float, turn: float = 0.5) -> float:
    """Return the size in nm, end to end, of a settled triangle of ``size_v`` volts peak to peak.

    Raises
    ------
    ValueError
        If the triangle leaves the driver's range.
    """
    ticks = TICKS * _finer(axis, rate_hz * TICKS, TICKS)
    displacement_nm = axis.settled(_triangle(size_v, offset_v, ticks, turn), 1.0 / (rate_hz * ticks))
    return float(np.max(displacement_nm) - np.min(displacement_nm))


def sensor_trace(
    axis: VirtualAxis,
    size_v: float,
    offset_v: float,
    rate_hz: float,
    periods: int = 3,
    samples: int = 2000,
    turn: float = 0.5,
    sensor: Sensor | None = None,
) -> dict[str, Floats]:
    """Simulate the trace of a triangle that starts after a long rest at its lowest voltage.

    The first period is not settled, and creep drifts through all of them.

    Parameters
    ----------
    samples
        Samples per period.

    Returns
    -------
    ``time_s``, ``drive_v``, ``displacement_nm``, each of shape (periods * samples,).

    Raises
    ------
    ValueError
        If the triangle leaves the driver's range.
    """
    finer = _finer(axis, rate_hz * samples, periods * samples)
    volts = np.tile(_triangle(size_v, offset_v, samples * finer, turn), periods)
    time = np.arange(periods * samples, dtype=np.float64) / (rate_hz * samples)
    displacement_nm = axis.follow(volts, 1.0 / (rate_hz * samples * finer), offset_v)[::finer]
    volts = volts[::finer]
    return {"time_s": time, "drive_v": volts, "displacement_nm": (sensor or Sensor()).read(displacement_nm, time)}


def apparent_sizes(
    axis: VirtualAxis,
    offsets_v: Sequence[float],
    size_v: float,
    rate_hz: float,
    true_nm: float = 17.7,
    noise: float = 0.0,
    seed: int = 0,
    turn: float = 0.5,
) -> dict[str, Floats]:
    """Simulate how large an object of ``true_nm`` looks at each offset, calibrated at the middle of the range.

    Parameters
    ----------
    offsets_v, size_v
        Offsets and the scan voltage, in V.
    noise
        Rms noise of a size, relative.

    Returns
    -------
    ``offset_v`` and ``apparent_nm``, each of shape (offsets,).

    Raises
    ------
    ValueError
        If a scan leaves the driver's range.
    """
    middle = triangle_size(axis, size_v, axis.driver.middle, rate_hz, turn)
    ratios = [middle / triangle_size(axis, size_v, offset, rate_hz, turn) for offset in offsets_v]
    return {"offset_v": np.array(offsets_v, dtype=np.float64), "apparent_nm": true_nm * _noisy(ratios, noise, seed)}


def actual_sizes(
    axis: VirtualAxis,
    nominal_nm: Sequence[float],
    k_nm_per_v: float,
    rate_hz: float,
    offset_v: float | None = None,
    noise: float = 0.0,
    seed: int = 0,
    turn: float = 0.5,
) -> dict[str, Floats]:
    """Simulate the sizes reached where a linear k sets them.

    Parameters
    ----------
    offset_v
        Offset in V; the middle of the range if None.
    noise
        Rms noise of a size, relative.

    Returns
    -------
    ``nominal_nm`` and ``actual_nm``, each of shape (sizes,).

    Raises
    ------
    ValueError
        If a scan leaves the driver's range.
    """
    offset = axis.driver.middle if offset_v is None else offset_v
    sizes = [triangle_size(axis, nominal / k_nm_per_v, offset, rate_hz, turn) for nominal in nominal_nm]
    return {"nominal_nm": np.array(nominal_nm, dtype=np.float64), "actual_nm": _noisy(sizes, noise, seed)}


def frequency_response(
    axis: VirtualAxis, frequency_hz: FloatsLike, noise: float = 0.0, seed: int = 0
) -> dict[str, Floats]:
    """Simulate the response to a small sine; the gain is 1 at the reference of the creep.

    Parameters
    ----------
    frequency_hz
        Frequencies in Hz, shape (frequencies,).
    noise
        Rms noise of the real and of the imaginary part, relative.

    Returns
    -------
    ``frequency_hz``, ``gain`` and ``phase_deg``, each of shape (frequencies,).
    """
    f = np.asarray(frequency_hz, dtype=np.float64)
    generator = np.random.default_rng(seed)
    complex_noise = generator.standard_normal(f.shape) + 1j * generator.standard_normal(f.shape)
    h = axis.response(f) * (1.0 + noise * complex_noise)
    return {"frequency_hz": f, "gain": np.abs(h), "phase_deg": np.degrees(np.unwrap(np.angle(h)))}


def _finer(axis: VirtualAxis, tick_hz: float, ticks: int) -> int:
    """Return into how many steps a tick is split, so that the generator's own steps do not ring the resonance.

    Steps that are far enough from each other are not split: their ringing has decayed when the tick ends.
    """
    if not axis.resonance.poles:
        return 1
    ringing = max(axis.resonance.poles, key=lambda pole: abs(pole.imag))
    if exp(ringing.real / tick_hz) < RUNG_OUT:
        return 1
    return max(1, min(ceil(STEPS_PER_RING * abs(ringing.imag) / (2.0 * pi * tick_hz)), MAX_TICKS // ticks))


def _triangle(size_v: float, offset_v: float, samples: int, turn: float) -> Floats:
    return offset_v + size_v * (ideal_triangle(samples, turn) - 0.5)


def _noisy(values: Sequence[float], noise: float, seed: int) -> Floats:
    exact = np.array(values, dtype=np.float64)
    return exact * (1.0 + noise * np.random.default_rng(seed).standard_normal(exact.shape))
