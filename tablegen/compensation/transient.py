"""The drift of a line after a change of offset or of size, line after line."""

import numpy as np
from msgspec import Struct

from tablegen.numerics.arrays import Floats, freeze
from tablegen.numerics.elementary import exp

OFFSET_CHANGE = 0.1  # of v_max: the change of offset that drift is stated for, from the middle's side
SIZE_CHANGE = 0.5  # of the size: the smaller scan before


class CreepTerm(Struct, frozen=True):
    """A term of what comes late: ``nm`` are still to come at the change, ``after_nm`` at the end of the first sweep.

    Either falls by exp(-t / ``tau_s``); the second includes what the memory of hysteresis has added meanwhile.
    """

    nm: float
    after_nm: float
    tau_s: float


class Transient(Struct, frozen=True, eq=False):
    """Creep and bias memory after a change, and the distance of hysteresis from its settled loop in the first sweep.

    ``memory_nm`` is the first sweep less settled ones, at ``memory_s`` after its beginning, both (n,). Creep with time
    constants above ``measured_s`` is extrapolated. ``bias`` is the measured memory of the bias; where
    none was measured, ``unknown_nm`` is how far the position may drift in all if the sensitivity follows late.
    """

    late: tuple[CreepTerm, ...]
    measured_s: float
    memory_s: Floats
    memory_nm: Floats
    bias: tuple[CreepTerm, ...] = ()
    unknown_nm: float = 0.0

    def __post_init__(self) -> None:
        freeze(self.memory_s, self.memory_nm)

    @property
    def most_memory_nm(self) -> float:
        """The largest distance of the first sweep from settled ones."""
        return float(np.max(np.abs(self.memory_nm)))

    def drift_nm(self, line_s: float, first: int, count: int, slower_than_s: float = 0.0) -> float:
        """Return how far the mean position moves from line ``first`` after the change on, over ``count`` lines, in nm.

        With ``slower_than_s`` only terms of creep with longer time constants count.
        """
        off = self.off_nm(line_s, first + count + 1, slower_than_s)
        return float(abs(off[first + count] - off[first]))

    def lines(self, line_s: float, count: int, bound_nm: float, most: int) -> int:
        """Return after how many lines no ``count`` lines drift by more than a bound; at most ``most`` + 1."""
        off = self.off_nm(line_s, most + 1 + count, 0.0)
        beyond = np.flatnonzero(np.abs(off[count:] - off[: most + 1]) > bound_nm)
        return int(beyond[-1]) + 1 if len(beyond) else 0

    def off_nm(self, line_s: float, lines: int, slower_than_s: float) -> Floats:
        """Return how far the mean of each of the first lines is from the settled one.

        Hysteresis and the memory of the bias count only without ``slower_than_s``.
        """
        sweep_s = float(self.memory_s[-1])
        within = min(-int(-sweep_s // line_s), lines)  # lines that begin before the first sweep ends
        off = np.zeros(lines)
        for term in self.late if slower_than_s > 0.0 else (*self.late, *self.bias):
            if term.tau_s > slower_than_s:
                share = line_s / term.tau_s
                of_line = (1.0 - exp(-share)) / share if share > 1e-9 else 1.0
                decay = np.full(lines, exp(-share))
                decay[0] = term.nm
                decay[within : within + 1] = term.after_nm * exp(-(within * line_s - sweep_s) / term.tau_s)
                off[:within] -= of_line * np.multiply.accumulate(decay[:within])
                off[within:] -= of_line * np.multiply.accumulate(decay[within:])
        return off if slower_than_s > 0.0 else off + self._memory(line_s, lines)

    def _memory(self, line_s: float, lines: int) -> Floats:
        """Return the mean over each line of the distance of the first sweep from settled ones."""
        steps = np.diff(self.memory_s)
        whole = np.concatenate([[0.0], np.add.accumulate(0.5 * steps * (self.memory_nm[1:] + self.memory_nm[:-1]))])
        at = np.minimum(np.arange(lines + 1.0) * line_s, self.memory_s[-1])
        left = np.clip(np.searchsorted(self.memory_s, at, side="right") - 1, 0, len(steps) - 1)
        into = at - self.memory_s[left]
        slope = (self.memory_nm[left + 1] - self.memory_nm[left]) / steps[left]
        until = whole[left] + into * (self.memory_nm[left] + 0.5 * slope * into)
        return np.asarray(np.diff(until) / line_s, dtype=np.float64)
