"""A real, periodic, band-limited waveform: w(t) = a0 + sum_n a_n cos(2 pi n t) + b_n sin(2 pi n t)."""

from collections.abc import Iterator
from functools import cached_property, lru_cache
from math import tau

import numpy as np
from msgspec import Struct

from tablegen.numerics.arrays import Floats, FloatsLike, freeze, multiples
from tablegen.numerics.turns import sine_and_cosine

_BLOCK = 1 << 12  # times that are worked out together
_TURNED = 16  # harmonics from one whose sine is worked out to the next

_KEPT = 1 << 18  # sines and cosines of one grid that are kept for the next series on it: 4 MB


def _waves(count: int, harmonics: int) -> Iterator[tuple[Floats, Floats]]:
    """Sine and cosine of 2 pi n k / count for k in [0, count), for n = 1..harmonics."""
    s, c = sine_and_cosine(np.arange(count) / count)
    for at in multiples(np.arange(count), count, harmonics):
        yield s.take(at, mode="clip"), c.take(at, mode="clip")


@lru_cache(maxsize=4)  # both axes, in a plan and in its certificate
def _kept_waves(count: int, harmonics: int) -> list[tuple[Floats, Floats]]:
    return list(_waves(count, harmonics))


class FourierSeries(Struct, frozen=True, eq=False, dict=True):
    """Coefficients of one period; ``a[n - 1]`` and ``b[n - 1]`` belong to harmonic n = 1..H. Dimensionless."""

    a0: float
    a: Floats
    b: Floats

    def __post_init__(self) -> None:
        freeze(self.a, self.b)

    @property
    def harmonics(self) -> int:
        """H, the highest harmonic."""
        return len(self.a)

    def value(self, t: FloatsLike, derivative: int = 0) -> Floats:
        """w, or its derivative with respect to t, at times in periods; of the shape of ``t``."""
        return values(t, (self, derivative))[0]

    def on_grid(self, count: int, derivative: int = 0) -> Floats:
        """As ``value`` at k / count for k in [0, count), by one table of sines for all harmonics."""
        total = np.full(count, self.a0 if derivative == 0 else 0.0)
        kept = count * self.harmonics <= _KEPT
        cosines, sines = np.empty(count), np.empty(count)
        waves = (_kept_waves if kept else _waves)(count, self.harmonics)
        for (a, b), (s, c) in zip(self._all_factors(derivative), waves, strict=True):
            np.multiply(c, a, cosines)
            np.multiply(s, b, sines)
            np.add(cosines, sines, cosines)
            np.add(total, cosines, total)
        return total

    def term(self, n: int, derivative: int, s: Floats, c: Floats) -> Floats:
        """Harmonic n, or its derivative, where sine and cosine of 2 pi n t are s and c."""
        a, b = self._factors(n, derivative)
        return a * c + b * s

    def _factors(self, n: int, derivative: int) -> tuple[float, float]:
        """Of the cosine and of the sine of harmonic n in a derivative."""
        return _differentiated(n, float(self.a[n - 1]), float(self.b[n - 1]), derivative)

    def _all_factors(self, derivative: int) -> list[tuple[float, float]]:
        """Those of all harmonics in order."""
        pairs = zip(self.a.tolist(), self.b.tolist(), strict=True)
        return [_differentiated(n, a, b, derivative) for n, (a, b) in enumerate(pairs, 1)]

    def peak_slope(self) -> float:
        """max |w'| per period, on a grid of 32 points per period of the highest harmonic."""
        return self._peak_slope

    @cached_property
    def _peak_slope(self) -> float:
        return float(np.max(np.abs(self.on_grid(32 * self.harmonics, 1))))

    def peak_acceleration(self) -> float:
        """max |w''| per period squared, on a grid of 32 points per period of the highest harmonic."""
        return float(np.max(np.abs(self.on_grid(32 * self.harmonics, 2))))

    def plus(self, other: "FourierSeries") -> "FourierSeries":
        """The sum of both, with the harmonics of the longer one."""
        count = max(self.harmonics, other.harmonics)
        a, b = np.zeros(count), np.zeros(count)
        for one in (self, other):
            a[: one.harmonics] += one.a
            b[: one.harmonics] += one.b
        return FourierSeries(self.a0 + other.a0, a, b)

    def less(self, other: "FourierSeries") -> "FourierSeries":
        """The difference."""
        return self.plus(FourierSeries(-other.a0, -other.a, -other.b))

    def times(self, real: Floats, imaginary: Floats) -> "FourierSeries":
        """The series with harmonic n multiplied by real[n - 1] + i imaginary[n - 1]; the mean stays."""
        return FourierSeries(self.a0, self.a * real + self.b * imaginary, self.b * real - self.a * imaginary)


def _differentiated(n: int, a: float, b: float, derivative: int) -> tuple[float, float]:
    for _ in range(derivative % 4):  # d/dt turns (a, b) into 2 pi n (b, -a)
        a, b = b, -a
    factor = (tau * n) ** derivative
    return factor * a, factor * b


def values(t: FloatsLike, *asked: tuple[FourierSeries, int]) -> tuple[Floats, ...]:
    """Values of several series or of their derivatives at the same times, each of the shape of ``t``.

    The sines are worked out once for all of them: each sixteenth harmonic by itself, and those that follow by turning
    it on, which leaves some 16 units in the last place.
    """
    t = np.asarray(t, dtype=np.float64)
    totals = tuple(np.full(t.shape, series.a0 if derivative == 0 else 0.0) for series, derivative in asked)
    harmonics = max(series.harmonics for series, _ in asked)
    for first in range(0, t.size, _BLOCK):  # a block stays in the cache through all harmonics
        block = t.reshape(-1)[first : first + _BLOCK]
        parts = [total.reshape(-1)[first : first + _BLOCK] for total in totals]
        first_s, first_c = sine_and_cosine(block)
        s, c = first_s, first_c
        for n in range(1, harmonics + 1):
            if n % _TURNED == 0:
                s, c = sine_and_cosine(n * block)
            elif n > 1:
                s, c = s * first_c + c * first_s, c * first_c - s * first_s
            for part, (series, derivative) in zip(parts, asked, strict=True):
                if n <= series.harmonics:
                    part += series.term(n, derivative, s, c)
    return totals
