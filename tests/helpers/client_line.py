"""A serial line in virtual time between the client and a model of a device: paced, late, and spoilt where asked."""

import heapq
import itertools
from collections.abc import Callable, Iterator
from fractions import Fraction
from random import Random
from typing import Protocol

from tablegen.link.errors import LinkLost, NoPort

BITS_A_BYTE = 10
_STEP_S = 0.001  # the device plays at least as often
Spoil = Callable[[bytes], list[bytes]]  # what becomes of a piece that ends in 0x00


def intact(piece: bytes) -> list[bytes]:
    """Nothing is spoilt."""
    return [piece]


class FarEnd(Protocol):
    """A device, or a model of one."""

    def receive(self, data: bytes) -> None:
        """Bytes that arrive."""

    def transmit(self) -> bytes:
        """Bytes that leave."""

    def tick(self, ticks: int) -> None:
        """It goes on for so many samples."""


class VirtualLine:
    """A ``Transport`` whose clock only moves when the client waits.

    ``baud`` paces both ways; ``out_s`` and ``back_s`` is how long bytes are on their way; what comes back arrives at
    multiples of ``batch_s``, as through a USB bridge. ``spoil_out`` and ``spoil_back`` act on frames.
    """

    def __init__(
        self,
        device: FarEnd,
        *,
        baud: int | None = 115200,
        out_s: float = 0.001,
        back_s: float = 0.001,
        batch_s: float = 0.0,
        tick_hz: int = 20000,
        spoil_out: Spoil = intact,
        spoil_back: Spoil = intact,
    ) -> None:
        self.device, self.baud = device, baud
        self.spoil_out, self.spoil_back = spoil_out, spoil_back
        self.there = True  # whether the port is
        self.opened = 0
        self.sent = 0  # bytes that the host wrote
        self.first_byte_s: float | None = None
        self.last_byte_s = 0.0  # when the last one to the device had left
        self._out_s, self._back_s, self._batch_s, self._tick_hz = out_s, back_s, batch_s, tick_hz
        self._t = 0.0
        self._ticked = Fraction(0)
        self._out_free = self._back_free = 0.0
        self._order = itertools.count()
        self._to_device: list[tuple[float, int, bytes]] = []
        self._to_host: list[tuple[float, int, bytes]] = []

    # As the client sees it

    def open(self) -> "VirtualLine":
        """An opener; what was on its way has gone."""
        if not self.there:
            raise NoPort("the virtual port: cannot be opened: it is not there")
        self.opened += 1
        self._to_device.clear()
        self._to_host.clear()
        self._out_free = self._back_free = 0.0
        return self

    def write(self, data: bytes) -> None:
        self._check()
        self.sent += len(data)
        if self.first_byte_s is None:
            self.first_byte_s = self._t
        for piece in _pieces(data):
            for spoilt in self.spoil_out(piece):
                self._out_free = max(self._out_free, self._t) + self._byte_s * len(spoilt)
                heapq.heappush(self._to_device, (self._out_free + self._out_s, next(self._order), spoilt))
        self.last_byte_s = self._out_free

    def read(self, timeout_s: float) -> bytes:
        self._check()
        end = self._t + timeout_s
        while True:
            found = b""
            while self._to_host and self._to_host[0][0] <= self._t:
                found += heapq.heappop(self._to_host)[2]
            if found or self._t >= end:
                return found
            self._advance(end)
            self._check()

    def close(self) -> None:
        pass

    def now(self) -> float:
        return self._t

    def sleep(self, seconds: float) -> None:
        """Time passes without the host."""
        end = self._t + seconds
        while self._t < end:
            self._advance(end)

    # What happens

    @property
    def _byte_s(self) -> float:
        return BITS_A_BYTE / self.baud if self.baud else 0.0

    def _check(self) -> None:
        if not self.there:
            raise LinkLost("the virtual port: the port disappeared")

    def _advance(self, end: float) -> None:
        """To the next thing that happens, at most to ``end``."""
        events = [queue[0][0] for queue in (self._to_device, self._to_host) if queue and queue[0][0] > self._t]
        self._t = min([end, self._t + _STEP_S, *events])
        due = Fraction(self._t) * self._tick_hz - self._ticked
        if due >= 1:
            self.device.tick(int(due))
            self._ticked += int(due)
        while self._to_device and self._to_device[0][0] <= self._t:
            self.device.receive(heapq.heappop(self._to_device)[2])
            self._collect()
        self._collect()

    def _collect(self) -> None:
        for piece in _pieces(self.device.transmit()):
            for spoilt in self.spoil_back(piece):
                self._back_free = max(self._back_free, self._t) + self._byte_s * len(spoilt)
                arrives = self._back_free + self._back_s
                if self._batch_s:
                    arrives = -(-arrives // self._batch_s) * self._batch_s
                heapq.heappush(self._to_host, (arrives, next(self._order), spoilt))


def _pieces(data: bytes) -> Iterator[bytes]:
    """Up to each 0x00; what follows the last one too."""
    at = 0
    while at < len(data):
        end = data.find(b"\0", at) + 1 or len(data)
        yield data[at:end]
        at = end


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
