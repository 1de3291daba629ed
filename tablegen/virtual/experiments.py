"""What a laboratory would measure on the virtual scanner: simulated data for the calibration, by column name.

Columns have the names and units that ``tablegen.calibration`` reads. Noise comes from the seed alone.
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
    """Nanometres between the ends of a settled triangle of ``size_v`` volts peak to peak."""
    ticks = TICKS * _finer(axis, rate_hz * TICKS, TICKS)
    moved = axis.settled(_triangle(size_v, offset_v, ticks, turn), 1.0 / (rate_hz * ticks))
    return float(np.max(moved) - np.min(moved))


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
    """Simulate ``time_s``, ``drive_v``, ``displacement_nm`` of a triangle after a long rest at its lowest voltage.

    ``samples`` a period; the first period is not settled, and creep drifts through all of them.
    """
    finer = _finer(axis, rate_hz * samples, periods * samples)
    volts = np.tile(_triangle(size_v, offset_v, samples * finer, turn), periods)
    time = np.arange(periods * samples, dtype=np.float64) / (rate_hz * samples)
    moved = axis.follow(volts, 1.0 / (rate_hz * samples * finer), offset_v)[::finer]
    volts = volts[::finer]
    return {"time_s": time, "drive_v": volts, "displacement_nm": (sensor or Sensor()).read(moved, time)}


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
    """``offset_v``, ``apparent_nm``: how large an object looks in a scan of ``size_v``, calibrated at the middle.

    ``noise`` is relative, rms.
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
    """``nominal_nm``, ``actual_nm``: sizes set with a linear k, and those reached; by default at the middle."""
    offset = axis.driver.middle if offset_v is None else offset_v
    sizes = [triangle_size(axis, nominal / k_nm_per_v, offset, rate_hz, turn) for nominal in nominal_nm]
    return {"nominal_nm": np.array(nominal_nm, dtype=np.float64), "actual_nm": _noisy(sizes, noise, seed)}


def frequency_response(
    axis: VirtualAxis, frequency_hz: FloatsLike, noise: float = 0.0, seed: int = 0
) -> dict[str, Floats]:
    """``frequency_hz``, ``gain``, ``phase_deg`` of a small sine, 1 at the creep's reference. ``noise`` is relative."""
    f = np.asarray(frequency_hz, dtype=np.float64)
    generator = np.random.default_rng(seed)
    complex_noise = generator.standard_normal(f.shape) + 1j * generator.standard_normal(f.shape)
    h = axis.response(f) * (1.0 + noise * complex_noise)
    return {"frequency_hz": f, "gain": np.abs(h), "phase_deg": np.degrees(np.unwrap(np.angle(h)))}


def _finer(axis: VirtualAxis, tick_hz: float, ticks: int) -> int:
    """Into how many a tick is split, so that the generator's own steps do not ring the resonance.

    Steps that are far apart need not be: their ringing has died away when the tick ends.
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
