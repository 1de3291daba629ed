"""The words of the cubic spline that is nearest to a waveform, by its harmonics."""

import numpy as np

from tablegen.numerics.arrays import Floats
from tablegen.numerics.turns import sinc, sine_and_cosine

# What two cubic B-splines 0, 1, 2 and 3 knots apart have in common, times 5040: the B-spline of degree 7 at its knots.
_OVERLAP = (2416.0, 1191.0, 120.0, 1.0)


def spline_factors(harmonics: int, length: int) -> tuple[Floats, Floats]:
    """Return factors of harmonics 1..``harmonics`` of a waveform after which its values at k / length are spline words.

    The spline of these ``length`` words is the one nearest to the waveform in least squares; the harmonics are
    below half of them. In closed form, since the normal equations of a periodic spline are circulant: sinc^4(n /
    length) over the spectrum of the overlaps of B-splines. Word k is the coefficient of the B-spline centred on
    (k - 1) / length, hence the rotation of the phase.

    Returns
    -------
    real, imaginary
        Both parts of the factors, shape (harmonics,).
    """
    share = np.arange(1, harmonics + 1) / length
    overlap = np.full(harmonics, _OVERLAP[0])
    for knots, value in enumerate(_OVERLAP[1:], 1):
        overlap += 2.0 * value * sine_and_cosine(knots * share)[1]
    wave = sinc(share)
    square = wave * wave
    size = 5040.0 * square * square / overlap
    s, c = sine_and_cosine(share)
    return size * c, -(size * s)
