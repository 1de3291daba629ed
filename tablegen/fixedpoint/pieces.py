"""A table in monotonic pieces: whole segments of lines, and parts of the segments of splines.

On a piece a sample is base + round(slope f / 2^shift) of the fraction f of the segment, ties up. The rounded Horner's
rule of a spline has that form wherever its inner sums are constant, and each of those is constant on parts of a
segment.
"""

from collections.abc import Iterator

import numpy as np
from msgspec import Struct

from tablegen.fixedpoint.interpolation import FRACTION_BITS
from tablegen.fixedpoint.phase import PHASE_BITS
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.rounding import shift_round
from tablegen.fixedpoint.spline import SPLINE_FRACTION_BITS, WORDS_BEHIND, coefficients
from tablegen.numerics.arrays import Ints

_PIECES = 1 << 14  # pieces that are computed at a time, so that they fit the cache
_SPLINE_SHIFT = SPLINE_FRACTION_BITS + 1


class Pieces(Struct, frozen=True, eq=False):
    """Some pieces in the order in which they are played; arrays have the shape (n,).

    A piece has the fractions [begins, ends) of its segment, of ``fraction_bits`` bits. All pieces of a segment stand
    together.
    """

    segment: Ints
    begins: Ints
    ends: Ints
    base: Ints
    slope: Ints
    shift: int
    fraction_bits: int
    index_bits: int

    def ends_of_samples(self) -> Ints:
        """Return the first and the last sample of each piece.

        Returns
        -------
        Ints
            Shape (2, n).
        """
        return np.stack([self.base + shift_round(self.slope * f, self.shift) for f in (self.begins, self.ends - 1)])

    def first_fraction(self, piece: Ints, sample: Ints) -> Ints:
        """Return the least fractions at which these pieces reach these samples.

        Parameters
        ----------
        piece
            Indices of pieces, shape (m,).
        sample
            A sample for each of them, shape (m,).

        Returns
        -------
        Ints
            Fractions with ``fraction_bits`` bits, shape (m,).
        """
        return _first_fraction(self.slope[piece], sample - self.base[piece], self.shift)

    def phase(self, piece: Ints, fraction: Ints) -> Ints:
        """Return the least phases of 32 bits that have these fractions of the segments of these pieces.

        Parameters
        ----------
        piece
            Indices of pieces, shape (m,).
        fraction
            A fraction with ``fraction_bits`` bits for each of them, shape (m,).

        Returns
        -------
        Ints
            Phases in [0, 2^32), shape (m,).
        """
        place = (self.segment[piece] << self.fraction_bits) | fraction
        return np.asarray(place << (PHASE_BITS - self.fraction_bits - self.index_bits))

    @property
    def phase_behind(self) -> int:
        """The phase at which the segment after these begins; 2^32 behind the last one."""
        return (int(self.segment[-1]) + 1) << (PHASE_BITS - self.index_bits)


def pieces_of(program: Program) -> Iterator[Pieces]:
    """Return the pieces of a period of an ``interpolated`` or a ``cubic`` program, some segments at a time."""
    return _splines(program) if program.mode == "cubic" else iter([_lines(program)])


def most_levels(program: Program) -> int:
    """Return an upper bound of how many codes the pieces of a period begin.

    For a spline it follows from the sizes of its coefficients; at the joint of two pieces a sample may be off by one.
    """
    output, words = program.output, program.words
    if program.mode == "cubic":
        _, b1, b2, b3 = map(np.abs, coefficients(_segments(words)))
        pieces, rise = _most_pieces(b2, b3), (4 * b1 + 2 * b2 + b3) // 8 + 1
        codes = (rise + pieces) * abs(output.gain_word) >> output.gain_q
        return int(np.sum(2 * pieces + codes))
    codes = output.code(_lines(program).ends_of_samples())
    return int(np.abs(codes[1] - codes[0]).sum()) + len(words)


def _lines(program: Program) -> Pieces:
    words, guard = program.words, program.guard
    return Pieces(
        segment=np.arange(len(words)),
        begins=np.zeros_like(words),
        ends=np.full_like(words, 1 << FRACTION_BITS),
        base=words << guard,
        slope=np.roll(words, -1) - words,
        shift=FRACTION_BITS - guard,
        fraction_bits=FRACTION_BITS,
        index_bits=program.index_bits,
    )


def _splines(program: Program) -> Iterator[Pieces]:
    b0, b1, b2, b3 = coefficients(_segments(program.words))
    group = np.cumsum(_most_pieces(np.abs(b2), np.abs(b3))) // _PIECES
    for some in np.split(np.arange(len(b0)), np.flatnonzero(np.diff(group)) + 1):
        whole = np.zeros_like(some), np.full_like(some, 1 << SPLINE_FRACTION_BITS)
        part, begins, ends, third = _steps(*whole, b3[some])
        segment = some[part]
        part, begins, ends, second = _steps(begins, ends, b2[segment] + third)
        segment = segment[part]
        yield Pieces(
            segment=segment,
            begins=begins,
            ends=ends,
            base=b0[segment],
            slope=b1[segment] + second,
            shift=_SPLINE_SHIFT,
            fraction_bits=SPLINE_FRACTION_BITS,
            index_bits=program.index_bits,
        )


def _segments(words: Ints) -> list[Ints]:
    """Return the four words of each segment."""
    return [np.roll(words, -ahead) for ahead in range(WORDS_BEHIND + 1)]


def _most_pieces(b2: Ints, b3: Ints) -> Ints:
    """Return an upper bound of the pieces of segments, by the sizes of their coefficients: v is below 1/2.

    The inmost sum takes |b3| / 2 + 1 values. The next one changes by |b2 + b3 v| / 2 and b3 v^2 / 2, and once more for
    each of those values.
    """
    return (2 * b2 + 5 * b3) // 4 + 3


def _steps(begins: Ints, ends: Ints, slope: Ints) -> tuple[Ints, Ints, Ints, Ints]:
    """Return parts of stretches [begins, ends) of fractions on which round(slope f / 2^19) is one value.

    The result has the number of its stretch, first fraction, end and value of each part, in order.
    """
    first, last = (shift_round(slope * f, _SPLINE_SHIFT) for f in (begins, ends - 1))
    count = np.abs(last - first) + 1
    stretch = np.repeat(np.arange(len(begins)), count)
    order = np.arange(len(stretch)) - np.repeat(np.cumsum(count) - count, count)
    value = first[stretch] + np.sign(last - first)[stretch] * order
    at = _first_fraction(slope[stretch], value, _SPLINE_SHIFT)
    new = order == 0
    at[new] = begins
    behind = np.append(at[1:], 0)
    behind[np.append(new[1:], True)] = ends
    there = behind > at  # of values that are reached at one fraction the last counts
    return stretch[there], at[there], behind[there], value[there]


def _first_fraction(slope: Ints, value: Ints, shift: int) -> Ints:
    """Return the least f with round(slope f / 2^shift) >= value where it rises, <= value where it falls; one shape."""
    falls = slope < 0
    distance = ((value + falls) << shift) - (1 << (shift - 1)) - falls
    return np.asarray(-(-distance // np.where(slope == 0, 1, slope)))
