"""A whole period as runs of one code: every tick accounted for, however many millions there are."""

import numpy as np
from msgspec import Struct

from tablegen.fixedpoint.interpolation import FRACTION_BITS, between, index_bits_of
from tablegen.fixedpoint.phase import PHASE_BITS
from tablegen.fixedpoint.program import Program
from tablegen.numerics.arrays import Ints

_MIN_TICKS_PER_RUN = 4  # average ticks per run from which runs are cheaper than ticks
_CHUNK_LEVELS = 1 << 13  # codes or samples that are worked out together, in the cache


class Runs(Struct, frozen=True, eq=False):
    """Run i plays ``codes[i]`` on the ticks [starts[i], starts[i + 1]), the last up to ``ticks``; none is empty."""

    starts: Ints
    codes: Ints
    ticks: int

    @property
    def lengths(self) -> Ints:
        """Ticks of each run."""
        if self.by_tick:
            return np.broadcast_to(np.int64(1), (self.ticks,))
        return np.diff(self.starts, append=self.ticks)

    def lengths_of(self, which: slice) -> Ints:
        """Ticks of some runs; ``which`` begins at a run and may end beyond the last one."""
        after = which.stop if which.stop is not None and which.stop < len(self.starts) else None
        return np.diff(self.starts[which], append=self.ticks if after is None else self.starts[after])

    @property
    def by_tick(self) -> bool:
        """Whether every run is a single tick."""
        return len(self.starts) == self.ticks

    @property
    def lasts(self) -> Ints:
        """The last tick of each run."""
        return self.starts if self.by_tick else np.append(self.starts[1:], self.ticks) - 1

    def at(self, k: Ints) -> Ints:
        """The codes at ticks k."""
        if self.by_tick:
            return self.codes[k]
        return self.codes[np.searchsorted(self.starts, k, side="right") - 1]

    def split_at(self, k: Ints) -> "Runs":
        """The same playback with runs that begin at ticks k as well, ascending and each once."""
        if self.by_tick:
            return self
        within = np.searchsorted(self.starts, k, side="right") - 1
        inside = self.starts[within] != k
        k, within = k[inside], within[inside]
        return Runs(
            np.insert(self.starts, within + 1, k), np.insert(self.codes, within + 1, self.codes[within]), self.ticks
        )


def runs_of(program: Program) -> Runs:
    """The period of a program as runs. Raises ``ValueError`` for one that is shaped, which has no period."""
    program.require_period()
    ticks = program.ticks
    if program.hold == 1 and program.mode == "interpolated":
        runs = _between_words(program)
        if runs is not None:
            return runs
    starts = np.arange(program.phase.ticks, dtype=np.int64) * program.hold
    return Runs(starts, program.codes(starts), ticks)


def _between_words(program: Program) -> Runs | None:
    """Runs between the words of a table, where codes rise or fall one by one; None where ticks are fewer.

    Along a segment the sample is monotonic in the fraction, so that there is one at which each sample, and each code,
    is first reached.
    """
    words, guard, output = program.words, program.guard, program.output
    ends_of = np.array([[0], [(1 << FRACTION_BITS) - 1]])
    samples = between(words, np.roll(words, -1), ends_of, guard)
    codes = output.code(samples)
    if (int(np.abs(codes[1] - codes[0]).sum()) + len(words)) * _MIN_TICKS_PER_RUN > program.ticks:
        return None

    # Where a sample is a code or more each is another code, so that samples are all there is to look at.
    by_sample = abs(output.gain_word) >= 1 << output.gain_q and bool((codes == output.unclamped(samples)).all())
    first, last = samples if by_sample else codes
    changes = np.abs(last - first)
    ends, direction = np.cumsum(changes + 1), np.sign(last - first)
    begins, levels = ends - changes - 1, int(ends[-1])
    segments, index_bits = _Segments(program, direction), index_bits_of(len(words))
    starts, played = [], []
    for at in range(0, levels, _CHUNK_LEVELS):
        number = np.arange(at, min(at + _CHUNK_LEVELS + 1, levels))  # and the first of the next part
        segment = np.searchsorted(ends, number, side="right")
        order = number - begins[segment]
        level = first[segment] + direction[segment] * order
        sample, code = (level, output.code(level)) if by_sample else (segments.sample(segment, level), level)
        reached = np.clip(segments.first_fraction(segment, sample), 0, (1 << FRACTION_BITS) - 1)
        reached[order == 0] = 0
        # The first tick whose phase reaches that fraction: ceil(phase ticks / 2^32), below 2^63.
        phase = ((segment << FRACTION_BITS) | reached) << (PHASE_BITS - FRACTION_BITS - index_bits)
        start = (phase * program.ticks + ((1 << PHASE_BITS) - 1)) >> PHASE_BITS
        if at + _CHUNK_LEVELS >= levels:
            start = np.append(start, program.ticks)
        taken = start[1:] > start[:-1]  # of codes that are reached at one tick the last is played
        starts.append(start[:-1][taken])
        played.append(code[: len(taken)][taken])
    return Runs(np.concatenate(starts), np.concatenate(played), program.ticks)


class _Segments:
    """The segments of a table, each from a word to the one after it: where codes and samples are first reached.

    ``between`` and ``Output.unclamped`` solved for the fraction, in whole numbers: a code rises to c where
    gain sample + offset + 1/2 >= c, falls to it where that is < c + 1; the sample rises to S, or falls to it, alike.
    """

    def __init__(self, program: Program, direction: Ints) -> None:
        """``direction`` is that of the codes along each segment, 1 where they rise, shape (words,)."""
        output, words = program.output, program.words
        self._gain_q = output.gain_q
        self._gain = abs(output.gain_word) or 1  # without gain no code changes, and nothing of this is used
        self._sign = -1 if output.gain_word < 0 else 1
        self._code_falls = np.where(direction > 0, 0, 1)
        self._bound = output.offset_word + (1 << (output.gain_q - 1)) + self._code_falls
        rise = np.roll(words, -1) - words
        self._falls = np.where(rise > 0, 0, 1)
        self._rise = np.where(rise == 0, 1, rise)
        self._shift = FRACTION_BITS - program.guard
        self._level = (words << FRACTION_BITS) + (1 << (self._shift - 1)) + self._falls

    def sample(self, segment: Ints, code: Ints) -> Ints:
        """The samples at which these segments first play these codes, both of shape (n,)."""
        product = (((code + self._code_falls[segment]) << self._gain_q) - self._bound[segment]) * self._sign
        least = product + np.where(self._falls[segment], 0, self._gain - 1)
        return np.asarray(least // self._gain)

    def first_fraction(self, segment: Ints, sample: Ints) -> Ints:
        """The least fractions at which these segments reach these samples, both of shape (n,)."""
        distance = ((sample + self._falls[segment]) << self._shift) - self._level[segment]
        return np.asarray(-(-distance // self._rise[segment]))
