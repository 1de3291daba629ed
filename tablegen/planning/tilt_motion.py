"""What an output beside x and y follows where these play a table each: a line or a sine in x, a ramp or steps in y."""

from dataclasses import dataclass

import numpy as np

from tablegen.compensation.operator.turned_frame import FrameMotion
from tablegen.device.schedule import Schedule
from tablegen.numerics.arrays import Bools, Floats, Ints
from tablegen.waveform.series import FourierSeries


@dataclass(frozen=True, slots=True, kw_only=True)
class TiltMotion(FrameMotion):
    """The motion of an output beside x and y in a frame of a ``schedule``.

    ``place`` is the predicted position over a line, from 0 to 1, of an x that moves as a sine; the schedule then says
    which ticks are imaged. With ``steps`` y has one level a line, that of the middle of the line.
    """

    schedule: Schedule
    place: FourierSeries | None = None
    steps: bool = False

    def wanted_nm(self, lines: Ints, t: Floats) -> Floats:
        """Return the wanted height in nm at phases ``t`` of lines, of the shape to which both broadcast."""
        phase = (lines + (0.5 + 0.0 * t if self.steps else t)) / self.lines
        return np.asarray(self.fast_nm * (self.fast(t) - 0.5) + self.slow_nm * (self.slow(phase) - 0.5))

    def fast(self, t: Floats) -> Floats:
        """Return x of the line from 0 to 1 at its phases ``t``, of any shape."""
        return FrameMotion.fast(self, t) if self.place is None else self.place.value(t)

    def inside(self, t: Floats) -> Bools:
        """Return which phases ``t`` of a line are imaged, shape of ``t``."""
        if self.place is None:
            return FrameMotion.inside(self, t)
        tick, windows = t * self.schedule.ticks, (self.schedule.forward, self.schedule.backward)
        sides = [(tick >= window.first) & (tick < window.stop) for window in windows]
        return np.asarray(sides[0] | sides[1])

    @property
    def step_room(self) -> float:
        """The part of a line on either side of a step of y that images nothing."""
        ticks = self.schedule.ticks
        imaged = np.flatnonzero(self.inside((np.arange(ticks) + 0.5) / ticks))
        return min(int(imaged[0]), ticks - int(imaged[-1])) / ticks
