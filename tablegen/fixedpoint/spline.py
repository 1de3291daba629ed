"""Evaluation of a uniform cubic B-spline at a phase: four words a sample, and far fewer words than lines need.

A spline stays between the least and the greatest of its words, and its slope between the least and the greatest of
their differences: what a device checks of a table of lines holds for it too.
"""

from collections.abc import Sequence

import numpy as np

from tablegen.fixedpoint.interpolation import index_bits_of
from tablegen.fixedpoint.phase import PHASE_BITS
from tablegen.fixedpoint.rounding import shift_round
from tablegen.numerics.arrays import Ints

# A sample is the spline's 1/6, 4/6, 1/6 without their divisor, and doubled: 12 units are a word's LSB, where a line
# has 2^4. The gain makes up for it, by 4/3.
SPLINE_UNIT = 12
WORDS_BEHIND = 3  # a segment's words after its first one
# 3 bits more than lines have: a spline has few words, so that the same part of a segment is more of the period.
SPLINE_FRACTION_BITS = 18


def cubic(table: Ints, phase: Ints) -> Ints:
    """Return samples at phases in [0, 2^32), of their shape; a sample is 12 times the spline.

    The table has 2^P words of up to 21 bits, 3 <= P <= 14. The top P bits of a phase are the index of the first of four
    words, the next 18 the fraction of the segment that is behind it; the rest is dropped. Word k is the coefficient of
    the B-spline centred on (k - 1) / 2^P.

    Parameters
    ----------
    table
        Coefficients of the B-spline, shape (2^P,).
    phase
        Phases of 32 bits, any shape.

    Returns
    -------
    Ints
        Samples, shape of ``phase``.
    """
    index, fraction = segments(phase, index_bits_of(len(table)))
    return evaluate_segment([table[(index + ahead) & (len(table) - 1)] for ahead in range(WORDS_BEHIND + 1)], fraction)


def segments(phase: Ints, index_bits: int) -> tuple[Ints, Ints]:
    """Return the segment of each phase in a table of so many index bits, and the fraction of it that is behind."""
    fraction = (phase >> (PHASE_BITS - index_bits - SPLINE_FRACTION_BITS)) & ((1 << SPLINE_FRACTION_BITS) - 1)
    return phase >> (PHASE_BITS - index_bits), fraction


def of_segments(table: Ints, segment: Ints, fraction: Ints) -> Ints:
    """Return ``cubic`` of phases that ``segments`` has taken apart: the same integers, faster for many samples.

    Parameters
    ----------
    table
        Coefficients of one B-spline or of several, shape (..., 2^P).
    segment, fraction
        Of each phase, shape (n,).

    Returns
    -------
    Ints
        Samples, shape (..., n).
    """
    of_table = coefficients([np.roll(table, -ahead, axis=-1) for ahead in range(WORDS_BEHIND + 1)])
    return _horner([one.take(segment, axis=-1) for one in of_table], fraction)


def evaluate_segment(words: Sequence[Ints], fraction: Ints) -> Ints:
    """Return the sample at a fraction in [0, 2^18) of the segment of four words.

    Horner's rule for 12 S = b0 + b1 v + b2 v^2 + b3 v^3 with v = fraction / 2^19; b_k holds the 2^k that the half of
    each v takes. For words of B bits |b3| <= 2^(B+6), |b2| <= 1.5 2^(B+5), |b1| <= 1.5 2^(B+3), and the sums on the
    way are no larger than b3, hence each product stays below 2^(B+24). The roundings add up to less than 1, so that a
    sample never leaves the 12-fold words.

    Parameters
    ----------
    words
        Four arrays of one shape: the consecutive words of each segment.
    fraction
        Whole numbers of 18 bits, of the same shape.

    Returns
    -------
    Ints
        Samples, 12 times the spline, of the same shape.
    """
    return _horner(coefficients(words), fraction)


def _horner(by_power: Sequence[Ints], fraction: Ints) -> Ints:
    b0, b1, b2, b3 = by_power
    sample = b3
    for lower in (b2, b1, b0):
        sample = lower + shift_round(sample * fraction, SPLINE_FRACTION_BITS + 1)
    return sample


def coefficients(words: Sequence[Ints]) -> tuple[Ints, Ints, Ints, Ints]:
    """Return b0 to b3 of Horner's rule in ``evaluate_segment``.

    Parameters
    ----------
    words
        Four arrays of one shape: the consecutive words of each segment.

    Returns
    -------
    b0, b1, b2, b3
        Each of the shape of a word.
    """
    first, second, third, fourth = words
    outer, inner = fourth - first, second - third
    return (
        2 * (first + 4 * second + third),
        12 * (third - first),
        24 * (first - 2 * second + third),
        16 * (outer + 3 * inner),
    )
