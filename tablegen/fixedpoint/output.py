"""Conversion of a sample to a code: gain, offset, rounding, clamp, and the coding of the converter."""

import numpy as np
from msgspec import Struct

from tablegen.fixedpoint.rounding import Integer, shift_round
from tablegen.fixedpoint.shaping import OFF, Remainders, Shaping, remainder_bits
from tablegen.numerics.arrays import Floats, Ints

GAIN_BITS = 18  # signed; the narrow port of a DSP block
# A gain of 2^16 makes a full-scale table a full-scale output; the range is [-2, 2) of that.
UNIT_GAIN_BITS = 16


class Output(Struct, frozen=True):
    """The output stage: code = clamp(round((gain_word sample + offset_word) / 2^gain_q), code_min, code_max), ties up.

    Codes are straight binary, 0 at the converter's v_min; ``offset_word`` is the offset in codes with ``gain_q``
    fraction bits, ``offset_code`` the nearest whole code to it. ``channel`` is the output of a dual converter, A or B,
    where the configuration gives it; the arithmetic is the same on both. ``shaping`` defines what becomes of the
    remainder of the rounding; ``begin`` and ``shaped`` play it.
    """

    gain_word: int
    gain_q: int
    offset_word: int
    code_min: int
    code_max: int
    max_step: int
    park_code: int
    dac_bits: int
    coding: str
    align: str
    word_bits: int
    channel: str = ""
    shaping: Shaping = OFF

    @property
    def offset_code(self) -> int:
        """The offset as the nearest code."""
        return shift_round(self.offset_word, self.gain_q)

    def unclamped(self, sample: Ints) -> Ints:
        """Return codes before the clamp, unshaped.

        |gain_word| <= 2^17 and |sample| <= 2^24 give a product of at most 2^41; |offset_word| < 2^42 by
        construction; the sum and its rounding stay below 2^43.

        Parameters
        ----------
        sample
            Samples of the table, any shape.

        Returns
        -------
        Ints
            Codes, shape of ``sample``.
        """
        return shift_round(self.gain_word * sample + self.offset_word, self.gain_q)

    def unrounded(self, sample: Ints) -> Floats:
        """Return codes before the rounding, as real numbers.

        Parameters
        ----------
        sample
            Samples of the table, any shape.

        Returns
        -------
        Floats
            Codes in LSB of the converter, shape of ``sample``.
        """
        return np.asarray((self.gain_word * sample + self.offset_word) / float(1 << self.gain_q))

    def code(self, sample: Ints) -> Ints:
        """Return codes as the converter plays them, without shaping.

        Parameters
        ----------
        sample
            Samples of the table, any shape.

        Returns
        -------
        Ints
            Codes in [code_min, code_max], shape of ``sample``.
        """
        return self.clamp(self.unclamped(sample))

    def clamp(self, codes: Ints) -> Ints:
        """Return codes within the limits of this axis.

        Parameters
        ----------
        codes
            Codes of any size and shape.

        Returns
        -------
        Ints
            Codes in [code_min, code_max], shape of ``codes``.
        """
        return np.clip(codes, self.code_min, self.code_max)

    def begin(self) -> Remainders:
        """Return the remainders at the beginning of a program."""
        return Remainders(self.shaping, remainder_bits(self.dac_bits))

    def shaped(self, sample: Ints, remainders: Remainders) -> Ints:
        """Return codes before the clamp at consecutive ticks, and update ``remainders``.

        Parameters
        ----------
        sample
            Samples of the table, shape (n,).
        remainders
            Those that the tick before the first has left.

        Returns
        -------
        Ints
            Codes, shape (n,).
        """
        return remainders.codes(self.shaping_input(sample)) if self.shaping.order else self.unclamped(sample)

    def shaping_input(self, sample: Ints) -> Ints:
        """Return the input of shaping: codes with ``remainder_bits`` fraction bits, and half a code more.

        Parameters
        ----------
        sample
            Samples of the table, any shape.

        Returns
        -------
        Ints
            Fixed-point codes, shape of ``sample``.
        """
        return self.with_remainders(self.gain_word * sample + self.offset_word)

    def with_remainders(self, sums: Ints) -> Ints:
        """Return codes with ``remainder_bits`` fraction bits, and half a code more.

        Parameters
        ----------
        sums
            Codes with ``gain_q`` fraction bits, any shape.

        Returns
        -------
        Ints
            Fixed-point codes, shape of ``sums``.
        """
        half = 1 << (self.gain_q - 1)
        return (sums + half) >> (self.gain_q - remainder_bits(self.dac_bits))

    def word(self, code: Integer) -> Integer:
        """Return a code as it is sent to the converter: its coding, then its alignment."""
        if self.coding == "twos-complement":
            code = code ^ (1 << (self.dac_bits - 1))
        return code << (self.word_bits - self.dac_bits) if self.align == "left" else code
