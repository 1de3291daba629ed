"""The memory of the bias for any drive: a sensitivity that follows the running mean of the drive late.

The running mean is that of each period of the drive, from one lower turn to the next, so that a settled line has none
of it. Where a period takes longer than the memory, or the drive does not turn, it is the drive itself.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tablegen.compensation.operator.bias_memory import BiasMemory
from tablegen.numerics.arrays import Floats

_ROUNDS = 50  # of the search for a state that a record repeats
_EXACT = 1e-14  # of the position, at which it ends
_ITSELF = -1  # number of the period of a sample that counts by itself
_TAIL = 1.5  # periods after the last lower turn, above which the drive rests there


@dataclass(frozen=True, eq=False)
class Periods:
    """The periods of a drive, as far as they are shorter than the memory.

    ``bounds`` has pairs of samples; the second of a pair is before the first one where the drive repeats. ``numbers``
    has the period of each sample, shape (n,), or -1 where it counts by itself.
    """

    time_s: Floats
    bounds: tuple[tuple[int, int], ...]
    numbers: NDArray[np.int64]

    @classmethod
    def of(cls, time_s: Floats, u: Floats, turns: list[int], repeated: int, longest_s: float) -> "Periods":
        """Return the periods.

        Parameters
        ----------
        time_s, u
            Ascending times in s and normalised drives, shapes (n,).
        turns
            The first sample, each turn and the last sample.
        repeated
            The number of samples at the start that the drive has repeated before; 0 if it has rested.
        longest_s
            The length of a period from which on its samples count by themselves.
        """
        count, settled = len(u), repeated == len(u)
        lows = [here for before, here, after in zip(turns, turns[1:], turns[2:], strict=False) if u[here] < u[after]]
        first, last = turns[:2], turns[-2:]
        rises, falls = bool(u[first[1]] > u[0]), bool(u[last[0]] > u[-1])
        if settled and rises and falls:
            lows = [0, *lows, count - 1]
        elif rises and not repeated:
            lows = [0, *lows]
        bounds = list(pairwise(lows))
        numbers = np.full(count, _ITSELF, dtype=np.int64)
        for number, (begin, end) in enumerate(bounds):
            numbers[begin:end] = number
        if lows:
            head, tail = slice(0, lows[0]), slice(lows[-1], count)
            if settled and lows[0] > 0:
                bounds.append((lows[-1], lows[0]))
                numbers[head] = numbers[tail] = len(bounds) - 1
            else:
                if repeated and lows[0] > 0:
                    bounds.append((0, repeated - 1))
                    numbers[head] = len(bounds) - 1
                if len(lows) > 1 and time_s[-1] - time_s[lows[-1]] <= _TAIL * (time_s[lows[-1]] - time_s[lows[-2]]):
                    numbers[tail] = len(lows) - 2
        span_s = float(time_s[-1] - time_s[0])
        for number, (begin, end) in enumerate(bounds):
            if float(time_s[end] - time_s[begin]) + (0.0 if end > begin else span_s) > longest_s:
                numbers[numbers == number] = _ITSELF
        return cls(time_s, tuple(bounds), numbers)

    def mean(self, values: Floats) -> Floats:
        """Return the mean over the period of each sample, of values that are linear between the times; shape (n,)."""
        time_s = self.time_s
        area = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(time_s) * (values[1:] + values[:-1]))])
        means = []
        for begin, end in self.bounds:
            nm_s, s = float(area[end] - area[begin]), float(time_s[end] - time_s[begin])
            if end <= begin:
                nm_s, s = nm_s + float(area[-1]), s + float(time_s[-1] - time_s[0])
            means.append(nm_s / s)
        whole: Floats = np.where(self.numbers == _ITSELF, values, np.array([*means, 0.0])[self.numbers])
        return whole


def remembered(memory: BiasMemory, periods: Periods, means_nm: Floats, first_nm: float | None) -> Floats:
    """Return the share of its settled value that the sensitivity has reached.

    Parameters
    ----------
    memory
        Shares and time constants.
    periods
        The periods of the drive.
    means_nm
        The running mean of the position, from that at v_min on; shape (n,).
    first_nm
        The mean of the position before the record; None for a drive that repeats.

    Returns
    -------
    Floats
        Shape (n,); 1 where the mean has not changed for long.
    """
    parts = list(_stretches(periods.time_s, means_nm))
    state = float(np.mean(means_nm)) if first_nm is None else first_nm
    if first_nm is None:
        for _ in range(_ROUNDS):  # Newton's method: what remains after a record depends on the state linearly
            after, exponent = _after(memory, parts, state)
            step = (after - state) / -float(np.expm1(-exponent))
            state += step
            if abs(step) <= _EXACT * abs(state):
                break
    out = np.empty(len(means_nm))
    for part, mean, since_s in parts:
        share, time_s = memory.late(mean - state)
        apart = (mean - state) * np.exp(-since_s[:-1] / time_s)
        # A share is of steps to a position of its own order: no more than that is late of steps down to nearly 0.
        out[part] = 1.0 - share * np.maximum(apart / mean, -1.0) if mean > 0.0 else 1.0
        state = mean - (mean - state) * float(np.exp(-since_s[-1] / time_s))
    return out


def _after(memory: BiasMemory, parts: list[tuple[slice, float, Floats]], state: float) -> tuple[float, float]:
    """Return the state after all parts, and the exponent by which a difference at the start has decayed."""
    total = 0.0
    for _, mean, since_s in parts:
        _, time_s = memory.late(mean - state)
        exponent = float(since_s[-1]) / time_s
        state -= (state - mean) * -float(np.expm1(-exponent))
        total += exponent
    return state, total


def _stretches(time_s: Floats, means_nm: Floats) -> Iterator[tuple[slice, float, Floats]]:
    """Yield stretches of one mean: their samples, the mean, and times since their first sample up to the next one."""
    edges = [0, *(np.flatnonzero(np.diff(means_nm)) + 1).tolist(), len(means_nm)]
    for begin, end in pairwise(edges):
        after = float(time_s[min(end, len(time_s) - 1)])
        yield slice(begin, end), float(means_nm[begin]), np.append(time_s[begin:end], after) - time_s[begin]
