"""One axis that plays a fast and a slow part: a table mixed once a line, a gain of the line, and an offset that ramps.

In line l of a frame, at tick k of L, as docs/decisions/0089 has it::

    table(l)[i] = saturate(fast[i] + round(ratio(l) second[i], 12))
    slow(l)     = slow_gain S_slow(l) + offset_word
    ramp(l)     = (slow(l + 1) - slow(l)) step / 2^32, towards 0, with step = floor(2^32 / L)
    c           = round(gain(l) S(table(l), k) + slow(l) + k ramp(l), gain_q)

Shaping, clamp, slew guard and coding of the converter follow as for every program.
"""

from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise
from math import ceil

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from tablegen.fixedpoint.output import GAIN_BITS, Output
from tablegen.fixedpoint.phase import PHASE_BITS, RationalPhase
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.rounding import saturate, shift_round, signed_limits
from tablegen.fixedpoint.shaping import Remainders
from tablegen.fixedpoint.spline import SPLINE_FRACTION_BITS, SPLINE_UNIT, cubic, of_segments, segments
from tablegen.numerics.arrays import Ints, freeze

RATIO_BITS = 16
RATIO_FRACTION_BITS = 12  # with 14 the ratios of turned scans overflow
SECOND_BITS = 8
SLOW_BITS = 43  # of an offset word
SUM_BITS = 44  # of product and offset before the rounding
MOST_KNOTS = 65
FACTOR_FRACTION_BITS = 16  # of a factor of all gains, which has 32 bits
_BLOCK = 1 << 15  # samples that are computed at a time, so that they fit the cache


class Knots(Struct, frozen=True, eq=False):
    """A word for each line of a frame: straight between knots that are ``spacing`` lines apart, the first at line 0.

    ``words`` has shape (n,), 2 <= n <= 65. The last knot is at line (n - 1) spacing, at the end of the frame or behind.
    """

    words: Ints
    spacing: int

    def __post_init__(self) -> None:
        if not (2 <= len(self.words) <= MOST_KNOTS and self.spacing >= 1):
            raise ValueError(f"{len(self.words)} knots, {self.spacing} lines apart; 2..{MOST_KNOTS} are possible")
        freeze(self.words)

    @property
    def lines(self) -> int:
        """The lines that the knots reach."""
        return (len(self.words) - 1) * self.spacing

    def times(self, factor_word: int) -> "Knots":
        """Return the knots times ``factor_word / 2^16``, to the nearest whole number, ties up: a move of a program."""
        half = 1 << (FACTOR_FRACTION_BITS - 1)
        return Knots((self.words * factor_word + half) >> FACTOR_FRACTION_BITS, self.spacing)

    def at(self, line: Ints) -> Ints:
        """Return the nearest whole numbers to the straight lines between the knots, ties up; a knot is met exactly.

        A device needs one division a knot: a step and its remainder, as in a phase, whose accumulator begins at half
        of ``spacing``.

        Parameters
        ----------
        line
            Lines in [0, lines], any shape.

        Returns
        -------
        Ints
            Shape of ``line``.
        """
        left = np.minimum(np.asarray(line) // self.spacing, len(self.words) - 2)
        ahead = line - left * self.spacing
        difference = self.words[left + 1] - self.words[left]
        return np.asarray(self.words[left] + (difference * ahead + self.spacing // 2) // self.spacing)


class SlowTable(Struct, frozen=True, eq=False):
    """The slow part, once a line: the sample of a cubic table over the frame, in the units of an offset word.

    ``words`` are the coefficients of a spline, shape (2^P,).
    """

    words: Ints
    gain_word: int
    offset_word: int

    def __post_init__(self) -> None:
        freeze(self.words)

    def at(self, line: Ints, lines: int) -> Ints:
        """Return offset words at lines of a frame; the line after the last one is the first.

        Parameters
        ----------
        line
            Lines in [0, lines], any shape.
        lines
            Lines of the frame.

        Returns
        -------
        Ints
            Codes with gain_q fraction bits, shape of ``line``.
        """
        samples = cubic(self.words, RationalPhase(lines).at(np.asarray(line) % lines))
        return np.asarray(self.gain_word * samples + self.offset_word)


class FrameProgram(Struct, frozen=True, eq=False, dict=True):
    """One axis of a program with a slow part.

    ``fast`` has the table of a line and the output stage, whose gain and offset words it does not use. ``second`` has
    the words that are mixed into the table, of its shape.
    """

    fast: Program
    lines: int
    gains: Knots
    ratios: Knots
    second: Ints
    slow: SlowTable

    def __post_init__(self) -> None:
        freeze(self.second)
        if self.fast.hold != 1 or self.fast.mode == "direct":
            raise ValueError("a frame program has a table of lines or of a spline, which advances every tick")
        if len(self.second) != len(self.fast.words):
            raise ValueError(f"{len(self.second)} words are mixed into {len(self.fast.words)}")
        slow = self.slow.at(np.arange(self.lines), self.lines)
        for name, words, bits in (
            ("gain", self.gains.words, GAIN_BITS),
            ("ratio", self.ratios.words, RATIO_BITS),
            ("word of the second table", self.second, SECOND_BITS),
            ("slow part", slow, SLOW_BITS),
        ):
            low, high = signed_limits(bits)
            if int(np.min(words)) < low or int(np.max(words)) > high:
                raise OverflowError(f"a {name} does not fit {bits} bits")
        for name, knots in (("gains", self.gains), ("ratios", self.ratios)):
            if knots.lines < self.lines:
                raise ValueError(f"the {name} reach {knots.lines} lines of {self.lines}")

    @classmethod
    def straight(cls, program: Program, lines: int) -> "FrameProgram":
        """Return the frame program that plays what a program of a line plays, in each line of a frame."""
        words = np.zeros(8, dtype=np.int64)
        still = SlowTable(words, 0, program.output.offset_word)
        gains, ratios = (Knots(np.full(2, word, dtype=np.int64), lines) for word in (program.output.gain_word, 0))
        return cls(program, lines, gains, ratios, np.zeros_like(program.words), still)

    @property
    def memory_bits(self) -> int:
        """The bits of all words of the program: tables, knots and the slow table, whose words are as wide as fast ones.

        A table, gain or ratio that does nothing counts all the same.
        """
        tables = len(self.fast.words) * self.fast.bits + len(self.second) * SECOND_BITS
        knots = len(self.gains.words) * GAIN_BITS + len(self.ratios.words) * RATIO_BITS
        return tables + knots + len(self.slow.words) * self.fast.bits

    def table(self, line: int) -> Ints:
        """Return the words of the table that plays in a line.

        Parameters
        ----------
        line
            Line in [0, lines).

        Returns
        -------
        Ints
            Saturated to the width of the fast words, of their shape.
        """
        return self.tables(np.array(line))

    def tables(self, lines: Ints) -> Ints:
        """Return the words of the tables that play in lines.

        Parameters
        ----------
        lines
            Lines in [0, lines), any shape.

        Returns
        -------
        Ints
            Saturated to the width of the fast words, of the shape of ``lines`` and of these words.
        """
        mixed = shift_round(self.ratios.at(lines)[..., None] * self.second, RATIO_FRACTION_BITS)
        return saturate(self.fast.words + mixed, self.fast.bits)

    @property
    def output(self) -> Output:
        """The output stage of the axis, whose gain and offset words do not play."""
        return self.fast.output

    def guarded(self, max_step: int) -> "FrameProgram":
        """Return the program with a slew guard of so many codes a tick, 1 at least."""
        guarded = replace(self, fast=replace(self.fast, output=replace(self.output, max_step=max(max_step, 1))))
        guarded.__dict__.update(self.__dict__)  # extremes do not depend on the guard
        return guarded

    def ramps(self) -> Ints:
        """Return by how much the slow part moves in a tick of each line, in the units of an offset word.

        ``k ramp`` never passes the slow part of the line after it. It stays behind by less than L (1 + |distance| /
        2^32) at the end of a line.

        Returns
        -------
        Ints
            Shape (lines,).
        """
        return self._ramps(0, self.lines)

    def sums(self, line: int) -> Ints:
        """Return gain times sample plus slow part at all ticks of a line, before they are rounded to codes.

        Parameters
        ----------
        line
            Line in [0, lines).

        Returns
        -------
        Ints
            Codes with gain_q fraction bits, shape (ticks of a line,).
        """
        return np.asarray(self._sums(line, 1)[0])

    def unclamped(self, first: int, count: int = 1) -> Ints:
        """Return the codes of lines before the clamp, unshaped.

        Parameters
        ----------
        first
            Line of the frame that is the first of them.
        count
            Number of lines, all of one frame.

        Returns
        -------
        Ints
            Codes, shape (count, ticks of a line).
        """
        return shift_round(self._sums(first, count), self.output.gain_q)

    def at(self, line: int, k: Ints) -> Ints:
        """Return the codes of ticks of a line before the clamp, unshaped.

        Parameters
        ----------
        line
            Line in [0, lines).
        k
            Ticks in [0, ticks of a line), any shape.

        Returns
        -------
        Ints
            Codes, shape of ``k``.
        """
        codes: Ints = shift_round(self._sums(line, 1, np.ravel(k))[0], self.output.gain_q)
        return codes.reshape(np.shape(k))

    def played(self, first: int, count: int, remainders: Remainders) -> Ints:
        """Return the codes of consecutive lines before the clamp, and update ``remainders``.

        Parameters
        ----------
        first
            Line of the frame that is the first of them.
        count
            Number of lines, all of one frame.
        remainders
            Those that the line before ``first`` has left.

        Returns
        -------
        Ints
            Codes, shape (count * ticks of a line,).
        """
        if not self.output.shaping.order:
            return self.unclamped(first, count).ravel()
        return remainders.codes(self.output.with_remainders(self._sums(first, count).ravel()))

    @property
    def starts(self) -> Ints:
        """The codes of the first tick of each line before the clamp, unshaped, shape (lines,)."""
        return np.asarray(self.at_all(np.zeros(1, dtype=np.int64))[:, 0])

    def at_all(self, k: Ints) -> Ints:
        """Return the codes of the same ticks of every line before the clamp, unshaped.

        Parameters
        ----------
        k
            Ticks in [0, ticks of a line), shape (n,).

        Returns
        -------
        Ints
            Codes, shape (lines, n).
        """
        return shift_round(self._sums(0, self.lines, k), self.output.gain_q)

    def frame(self) -> Ints:
        """Return the codes of a frame before the slew guard, unshaped.

        Returns
        -------
        Ints
            Codes in [code_min, code_max], shape (lines, ticks of a line).
        """
        return self.output.clamp(self.unclamped(0, self.lines))

    @cached_property
    def extremes(self) -> tuple[int, int, int]:
        """The least and the greatest code of a frame before the clamp, and the largest step of a tick, unshaped."""
        least, most, steepest = 1 << 40, -(1 << 40), 0
        before = int(self.at(self.lines - 1, np.array([self.fast.phase.ticks - 1]))[0])
        for first, count in self._blocks(self.fast.phase.ticks):
            codes = self.unclamped(first, count).ravel()
            least, most = min(least, int(np.min(codes))), max(most, int(np.max(codes)))
            steps = np.diff(codes, prepend=before)
            steepest = max(steepest, int(np.max(steps)), -int(np.min(steps)))
            before = int(codes[-1])
        return least, most, steepest

    @cached_property
    def bounds(self) -> tuple[int, int, int]:
        """What ``extremes`` do not exceed, by the words of the tables: a fraction of the time.

        A spline stays between 12 times its words, and its slope between 12 times their differences. A sample is within
        1 of it, and a tick goes on by no more than its share of the segments and one fraction.
        """
        if self.fast.mode != "cubic":
            return self.extremes
        ticks, length = self.fast.phase.ticks, len(self.fast.words)
        ends = self.at_all(np.array([0, ticks - 1]))
        steepest = int(np.max(np.abs(np.roll(ends[:, 0], -1) - ends[:, 1])))
        least, most = int(np.min(ends)), int(np.max(ends))
        for first, count in self._blocks(length):
            lines = np.arange(first, first + count)
            tables, gains = self.tables(lines), self.gains.at(lines)
            slow, ramps = self.slow.at(lines, self.lines), self._ramps(first, first + count)
            low, high = (SPLINE_UNIT * gains * end for end in (np.min(tables, axis=1), np.max(tables, axis=1)))
            behind = (ticks - 1) * ramps
            lowest = int(np.min(np.minimum(low, high) + slow + np.minimum(behind, 0)))
            highest = int(np.max(np.maximum(low, high) + slow + np.maximum(behind, 0)))
            rise = np.max(np.abs(np.diff(tables, axis=1, append=tables[:, :1])), axis=1)
            advance = (length << SPLINE_FRACTION_BITS) + ticks  # of 2^18 ticks
            samples = SPLINE_UNIT * rise * advance // (ticks << SPLINE_FRACTION_BITS) + 3
            step = int(np.max(np.abs(gains) * samples + np.abs(ramps)))
            least = min(least, shift_round(lowest, self.output.gain_q))
            most = max(most, shift_round(highest, self.output.gain_q))
            steepest = max(steepest, -(-step >> self.output.gain_q))
        return least, most, steepest

    def _blocks(self, of_line: int) -> Iterator[tuple[int, int]]:
        """Yield the first line and the count of blocks of lines that have so many values each."""
        count = max(_BLOCK // of_line, 1)
        for first in range(0, self.lines, count):
            yield first, min(count, self.lines - first)

    def _ramps(self, first: int, stop: int) -> Ints:
        step = RationalPhase(self.fast.phase.ticks).step
        slow = self.slow.at(np.arange(first, stop + 1), self.lines).tolist()
        return np.array([ramp(after - here, step) for here, after in pairwise(slow)], dtype=np.int64)

    def _sums(self, first: int, count: int, k: Ints | None = None) -> Ints:
        """Return the sums at ticks of lines, shape (count, len(k)); at all ticks unless ``k`` says which."""
        k = np.arange(self.fast.phase.ticks, dtype=np.int64) if k is None else k
        lines = np.arange(first, first + count)
        samples = self._samples(lines.tolist(), k)
        gains, slow = self.gains.at(lines), self.slow.at(lines, self.lines)
        ramps = self._ramps(first, first + count)
        return np.asarray(gains[:, None] * samples + slow[:, None] + k * ramps[:, None])

    def _samples(self, lines: list[int], k: Ints) -> Ints:
        """Return the samples of the mixed tables of lines at the same ticks of each, shape (len(lines), len(k))."""
        if self.fast.mode != "cubic":
            return np.stack([replace(self.fast, words=self.table(line)).samples(k) for line in lines])
        segment, fraction = segments(self.fast.phase.at(k), self.fast.index_bits)
        count = max(_BLOCK // max(len(k), 1), 1)
        blocks = [lines[first : first + count] for first in range(0, len(lines), count)]
        return np.concatenate([of_segments(self.tables(np.array(block)), segment, fraction) for block in blocks])


def played_extremes(program: FrameProgram) -> tuple[int, int, int]:
    """Return bounds of the codes of all frames before the clamp, and of the step of a tick, with what shaping adds."""
    return _shaped(program, program.extremes)


def played_bounds(program: FrameProgram) -> tuple[int, int, int]:
    """Return what ``played_extremes`` do not exceed, in a fraction of the time."""
    return _shaped(program, program.bounds)


def _shaped(program: FrameProgram, extremes: tuple[int, int, int]) -> tuple[int, int, int]:
    least, most, steepest = extremes
    shaping = program.output.shaping
    room = ceil(shaping.excess - 0.5)
    return least - room, most + room, steepest + shaping.step_excess


def ramp(distance: int, step: int) -> int:
    """Return the ramp of a tick towards the next line: distance step / 2^32, cut off towards 0.

    Parameters
    ----------
    distance
        From the slow part of this line to that of the next one.
    step
        Step of the line's phase, floor(2^32 / L).
    """
    size = (abs(distance) * step) >> PHASE_BITS
    return -size if distance < 0 else size
