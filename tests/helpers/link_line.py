"""A serial line in virtual time between the client and a device: paced, late, and with faults from a seed."""

import heapq
import itertools
from collections.abc import Callable
from random import Random
from typing import Protocol

from link_faults import Chances, Spoiler, split

from tablegen.link.errors import LinkLost, NoPort

BYTE_BITS = 10
_STEP_S = 0.001  # the device plays at least as often
_NO_FAULTS = Chances()


class FarEnd(Protocol):
    """A device, or a model of one."""

    def receive(self, data: bytes) -> None:
        """Bytes that arrive."""

    def transmit(self) -> bytes:
        """Bytes that leave."""

    def tick(self, ticks: int) -> None:
        """It goes on for so many samples."""

    def reboot(self) -> None:
        """It starts again."""


class Line:
    """The wire, its far end, and the clock, which moves only while the client waits.

    ``baud`` paces both ways (None: bytes take no time); ``out_s`` and ``back_s`` are their latencies. What comes back
    arrives at multiples of ``batch_s``, as through a USB bridge. The device plays ``tick_hz`` samples a second. Faults
    are of ``chances`` and ``seed``; ``on_frame`` is called with every frame as it reaches the device, before it. The
    client is told ``told_baud`` where it is not the rate of the line.
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
        chances: Chances = _NO_FAULTS,
        seed: int = 0,
        on_frame: Callable[[bytes], None] | None = None,
        told_baud: int | None = None,
    ) -> None:
        self.device, self.baud, self.now_s = device, told_baud or baud, 0.0
        self.sent = 0  # bytes that the host wrote
        self.arrived = 0  # bytes that left the host's end by now, faults aside
        self.resets = self.opened = 0
        random = Random(seed)
        self.out = Spoiler(chances, random)
        self.back = Spoiler(chances, random)
        self._chances, self._on_frame = chances, on_frame
        self._out_s, self._back_s, self._batch_s, self._tick_hz = out_s, back_s, batch_s, tick_hz
        self._line_baud = baud
        self._ticks = 0
        self._out_free = self._back_free = 0.0  # when the wire is
        self._away_until = self._deaf_until = 0.0
        self._port: object = None  # the one that was opened last, until it vanishes
        self._order = itertools.count()
        self._to_device: list[tuple[float, int, bytes]] = []
        self._to_host: list[tuple[float, int, bytes]] = []

    @property
    def _byte_s(self) -> float:
        return BYTE_BITS / self._line_baud if self._line_baud else 0.0

    def open(self) -> "Port":
        """An opener for the client. Raises ``NoPort`` while the port is away."""
        if self.now_s < self._away_until:
            raise NoPort("the virtual port is away")
        self.opened += 1
        self._to_host.clear()
        port = Port(self)
        self._port = port
        return port

    def heal(self) -> None:
        """No more faults, but for what is on its way."""
        self._chances = _NO_FAULTS
        self.out.heal()
        self.back.heal()

    def sleep(self, seconds: float) -> None:
        """Time passes without the host."""
        end = self.now_s + seconds
        while self.now_s < end:
            self.advance(end)

    def is_open(self, port: "Port") -> bool:
        """Whether it is the one that was opened last, and has not gone."""
        return port is self._port

    def write(self, data: bytes) -> None:
        """From the host."""
        self.sent += len(data)
        for frame in split(data):
            if self.out.happens("vanish"):
                self._port, self._away_until = None, self.now_s + self._chances.away_s
                self._to_device.clear()
                return
            for delay, piece in self._spoil_out(frame):
                self._out_free = max(self._out_free, self.now_s) + self._byte_s * len(piece) + delay
                heapq.heappush(self._to_device, (self._out_free + self._out_s, next(self._order), piece))

    def arrived_for_host(self) -> bytes:
        """What has come by now."""
        found = b""
        while self._to_host and self._to_host[0][0] <= self.now_s:
            found += heapq.heappop(self._to_host)[2]
        return found

    def advance(self, end: float) -> None:
        """To the next thing that happens, at most to ``end``."""
        events = [queue[0][0] for queue in (self._to_device, self._to_host) if queue and queue[0][0] > self.now_s]
        self.now_s = max(self.now_s, min([end, self.now_s + _STEP_S, *events]))
        due = int(self.now_s * self._tick_hz) - self._ticks
        self._ticks += due
        self.device.tick(due)
        self._collect()
        while self._to_device and self._to_device[0][0] <= self.now_s:
            self._deliver(heapq.heappop(self._to_device)[2])
            self._collect()

    def _deliver(self, piece: bytes) -> None:
        self.arrived += len(piece)
        if self.now_s < self._deaf_until:
            return
        if self._on_frame is not None:
            self._on_frame(piece)
        self.device.receive(piece)
        if self.out.happens("reset"):
            self.device.reboot()
            self.resets += 1
            self._deaf_until = self.now_s + self._chances.deaf_s

    def _spoil_out(self, frame: bytes) -> list[tuple[float, bytes]]:
        return self.out.spoil(frame)

    def _spoil_back(self, frame: bytes) -> list[tuple[float, bytes]]:
        return self.back.spoil(frame)

    def _collect(self) -> None:
        data = self.device.transmit()
        if self._port is None:
            return  # nobody listens
        for frame in split(data):
            for delay, piece in self._spoil_back(frame):
                self._back_free = max(self._back_free, self.now_s) + self._byte_s * len(piece) + delay
                arrives = self._back_free + self._back_s
                if self._batch_s:
                    arrives = -(-arrives // self._batch_s) * self._batch_s
                heapq.heappush(self._to_host, (arrives, next(self._order), piece))


class Port:
    """The host's end: a ``tablegen.link.transport.Transport``."""

    def __init__(self, line: Line) -> None:
        self._line = line
        self.baud = line.baud

    def write(self, data: bytes) -> None:
        self._check()
        self._line.write(data)

    def read(self, timeout_s: float) -> bytes:
        end = self._line.now_s + timeout_s
        while True:
            self._check()
            found = self._line.arrived_for_host()
            if found or self._line.now_s >= end:
                return found
            self._line.advance(end)

    def close(self) -> None:
        """The line goes on."""

    def now(self) -> float:
        return self._line.now_s

    def _check(self) -> None:
        if not self._line.is_open(self):
            raise LinkLost("the virtual port disappeared")
