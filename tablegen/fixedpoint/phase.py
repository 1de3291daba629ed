"""Coherent rational phase: phase k of a line of L ticks is exactly floor(k 2^32 / L), without a multiplier."""

import numpy as np
from msgspec import Struct

from tablegen.numerics.arrays import Ints

PHASE_BITS = 32
MAXIMUM_TICKS = (1 << 31) - 1


class RationalPhase(Struct, frozen=True):
    """The phase of a period of ``ticks`` advances, 1 <= ticks <= 2^31 - 1: ticks, or lines of a stepped axis.

    The device adds ``step`` at every advance, and 1 more whenever the remainder, which grows by ``remainder``
    modulo ``ticks``, wraps. After ``ticks`` ticks both are back at 0, so that there is no drift.
    """

    ticks: int

    def __post_init__(self) -> None:
        if not 1 <= self.ticks <= MAXIMUM_TICKS:
            raise ValueError(f"{self.ticks} ticks are outside 1..{MAXIMUM_TICKS}")

    @property
    def step(self) -> int:
        """The integer step floor(2^32 / L); 32 bits for L >= 2."""
        return (1 << PHASE_BITS) // self.ticks

    @property
    def remainder(self) -> int:
        """The remainder 2^32 mod L."""
        return (1 << PHASE_BITS) % self.ticks

    def at(self, k: Ints) -> Ints:
        """Return floor(k 2^32 / L); k < 2^31, hence k 2^32 < 2^63.

        Parameters
        ----------
        k
            Advances in [0, L), any shape.

        Returns
        -------
        Ints
            Phases in [0, 2^32), shape of ``k``.
        """
        return (np.asarray(k, dtype=np.int64) << PHASE_BITS) // self.ticks
