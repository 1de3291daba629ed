"""Fourier coefficients of the compensated line, in closed form for every model that has one and any turn in (0, 1).

Each branch is u(s) on s in [0, 1], stretched over a share T of the period; its coefficients follow from its moments
int_0^1 u(s) exp(-2 pi i y s) ds at y = n T, which the model has (derivation: docs/waveform.md).
"""

from typing import Protocol

import numpy as np

from tablegen.numerics.arrays import Floats
from tablegen.numerics.moments import plain_moment
from tablegen.numerics.turns import sine_and_cosine
from tablegen.waveform.series import FourierSeries


class SweepMoments(Protocol):
    """A branch with moments in closed form."""

    def moments(self, y: Floats) -> tuple[Floats, Floats]:
        """Return int_0^1 u(s) exp(-2 pi i y s) ds.

        Parameters
        ----------
        y
            Periods of the kernel in the sweep, shape (n,).

        Returns
        -------
        real, imaginary
            Each of the shape of ``y``.
        """


class TwoSweeps(Protocol):
    """A line of two branches."""

    @property
    def turn(self) -> float:
        """The time at which it turns, in periods."""

    @property
    def forward(self) -> SweepMoments:
        """The branch before the turn."""

    @property
    def backward(self) -> SweepMoments:
        """The branch after the turn, as 1 - u."""


def fourier_series(shape: TwoSweeps, harmonics: int) -> FourierSeries:
    """Return the first ``harmonics`` coefficients of a line waveform, w in [0, 1]."""
    n = np.arange(harmonics + 1, dtype=np.float64)
    turn = shape.turn
    forward = shape.forward.moments(n * turn)
    whole = plain_moment(n * (1.0 - turn))
    backward = shape.backward.moments(n * (1.0 - turn))
    # The backward branch is 1 - u(s), later by the turn: a factor exp(-2 pi i n turn).
    falling = whole[0] - backward[0], whole[1] - backward[1]
    s, c = sine_and_cosine(n * turn)
    real = turn * forward[0] + (1.0 - turn) * (falling[0] * c + falling[1] * s)
    imaginary = turn * forward[1] + (1.0 - turn) * (falling[1] * c - falling[0] * s)
    return FourierSeries(float(real[0]), 2.0 * real[1:], -2.0 * imaginary[1:])
