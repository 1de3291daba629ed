"""Two integrals over the unit interval, from which Fourier coefficients of lines and sines follow in closed form.

E(y) = int_0^1 exp(-2 pi i y s) ds and M(y) = int_0^1 s exp(-2 pi i y s) ds; both are entire in y, so that no y is
special. Derivation: docs/waveform.md.
"""

from tablegen.numerics.arrays import Floats
from tablegen.numerics.turns import sinc, sine_and_cosine, spherical_bessel_1


def plain_moment(y: Floats) -> tuple[Floats, Floats]:
    """Return E(y).

    Parameters
    ----------
    y
        Real numbers of any shape.

    Returns
    -------
    real, imaginary
        Each of the shape of ``y``.
    """
    s, c = sine_and_cosine(0.5 * y)
    height = sinc(y)
    return height * c, -height * s


def ramp_moment(y: Floats) -> tuple[Floats, Floats]:
    """Return M(y).

    Parameters
    ----------
    y
        Real numbers of any shape.

    Returns
    -------
    real, imaginary
        Each of the shape of ``y``.
    """
    s, c = sine_and_cosine(0.5 * y)
    even, odd = 0.5 * sinc(y), 0.5 * spherical_bessel_1(y)
    return even * c - odd * s, -even * s - odd * c
