"""Requests out and answers in, on one port and in one session: framing, numbering, and how long to wait."""

from dataclasses import dataclass
from random import Random

from tablegen.link.frames import OVERHEAD, Frame, FrameReader
from tablegen.link.messages import ANSWER, REFUSAL, Refusal, Request
from tablegen.link.transport import Transport, byte_s

LATENCY_S = 0.016  # latency of a USB bridge, which forwards bytes 60 times a second
_DEVICE_DELAY_S = 0.02  # a device has other things to do
_LATENESS_MARGIN = 1.5
_FRAME_END = b"\0"  # in front of a frame, it ends a frame that noise began
_LATENESS_DECAY = 0.8  # factor per answer
_MAX_LATENESS_S = 0.25  # more is a stall, which says nothing of the next answer
_ANSWERED_AT_LINE_START = (Request.COMMIT, Request.ABORT)  # their answers tell nothing about the latency


@dataclass(slots=True)
class Answer:
    """What answers a request: ``payload`` of an answer, or of a refusal ``reason`` and ``detail``."""

    kind: int
    seq: int
    payload: bytes
    reason: int = 0
    detail: int = 0


class Exchange:
    """Sends requests and tells which answers belong to its session; it repeats nothing by itself.

    Requests that act are numbered apart from the others: so many uploads may lie between two of them.
    """

    def __init__(self, transport: Transport, latency_s: float, random: Random) -> None:
        self.transport = transport
        self.session = 0
        self._latency_s = latency_s
        self._random = random
        self._reader = FrameReader()
        self._free = random.randrange(256)
        self._number = random.randrange(256)
        self._line_free = 0.0  # when what was written has left
        self._expected: dict[tuple[int, int], float | None] = {}  # when; None: of what was sent twice nobody knows
        self._late_s = 0.0  # by which answers came later than line and latency explain: the most, fading
        self.bytes_sent = 0
        self.frames_heard = 0
        self.noise = False  # bytes came that are no frames
        self.new_session()

    def use(self, transport: Transport) -> None:
        """Go on with another port, in the same session."""
        self.transport = transport
        self._reader = FrameReader()
        self._line_free = 0.0
        self._expected.clear()

    def new_session(self) -> None:
        """Choose another session; HELLO tells the device."""
        self.session = self._random.randrange(1, 1 << 32)

    def now(self) -> float:
        """The clock of the port."""
        return self.transport.now()

    def seq(self) -> int:
        """For a request that does not act."""
        self._free = (self._free + 1) % 256
        return self._free

    def number(self) -> int:
        """For a request that acts."""
        self._number = (self._number + 1) % 256
        return self._number

    def send(self, kind: int, seq: int, payload: bytes = b"", answer_bytes: int = 16, again: bool = False) -> float:
        """Send a request; returns when its answer, of so many bytes of payload at most, should have come.

        What answers take longer than line and latency explain, a busy device or a way through a network, is learned.
        """
        wire = Frame(kind, seq, self.session, payload).encode()
        if again:
            wire = _FRAME_END + wire
        self.transport.write(wire)
        now, one = self.now(), byte_s(self.transport.baud)
        self._line_free = max(self._line_free, now) + one * len(wire)
        self.bytes_sent += len(wire)
        way = self._line_free - now + one * (answer_bytes + OVERHEAD) + self._latency_s
        if kind not in _ANSWERED_AT_LINE_START:
            self._expected[kind, seq] = None if (kind, seq) in self._expected else now + way
        return now + _LATENESS_MARGIN * (way + self._late_s) + _DEVICE_DELAY_S

    def receive(self, until: float) -> list[Answer]:
        """Answers of this session that have come, or come first until then."""
        found: list[Answer] = []
        while not found:
            left = until - self.now()
            data = self.transport.read(max(left, 0.0))
            for frame in self._reader.feed(data):
                found += self._answer(frame)
            self.noise = self.noise or self._reader.bad_frames > 0
            if not data and self.now() >= until:
                break
        return found

    def _answer(self, frame: Frame) -> list[Answer]:
        """An answer of this session; nothing where it is another's, or an echo of a request."""
        if frame.session != self.session or not frame.type & ANSWER:
            return []
        self.frames_heard += 1
        answer = Answer(frame.type & ~ANSWER, frame.seq, frame.payload)
        if frame.type == REFUSAL:
            try:
                refusal = Refusal.unpack(frame.payload)
            except ValueError:
                return []
            answer = Answer(refusal.type, frame.seq, b"", refusal.reason, refusal.detail)
        self._learn(answer)
        return [answer]

    def _learn(self, answer: Answer) -> None:
        expected = self._expected.pop((answer.kind, answer.seq), None)
        if expected is not None:
            late = min(self.now() - expected, _MAX_LATENESS_S)
            self._late_s = max(late, _LATENESS_DECAY * self._late_s)
