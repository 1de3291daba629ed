"""Quantise the drive of a frame into the integers of an axis with a fast and a slow part."""

from math import ceil

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from tablegen.base.input_errors import Unphysical
from tablegen.fixedpoint.converter import fit_gain, scaled_output
from tablegen.fixedpoint.frame_program import (
    FACTOR_FRACTION_BITS,
    RATIO_BITS,
    RATIO_FRACTION_BITS,
    SECOND_BITS,
    FrameProgram,
    Knots,
    SlowTable,
)
from tablegen.fixedpoint.output import GAIN_BITS, Output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Program, sample_gain
from tablegen.fixedpoint.rounding import round_number
from tablegen.fixedpoint.spline_words import spline_factors
from tablegen.fixedpoint.synthesis import encode, synthesize
from tablegen.numerics.arrays import Floats, Ints
from tablegen.waveform.series import FourierSeries

BITS = 16  # of the words of both tables
_LEAST_LENGTH = 64
_GRID = 1024
_PEAK_GRID = 1024  # peaks are rounded up to it, so that a scale does not depend on the last bit of one
_MOST_MIXED_LSB = 0.99 * ((1 << 7) - 1) * (1 << (RATIO_BITS - RATIO_FRACTION_BITS - 1))  # of a fast word
_MOST_SHARE = 4.0  # of the scale of the fast words that is given up for it: 2 bits,
_FINEST_CODES = float(1 << 14)  # or as much as leaves an LSB of a word below half a code


class FrameShape(Struct, frozen=True):
    """The cubic tables of an axis: the words over the line, of which a second table has as many, and over the frame.

    ``bits`` are those of the fast and of the slow words.
    """

    length: int
    bits: int
    slow_length: int

    @classmethod
    def of(cls, fast: FourierSeries, slow: FourierSeries) -> "FrameShape":
        """Return the shape that a drive has unless another one is given: four words for a harmonic."""
        return cls(_length(fast), BITS, _length(slow))

    def memory_bits(self, knots: int) -> int:
        """Return the bits of all words, packed, with ``knots`` gains and as many ratios."""
        words = self.length * (self.bits + SECOND_BITS) + self.slow_length * self.bits
        return words + knots * (GAIN_BITS + RATIO_BITS)

    def __str__(self) -> str:
        return f"{self.length} words over the line and {self.slow_length} over the frame, of {self.bits} bits"


class FrameParts(Struct, frozen=True, eq=False):
    """The drive of a frame in its parts, of which 1 is ``codes`` codes, about ``offset``, a code as a real number.

    ``fast``, ``second`` and ``slow`` have no mean; ``gains`` and ``ratios`` are at knots ``spacing`` lines apart,
    shape (knots,).
    """

    fast: FourierSeries
    second: FourierSeries
    slow: FourierSeries
    gains: Floats
    ratios: Floats
    spacing: int
    codes: float
    offset: float


def quantise_frame(
    parts: FrameParts, output: Output, ticks: int, lines: int, shape: FrameShape | None = None
) -> FrameProgram:
    """Return the program of a drive; its gain and offset take the place of those of ``output``.

    Parameters
    ----------
    shape
        Its tables; by default those of ``FrameShape.of``.

    Raises
    ------
    Unphysical
        If a word does not fit.
    """
    shape = FrameShape.of(parts.fast, parts.slow) if shape is None else shape
    length, bits = shape.length, shape.bits
    mixed = _peak(_spline(parts.second, length)) * float(np.max(np.abs(parts.ratios)))
    words, gain_word, scale = _table(parts.fast, mixed, shape.length, bits, parts.codes, output.dac_bits)
    slow_words, slow_gain, _ = _table(parts.slow, 0.0, shape.slow_length, bits, parts.codes, output.dac_bits)
    second, ratio_word = _second(parts.second, length, bits, scale, _peak(parts.fast))
    output = scaled_output(output, parts.offset, bits, gain_word)
    try:
        return FrameProgram(
            fast=Program(RationalPhase(ticks), 1, "cubic", bits, words, output),
            lines=lines,
            gains=Knots(np.rint(parts.gains * gain_word).astype(np.int64), parts.spacing),
            ratios=Knots(np.rint(parts.ratios * ratio_word).astype(np.int64), parts.spacing),
            second=second,
            slow=SlowTable(slow_words, slow_gain, output.offset_word),
        )
    except OverflowError as reason:
        raise Unphysical(f"{reason}; a smaller scan would fit") from None


def _length(series: FourierSeries) -> int:
    return max(_LEAST_LENGTH, 1 << (4 * series.harmonics - 1).bit_length())


class FrameMove(Struct, frozen=True):
    """The words that move a program with a slow part: a factor of its gains, gain and offset of the slow table.

    A device makes them of a MOVE, or plays them in a program that was uploaded.
    """

    factor_word: int
    gain_word: int
    offset_word: int

    @classmethod
    def of(cls, program: FrameProgram, fast: float, slow: float, offset: float) -> "FrameMove":
        """Return the words that scale the parts of line and frame of a program, about an offset.

        Parameters
        ----------
        fast, slow
            Factors of the gains of the line and of the gain of the frame.
        offset
            Code of the slow part at 0, as a real number.
        """
        return cls(
            factor_word=round_number(fast * float(1 << FACTOR_FRACTION_BITS)),
            gain_word=round_number(slow * program.slow.gain_word),
            offset_word=round_number(offset * float(1 << program.output.gain_q)),
        )

    def program(self, before: FrameProgram) -> FrameProgram:
        """Return the program with the same tables and these words.

        Raises
        ------
        OverflowError
            If a word does not fit.
        """
        table = SlowTable(before.slow.words, self.gain_word, self.offset_word)
        return replace(before, gains=before.gains.times(self.factor_word), slow=table)


def _spline(series: FourierSeries, length: int) -> FourierSeries:
    return series.times(*spline_factors(series.harmonics, length))


def _peak(series: FourierSeries) -> float:
    return float(np.max(np.abs(series.on_grid(max(_GRID, 32 * series.harmonics)))))


def _table(
    series: FourierSeries, room: float, length: int, bits: int, codes: float, dac_bits: int
) -> tuple[Ints, int, float]:
    """Return the words of a spline of a series in shares of v_max, its gain word, and the scale of its words.

    ``room`` is what is mixed into it at most; ``codes`` are those of v_max.
    """
    spline = _spline(series, length)
    peak = _peak(spline)
    if not peak > 0.0:
        return np.zeros(length, dtype=np.int64), 0, 1.0
    # Beside a large second part the words of the fast one are smaller, so that those that are mixed in suffice.
    most_mixed = _MOST_MIXED_LSB / float(1 << (bits - 1))  # of full scale
    share = ceil(max(1.0 + room / peak, room / peak / most_mixed) * _PEAK_GRID) / _PEAK_GRID
    if share > max(_MOST_SHARE, _FINEST_CODES / (peak * abs(codes))):
        raise Unphysical("lines of the frame differ by more than a second table holds; a smaller scan would fit")
    gain_word, scale = fit_gain(sample_gain("cubic") * peak * codes, share, bits, dac_bits)
    fourier = encode(0.5, 0.5 * spline.a / peak, 0.5 * spline.b / peak, scale)
    return synthesize(fourier, length, bits), gain_word, scale * peak


def _second(series: FourierSeries, length: int, bits: int, scale: float, fast: float) -> tuple[Ints, float]:
    """Return the words that are mixed in, and the ratio word of a ratio of 1.

    ``scale`` is the share of v_max of a full word of the fast table.
    """
    spline = _spline(series, length)
    peak = _peak(spline)
    if not peak > 1e-9 * fast:
        return np.zeros(length, dtype=np.int64), 0.0
    top = float((1 << (SECOND_BITS - 1)) - 1)
    words = np.rint(np.clip(spline.on_grid(length) / peak, -1.0, 1.0) * top).astype(np.int64)
    in_lsb = peak / scale * float(1 << (bits - 1))  # of a full word of the second table, in LSB of the fast one
    return words, in_lsb / top * float(1 << RATIO_FRACTION_BITS)
