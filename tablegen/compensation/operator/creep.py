"""Logarithmic creep: a share of the displacement that follows late, the same in every decade of time.

C(f) = 1 + sum_k a / (1 + i f / f_k), with f_k spaced evenly over the decades; what is lost from one decade of frequency
to the next is ``loss_per_decade`` of the displacement.
"""

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from tablegen.numerics.arrays import Floats
from tablegen.numerics.elementary import exp

_TERMS_PER_DECADE = 3
_PERIODS = 10.0  # of a line: terms that are slower only shift it
_LN10 = 2.302585092994046


@dataclass(frozen=True, slots=True)
class LogarithmicCreep:
    """Time constants from ``fastest_s`` to ``slowest_s``; at ``reference_hz`` |C| is taken as 1."""

    loss_per_decade: float
    fastest_s: float
    slowest_s: float
    reference_hz: float

    def down_to(self, rate_hz: float) -> "LogarithmicCreep":
        """The same, with terms as slow as lines of this rate show: creep knows no slowest time."""
        return replace(self, slowest_s=max(self.slowest_s, _PERIODS / rate_hz))

    def response(self, f_hz: Floats) -> tuple[Floats, Floats]:
        """Real and imaginary part of C(f) / |C(reference)|."""
        real, imaginary = self._response(f_hz)
        at_real, at_imaginary = self._response(np.array([self.reference_hz]))
        size = float(np.sqrt(at_real * at_real + at_imaginary * at_imaginary)[0])
        return real / size, imaginary / size

    def _response(self, f_hz: Floats) -> tuple[Floats, Floats]:
        real, imaginary = np.ones_like(f_hz), np.zeros_like(f_hz)
        if not self.loss_per_decade:
            return real, imaginary
        share = self.loss_per_decade / _TERMS_PER_DECADE
        step = exp(_LN10 / _TERMS_PER_DECADE)
        tau_s = self.fastest_s
        while tau_s <= 1.0001 * self.slowest_s:
            x = f_hz * (2.0 * pi * tau_s)
            size = share / (1.0 + x * x)
            real, imaginary = real + size, imaginary - x * size
            tau_s *= step
        return real, imaginary


NO_CREEP = LogarithmicCreep(0.0, 1.0, 1.0, 1.0)
