"""The stability bound of learning, harmonic by harmonic.

Let G be the scanner's true gain over the modelled one at a harmonic, a complex number, 1 for a perfect model. After a
round |1 - gain G| of the error there remains: it shrinks if and only if |G| < 2 cos(arg G) / gain. Derivation:
docs/refine.md.
"""

from dataclasses import dataclass
from itertools import product
from math import acos, degrees, pi

import numpy as np
import numpy.typing as npt

from tablegen.compensation.dynamics import Measured, Response, SecondOrder, capped_inverse
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan

# Assumed errors of the dynamics of a scanner file: frequencies, quality, and for responses gain and phase.
FREQUENCIES = (0.8, 1.0, 1.25)
QUALITIES = (0.5, 1.0, 2.0)
GAINS = (0.8, 1.0, 1.25)
PHASES = (-1.0 / 18.0, 0.0, 1.0 / 18.0)  # periods: 20 degrees
MAX_ERROR_LEFT = 0.9  # share of the error of a learnt harmonic that a round may leave

Complex = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class Bound:
    """The limits within which learning converges.

    ``harmonics`` is the largest number that can be learnt, ``remaining`` the largest share of the error of those in use
    that a round leaves, with dynamics as wrong as above. ``largest_gain`` is the true over the modelled gain without a
    phase error, ``phase_deg`` the phase error at a gain of 1, ``delay_s`` that phase at the highest harmonic in use.
    """

    gain: float
    harmonics: int
    used: int
    remaining: float
    largest_gain: float
    phase_deg: float
    delay_s: float
    dynamics: bool


def remaining_error(gain: float, ratio: Complex) -> Floats:
    """Return the share of an error that remains after a round.

    Parameters
    ----------
    ratio
        True gains over modelled ones, of any shape.

    Returns
    -------
    Shares, of that shape.
    """
    return np.abs(1.0 - gain * ratio)


def bound(line: LinePlan, gain: float, used: int) -> Bound:
    """Compute the bound of one axis at a learning gain, for ``used`` harmonics, or as many as it allows."""
    n = np.arange(1.0, line.target.harmonics + 1.0)
    worst = np.max(remaining_error(gain, plausible_ratios(line, n * float(line.rate))), axis=0)
    beyond = np.flatnonzero(worst > MAX_ERROR_LEFT)
    most = int(beyond[0]) if len(beyond) else line.target.harmonics
    used = min(used, most)
    phase = acos(min(0.5 * gain, 1.0))
    return Bound(
        gain=gain,
        harmonics=most,
        used=used,
        remaining=float(np.max(worst[:used])) if used else float(worst[0]),
        largest_gain=2.0 / gain,
        phase_deg=degrees(phase),
        delay_s=phase / (2.0 * pi * max(used, 1) * float(line.rate)),
        dynamics=line.drive.response is not None,
    )


def plausible_ratios(line: LinePlan, f_hz: Floats) -> Complex:
    """Return true gains over modelled ones for scanners that the file may describe wrongly.

    Without dynamics in the file there is one, whose ratio is 1: nothing is known of others.

    Parameters
    ----------
    f_hz
        Frequencies in Hz, shape (frequencies,).

    Returns
    -------
    Ratios, shape (scanners, frequencies).
    """
    response = line.drive.response
    if response is None:
        return np.ones((1, len(f_hz)), dtype=np.complex128)
    real, imaginary, _ = capped_inverse(response, f_hz, line.drive.max_boost_db)
    played = real + 1j * imaginary
    ratios: list[Complex] = []
    if isinstance(response, SecondOrder):
        for frequency, quality in product(FREQUENCIES, QUALITIES):
            true = SecondOrder(frequency * response.frequency_hz, quality * response.quality, response.delay_s)
            ratios.append(played / _inverse(true, f_hz))
    else:
        top = float(response.f_hz[-1]) if isinstance(response, Measured) else float(np.max(f_hz))
        for frequency, gain, phase in product(FREQUENCIES, GAINS, PHASES):
            true_inverse = _inverse(response, np.minimum(f_hz / frequency, top))
            ratios.append(played / true_inverse * gain * np.exp(2j * pi * phase))
    return np.array(ratios)


def _inverse(response: Response, f_hz: Floats) -> Complex:
    real, imaginary = response.inverse(f_hz)
    gain: Complex = real + 1j * imaginary
    return gain
