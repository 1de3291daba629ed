"""Sine and cosine of an angle in turns (1 turn = 2 pi rad).

The reduction to an eighth of a turn is exact, hence sin(1/2) is 0 and cos(1/4) is 0, not 6e-17: the removable
singularities of the closed forms need no special cases. The error is below 2.5 units in the last place.
"""

from math import pi, tau
from typing import TypeVar

import numpy as np

from tablegen.numerics.arrays import Floats, FloatsLike

_Real = TypeVar("_Real", float, Floats)

# Taylor series about 0: at pi/4 the first omitted terms are 4e-20 (sine) and 8e-21 (cosine).
_SINE_TERMS = 9
_COSINE_TERMS = 10
_BLOCK = 1 << 13  # angles that are computed at a time, so that they fit the cache


def _reciprocal_factorials(first: int, terms: int) -> list[float]:
    signed, factorial = [], 1
    for k in range(1, first + 1):
        factorial *= k
    for term in range(terms):
        signed.append((-1) ** term / factorial)
        factorial *= (first + 2 * term + 1) * (first + 2 * term + 2)
    return signed


_SINE = _reciprocal_factorials(1, _SINE_TERMS)
_COSINE = _reciprocal_factorials(0, _COSINE_TERMS)


def _horner(coefficients: list[float], square: _Real) -> _Real:
    value = coefficients[-1] * square
    for coefficient in reversed(coefficients[1:-1]):
        value += coefficient
        value *= square
    value += coefficients[0]
    return value


def sine_and_cosine(turns: FloatsLike) -> tuple[Floats, Floats]:
    """Return sine and cosine of angles in turns.

    Parameters
    ----------
    turns
        Angles in turns (2 pi rad), any shape.

    Returns
    -------
    sine, cosine
        Each of the shape of ``turns``.
    """
    x = np.asarray(turns, dtype=np.float64)
    if x.size <= _BLOCK:
        return _sine_and_cosine(x)
    flat, sines, cosines = x.reshape(-1), np.empty(x.size), np.empty(x.size)
    for first in range(0, x.size, _BLOCK):
        block = slice(first, first + _BLOCK)
        sines[block], cosines[block] = _sine_and_cosine(flat[block])
    return sines.reshape(x.shape), cosines.reshape(x.shape)


def _sine_and_cosine(x: Floats) -> tuple[Floats, Floats]:
    x = x - np.rint(x)
    quadrant = np.rint(4.0 * x)
    angle = (x - 0.25 * quadrant) * tau
    square = angle * angle
    sine = angle * _horner(_SINE, square)
    cosine = _horner(_COSINE, square)
    number = quadrant.astype(np.int64)  # -2..2
    odd = (number & 1).astype(np.bool_)
    sines, cosines = np.where(odd, cosine, sine), np.where(odd, sine, cosine)
    sines *= 1 - (number & 2)  # quadrants 2 and 3 change the sign of the sine, 1 and 2 that of the cosine
    cosines *= 1 - (number + 1 & 2)
    return sines, cosines


def sine_and_cosine_of(turns: float) -> tuple[float, float]:
    """Return (sin(2 pi turns), cos(2 pi turns)) of one number: the bits of ``sine_and_cosine``, but faster."""
    x = turns - round(turns) + 0.0  # no -0, as an array has none
    quadrant = round(4.0 * x)
    angle = (x - 0.25 * quadrant) * tau
    square = angle * angle
    sine, cosine = angle * _horner(_SINE, square), _horner(_COSINE, square)
    if quadrant & 1:
        sine, cosine = cosine, sine
    return sine * (1 - (quadrant & 2)), cosine * (1 - (quadrant + 1 & 2))


def sine(turns: FloatsLike) -> Floats:
    """Return sin(2 pi turns).

    Parameters
    ----------
    turns
        Angles in turns (2 pi rad), any shape.

    Returns
    -------
    Floats
        Shape of ``turns``.
    """
    return sine_and_cosine(turns)[0]


def cosine(turns: FloatsLike) -> Floats:
    """Return cos(2 pi turns).

    Parameters
    ----------
    turns
        Angles in turns (2 pi rad), any shape.

    Returns
    -------
    Floats
        Shape of ``turns``.
    """
    return sine_and_cosine(turns)[1]


def sinc(y: FloatsLike) -> Floats:
    """Return sin(pi y) / (pi y), exactly 1 at y = 0 and exactly 0 at every other whole y.

    Parameters
    ----------
    y
        Real numbers of any shape.

    Returns
    -------
    Floats
        Shape of ``y``.
    """
    x = np.asarray(y, dtype=np.float64)
    safe = np.where(x == 0.0, 1.0, x)
    return np.where(x == 0.0, 1.0, sine(0.5 * safe) / (pi * safe))


def spherical_bessel_1(y: FloatsLike) -> Floats:
    """Return j1(pi y) = (sin(pi y) - pi y cos(pi y)) / (pi y)^2, by its series where the difference would cancel.

    Parameters
    ----------
    y
        Real numbers of any shape.

    Returns
    -------
    Floats
        Shape of ``y``; 0 at y = 0.
    """
    x = np.asarray(y, dtype=np.float64)
    small = np.abs(x) < 0.3
    safe = np.where(small, 1.0, x) * pi
    s, c = sine_and_cosine(np.where(small, 1.0, x) * 0.5)
    square = (np.where(small, x, 0.0) * pi) ** 2
    series, denominator = [], 3.0
    for term in range(8):  # z / 3 (1 - z^2/10 + z^4/280 - ...), 1e-20 left at z = 0.3 pi
        series.append(1.0 / denominator)
        denominator *= -2.0 * (term + 1) * (2 * term + 5)
    return np.where(small, x * pi * _horner(series, square), (s - safe * c) / (safe * safe))
