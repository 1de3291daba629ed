"""Fourier words, and the integer synthesis that renders them into table words on the host and on the device alike."""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np
from msgspec import Struct

from tablegen.fixedpoint.rounding import round_half_up, round_number, saturate, shift_round, signed_limits
from tablegen.numerics.arrays import Floats, Ints, freeze, multiples
from tablegen.numerics.turns import sine

WORD_BITS = 32
FRACTION_BITS = 30  # Q2.30: |s| <= 1 bounds every coefficient by 4/pi
SINE_FRACTION_BITS = 30
ACCUMULATOR_BITS = 64
_CACHED = 1 << 16  # words of the longest sine table that is cached
_CACHED_WAVES = 1 << 17  # words of the cosines of all harmonics that are cached, and as many of the sines: 2 MB


class FourierWords(Struct, frozen=True, eq=False):
    """The Fourier words of s(t) = (2 w(t) - 1) / scale in Q2.30: s = a0 + sum a_n cos + b_n sin, int32 over 2^30."""

    a0: int
    a: Ints
    b: Ints

    def __post_init__(self) -> None:
        freeze(self.a, self.b)

    @property
    def harmonics(self) -> int:
        """The highest harmonic H."""
        return len(self.a)

    @property
    def in_order(self) -> Ints:
        """The words in the order in which devices hold them: a0, a1..aH, b1..bH.

        Returns
        -------
        Ints
            Q2.30, shape (2 H + 1,).
        """
        return np.concatenate([[self.a0], self.a, self.b])


def encode(a0: float, a: Floats, b: Floats, scale: float) -> FourierWords:
    """Return the words of (2 w - 1) / scale for w = a0 + sum a_n cos + b_n sin, rounded to nearest, ties up.

    Parameters
    ----------
    a, b
        Coefficients of harmonics 1..H, (H,).

    Raises
    ------
    OverflowError
        If a word does not fit 32 bits, or their sum does not fit the accumulator.
    """
    unit = float(1 << FRACTION_BITS)
    high = signed_limits(WORD_BITS)[1]
    mean = round_number((2.0 * a0 - 1.0) / scale * unit)
    cosines, sines = (round_half_up(2.0 * c / scale * unit) for c in (a, b))
    largest = max(abs(mean), int(np.max(np.abs(cosines))), int(np.max(np.abs(sines))))
    if largest > high:
        raise OverflowError(f"a Fourier word of {largest} does not fit {WORD_BITS} bits")
    # Each product is at most |word| 2^30; their sum and the rounding have to stay inside 64 bits.
    total = (abs(mean) + int(np.sum(np.abs(cosines))) + int(np.sum(np.abs(sines)))) << SINE_FRACTION_BITS
    if total >= 1 << (ACCUMULATOR_BITS - 2):
        raise OverflowError(f"the Fourier words sum to {total / 2.0**60:.3f}, the accumulator holds 4")
    return FourierWords(mean, cosines, sines)


def sine_table(length: int) -> Ints:
    """Return round(2^30 sin(2 pi j / length)) for j in [0, length), ties away from 0 so that the table is odd.

    A device holds a quarter of it: for a length divisible by 4 the rest follows by symmetry, word for word.

    Returns
    -------
    Ints
        Read-only, shape (length,).
    """
    return _cached_sine_table(length) if length <= _CACHED else _sine_table(length)


def _sine_table(length: int) -> Ints:
    value = sine(np.arange(length) / length) * float(1 << SINE_FRACTION_BITS)
    magnitude: Floats = np.abs(value)
    table: Ints = np.where(value < 0.0, -round_half_up(magnitude), round_half_up(magnitude))
    freeze(table)
    return table


@lru_cache(maxsize=4)  # a build asks for the same one or two again and again
def _cached_sine_table(length: int) -> Ints:
    return _sine_table(length)


def sine_quarter(index_bits: int) -> Ints:
    """Return the first quarter of the sine words, which a device holds for tables of up to 2^index_bits words.

    index_bits >= 3. sin(pi/2) is not among them: it is 2^30, the only word that does not fit 30 bits. The sine table of
    a shorter length is every 2^n-th word of a longer one.

    Returns
    -------
    Ints
        Words with 30 fraction bits, shape (2^(index_bits - 2),).
    """
    return sine_table(1 << index_bits)[: 1 << (index_bits - 2)]


def sine_periods(index_bits: int) -> Ints:
    """Return a period and a quarter of the sine table of 2^index_bits words: the cosine begins a quarter later.

    The C runtime renders with it, from a longer table too. index_bits >= 2.

    Returns
    -------
    Ints
        Words with 30 fraction bits, shape (5/4 2^index_bits,).
    """
    sines = sine_table(1 << index_bits)
    return np.concatenate([sines, sines[: len(sines) // 4]])


def _waves(length: int, harmonics: int) -> Iterator[tuple[Ints, Ints]]:
    """Yield C[n k mod length] and S[n k mod length] for k in [0, length / 2], for n = 1..harmonics."""
    sines = sine_table(length)
    if length % 4 == 0:
        cosines = np.roll(sines, -(length // 4))
    else:
        value = sine(np.arange(length) / length + 0.25) * float(1 << SINE_FRACTION_BITS)
        cosines = np.where(value < 0.0, -round_half_up(-value), round_half_up(value))
    for at in multiples(np.arange(length // 2 + 1, dtype=np.int64), length, harmonics):
        yield cosines.take(at, mode="clip"), sines.take(at, mode="clip")


@lru_cache(maxsize=4)  # tables of one length and as many harmonics are made again and again
def _cached_waves(length: int, harmonics: int) -> tuple[Ints, Ints]:
    cosines, sines = (np.empty((harmonics, length // 2 + 1), dtype=np.int64) for _ in "cs")
    for n, (cosine, sine_) in enumerate(_waves(length, harmonics)):
        cosines[n], sines[n] = cosine, sine_
    freeze(cosines, sines)
    return cosines, sines


def synthesize(words: FourierWords, length: int, bits: int) -> Ints:
    """Return the table words saturate(round(2^(bits-1) s(k / length))) for k = 0..length-1, ties up.

    acc = a0 2^30 + sum_n a_n C[n k mod length] + b_n S[n k mod length], exact in 64 bits, so that the order of the
    terms and any use of symmetry do not matter; C[j] is S[j + length/4], or the cosine rounded alike
    where the length is not divisible by 4. Then one rounding shift by 60 - (bits - 1).

    Parameters
    ----------
    words
        The 2 H + 1 Fourier words.
    length
        Words of the table.
    bits
        Word length, sign included.

    Returns
    -------
    Ints
        Shape (length,).
    """
    # Word length - k has the cosines of word k, and its sines with the other sign.
    half = length // 2 + 1
    if half * words.harmonics <= _CACHED_WAVES:
        cosines, sines = _cached_waves(length, words.harmonics)
        even, odd = (np.einsum("n,nk->k", *both) for both in ((words.a, cosines), (words.b, sines)))
    else:
        even, odd = np.zeros(half, dtype=np.int64), np.zeros(half, dtype=np.int64)
        for n, (cosine, sine_) in enumerate(_waves(length, words.harmonics)):
            even += words.a[n] * cosine
            odd += words.b[n] * sine_
    even += words.a0 << SINE_FRACTION_BITS
    accumulator = np.concatenate([even + odd, (even - odd)[length - half : 0 : -1]])
    return saturate(shift_round(accumulator, FRACTION_BITS + SINE_FRACTION_BITS - (bits - 1)), bits)
