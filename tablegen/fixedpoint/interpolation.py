"""Interpolation of a sample at a phase: the two words beside it, and the fraction between them."""

import numpy as np

from tablegen.fixedpoint.phase import PHASE_BITS
from tablegen.fixedpoint.rounding import shift_round
from tablegen.numerics.arrays import Ints

# 15 bits of fraction: the difference of two 16-bit words times the fraction is at most 65535 * 32767 < 2^31, so that
# a 32-bit multiplication serves every table of up to 16 bits, whatever is in it.
FRACTION_BITS = 15
# The sample keeps up to 4 bits below the word's LSB, and is never wider than the 25-bit port of a DSP block.
_GUARD_BITS = 4
MAXIMUM_SAMPLE_BITS = 25


def guard_bits(word_bits: int) -> int:
    """Return how many bits a sample has below the LSB of a table word: 4, and fewer above 21-bit words."""
    return min(_GUARD_BITS, MAXIMUM_SAMPLE_BITS - word_bits)


def index_bits_of(length: int) -> int:
    """Return P of a table of 2^P words."""
    return length.bit_length() - 1


def interpolate(table: Ints, phase: Ints, guard: int) -> Ints:
    """Return samples at phases in [0, 2^32), of their shape, from a table of 2^P words, P <= 17.

    The top P bits of a phase are the index of word t0, the next 15 the fraction on the way to the word after it, t1;
    the rest is dropped.

    sample = t0 2^G + round((t1 - t0) fraction / 2^(15 - G)), ties up; the word after the last is the first.
    |t1 - t0| < 2^24 and fraction < 2^15, hence the product stays below 2^39.

    Parameters
    ----------
    table
        Words of up to 24 bits, shape (2^P,).
    phase
        Phases of 32 bits, any shape.
    guard
        G, the bits of a sample below the LSB of a word.

    Returns
    -------
    Ints
        Samples with ``guard`` bits below the word's LSB, shape of ``phase``.
    """
    index_bits = index_bits_of(len(table))
    index = phase >> (PHASE_BITS - index_bits)
    fraction = (phase >> (PHASE_BITS - index_bits - FRACTION_BITS)) & ((1 << FRACTION_BITS) - 1)
    here: Ints = table[index]
    there: Ints = table[(index + 1) & (len(table) - 1)]
    return lerp(here, there, fraction, guard)


def lerp(here: Ints, there: Ints, fraction: Ints, guard: int) -> Ints:
    """Return the sample at a fraction in [0, 2^15) of the way from one word to the next; monotonic in the fraction.

    Parameters
    ----------
    here, there
        Consecutive words, of one shape.
    fraction
        Whole numbers of 15 bits, of the shape of the words.
    guard
        Bits of a sample below the LSB of a word.

    Returns
    -------
    Ints
        Samples, of the same shape.
    """
    return (here << guard) + shift_round((there - here) * fraction, FRACTION_BITS - guard)


def direct(table: Ints, k: Ints, guard: int) -> Ints:
    """Return samples of a table with one word an advance: word k times 2^G.

    Parameters
    ----------
    table
        Words, shape (ticks of a period,).
    k
        Advances in [0, len(table)), any shape.
    guard
        G, the bits of a sample below the LSB of a word.

    Returns
    -------
    Ints
        Samples, shape of ``k``.
    """
    return np.asarray(table[k] << guard)
