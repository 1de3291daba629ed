"""The drift of a scan at an angle after a change: how far an axis moves on in the first frame, by its operator.

Hysteresis remembers turns (return-point memory), so that two frames of the scan before and two of the new one have all
of its way. Creep and the memory of the bias begin as the scan before has left them after many frames.
"""

import numpy as np
from msgspec import Struct

from tablegen.compensation.operator.bias_memory import late_terms
from tablegen.compensation.operator.in_time import OperatorInTime, Start, late_mode
from tablegen.numerics.arrays import Floats

SAMPLES = 128  # of a line


class DrivenFrame(Struct, frozen=True, eq=False):
    """The drive of an axis over a frame that repeats, of v_max, shape (lines, SAMPLES), and the time of a line in s."""

    u: Floats
    line_s: float

    def from_line(self, line: int) -> "DrivenFrame":
        """Return the same frame, beginning at another line; at its first one if it has fewer."""
        return DrivenFrame(np.roll(self.u, -line, axis=0), self.line_s) if line < len(self.u) else self


def frame_drift_nm(axis: OperatorInTime, before: DrivenFrame, now: DrivenFrame) -> float:
    """Return how far the mean of a line drifts in the first frame after a change, in nm, against settled frames.

    Parameters
    ----------
    axis
        The axis in time.
    before
        The frame that has played, from the line on at which the change comes.
    now
        The frame that plays after it, likewise.
    """
    lines = len(now.u)
    after = _line_means(axis, before, now)
    moved = after[len(before.u) :]
    off = moved - _line_means(axis, now, now)[lines:]
    if axis.operator.bias_memory is not None:
        step = float(np.mean(now.u)) - float(np.mean(before.u))
        share, time_s = axis.operator.bias_memory.late(step)
        whole_nm = share * (float(np.mean(moved[:lines])) - float(np.mean(after[: len(before.u)])))
        for part, tau_s in late_terms(axis.operator.creep, time_s) if share else ():
            off = off - whole_nm * part * np.exp((np.arange(lines + 1.0) + 0.5) * (-now.line_s / tau_s))
    return float(abs(off[lines] - off[0]))


def _line_means(axis: OperatorInTime, before: DrivenFrame, now: DrivenFrame) -> Floats:
    """Return the mean position of each line of a frame before, of a frame now, and of the line after it, in nm.

    Both are as sensitive as at the mean of ``now``. Positions are from v_min on, where the axis has rested.
    """
    first, then = before.u.ravel(), now.u.ravel()
    played = np.concatenate([first, first, then, then[:SAMPLES]])
    y = axis.hysteresis(played, Start.REST, mean=float(np.mean(then)))[len(first) :]
    steps = np.repeat([before.line_s / SAMPLES, now.line_s / SAMPLES], [len(first), len(y) - len(first)])
    time_s = np.cumsum(steps) - steps
    creep = axis.operator.creep
    late = [share * late_mode(time_s, y, tau_s, len(first)).real for share, tau_s in creep.terms()]
    position = creep.direct * y + np.sum(late, axis=0) if late else y
    return np.asarray(position.reshape(-1, SAMPLES).mean(axis=1))
