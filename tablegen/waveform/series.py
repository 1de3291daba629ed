"""A real, periodic, band-limited waveform: w(t) = a0 + sum_n a_n cos(2 pi n t) + b_n sin(2 pi n t)."""

from collections.abc import Iterator, Sequence
from functools import cached_property, lru_cache
from math import tau
from typing import TypeVar

import numpy as np
from msgspec import Struct

from tablegen.numerics.arrays import Floats, FloatsLike, freeze, multiples
from tablegen.numerics.turns import sine_and_cosine

_Real = TypeVar("_Real", float, Floats)

_BLOCK = 1 << 12  # times that are computed at a time
_ROTATED = 16  # harmonics from one whose sine is computed to the next

_TOGETHER = 16  # series of one grid that are computed at a time
_CACHED = 1 << 17  # cosines of one grid that are cached for the next series on it, and as many sines: 2 MB


def _waves(count: int, harmonics: int) -> Iterator[tuple[Floats, Floats]]:
    """Yield cosine and sine of 2 pi n k / count for k in [0, count / 4], for n = 1..harmonics; ``count`` is even."""
    s, c = sine_and_cosine(np.arange(count) / count)
    for at in multiples(np.arange(count // 4 + 1), count, harmonics):
        yield c.take(at, mode="clip"), s.take(at, mode="clip")


@lru_cache(maxsize=4)  # both axes, in a plan and in its certificate
def _cached_waves(count: int, harmonics: int) -> tuple[Floats, Floats]:
    cosines, sines = (np.empty((harmonics, count // 4 + 1)) for _ in "cs")
    for n, (c, s) in enumerate(_waves(count, harmonics)):
        cosines[n], sines[n] = c, s
    return cosines, sines


def _sums(a0: float, a: Floats, b: Floats, count: int) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the values on a quarter of a grid, k in [0, count / 4]: at k, count - k, count / 2 + k and count / 2 - k.

    Each is the sum of its harmonics in order. At count - k the sines have the other sign, half a period on all odd
    harmonics, so that all four have the same products.
    """
    points = count // 4 + 1
    if len(a) * points <= _CACHED:
        cosines, sines = _cached_waves(count, len(a))
        cosine_terms, sine_terms = cosines * a[:, None], sines * b[:, None]
        terms = cosine_terms + sine_terms, np.subtract(cosine_terms, sine_terms, out=cosine_terms)
        near = [np.add.reduce(part, axis=0, initial=a0) for part in terms]
        for part in terms:
            np.negative(part[::2], out=part[::2])
        far = [np.add.reduce(part, axis=0, initial=a0) for part in terms]
        return near[0], near[1], far[0], far[1]
    sums = np.full((4, points), a0)
    for n, (c, s) in enumerate(_waves(count, len(a)), 1):
        cosine_term, sine_term = a[n - 1] * c, b[n - 1] * s
        here, mirrored = cosine_term + sine_term, cosine_term - sine_term
        sums[0] += here
        sums[1] += mirrored
        if n % 2:
            here, mirrored = -here, -mirrored
        sums[2] += here
        sums[3] += mirrored
    return sums[0], sums[1], sums[2], sums[3]


def _whole(count: int, first: Floats, last: Floats, third: Floats, second: Floats) -> Floats:
    """Return the values on a grid from those of ``_sums``, along the last axis."""
    half, quarter = count // 2, count // 4
    total = np.empty((*first.shape[:-1], count))
    total[..., : quarter + 1] = first
    total[..., half - quarter : half + 1] = second[..., ::-1]
    total[..., half : half + quarter + 1] = third
    total[..., count - quarter :] = last[..., :0:-1]
    return total


class FourierSeries(Struct, frozen=True, eq=False, dict=True):
    """Coefficients of one period; ``a[n - 1]`` and ``b[n - 1]`` belong to harmonic n = 1..H. Dimensionless."""

    a0: float
    a: Floats
    b: Floats

    def __post_init__(self) -> None:
        freeze(self.a, self.b)

    @property
    def harmonics(self) -> int:
        """The highest harmonic H."""
        return len(self.a)

    def value(self, t: FloatsLike, derivative: int = 0) -> Floats:
        """Return w, or its derivative with respect to t.

        Parameters
        ----------
        t
            Times in periods, any shape.
        derivative
            Order of the derivative.

        Returns
        -------
        Floats
            Shape of ``t``.
        """
        return values(t, (self, derivative))[0]

    def on_grid(self, count: int, derivative: int = 0) -> Floats:
        """Return ``value`` at k / count for k in [0, count), by one table of sines.

        Parameters
        ----------
        count
            Points of the period.
        derivative
            Order of the derivative with respect to t in periods.

        Returns
        -------
        Floats
            Shape (count,).
        """
        if count % 2:
            return self.on_grid(2 * count, derivative)[::2].copy()
        a, b = _differentiated(np.arange(1.0, self.harmonics + 1.0), self.a, self.b, derivative)
        return _whole(count, *_sums(self.a0 if derivative == 0 else 0.0, a, b, count))

    def term(self, n: int, derivative: int, s: Floats, c: Floats) -> Floats:
        """Return harmonic n, or its derivative with respect to t.

        Parameters
        ----------
        n
            Harmonic, 1..H.
        derivative
            Order of the derivative.
        s, c
            Sine and cosine of 2 pi n t, of one shape.

        Returns
        -------
        Floats
            Shape of ``s``.
        """
        a, b = self._factors(n, derivative)
        return a * c + b * s

    def _factors(self, n: int, derivative: int) -> tuple[float, float]:
        """Return the factors of the cosine and of the sine of harmonic n in a derivative."""
        return _differentiated(n, float(self.a[n - 1]), float(self.b[n - 1]), derivative)

    def peak_slope(self) -> float:
        """Return max |w'| per period, on a grid of 32 points per period of the highest harmonic."""
        return self._peak_slope

    @cached_property
    def _peak_slope(self) -> float:
        return float(np.max(np.abs(self.on_grid(32 * self.harmonics, 1))))

    def peak_acceleration(self) -> float:
        """Return max |w''| per period squared, on a grid of 32 points per period of the highest harmonic."""
        return float(np.max(np.abs(self.on_grid(32 * self.harmonics, 2))))

    def plus(self, other: "FourierSeries") -> "FourierSeries":
        """Return the sum of two series, with the harmonics of the longer one."""
        count = max(self.harmonics, other.harmonics)
        a, b = np.zeros(count), np.zeros(count)
        for one in (self, other):
            a[: one.harmonics] += one.a
            b[: one.harmonics] += one.b
        return FourierSeries(self.a0 + other.a0, a, b)

    def less(self, other: "FourierSeries") -> "FourierSeries":
        """Return the difference of two series, with the harmonics of the longer one."""
        return self.plus(FourierSeries(-other.a0, -other.a, -other.b))

    def times(self, real: Floats, imaginary: Floats) -> "FourierSeries":
        """Return the series with harmonic n multiplied by real[n - 1] + i imaginary[n - 1]; the mean stays.

        Parameters
        ----------
        real, imaginary
            Both parts of the factors, shape (H,).

        Returns
        -------
        FourierSeries
            Of the same H harmonics.
        """
        return FourierSeries(self.a0, self.a * real + self.b * imaginary, self.b * real - self.a * imaginary)


def on_one_grid(series: Sequence[FourierSeries], count: int) -> Floats:
    """Return ``on_grid`` of several series of as many harmonics, with every bit of it.

    Parameters
    ----------
    series
        At least one.
    count
        Points of the period.

    Returns
    -------
    Floats
        Shape (len(series), count).
    """
    harmonics, points = series[0].harmonics, count // 4 + 1
    if count % 2 or harmonics * points > _CACHED or any(one.a0 for one in series):
        return np.stack([one.on_grid(count) for one in series])
    cosines, sines = _cached_waves(count, harmonics)
    rows = []
    for first in range(0, len(series), _TOGETHER):
        a, b = (np.stack([getattr(one, name) for one in series[first : first + _TOGETHER]], axis=1) for name in "ab")
        cosine_terms, sine_terms = cosines[:, None] * a[:, :, None], sines[:, None] * b[:, :, None]
        terms = cosine_terms + sine_terms, cosine_terms - sine_terms
        near = [np.add.reduce(part, axis=0, initial=0.0) for part in terms]
        for part in terms:
            np.negative(part[::2], out=part[::2])
        far = [np.add.reduce(part, axis=0, initial=0.0) for part in terms]
        rows.append(_whole(count, near[0], near[1], far[0], far[1]))
    return np.concatenate(rows)


def _differentiated(n: _Real, a: _Real, b: _Real, derivative: int) -> tuple[_Real, _Real]:
    for _ in range(derivative % 4):  # d/dt turns (a, b) into 2 pi n (b, -a)
        a, b = b, -a
    rate = factor = tau * n
    for _ in range(derivative - 1):  # not a power, whose last bit is the processor's
        factor = factor * rate
    return (factor * a, factor * b) if derivative else (a, b)


def values(t: FloatsLike, *requests: tuple[FourierSeries, int]) -> tuple[Floats, ...]:
    """Return the values of several series or of their derivatives at the same times, each of the shape of ``t``.

    Each sixteenth harmonic has sines of its own; those that follow are rotated from it, which leaves some 16 units in
    the last place.

    Parameters
    ----------
    t
        Times in periods.
    requests
        Each a series and the order of its derivative.
    """
    t = np.asarray(t, dtype=np.float64)
    totals = tuple(np.full(t.shape, series.a0 if derivative == 0 else 0.0) for series, derivative in requests)
    harmonics = max(series.harmonics for series, _ in requests)
    for first in range(0, t.size, _BLOCK):  # a block stays in the cache through all harmonics
        block = t.reshape(-1)[first : first + _BLOCK]
        parts = [total.reshape(-1)[first : first + _BLOCK] for total in totals]
        first_s, first_c = sine_and_cosine(block)
        s, c = first_s, first_c
        for n in range(1, harmonics + 1):
            if n % _ROTATED == 0:
                s, c = sine_and_cosine(n * block)
            elif n > 1:
                s, c = s * first_c + c * first_s, c * first_c - s * first_s
            for part, (series, derivative) in zip(parts, requests, strict=True):
                if n <= series.harmonics:
                    part += series.term(n, derivative, s, c)
    return totals
