"""Linear dynamics of the scanner, and their inverse for each harmonic of the scan."""

from math import inf, sqrt
from typing import Protocol

import numpy as np
from msgspec import Struct

from tablegen.base.input_errors import Unphysical
from tablegen.numerics.arrays import Bools, Floats, Ints
from tablegen.numerics.elementary import exp
from tablegen.numerics.turns import sine_and_cosine

_FOLLOWED_TURNS = 0.375  # of the phase between two points, up to which 1 / H is followed


class Response(Protocol):
    """A frequency response, normalised to 1 at 0 Hz."""

    def inverse(self, f_hz: Floats) -> tuple[Floats, Floats]:
        """Return 1 / H(f).

        Parameters
        ----------
        f_hz
            Frequencies in Hz, any shape.

        Returns
        -------
        real, imaginary
            Dimensionless, each of the shape of ``f_hz``.
        """

    @property
    def resonance_hz(self) -> float:
        """The frequency at which the response is largest."""

    @property
    def half_width_hz(self) -> float:
        """Half the width of the resonance."""

    @property
    def highest_hz(self) -> float:
        """The frequency up to which the response is known; ``inverse`` refuses higher ones."""


class SecondOrder(Struct, frozen=True):
    """A resonance H = exp(-i 2 pi f delay) / (1 - r^2 + i r / Q), r = f / frequency."""

    frequency_hz: float
    quality: float
    delay_s: float = 0.0

    def inverse(self, f_hz: Floats) -> tuple[Floats, Floats]:
        """Return 1 / H(f).

        Parameters
        ----------
        f_hz
            Frequencies in Hz, any shape.

        Returns
        -------
        real, imaginary
            Dimensionless, each of the shape of ``f_hz``.
        """
        r = f_hz / self.frequency_hz
        real, imaginary = 1.0 - r * r, r / self.quality
        s, c = sine_and_cosine(f_hz * self.delay_s)
        return real * c - imaginary * s, real * s + imaginary * c

    @property
    def resonance_hz(self) -> float:
        """The undamped resonance."""
        return self.frequency_hz

    @property
    def half_width_hz(self) -> float:
        """Half the width at half the power."""
        return self.frequency_hz / (2.0 * self.quality)

    @property
    def highest_hz(self) -> float:
        """The frequency up to which the response is known: there is no limit."""
        return inf


class Measured(Struct, frozen=True):
    """A response as measured: ascending Hz, gain relative to that at low frequency, phase in turns."""

    f_hz: Floats
    gain: Floats
    phase_turns: Floats

    def inverse(self, f_hz: Floats) -> tuple[Floats, Floats]:
        """Return 1 / H(f), interpolated by cubics between the points.

        1 / H of a mode is a polynomial of the second degree, times a phase that is linear in f by a dead time: cubics
        with the slopes of parabolas through three points follow it, however sharp the resonance is. The phase
        that is linear from the first point to the last is taken out before. Where the rest of it turns by more than
        3/8 between two points, these are too far apart, and gain and phase are linear.

        Below the first point the gain is that of it, and the phase is linear to 0 at 0 Hz, as that of a dead time, or
        to the nearest half turn where the response is inverted.

        Parameters
        ----------
        f_hz
            Frequencies in Hz, any shape.

        Returns
        -------
        real, imaginary
            Dimensionless, each of the shape of ``f_hz``.

        Raises
        ------
        Unphysical
            If a frequency is above the last point.
        """
        f = np.maximum(f_hz, self.f_hz[0])
        if f.size and float(np.max(f)) > self.f_hz[-1]:
            top = float(self.f_hz[-1])
            raise Unphysical(f"the response is measured up to {top:g} Hz; the scan plays up to {float(np.max(f)):g} Hz")
        right = np.clip(np.searchsorted(self.f_hz, f), 1, len(self.f_hz) - 1)
        left = right - 1
        share = (f - self.f_hz[left]) / (self.f_hz[right] - self.f_hz[left])
        gain = self.gain[left] + share * (self.gain[right] - self.gain[left])
        phase = self.phase_turns[left] + share * (self.phase_turns[right] - self.phase_turns[left])
        first = float(self.phase_turns[0])
        at_rest = round(2.0 * first) / 2.0
        below = at_rest + np.minimum(f_hz / self.f_hz[0], 1.0) * (first - at_rest)
        s, c = sine_and_cosine(np.where(f_hz < self.f_hz[0], below, phase))
        late = (float(self.phase_turns[-1]) - first) / float(self.f_hz[-1] - self.f_hz[0])  # turns per Hz
        rest = self.phase_turns - late * (self.f_hz - self.f_hz[0])
        near = (np.abs(np.diff(rest))[left] <= _FOLLOWED_TURNS) & (f_hz >= self.f_hz[0])
        sines, cosines = sine_and_cosine(rest)
        real, imaginary = (
            _cubic(self.f_hz, values, left, share) for values in (cosines / self.gain, -sines / self.gain)
        )
        sine, cosine = sine_and_cosine(late * (f - self.f_hz[0]))
        return (
            np.where(near, real * cosine + imaginary * sine, c / gain),
            np.where(near, imaginary * cosine - real * sine, -s / gain),
        )

    @property
    def resonance_hz(self) -> float:
        """The frequency of the largest gain."""
        return float(self.f_hz[np.argmax(self.gain)])

    @property
    def half_width_hz(self) -> float:
        """Half the range over which the gain is above its maximum / sqrt(2)."""
        high = self.f_hz[self.gain >= float(np.max(self.gain)) / sqrt(2.0)]
        return max(float(high[-1] - high[0]) / 2.0, float(np.min(np.diff(self.f_hz))))

    @property
    def highest_hz(self) -> float:
        """The frequency of the last point."""
        return float(self.f_hz[-1])


def _cubic(x: Floats, y: Floats, left: Ints, share: Floats) -> Floats:
    """Return the cubics through points whose slopes there are those of the parabola through the nearest three.

    Parameters
    ----------
    x, y
        Ascending abscissae and values, shape (points,); two points make a straight line.
    left, share
        Index of the point before each place, and how much of the way to the next one has passed; any shape.
    """
    steps = np.diff(x)
    secants = np.diff(y) / steps
    if len(x) == 2:
        slopes = np.array([secants[0], secants[0]])
    else:
        slopes = np.empty_like(y)
        slopes[1:-1] = (steps[:-1] * secants[1:] + steps[1:] * secants[:-1]) / (steps[:-1] + steps[1:])
        slopes[0] = 2.0 * secants[0] - slopes[1]
        slopes[-1] = 2.0 * secants[-1] - slopes[-2]
    rest = 1.0 - share
    ends = y[left] * (rest * rest * (1.0 + 2.0 * share)) + y[left + 1] * (share * share * (1.0 + 2.0 * rest))
    bend = steps[left] * (share * rest) * (slopes[left] * rest - slopes[left + 1] * share)
    return np.asarray(ends + bend, dtype=np.float64)


def capped_inverse(response: Response, f_hz: Floats, max_boost_db: float) -> tuple[Floats, Floats, Bools]:
    """Return 1 / H at each frequency, with its size limited to the boost and its phase unchanged.

    Parameters
    ----------
    f_hz
        Frequencies in Hz, shape (n,).
    max_boost_db
        The largest size of the inverse, in dB.

    Returns
    -------
    real, imaginary, limited
        Both parts, and True where the limit acts; each (n,).
    """
    real, imaginary = response.inverse(f_hz)
    size = np.sqrt(real * real + imaginary * imaginary)
    ceiling = decibels(max_boost_db)
    limited = size > ceiling
    factor = np.where(limited, ceiling / np.where(limited, size, 1.0), 1.0)
    return real * factor, imaginary * factor, limited


def decibels(value_db: float) -> float:
    """Return the amplitude ratio 10^(dB / 20) of a value in dB, from basic operations."""
    return exp(value_db * 0.11512925464970228)  # ln(10) / 20
