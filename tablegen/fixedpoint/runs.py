"""A whole period as runs of one code: every tick accounted for, however many millions there are."""

from collections.abc import Iterator

import numpy as np
from msgspec import Struct

from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.phase import PHASE_BITS
from tablegen.fixedpoint.pieces import Pieces, most_levels, pieces_of
from tablegen.fixedpoint.program import Program
from tablegen.numerics.arrays import Ints

_MIN_TICKS_PER_RUN = 4  # average ticks per run from which runs are cheaper than ticks
_MOST_TICKS_PER_CODE = 8  # up to which a search for codes scans all ticks from the first to the last
_CHUNK_TICKS = 1 << 13  # ticks whose codes are searched at a time, so that they fit the cache
_CHUNK_LEVELS = 1 << 13  # codes or samples that are computed at a time, so that they fit the cache


class Runs(Struct, frozen=True, eq=False):
    """Runs of one code: run i plays ``codes[i]`` on the ticks [starts[i], starts[i + 1]), the last up to ``ticks``.

    No run is empty; both arrays have the shape (runs,).
    """

    starts: Ints
    codes: Ints
    ticks: int

    @property
    def lengths(self) -> Ints:
        """The length of each run.

        Returns
        -------
        Ints
            Ticks, shape (runs,).
        """
        if self.by_tick:
            return np.broadcast_to(np.int64(1), (self.ticks,))
        return np.diff(self.starts, append=self.ticks)

    def lengths_of(self, which: slice) -> Ints:
        """Return the lengths of some runs.

        Parameters
        ----------
        which
            Slice of the runs; it begins at a run and may end beyond the last one.

        Returns
        -------
        Ints
            Ticks, shape (n,) for n runs in the slice.
        """
        after = which.stop if which.stop is not None and which.stop < len(self.starts) else None
        return np.diff(self.starts[which], append=self.ticks if after is None else self.starts[after])

    @property
    def by_tick(self) -> bool:
        """True if every run is a single tick."""
        return len(self.starts) == self.ticks

    @property
    def lasts(self) -> Ints:
        """The last tick of each run.

        Returns
        -------
        Ints
            Ticks, shape (runs,).
        """
        return self.starts if self.by_tick else np.append(self.starts[1:], self.ticks) - 1

    def at(self, k: Ints) -> Ints:
        """Return the codes at ticks.

        Parameters
        ----------
        k
            Ticks in [0, ticks), shape (n,).

        Returns
        -------
        Ints
            Codes, shape (n,).
        """
        if self.by_tick:
            return self.codes[k]
        if len(k) <= _CHUNK_TICKS:
            return self._codes(k)
        return np.concatenate([self._codes(k[at : at + _CHUNK_TICKS]) for at in range(0, len(k), _CHUNK_TICKS)])

    def _codes(self, k: Ints) -> Ints:
        low, high = (int(k.min()), int(k.max())) if len(k) else (0, -1)
        if high - low >= _MOST_TICKS_PER_CODE * len(k):
            return self.codes[np.searchsorted(self.starts, k, side="right") - 1]
        # Counting the runs that begin is faster than a search for each tick.
        first, last = np.searchsorted(self.starts, (low, high), side="right")
        begins = np.zeros(high - low + 1, dtype=np.bool_)
        begins[self.starts[first:last] - low] = True
        return self.codes[first - 1 :].take(np.cumsum(begins, dtype=np.int32)[k - low])

    def split_at(self, k: Ints) -> "Runs":
        """Return the same playback with runs that begin at these ticks as well.

        Parameters
        ----------
        k
            Ticks in [0, ticks), ascending and each once, shape (n,).

        Returns
        -------
        Runs
            At most n runs more.
        """
        if self.by_tick:
            return self
        within = np.searchsorted(self.starts, k, side="right") - 1
        inside = self.starts[within] != k
        k, within = k[inside], within[inside]
        return Runs(
            np.insert(self.starts, within + 1, k), np.insert(self.codes, within + 1, self.codes[within]), self.ticks
        )


def runs_of(program: Program) -> Runs:
    """Return the period of a program as runs.

    Raises
    ------
    ValueError
        If the output is shaped, so that there is no period.
    """
    runs = long_runs(program)
    if runs is not None:
        return runs
    starts = np.arange(program.phase.ticks, dtype=np.int64) * program.hold
    return Runs(starts, program.codes(starts), program.ticks)


def long_runs(program: Program) -> Runs | None:
    """Return the runs of a table on whose pieces codes rise or fall one by one; None where ticks are fewer.

    Along a piece the sample is monotonic in the fraction, so that there is one at which each sample, and each code,
    is first reached. A run begins with each segment.

    Raises
    ------
    ValueError
        As ``runs_of``.
    """
    program.require_period()
    if program.hold != 1 or program.mode == "direct":
        return None
    if most_levels(program) * _MIN_TICKS_PER_RUN > program.ticks:
        return None
    starts, played = [], []
    for pieces in pieces_of(program):
        for start, code in _levels(program, pieces):
            starts.append(start)
            played.append(code)
    return Runs(np.concatenate(starts), np.concatenate(played), program.ticks)


def _levels(program: Program, pieces: Pieces) -> Iterator[tuple[Ints, Ints]]:
    """Yield the first ticks and the codes of the runs of some pieces, some at a time."""
    output, samples = program.output, pieces.ends_of_samples()
    codes = output.code(samples)
    # Where a sample is a code or more, each sample is another code, so that samples alone are examined.
    by_sample = abs(output.gain_word) >= 1 << output.gain_q and bool((codes == output.unclamped(samples)).all())
    first, last = samples if by_sample else codes
    changes = np.abs(last - first)
    ends, direction = np.cumsum(changes + 1), np.sign(last - first)
    begins, levels = ends - changes - 1, int(ends[-1])
    behind = -(-pieces.phase_behind * program.ticks >> PHASE_BITS)
    inverse, played = _Inverse(output, np.sign(codes[1] - codes[0]), pieces), (-1, -1)
    for at in range(0, levels, _CHUNK_LEVELS):
        behind_number = min(at + _CHUNK_LEVELS + 1, levels)  # and the first of the next part
        number = np.arange(at, behind_number)
        first_piece, last_piece = np.searchsorted(ends, (at, behind_number - 1), side="right")
        counts = np.diff(ends[first_piece:last_piece], prepend=at, append=behind_number)
        piece = np.repeat(np.arange(first_piece, last_piece + 1), counts)
        order = number - begins[piece]
        level = first[piece] + direction[piece] * order
        sample, code = (level, output.code(level)) if by_sample else (inverse.sample(piece, level), level)
        reached = np.clip(pieces.first_fraction(piece, sample), pieces.begins[piece], pieces.ends[piece] - 1)
        reached = np.where(order == 0, pieces.begins[piece], reached)
        # The first tick whose phase reaches that fraction: ceil(phase ticks / 2^32), below 2^63.
        start = (pieces.phase(piece, reached) * program.ticks + ((1 << PHASE_BITS) - 1)) >> PHASE_BITS
        if at + _CHUNK_LEVELS >= levels:
            start = np.append(start, behind)
        visible = np.flatnonzero(start[1:] > start[:-1])  # of codes that are reached at one tick the last is played
        start, code, segment = start[visible], code[visible], pieces.segment[piece[visible]]
        changed = (np.diff(code, prepend=played[0]) != 0) | (np.diff(segment, prepend=played[1]) != 0)
        if len(code):
            played = int(code[-1]), int(segment[-1])
        yield start[changed], code[changed]


class _Inverse:
    """The inverse of ``Output.unclamped`` in whole numbers: the samples at which codes are first reached.

    A code rises to c where gain sample + offset + 1/2 >= c, and falls to it where that is < c + 1.
    """

    def __init__(self, output: Output, direction: Ints, pieces: Pieces) -> None:
        """``direction`` is that of the codes along each piece, 1 where they rise, shape (n,)."""
        self._gain_q = output.gain_q
        self._gain = abs(output.gain_word) or 1  # without gain no code changes, and the inverse is not used
        self._sign = -1 if output.gain_word < 0 else 1
        self._code_falls = np.where(direction > 0, 0, 1)
        self._bound = output.offset_word + (1 << (output.gain_q - 1)) + self._code_falls
        self._sample_falls = pieces.slope <= 0

    def sample(self, piece: Ints, code: Ints) -> Ints:
        """Return the samples at which these pieces first play these codes.

        Parameters
        ----------
        piece, code
            Indices of pieces and a code for each, both of shape (m,).

        Returns
        -------
        Ints
            Samples, shape (m,).
        """
        product = (((code + self._code_falls[piece]) << self._gain_q) - self._bound[piece]) * self._sign
        least = product + np.where(self._sample_falls[piece], 0, self._gain - 1)
        return np.asarray(least // self._gain)
