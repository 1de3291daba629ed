"""The shape of a table: the mode that plays it, how many words it has, and how wide they are."""

from msgspec import Struct

from tablegen.config.schema import MAXIMUM_SPLINE_BITS, MAXIMUM_SPLINE_LENGTH
from tablegen.fixedpoint.program import Mode

MODES: tuple[Mode, ...] = ("direct", "interpolated", "cubic")  # from the simplest to play
LEAST_BITS = 8
MOST_BITS: dict[Mode, int] = {"direct": 24, "interpolated": 24, "cubic": MAXIMUM_SPLINE_BITS}
LEAST_LENGTH = 8  # of what every device renders and plays
MOST_LENGTH: dict[Mode, int] = {"direct": 1 << 16, "interpolated": 1 << 16, "cubic": MAXIMUM_SPLINE_LENGTH}


class TableShape(Struct, frozen=True):
    """A table of ``length`` words of ``bits`` bits, played in a ``mode``."""

    mode: Mode
    length: int
    bits: int

    @property
    def memory_bits(self) -> int:
        """The bits of all words, packed."""
        return self.length * self.bits

    @property
    def order(self) -> tuple[int, int, int, int]:
        """The sort key: memory, then how simple the mode is to play, then the length."""
        return self.memory_bits, MODES.index(self.mode), self.length, self.bits

    def __str__(self) -> str:
        return f"{self.length} words of {self.bits} bits, {self.mode}"
