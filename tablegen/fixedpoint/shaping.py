"""Shaped output: the remainder of a rounding is fed back, so that the error moves to where the piezo does not follow.

Codes of D bits have 28 - D bits below their LSB here. With 4 bits more, for the sign, for values beyond the converter
and for what is fed back, everything fits 32 bits, whatever the words of a program are.
"""

from math import ceil

import numpy as np
from msgspec import Struct

from tablegen.numerics.arrays import Ints

ZERO_BITS = 6  # fraction bits of 2 cos(theta), the place of the zeros on the unit circle
MAXIMUM_ZERO = 2 << ZERO_BITS
ORDERS = (0, 1, 2, 3)  # off, first, second, scanner
_CODE_AND_REMAINDER_BITS = 28


def remainder_bits(dac_bits: int) -> int:
    """Return R, the bits of a remainder: 20 at 8 bits of the converter, 4 at 24; never more than ``gain_q``."""
    return _CODE_AND_REMAINDER_BITS - dac_bits


class Shaping(Struct, frozen=True):
    """The feedback of the remainders e1, e2, e3 of the last three ticks, the newest first.

    ``order`` 0 feeds nothing back; 1: e1, a zero of the error's spectrum at DC; 2: 2 e1 - e2, two zeros at DC; 3:
    (e1 - e2) + e3 + floor(zero (e1 - e2) / 64), one zero at DC and a pair at the angles of 2 cos(theta) = zero / 64.
    ``zero`` is 0..128, and 0 where the order is not 3.
    """

    order: int = 0
    zero: int = 0

    def __post_init__(self) -> None:
        if self.order not in ORDERS or not 0 <= self.zero <= (MAXIMUM_ZERO if self.order == 3 else 0):
            raise ValueError(f"no shaping of order {self.order} with zero {self.zero}")

    @property
    def word(self) -> int:
        """The program word 11 of an axis: the order in bits 0 and 1, the zero in bits 8 to 15."""
        return self.order | self.zero << 8

    @classmethod
    def of_word(cls, word: int) -> "Shaping":
        """Return the shaping of a program word.

        Raises
        ------
        ValueError
            If the word does not define one.
        """
        if word & ~0xFF03:
            raise ValueError(f"{word:#x} is no word of shaping")
        return cls(word & 3, word >> 8)

    @property
    def noise(self) -> tuple[float, ...]:
        """The coefficients, from z^0 on, of the filter from the rounding error to the codes."""
        a = self.zero / (1 << ZERO_BITS)
        return ((1.0,), (1.0, -1.0), (1.0, -2.0, 1.0), (1.0, -1.0 - a, 1.0 + a, -1.0))[self.order]

    @property
    def excess(self) -> float:
        """The largest distance of a code from its unrounded value: half of the sum of |noise|, at most 4 codes."""
        return 0.5 * sum(abs(c) for c in self.noise)

    @property
    def step_excess(self) -> int:
        """The largest excess of a code step over the same step of rounded codes: 0, 2, 4, or 4 + zero / 32.

        Half of the sum of |(1 - z^-1) noise|, rounded up: values of rounded codes r apart are less than r + 1 apart,
        and the bound on what is added is not reached, since a remainder is never half a code itself. 0 without shaping.
        """
        if self.order == 0:
            return 0
        noise = self.noise
        return ceil(0.5 * sum(abs(b - a) for a, b in zip((0.0, *noise), (*noise, 0.0), strict=True)))

    def feedback(self, e1: int, e2: int, e3: int) -> int:
        """Return what is added to the next code, in its remainder bits; at most 3.5 codes."""
        if self.order == 0:
            return 0
        if self.order == 1:
            return e1
        if self.order == 2:
            return 2 * e1 - e2
        return (e1 - e2) + e3 + (self.zero * (e1 - e2) >> ZERO_BITS)


OFF = Shaping()


class Remainders:
    """The remainders of one axis, carried from tick to tick; all 0 where a program begins."""

    def __init__(self, shaping: Shaping, bits: int) -> None:
        self._shaping, self._bits = shaping, bits
        self.last: tuple[int, int, int] = (0, 0, 0)

    def codes(self, unrounded: Ints) -> Ints:
        """Return codes before the clamp at consecutive ticks, and carry the remainders on.

        Parameters
        ----------
        unrounded
            Codes with ``bits`` fraction bits, half a code added, shape (n,): see ``Output.shaping_input``.

        Returns
        -------
        Ints
            Codes, shape (n,).
        """
        bits, half, mask = self._bits, 1 << (self._bits - 1), (1 << self._bits) - 1
        feedback = self._shaping.feedback
        e1, e2, e3 = self.last
        codes = []
        for value in unrounded.tolist():
            total = value + feedback(e1, e2, e3)
            e1, e2, e3 = (total & mask) - half, e1, e2
            codes.append(total >> bits)
        self.last = e1, e2, e3
        return np.array(codes, dtype=np.int64)
