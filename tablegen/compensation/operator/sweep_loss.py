"""Hysteresis and creep in a response that was measured with a swept sine, and the dynamics without them.

A swept sine moves the piezo itself: its gain falls with every decade by the loss of creep, and its phase lags, at all
frequencies alike, by the loss angles of creep and of the hysteresis of its stroke. An operator has both of its own.
"""

from math import tau

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from tablegen.compensation.dynamics import Measured
from tablegen.compensation.operator.creep import LogarithmicCreep
from tablegen.numerics.arrays import Floats

_ROUNDING = 2.0**40  # phases are multiples of its inverse, in turns: the last bits of an arc tangent do not matter then


class SweepLoss(Struct, frozen=True):
    """What a measured response contains beside dynamics: a lag of ``loss_turns`` at all frequencies, and ``creep``."""

    loss_turns: float
    creep: LogarithmicCreep | None

    def without(self, response: Measured) -> Measured:
        """Return the dynamics: the response over the creep, and without the lag.

        The gain stays relative to that at the first frequency.
        """
        gain, phase = response.gain, response.phase_turns + self.loss_turns
        if self.creep is not None:
            size, turns = _polar(self.creep, response.f_hz)
            gain, phase = gain * (size[0] / size), phase - turns
        return replace(response, gain=gain, phase_turns=phase)


def _polar(creep: LogarithmicCreep, f_hz: Floats) -> tuple[Floats, Floats]:
    """Return size and phase in turns of the creep at frequencies in Hz, each of their shape."""
    real, imaginary = creep.response(f_hz)
    turns = np.rint(np.arctan2(imaginary, real) / tau * _ROUNDING) / _ROUNDING
    return np.sqrt(real * real + imaginary * imaginary), turns
