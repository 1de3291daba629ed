"""A whole period as runs of one code: every tick accounted for, however many millions there are."""

import numpy as np
from msgspec import Struct

from tablegen.fixedpoint.interpolation import FRACTION_BITS, between, index_bits_of
from tablegen.fixedpoint.phase import PHASE_BITS
from tablegen.fixedpoint.program import Program
from tablegen.numerics.arrays import Ints, merged

_MIN_TICKS_PER_RUN = 4  # average ticks per run from which runs are cheaper than ticks


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
        """The same playback with runs that begin at ascending ticks k as well."""
        if self.by_tick:
            return self
        starts = merged(self.starts, k)
        return Runs(starts, self.at(starts), self.ticks)


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

    Along a segment the code is monotonic in the fraction, so that there is one at which each code is first reached.
    """
    words, guard = program.words, program.guard
    here, there = words, np.roll(words, -1)
    last = np.full_like(words, (1 << FRACTION_BITS) - 1)
    first_code = program.output.code(between(here, there, np.zeros_like(words), guard))
    last_code = program.output.code(between(here, there, last, guard))
    changes = np.abs(last_code - first_code)
    if (int(changes.sum()) + len(words)) * _MIN_TICKS_PER_RUN > program.ticks:
        return None

    segment = np.repeat(np.arange(len(words)), changes + 1)
    order = np.arange(len(segment)) - np.repeat(np.cumsum(changes + 1) - (changes + 1), changes + 1)
    direction = np.sign(last_code - first_code)[segment]
    codes = first_code[segment] + direction * order
    reached = _first_fraction(program, here[segment], there[segment], codes, direction)
    reached = np.where(order == 0, 0, np.clip(reached, 0, last[segment]))

    # The first tick whose phase reaches that fraction: ceil(phase ticks / 2^32), below 2^63.
    index_bits = index_bits_of(len(words))
    phase = ((segment << FRACTION_BITS) | reached) << (PHASE_BITS - FRACTION_BITS - index_bits)
    starts = (phase * program.ticks + ((1 << PHASE_BITS) - 1)) >> PHASE_BITS
    taken = np.append(np.diff(starts) > 0, starts[-1] < program.ticks)
    return Runs(starts[taken], codes[taken], program.ticks)


def _first_fraction(program: Program, here: Ints, there: Ints, codes: Ints, direction: Ints) -> Ints:
    """The least fraction at which a segment from word to word plays a code, on its way up (direction 1) or down (-1).

    ``between`` and ``Output.unclamped`` solved for the fraction, in whole numbers: a code rises to c where
    gain sample + offset + 1/2 >= c, falls to it where that is < c + 1; the sample rises to S, or falls to it, alike.
    """
    output, guard = program.output, program.guard
    shift = FRACTION_BITS - guard
    half = 1 << (output.gain_q - 1)
    rising = direction > 0
    product = ((codes + np.where(rising, 0, 1)) << output.gain_q) - output.offset_word - half - np.where(rising, 0, 1)
    rise = there - here
    up = rise > 0
    gain = np.int64(output.gain_word or 1)  # without gain no code changes, and nothing of this is used
    sample = np.where(up, -(-product // gain), product // gain + 1) - (here << guard)
    return np.asarray(-(-((sample << shift) - (1 << (shift - 1)) - np.where(up, 0, 1)) // np.where(rise == 0, 1, rise)))
