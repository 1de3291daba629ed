"""One period of a drive on a settled loop, then creep and dynamics: for figures and images, by fast transforms."""

import numpy as np

from tablegen.compensation.dynamics import Response
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.compensation.operator.loop import Loop
from tablegen.numerics.arrays import Floats


def settled(loop: Loop, u: Floats, rate_hz: float, creep: LogarithmicCreep, response: Response | None) -> Floats:
    """Return the position in nm at the times of ``u``, after creep and dynamics.

    Creep and ``response`` act on all harmonics of the position; above the last frequency at which a response was
    measured it acts as there.

    Parameters
    ----------
    u
        Normalised drives of one period, (n,), that rise once and fall once between the loop's ends.
    """
    bottom, top, count = int(np.argmin(u)), int(np.argmax(u)), len(u)
    rising = (np.arange(count) - bottom) % count < (top - bottom) % count
    place = np.where(rising, loop.position(u, True), loop.position(u, False))
    n = np.arange(1, (count - 1) // 2 + 1)
    f_hz = n.astype(np.float64) * rate_hz
    real, imaginary = creep.response(f_hz)
    linear = real + 1j * imaginary
    if response is not None:
        real, imaginary = response.inverse(np.minimum(f_hz, response.highest_hz))
        linear = linear / (real + 1j * imaginary)
    spectrum = np.fft.rfft(place)
    spectrum[n] *= linear
    position: Floats = loop.extent_nm * np.fft.irfft(spectrum, count)
    return position
