"""Fast evaluation of a waveform at any tick of a period of any length, for the certificate, plots and comparisons.

Nothing that is emitted comes from the transform, whose last bits differ between processors: what decides a table takes
``slow_grid`` in its place.
"""

from collections.abc import Callable
from math import factorial, tau

import numpy as np

from tablegen.numerics.arrays import Complexes, Floats, Ints
from tablegen.waveform.series import FourierSeries

_TAYLOR_ORDER = 6
# Half a block of the highest harmonic is then pi/64 of angle, and its seventh power over 7! is 1e-13.
_BLOCKS_PER_HARMONIC = 64
_CHUNK_TICKS = 1 << 14  # ticks that are computed at a time, so that they fit the cache

# Half a block of the highest harmonic is then pi/16 of angle: its eleventh power over 11! is 4e-16.
_LONG_ORDER, _LONG_BLOCKS_PER_HARMONIC = 10, 16
_MOST_DERIVATIVES = 2


def _spectrum(series: FourierSeries) -> Complexes:
    return np.concatenate([[series.a0], 0.5 * (series.a - 1j * series.b)])


Grid = Callable[[FourierSeries, int, int], Floats]


def on_grid(series: FourierSeries, count: int, derivative: int = 0) -> Floats:
    """Return w(k / count), or a derivative of it, for k in [0, count), by a transform.

    Parameters
    ----------
    count
        Points of the period, above twice the highest harmonic.
    derivative
        Order of the derivative with respect to t in periods.

    Returns
    -------
    Floats
        Shape (count,).
    """
    spectrum = _spectrum(series)
    if derivative:
        spectrum = spectrum * (1j * tau * np.arange(series.harmonics + 1)) ** derivative
    samples: Floats = np.fft.irfft(spectrum, count) * count
    return samples


def slow_grid(series: FourierSeries, count: int, derivative: int = 0) -> Floats:
    """Return ``on_grid`` from sums in a fixed order: the same bits on every machine.

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
    return series.on_grid(count, derivative)


class Expansion:
    """Evaluator of w and its first two derivatives at any times, to some units in the last place.

    Taylor series about the centres of blocks, as in ``Sampler``, but to the precision of the numbers: the cost of a
    time does not depend on the harmonics.
    """

    def __init__(self, series: FourierSeries) -> None:
        self._blocks = blocks = 1 << (_LONG_BLOCKS_PER_HARMONIC * series.harmonics - 1).bit_length()
        spectrum, rate = _spectrum(series), 1j * tau * np.arange(series.harmonics + 1)
        orders = range(_LONG_ORDER + _MOST_DERIVATIVES + 1)
        spectra = np.empty((len(orders), len(rate)), dtype=np.complex128)
        for m in orders:
            np.multiply(spectrum, blocks / factorial(m), out=spectra[m])
            spectrum = spectrum * rate
        self._terms: list[Floats] = list(np.fft.irfft(spectra, blocks))

    def at(self, t: Floats, *derivatives: int) -> list[Floats]:
        """Return w or derivatives of it.

        Parameters
        ----------
        t
            Times in periods, any shape.
        derivatives
            Orders, 0 for w itself, up to 2.

        Returns
        -------
        list of Floats
            One of each order, of the shape of ``t``.
        """
        nearest = np.rint(t * self._blocks)
        h = t - nearest / self._blocks
        block = nearest.astype(np.int64) & (self._blocks - 1)
        near = [term.take(block, mode="clip") for term in self._terms[: _LONG_ORDER + max(derivatives) + 1]]
        return [_derivative(near, h, order) for order in derivatives]


def _derivative(near: list[Floats], h: Floats, order: int) -> Floats:
    """Return the derivative of a polynomial in h, without its highest terms, by Horner's rule."""
    total = np.zeros_like(h)
    for m in reversed(range(order, order + _LONG_ORDER + 1)):
        total *= h
        total += near[m] * (factorial(m) // factorial(m - order))
    return total


class Sampler:
    """Evaluator of w(k / count) for any k in [0, count); error below 1e-12.

    Long periods are expanded into Taylor series about the centres of blocks: a few multiplications a tick, however
    many harmonics there are.
    """

    def __init__(self, series: FourierSeries, count: int, grid: Grid = on_grid) -> None:
        self._count = count
        blocks = 1 << (_BLOCKS_PER_HARMONIC * series.harmonics - 1).bit_length()
        if count <= 2 * blocks:
            self._blocks = 0  # few enough to hold them all
            self._samples = grid(series, count, 0)
            return
        self._blocks = blocks
        self._terms = [grid(series, blocks, m) / factorial(m) for m in range(_TAYLOR_ORDER + 1)]

    def at(self, k: Ints) -> Floats:
        """Return w(k / count).

        Parameters
        ----------
        k
            Ticks in [0, count), shape (n,).

        Returns
        -------
        Floats
            Shape (n,).
        """
        if not self._blocks:
            return self._samples[k]
        if len(k) <= _CHUNK_TICKS:
            return self._expanded(k)
        chunks = range(0, len(k), _CHUNK_TICKS)
        return np.concatenate([self._expanded(k[first : first + _CHUNK_TICKS]) for first in chunks])

    def _expanded(self, k: Ints) -> Floats:
        block = (k * self._blocks + self._count // 2) // self._count
        h = (k * self._blocks - block * self._count) * (1.0 / (self._count * float(self._blocks)))
        block = block & (self._blocks - 1)
        total: Floats = self._terms[-1].take(block, mode="clip")  # clip looks for no index that is outside
        for term in reversed(self._terms[:-1]):
            total *= h
            total += term.take(block, mode="clip")
        return total
