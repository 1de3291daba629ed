"""The position of an unshaped axis behind its response, computed again tick by tick from the words of a manifest.

A second-order response is followed in time, from the state with which a period begins as it ends. A measured one is
known at frequencies alone: there images of the codes at multiples of the update rate are added. The target is the
series that the manifest states, in the middle of every tick.
"""

from math import ceil, isfinite, pi

import numpy as np
import numpy.typing as npt

from tablegen.base.input_errors import shortened
from tablegen.manifest.fields import ManifestAxis, ManifestPassage, ManifestSeries
from tablegen.numerics.arrays import Floats
from tablegen.verification.checks.certified import PlayedPeriod, different_figures, on_grid
from tablegen.verification.checks.passage import passes
from tablegen.verification.checks.scaling import position_scaling, reached

MOST_TICKS = 1 << 20  # of a period that is judged
_MOST_IMAGES = 64
_TERMS = 24  # of the exponential of a matrix below 1/4


def is_judged(axis: ManifestAxis) -> bool:
    """Return True if a certificate has errors of the position of this axis."""
    measured = axis.drive.resonance is not None and not axis.resting and axis.output.shaping is None
    return measured and axis.line.hold_ticks == 1 and axis.line.ticks <= MOST_TICKS


def wrong_position(
    axis: ManifestAxis, period: PlayedPeriod, rate_hz: float, scaling_known: bool
) -> tuple[int, list[str]]:
    """Return how many figures of the position there are, and those that differ from the words.

    The passage was compared with that of the axis before.
    """
    stated = axis.certificate.position
    if (stated is not None) != is_judged(axis):
        return 0, [f"certificate.position is {'missing' if stated is None else 'there, and the axis is not judged so'}"]
    if stated is None:
        return 0, []
    errors = position_errors(axis, period, stated.passage, rate_hz)
    figures: dict[str, float | int | None] = {
        "max_error_lsb": float(np.max(np.abs(errors))),
        "rms_error_lsb": float(np.sqrt(np.mean(errors * errors))),
    }
    stated_figures: dict[str, float | int | None] = {name: getattr(stated, name) for name in figures}
    wrong = different_figures(stated_figures, figures, True, "position.")
    if not scaling_known:
        return len(figures), wrong
    sides, stated_sides = position_scaling(axis, period, errors), stated.scaling_error_percent
    name = "position.scaling_error_percent"
    if sides.keys() != stated_sides.keys():
        wrong.append(f"certificate.{name} has {shortened(', '.join(stated_sides)) or 'no direction'}")
    else:
        wrong += different_figures(stated_sides, sides, True, f"{name}.")
    return len(figures) + len(sides), wrong


def position_errors(axis: ManifestAxis, period: PlayedPeriod, passage: ManifestPassage, rate_hz: float) -> Floats:
    """Return the position less the one that is to arrive, in the middle of each tick.

    Returns
    -------
    Floats
        LSB of the converter, shape (ticks,).
    """
    ticks, per_unit = axis.line.ticks, period.codes_per_unit
    output, drive = axis.output, axis.drive
    middle = (drive.v_offset - output.v_zero) / output.v_per_code
    w: Floats = np.asarray(0.5 + (period.runs.at(np.arange(ticks, dtype=np.int64)) - middle) / per_unit)
    intended = on_grid(_later(reached(axis), 0.5 / ticks), ticks)
    position = _measured(passage, w, rate_hz) if passage.response is not None else _stepped(passage, w, rate_hz * ticks)
    return np.asarray((position - intended) * per_unit)


def _later(series: ManifestSeries, by: float) -> ManifestSeries:
    """Return a series whose value at t is that of this one at t + by, in periods."""
    angle = 2.0 * pi * by * np.arange(1, len(series.a) + 1)
    a, b, c, s = np.array(series.a), np.array(series.b), np.cos(angle), np.sin(angle)
    return ManifestSeries((a * c + b * s).tolist(), (b * c - a * s).tolist(), series.a0)


def _stepped(passage: ManifestPassage, w: Floats, update_hz: float) -> Floats:
    """Return the settled response, in the middle of ticks, to values that are each held for a tick."""
    omega_s, quality = 2.0 * pi * (passage.frequency_hz or 0.0) / update_hz, passage.quality or 1.0
    if not (isfinite(omega_s) and omega_s > 0.0):
        raise ValueError("a response without a frequency")
    late = 0.5 - (passage.delay_s or 0.0) * update_hz
    begins = int(np.floor(late))
    matrix = np.array([[0.0, omega_s], [-omega_s, -omega_s / quality]])
    step, part = _exponential(matrix), _exponential((late - begins) * matrix)
    (a, b), (c, d) = step.tolist()
    values = np.roll(w, -begins).tolist()

    def played(position: float, speed: float) -> tuple[list[float], list[float]]:
        positions, speeds = [], []
        for value in values:
            positions.append(position)
            speeds.append(speed)
            away = position - value
            position, speed = value + a * away + b * speed, c * away + d * speed
        return [*positions, position], [*speeds, speed]

    ends = [one[-1] for one in played(0.0, 0.0)]
    begin = np.linalg.solve(np.eye(2) - np.linalg.matrix_power(step, len(values)), ends)
    positions, speeds = (np.array(one[:-1]) for one in played(*begin.tolist()))
    codes = np.array(values)
    return np.asarray(codes + part[0, 0] * (positions - codes) + part[0, 1] * speeds)


def _exponential(matrix: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the exponential of a matrix: Taylor's series of a part of it, squared as often."""
    size = float(np.max(np.abs(matrix)))
    halvings = max(0, ceil(np.log2(max(size, 1e-300))) + 3)
    small, term = np.eye(2), np.eye(2)
    for k in range(1, _TERMS):
        term = term @ (matrix / 2.0**halvings) / k
        small = small + term
    return np.linalg.matrix_power(small, 2**halvings)


def _measured(passage: ManifestPassage, w: Floats, rate_hz: float) -> Floats:
    """Return the response of a measured passage: harmonics, each with its images in held codes."""
    ticks = len(w)
    spectrum = np.fft.fft(w)
    harmonic = np.fft.fftfreq(ticks, 1.0 / ticks)
    assert passage.response is not None
    most = min(ceil(passage.response.hz[-1] / (rate_hz * ticks)) + 1, _MOST_IMAGES)
    total = np.zeros(ticks, dtype=np.complex128)
    for image in range(-most, most + 1):
        at = harmonic + image * ticks
        passed = passes(passage, np.abs(at) * rate_hz)
        total += np.sinc(at / ticks) * np.where(at < 0.0, np.conj(passed), passed)
    if ticks % 2 == 0:  # the highest harmonic stands for both of its signs
        total[ticks // 2] = total[ticks // 2].real
    return np.asarray(np.fft.ifft(spectrum * total).real)
