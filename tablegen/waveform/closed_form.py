"""Fourier coefficients of the compensated line, in closed form for every model and any turn in (0, 1).

Each branch is u(s) = lambda s + xi sin(pi s) + xi_gamma (cos(pi s) - 1) on s in [0, 1], stretched over a share T of
the period; all its coefficients follow from two integrals (derivation: docs/waveform.md)::

    E(y) = int_0^1 exp(-2 pi i y s) ds   = exp(-i pi y) sinc(y)
    M(y) = int_0^1 s exp(-2 pi i y s) ds = exp(-i pi y) (sinc(y) - i j1(pi y)) / 2

with y = n T, sinc(y) = sin(pi y) / (pi y) and j1 the spherical Bessel function. Both are entire in y: n = 0 and
n = 1 / (2 T), where the textbook formulas divide by zero, are points like any other.
"""

import numpy as np

from tablegen.compensation.hysteresis import BranchShape, LineShape
from tablegen.numerics.arrays import Floats
from tablegen.numerics.turns import sinc, sine_and_cosine, spherical_bessel_1
from tablegen.waveform.series import FourierSeries


def fourier_series(shape: LineShape, harmonics: int) -> FourierSeries:
    """The first ``harmonics`` coefficients of a line waveform, w in [0, 1]."""
    n = np.arange(harmonics + 1, dtype=np.float64)
    turn = shape.turn
    forward = _branch(n * turn, shape.forward)
    whole = _plain(n * (1.0 - turn))
    backward = _branch(n * (1.0 - turn), shape.backward)
    # The backward branch is 1 - u(s), later by the turn: a factor exp(-2 pi i n turn).
    falling = whole[0] - backward[0], whole[1] - backward[1]
    s, c = sine_and_cosine(n * turn)
    real = turn * forward[0] + (1.0 - turn) * (falling[0] * c + falling[1] * s)
    imaginary = turn * forward[1] + (1.0 - turn) * (falling[1] * c - falling[0] * s)
    return FourierSeries(float(real[0]), 2.0 * real[1:], -2.0 * imaginary[1:])


def _plain(y: Floats) -> tuple[Floats, Floats]:
    """E(y), real and imaginary part."""
    s, c = sine_and_cosine(0.5 * y)
    height = sinc(y)
    return height * c, -height * s


def _ramp(y: Floats) -> tuple[Floats, Floats]:
    """M(y), real and imaginary part."""
    s, c = sine_and_cosine(0.5 * y)
    even, odd = 0.5 * sinc(y), 0.5 * spherical_bessel_1(y)
    return even * c - odd * s, -even * s - odd * c


def _branch(y: Floats, shape: BranchShape) -> tuple[Floats, Floats]:
    """int_0^1 u(s) exp(-2 pi i y s) ds, real and imaginary part."""
    ramp, plain = _ramp(y), _plain(y)
    below, above = _plain(y - 0.5), _plain(y + 0.5)  # the integrals of exp(+- i pi s) times the kernel
    sine = 0.5 * (below[1] - above[1]), 0.5 * (above[0] - below[0])
    cosine = 0.5 * (below[0] + above[0]), 0.5 * (below[1] + above[1])
    linear, xi, xi_gamma = shape.linear, shape.xi, shape.xi_gamma
    return (
        linear * ramp[0] + xi * sine[0] + xi_gamma * (cosine[0] - plain[0]),
        linear * ramp[1] + xi * sine[1] + xi_gamma * (cosine[1] - plain[1]),
    )
