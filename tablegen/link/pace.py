"""The time that answers take: by line and latency, and by the lateness of the answers so far."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from tablegen.link.frames import OVERHEAD
from tablegen.link.transport import byte_s

LATENCY_S = 0.016  # latency of a USB bridge, which forwards bytes 60 times a second
_DEVICE_DELAY_S = 0.02  # delay of a device that is busy with other tasks
_MARGIN = 1.5
_DECAY = 0.8  # factor of the lateness at each answer
_SPACINGS = 32  # answers from which the rate of the line is estimated
_MIN_SPACINGS = 8
_SPACED_BYTES = 100  # bytes of a frame that shows a rate; for smaller ones latency dominates
_MIN_SLOWER = 2.0  # a line so many times slower than its rate is called slow
_MIN_BACK_OFF_S = 1.0  # waits double at least up to this
_MAX_BACK_OFF = 4  # or up to so many times the first wait


@dataclass(frozen=True, slots=True)
class _Mark:
    """A request that was sent: its time, its end in the count of all bytes, and the expected time of its answer."""

    at: float
    end: int
    expected: float


class Pace:
    """The pace of a link, estimated from the answers that come.

    The lateness of an answer is the time beyond what line and latency explain. Waits allow for the largest, without a
    cap; it decays as other answers come. Only requests that were sent once count (Karn's algorithm).
    """

    def __init__(self, latency_s: float) -> None:
        self._latency_s = latency_s
        self._line_free = 0.0  # time at which the written bytes have left
        self._marks: dict[tuple[int, int], _Mark | None] = {}
        self._sent = self._answered = 0  # bytes sent, and those up to the request that was answered last
        self._answered_at = 0.0
        self._spacings: deque[float] = deque(maxlen=_SPACINGS)  # seconds per byte
        self.late_s = 0.0  # largest lateness, which decays

    def forget(self) -> None:
        """Drop all requests on their way: the port is another one, and they will not be answered."""
        self._marks.clear()
        self._line_free = 0.0

    def sent(self, key: tuple[int, int], now: float, baud: int | None, sizes: tuple[int, int], learn: bool) -> float:
        """Record that a request leaves, and return how long to wait for its answer.

        ``key`` is its type and seq, ``sizes`` the bytes of the request on the wire and of the answer's payload.
        ``learn`` is false where the answer's time says nothing about the way.
        """
        request, answer = sizes[0], sizes[1] + OVERHEAD
        one = byte_s(baud)
        self._line_free = max(self._line_free, now) + one * request
        self._sent += request
        way = self._line_free - now + one * answer + self._latency_s
        if learn:
            self._marks[key] = None if key in self._marks else _Mark(now, self._sent, now + way)
        return _MARGIN * (way + self.late_s) + _DEVICE_DELAY_S

    def answered(self, key: tuple[int, int], now: float, answer_bytes: int) -> None:
        """Record that an answer of so many bytes of payload has come."""
        mark = self._marks.pop(key, None)
        if mark is None:
            return
        self.late_s = max(now - mark.expected, _DECAY * self.late_s)
        between = mark.end - self._answered
        if between <= 0:
            return
        transfer = max(between, answer_bytes + OVERHEAD)
        # Only a request that was under way when the one before was answered shows the rate.
        if mark.at < self._answered_at and transfer >= _SPACED_BYTES:
            self._spacings.append((now - self._answered_at) / transfer)
        self._answered, self._answered_at = mark.end, now

    def slow_baud(self, baud: int | None) -> int | None:
        """Return about the rate of the answers in bit/s where it is far below ``baud``, else None.

        Most answers through a long way follow each other closely. So the quarter of the answers with the shortest
        spacing decides.
        """
        if baud is None or len(self._spacings) < _MIN_SPACINGS:
            return None
        spacing = sorted(self._spacings)[len(self._spacings) // 4]
        slower = spacing / byte_s(baud)
        if slower < _MIN_SLOWER:
            return None
        return int(float(f"{baud / slower:.2g}"))


class Deadline:
    """The end of the time for a transfer; the time may grow while the host learns how slow the link is.

    The largest result of ``allowed_s`` so far counts. Times are those of the port's clock, in seconds.
    """

    def __init__(self, start: float, allowed_s: Callable[[], float]) -> None:
        self._start, self._allowed_s, self._most_s = start, allowed_s, 0.0

    @property
    def at(self) -> float:
        """The time of the deadline in s."""
        self._most_s = max(self._most_s, self._allowed_s())
        return self._start + self._most_s


def back_off(wait_s: float, in_vain: int) -> float:
    """Return the wait after so many in vain: twice as long each time, up to a second or 4 times the first."""
    return min(wait_s * 2.0 ** min(in_vain, 60), max(_MIN_BACK_OFF_S, _MAX_BACK_OFF * wait_s))
