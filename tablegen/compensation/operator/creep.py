"""Logarithmic creep: a share of the displacement that follows late, the same in every decade of time.

C(f) = 1 + sum_k a / (1 + i f / f_k), with f_k spaced evenly over the decades; what is lost from one decade of frequency
to the next is ``loss_per_decade`` of the displacement.
"""

from collections.abc import Iterator
from math import pi

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from tablegen.numerics.arrays import Floats
from tablegen.numerics.elementary import exp

SEVERAL_RATES = 2.0  # ratio of the highest rate to the lowest, from which sizes determine creep
_TERMS_PER_DECADE = 3
_PERIODS = 10.0  # of a line: terms that are slower only shift it
_LN10 = 2.302585092994046


class LogarithmicCreep(Struct, frozen=True):
    """Creep with time constants from ``fastest_s`` to ``slowest_s``; |C| is 1 at ``reference_hz``."""

    loss_per_decade: float
    fastest_s: float
    slowest_s: float
    reference_hz: float

    def down_to(self, rate_hz: float) -> "LogarithmicCreep":
        """Return the creep with terms as slow as lines of this rate show: creep has no slowest time constant."""
        return replace(self, slowest_s=max(self.slowest_s, _PERIODS / rate_hz))

    def response(self, f_hz: Floats) -> tuple[Floats, Floats]:
        """Return C(f) / |C(reference)|.

        Parameters
        ----------
        f_hz
            Frequencies in Hz, shape (n,).

        Returns
        -------
        real, imaginary
            Dimensionless, each of shape (n,).
        """
        real, imaginary = self._response(f_hz)
        at_real, at_imaginary = self._response(np.array([self.reference_hz]))
        size = float(np.sqrt(at_real * at_real + at_imaginary * at_imaginary)[0])
        return real / size, imaginary / size

    def terms(self) -> tuple[tuple[float, float], ...]:
        """Return share and time constant in s of every term, where |C| is 1 at the reference."""
        real, imaginary = self._response(np.array([self.reference_hz]))
        size = float(np.sqrt(real * real + imaginary * imaginary)[0])
        return tuple((share / size, tau_s) for share, tau_s in self._terms())

    @property
    def direct(self) -> float:
        """The share of the displacement that follows at once, where |C| is 1 at the reference."""
        real, imaginary = self._response(np.array([self.reference_hz]))
        return 1.0 / float(np.sqrt(real * real + imaginary * imaginary)[0])

    def _response(self, f_hz: Floats) -> tuple[Floats, Floats]:
        real, imaginary = np.ones_like(f_hz), np.zeros_like(f_hz)
        for share, tau_s in self._terms():
            x = f_hz * (2.0 * pi * tau_s)
            size = share / (1.0 + x * x)
            real, imaginary = real + size, imaginary - x * size
        return real, imaginary

    def _terms(self) -> Iterator[tuple[float, float]]:
        step, tau_s = exp(_LN10 / _TERMS_PER_DECADE), self.fastest_s
        while self.loss_per_decade and tau_s <= 1.0001 * self.slowest_s:
            yield self.loss_per_decade / _TERMS_PER_DECADE, tau_s
            tau_s *= step


NO_CREEP = LogarithmicCreep(0.0, 1.0, 1.0, 1.0)
