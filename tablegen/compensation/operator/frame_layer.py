"""What was measured of a frame beside the operator: a part of the line and one of the frame, in nm."""

from dataclasses import dataclass

import numpy as np

from tablegen.numerics.arrays import Floats
from tablegen.waveform.series import FourierSeries


@dataclass(frozen=True, eq=False)
class FrameLayer:
    """How much further an axis goes than its operator says, in nm: ``line`` over a line, ``frame`` over a frame."""

    line: FourierSeries
    frame: FourierSeries

    def at(self, lines: int, t: Floats) -> Floats:
        """Return it at the phases ``t`` of each of the lines of a frame, shape (lines, len(t))."""
        phase = (np.arange(lines)[:, None] + t) / lines
        return np.asarray(self.line.value(t) + self.frame.value(phase.ravel()).reshape(phase.shape))

    def times(self, factor: float) -> "FrameLayer":
        """Return a multiple of it."""
        line, frame = (FourierSeries(0.0, factor * one.a, factor * one.b) for one in (self.line, self.frame))
        return FrameLayer(line, frame)

    def plus(self, other: "FrameLayer") -> "FrameLayer":
        """Return the sum of both."""
        return FrameLayer(self.line.plus(other.line), self.frame.plus(other.frame))
