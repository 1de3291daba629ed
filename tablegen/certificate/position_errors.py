"""Errors of the position of an axis whose scanner has a response: held codes behind it, less the target.

The codes of a tick are held, and each step of them drives the resonance. The certificate's other figures are of the
codes of the period. Here all that a period of codes does is followed through the response, once it has settled: of a
second-order response exactly, of a measured one up to its last point. docs/manifest.md says where it is judged.
"""

from collections.abc import Mapping
from math import ceil, pi
from typing import TYPE_CHECKING

import numpy as np
from msgspec import Struct

from tablegen.certificate.line_errors import EmittedPeriod, TickErrors, tick_scaling
from tablegen.certificate.shaped_periods import MOST_TICKS, Passage, largest_and_rms
from tablegen.compensation.dynamics import Measured, Response, SecondOrder
from tablegen.compensation.line import Sweep
from tablegen.numerics.arrays import Floats, Ints
from tablegen.planning.line_plan import LinePlan

if TYPE_CHECKING:
    import numpy.typing as npt

    Complex = npt.NDArray[np.complex128]

_MOST_IMAGES = 64  # of a measured response: multiples of the update rate
_CHUNK = 1 << 14  # harmonics that are worked out together


class ArrivingErrors(Struct, frozen=True):
    """The errors in the middle of each tick in LSB of the drive, and the scaling error of each direction in percent."""

    passage: Passage
    max_error_lsb: float
    rms_error_lsb: float
    scaling: dict[str, float]

    @property
    def worst(self) -> tuple[str, float]:
        """The direction with the larger scaling error, and that error."""
        return max(self.scaling.items(), key=lambda one: one[1])


def position_errors(line: LinePlan, played: EmittedPeriod, directions: Mapping[str, Sweep]) -> ArrivingErrors | None:
    """Compute the position errors of an axis; None where they are not judged.

    That is without a response, at rest, of shaped codes, whose certificate is of the position, of an axis that steps
    once a line, and of periods of more than ``MOST_TICKS`` ticks.
    """
    program = line.program
    if line.drive.response is None or line.drive.resting or program.output.shaping.order:
        return None
    if program.hold > 1 or program.ticks > MOST_TICKS:
        return None
    errors = arriving(line, played)
    ticks = TickErrors(errors)
    scaling = {side: tick_scaling(line, played, side, branch, ticks) for side, branch in directions.items()}
    return ArrivingErrors(Passage.of(line), *largest_and_rms(errors), scaling)


def arriving(line: LinePlan, played: EmittedPeriod) -> Floats:
    """Return the position in the middle of each tick less the one that the float waveform should make.

    Returns
    -------
    Floats
        LSB of the converter, shape (ticks,).
    """
    ticks, response, series = line.program.ticks, line.drive.response, line.series
    assert response is not None
    rate = float(line.rate)
    spectrum = np.fft.rfft(played.errors(np.arange(ticks, dtype=np.int64)))
    for first in range(0, len(spectrum), _CHUNK):
        n = np.arange(first, min(first + _CHUNK, len(spectrum)))
        spectrum[n] *= _held_response(response, rate, ticks, n)
    # Of the waveform's own steps, what is beyond its harmonics' share: images of the update rate.
    n = np.arange(1, series.harmonics + 1)
    real, imaginary = response.inverse(np.asarray(n * rate))
    beyond = _held_response(response, rate, ticks, n) - np.sinc(n / ticks) / (real + 1j * imaginary)
    spectrum[n] += 0.5 * ticks * line.codes_per_unit * (series.a - 1j * series.b) * beyond
    position: Floats = np.fft.irfft(spectrum, ticks)
    return position


def _held_response(response: Response, rate_hz: float, ticks: int, n: Ints) -> "Complex":
    """Compute the position in the middle of ticks of a sequence of held codes, over the codes, of its harmonics n."""
    match response:
        case SecondOrder() as second:
            return _of_second_order(second, rate_hz * ticks, np.exp(2j * pi * n / ticks))
        case Measured() as measured:
            return _of_images(measured, rate_hz, ticks, n)
    raise TypeError(f"{type(response)} is no response of a scanner file")  # pragma: no cover


def _of_second_order(response: SecondOrder, update_hz: float, z: "Complex") -> "Complex":
    """Return the pulse transfer function of hold and response, at the middle of a tick, for z on the unit circle.

    Position and speed over omega, (p, s), go to the code u by the matrix of a free response from (p - u, s).
    """
    late = 0.5 - response.delay_s * update_hz  # of a tick, behind its begin
    whole = np.floor(late)
    step, part = (_free(response, share / update_hz) for share in (1.0, late - whole))
    (a, b), (c, d) = step
    # (z - step) x = (1 - step) (1, 0): state at the begin of a tick, over the code of that tick.
    determinant = z * z - (a + d) * z + (a * d - b * c)
    # A response so slow that it does not move within a tick leaves 0 / 0 at DC, where the position is the code.
    moves = determinant != 0.0
    determinant = np.where(moves, determinant, 1.0)
    position = np.where(moves, ((z - d) * (1.0 - a) - b * c) / determinant, 1.0)
    speed = np.where(moves, (c * (1.0 - a) - (z - a) * c) / determinant, 0.0)
    at_middle = 1.0 + part[0][0] * (position - 1.0) + part[0][1] * speed
    return np.asarray(z**whole * at_middle)


def _free(response: SecondOrder, time_s: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the matrix that takes position and speed over omega of a free response over a time."""
    omega = 2.0 * pi * response.frequency_hz
    damped = 0.5 / response.quality
    root = np.sqrt(complex(damped * damped - 1.0)) * omega * time_s
    decay = -damped * omega * time_s
    # cosh and sinh with the decay inside, since strongly damped ones alone overflow.
    growing, falling = np.exp(decay + root), np.exp(decay - root)
    cosh = 0.5 * (growing + falling)
    sinh = 0.5 * (growing - falling) / root if abs(root) > 1e-6 else np.exp(decay) * (1.0 + root * root / 6.0)
    along, across = omega * time_s * damped * sinh, omega * time_s * sinh
    return (
        (float((cosh + along).real), float(across.real)),
        (float(-across.real), float((cosh - along).real)),
    )


def _of_images(response: Measured, rate_hz: float, ticks: int, n: Ints) -> "Complex":
    """Return the sum over all images of each harmonic at multiples of the update rate, up to the last point."""
    total = np.zeros(len(n), dtype=np.complex128)
    most = min(ceil(response.highest_hz / (rate_hz * ticks)) + 1, _MOST_IMAGES)
    for image in range(-most, most + 1):
        at = n + image * ticks
        known = np.flatnonzero(np.abs(at) * rate_hz <= response.highest_hz)
        if len(known):
            real, imaginary = response.inverse(np.abs(at[known]) * rate_hz)
            passed = 1.0 / (real + 1j * imaginary)
            total[known] += np.sinc(at[known] / ticks) * np.where(at[known] < 0, np.conj(passed), passed)
    return total
