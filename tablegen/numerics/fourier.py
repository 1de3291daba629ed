"""The discrete Fourier transform from basic operations in a fixed order: the same bits on every machine.

NumPy's transform differs in the last bits between builds of it, and a coefficient of an emitted word must not.
"""

from functools import lru_cache

import numpy as np

from tablegen.numerics.arrays import Floats
from tablegen.numerics.turns import sine_and_cosine


def filtered(values: Floats, real: Floats, imaginary: Floats) -> Floats:
    """Return one period of a real signal with harmonic n multiplied by real[n - 1] + i imaginary[n - 1].

    The mean and the component at half the sampling rate stay.

    Parameters
    ----------
    values
        One period, shape (count,); count is a power of 2, at least 4.
    real, imaginary
        Both parts of the factors, shape (count / 2 - 1,).

    Returns
    -------
    Floats
        Shape (count,).

    Raises
    ------
    ValueError
        If the count is no power of 2, or the factors have another length.
    """
    count = len(values)
    if count < 4 or count & (count - 1) or len(real) != count // 2 - 1 or len(imaginary) != len(real):
        raise ValueError(f"{count} values and {len(real)} factors; a power of 2 and half of it less 1 are needed")
    a, b = _transformed(values, np.zeros(count))
    n = np.arange(1, count // 2)
    a_n, b_n = a[n] * real - b[n] * imaginary, a[n] * imaginary + b[n] * real
    a[n], b[n], a[count - n], b[count - n] = a_n, b_n, a_n, -b_n
    # The inverse is the transform of the conjugate; the result is real.
    out, _ = _transformed(a, -b)
    return out / count


def _transformed(real: Floats, imaginary: Floats) -> tuple[Floats, Floats]:
    """Return sum_k z_k exp(-2 pi i k n / count) by Stockham's algorithm of radix 2; both parts, shape (count,)."""
    count = len(real)
    parts = real, imaginary
    for sine, cosine in _twiddles(count):
        half, width = len(sine), count // (2 * len(sine))
        (a_re, b_re), (a_im, b_im) = (part.reshape(2, half, width) for part in parts)
        out_re, out_im = np.empty((half, 2, width)), np.empty((half, 2, width))
        by_re, by_im = a_re - b_re, a_im - b_im
        out_re[:, 0], out_im[:, 0] = a_re + b_re, a_im + b_im
        out_re[:, 1] = by_re * cosine[:, None] + by_im * sine[:, None]
        out_im[:, 1] = by_im * cosine[:, None] - by_re * sine[:, None]
        parts = out_re.reshape(count), out_im.reshape(count)
    return parts


@lru_cache(maxsize=8)
def _twiddles(count: int) -> list[tuple[Floats, Floats]]:
    """Return sine and cosine of each stage, of 1/2, 1/4, ... of the count."""
    stages, half = [], count // 2
    while half:
        stages.append(sine_and_cosine(np.arange(half) / (2 * half)))
        half //= 2
    return stages
