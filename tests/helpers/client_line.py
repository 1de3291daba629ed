"""A line and its port in one, for tests that spoil frames by a function of their own; and such functions."""

from collections.abc import Callable
from random import Random

from link_line import FarEnd, Line

from tablegen.link.errors import LinkLost, NoPort

Spoil = Callable[[bytes], list[bytes]]  # what becomes of a piece that ends in 0x00


def intact(piece: bytes) -> list[bytes]:
    """Nothing is spoilt."""
    return [piece]


class VirtualLine(Line):
    """A ``Line`` that is a ``Transport``: ``spoil_out`` and ``spoil_back`` act on its frames, in place of chance.

    ``there`` tells whether its port is. To open it again loses what was on its way.
    """

    def __init__(
        self, device: FarEnd, *, spoil_out: Spoil = intact, spoil_back: Spoil = intact, **options: object
    ) -> None:
        super().__init__(device, **options)  # type: ignore[arg-type]
        self.spoil_out, self.spoil_back = spoil_out, spoil_back
        self.there = True
        self._port = self

    def open(self) -> "VirtualLine":
        """An opener."""
        if not self.there:
            raise NoPort("the virtual port: cannot be opened: it is not there")
        self.opened += 1
        self._to_device.clear()
        self._to_host.clear()
        self._out_free = self._back_free = 0.0
        return self

    def write(self, data: bytes) -> None:
        self._check()
        super().write(data)

    def read(self, timeout_s: float) -> bytes:
        end = self.now_s + timeout_s
        while True:
            self._check()
            found = self.arrived_for_host()
            if found or self.now_s >= end:
                return found
            self.advance(end)

    def close(self) -> None:
        pass

    def now(self) -> float:
        return self.now_s

    def _spoil_out(self, frame: bytes) -> list[tuple[float, bytes]]:
        return [(0.0, piece) for piece in self.spoil_out(frame)]

    def _spoil_back(self, frame: bytes) -> list[tuple[float, bytes]]:
        return [(0.0, piece) for piece in self.spoil_back(frame)]

    def _check(self) -> None:
        if not self.there:
            raise LinkLost("the virtual port: the port disappeared")


class Noise:
    """Loses, damages, repeats and delays frames with a probability each, from a seed."""

    def __init__(self, random: Random, lose: float = 0.0, damage: float = 0.0, repeat: float = 0.0, swap: float = 0.0):
        self.random = random
        self.lose, self.damage, self.repeat, self.swap = lose, damage, repeat, swap
        self.spoilt = 0
        self._kept: bytes | None = None

    def __call__(self, piece: bytes) -> list[bytes]:
        found = [piece]
        if self.random.random() < self.lose:
            found = []
        elif self.random.random() < self.damage and len(piece) > 1:
            bad = bytearray(piece)
            bad[self.random.randrange(len(bad))] ^= 1 << self.random.randrange(8)
            found = [bytes(bad)]
        elif self.random.random() < self.repeat:
            found = [piece, piece]
        elif self._kept is None and self.random.random() < self.swap:
            self._kept, found = piece, []
        elif self._kept is not None:
            found, self._kept = [piece, self._kept], None
        self.spoilt += found != [piece]
        return found


class BadBytes:
    """Damages one byte of so many on average, from a seed."""

    def __init__(self, random: Random, one_of: int) -> None:
        self.random, self.one_of = random, one_of

    def __call__(self, piece: bytes) -> list[bytes]:
        damaged = bytearray(piece)
        for index in range(len(damaged)):
            if self.random.random() * self.one_of < 1.0:
                damaged[index] ^= 1 << self.random.randrange(8)
        return [bytes(damaged)]
