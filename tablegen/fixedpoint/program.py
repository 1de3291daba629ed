"""The program of one axis of a device: a period, a table, and an output stage, which together play codes."""

from typing import Literal

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from tablegen.config.schema import MAXIMUM_SPLINE_BITS
from tablegen.fixedpoint.interpolation import direct, guard_bits, index_bits_of, interpolate
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.shaping import OFF, Remainders
from tablegen.fixedpoint.spline import SPLINE_UNIT, cubic
from tablegen.numerics.arrays import Ints, freeze

Mode = Literal["interpolated", "cubic", "direct"]
_CHUNK_TICKS = 1 << 14  # ticks that are computed at a time, so that they fit the cache


def sample_gain(mode: Mode) -> float:
    """Return the factor that the gain makes up for: a spline's sample has 12 units for an LSB of a word, others 2^4."""
    return float(1 << guard_bits(MAXIMUM_SPLINE_BITS)) / SPLINE_UNIT if mode == "cubic" else 1.0


class Program(Struct, frozen=True, eq=False):
    """One axis of a program.

    ``phase`` advances once every ``hold`` ticks: 1, or a line's ticks where the slow axis steps once a line.
    ``words`` are two's complement of ``bits`` bits, int64 of shape (2^P,), or (phase.ticks,) in ``direct`` mode. In
    ``cubic`` mode they are the coefficients of a spline.
    """

    phase: RationalPhase
    hold: int
    mode: Mode
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
        return 0 if self.mode == "direct" else index_bits_of(len(self.words))

    def resting(self, words: Ints) -> Ints:
        """Return the samples of constant tables, one for each of ``words``: they bound all samples.

        Parameters
        ----------
        words
            Table words, any shape.

        Returns
        -------
        Ints
            Samples, shape of ``words``.
        """
        return words * SPLINE_UNIT if self.mode == "cubic" else words << self.guard

    @property
    def rounded(self) -> "Program":
        """The program without shaping."""
        return replace(self, output=replace(self.output, shaping=OFF)) if self.output.shaping.order else self

    def samples(self, k: Ints) -> Ints:
        """Return the samples of the table at ticks.

        Parameters
        ----------
        k
            Ticks in [0, ticks), any shape.

        Returns
        -------
        Ints
            Shape of ``k``; a word's LSB is 2^guard, or 12 in ``cubic`` mode.
        """
        advance = k if self.hold == 1 else k // self.hold
        if self.mode == "direct":
            return direct(self.words, advance, self.guard)
        if self.mode == "cubic":
            return cubic(self.words, self.phase.at(advance))
        return interpolate(self.words, self.phase.at(advance), self.guard)

    def codes(self, k: Ints) -> Ints:
        """Return codes before the slew guard.

        Parameters
        ----------
        k
            Ticks in [0, ticks), shape (n,).

        Returns
        -------
        Ints
            Codes in [code_min, code_max], shape (n,).

        Raises
        ------
        ValueError
            If the output is shaped: a code then depends on all ticks before it.
        """
        self.require_period()
        if len(k) <= _CHUNK_TICKS:
            return self.output.code(self.samples(k))
        chunks = range(0, len(k), _CHUNK_TICKS)
        return np.concatenate([self.output.code(self.samples(k[first : first + _CHUNK_TICKS])) for first in chunks])

    def require_period(self) -> None:
        """Check that codes are periodic.

        Raises
        ------
        ValueError
            If the output is shaped, so that codes depend on all ticks before.
        """
        if self.output.shaping.order:
            raise ValueError("shaped codes are not periodic: they are played from the beginning of a program")

    def unclamped(self, first: int, stop: int, remainders: Remainders) -> Ints:
        """Return codes at ticks [first, stop) of a period before the clamp, and update ``remainders``.

        Parameters
        ----------
        first, stop
            Ticks of the period, 0 <= first < stop <= ticks.
        remainders
            Those that the tick before ``first`` has left.

        Returns
        -------
        Ints
            Codes, shape (stop - first,).
        """
        chunks = range(first, stop, _CHUNK_TICKS)
        samples = (self.samples(np.arange(at, min(at + _CHUNK_TICKS, stop), dtype=np.int64)) for at in chunks)
        return np.concatenate([self.output.shaped(chunk, remainders) for chunk in samples])

    def played(self, first: int, stop: int) -> Ints:
        """Return codes at ticks [first, stop) since a program began, over as many periods, before the slew guard.

        Parameters
        ----------
        first, stop
            Ticks, 0 <= first <= stop.

        Returns
        -------
        Ints
            Codes in [code_min, code_max], shape (stop - first,).
        """
        if not self.output.shaping.order:
            return self.codes(np.arange(first, stop, dtype=np.int64) % self.ticks)
        remainders, codes = self.output.begin(), []
        for at in range(0, stop, self.ticks):
            codes.append(self.unclamped(0, min(self.ticks, stop - at), remainders)[max(first - at, 0) :])
        return self.output.clamp(np.concatenate(codes or [np.zeros(0, dtype=np.int64)]))
