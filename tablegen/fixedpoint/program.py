"""What one axis of a device holds: a period, a table, and an output stage. It plays codes, and nothing else."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tablegen.fixedpoint.interpolation import direct, guard_bits, index_bits_of, interpolate
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.numerics.arrays import Ints, freeze

_CHUNK_TICKS = 1 << 14  # ticks that are worked out together, in the cache


@dataclass(frozen=True, eq=False)
class Program:
    """One axis of a program.

    ``phase`` advances once every ``hold`` ticks: 1, or a line's ticks where the slow axis steps once a line.
    ``words`` are two's complement of ``bits`` bits, int64 of shape (2^P,), or (phase.ticks,) in ``direct`` mode.
    """

    phase: RationalPhase
    hold: int
    mode: Literal["interpolated", "direct"]
    bits: int
    words: Ints
    output: Output

    def __post_init__(self) -> None:
        freeze(self.words)

    @property
    def ticks(self) -> int:
        """Ticks of a period: a line on the fast axis, a frame on the slow one."""
        return self.phase.ticks * self.hold

    @property
    def guard(self) -> int:
        """Bits of a sample below the LSB of a word."""
        return guard_bits(self.bits)

    @property
    def index_bits(self) -> int:
        """Bits of the phase that index the table; 0 in ``direct`` mode, which has no phase."""
        return index_bits_of(len(self.words)) if self.mode == "interpolated" else 0

    def samples(self, k: Ints) -> Ints:
        """Samples at ticks k in [0, ticks), with ``guard`` bits below the word's LSB."""
        advance = k if self.hold == 1 else k // self.hold
        if self.mode == "direct":
            return direct(self.words, advance, self.guard)
        return interpolate(self.words, self.phase.at(advance), self.guard)

    def codes(self, k: Ints) -> Ints:
        """Codes at ticks k in [0, ticks), before the slew guard."""
        if len(k) <= _CHUNK_TICKS:
            return self.output.code(self.samples(k))
        chunks = range(0, len(k), _CHUNK_TICKS)
        return np.concatenate([self.output.code(self.samples(k[first : first + _CHUNK_TICKS])) for first in chunks])
