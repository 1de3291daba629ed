"""Half-sample compensation of the converter's zero-order hold, for each harmonic of the scan.

A code is held from its tick to the next. Of samples w(k / N) the piezo gets harmonic n times
``exp(-i pi n / N) sinc(n / N)``: half a tick late, and a little smaller. docs/waveform.md has the convention of time.
"""

from math import pi

import numpy as np

from tablegen.numerics.arrays import Floats
from tablegen.numerics.turns import sine_and_cosine


def hold_inverse(harmonics: int, advances: int, steps: bool) -> tuple[Floats, Floats]:
    """Return the inverse of the hold for harmonics 1..``harmonics``, with ``advances`` codes a period.

    An axis that ``steps`` once a line is imaged at its codes, and not in between: only the phase is compensated. The
    gain is below pi / 2 (3.9 dB), since ``harmonics`` stay below half of ``advances``.

    Returns
    -------
    real, imaginary
        Both parts of the factors, shape (harmonics,).
    """
    share = np.arange(1, harmonics + 1) / advances
    s, c = sine_and_cosine(0.5 * share)
    if steps:
        return c, s
    size = s / (pi * share)  # sinc of it, which is not 0
    return c / size, s / size
