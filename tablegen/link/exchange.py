"""The exchange of requests and answers on one port and in one session: framing, numbering, and waits."""

from collections import deque
from dataclasses import dataclass
from random import Random

from tablegen.link.errors import NotUnderstood
from tablegen.link.frames import MAXIMUM_FRAME, Frame, FrameReader
from tablegen.link.messages import ANSWER, REFUSAL, Refusal, Request
from tablegen.link.pace import Pace
from tablegen.link.transport import Transport

_FRAME_END = b"\0"  # in front of a frame, it ends a frame that noise began
_ANSWERED_AT_LINE_START = (Request.COMMIT, Request.ABORT, Request.MOVE)  # their answers tell nothing about the latency
_COUNTED_FRAMES = 40  # the last requests, of which the lost ones are counted
_MIN_LOST_FRAMES = 4  # fewer say nothing about a line
_MAX_ON_WAY = 255  # a seq has 8 bits


@dataclass(slots=True)
class Answer:
    """The answer to a request: its ``payload``, or the ``reason`` and ``detail`` of a refusal.

    ``lost`` are type and seq of the requests that were sent before it and are lost, since a line keeps the order.
    """

    kind: int
    seq: int
    payload: bytes
    reason: int = 0
    detail: int = 0
    lost: tuple[tuple[int, int], ...] = ()


class Exchange:
    """The frames of one session on one port: it sends requests and sorts answers, and repeats nothing by itself.

    Requests that act are numbered apart from the others: so many uploads may lie between two of them.
    """

    def __init__(self, transport: Transport, latency_s: float, random: Random) -> None:
        self.transport = transport
        self.session = 0
        self.pace = Pace(latency_s)
        self._random = random
        self._reader = FrameReader()
        self._free = random.randrange(256)
        self._number = random.randrange(256)
        self._strange_bytes = self._bad_before = 0  # bytes since the last frame; bad frames up to the last answer
        self._on_way: list[tuple[int, int]] = []  # requests without an answer, in the order in which they were sent
        self._outcomes: deque[bool] = deque(maxlen=_COUNTED_FRAMES)  # of the last requests: True if answered
        self.bytes_sent = 0
        self.new_session()

    def use(self, transport: Transport) -> None:
        """Go on with another port, in the same session."""
        self.transport = transport
        self._reader = FrameReader()
        self._strange_bytes = self._bad_before = 0
        self._on_way.clear()
        self.pace.forget()

    @property
    def noise(self) -> bool:
        """True if bytes that are no frames have come since the last answer."""
        return self._reader.bad_frames > self._bad_before or self._strange_bytes > MAXIMUM_FRAME

    @property
    def bad_line(self) -> str | None:
        """Say that the line damages frames, and what to do, if it lost many before the last answer; else None."""
        lost = self._outcomes.count(False)
        if lost < _MIN_LOST_FRAMES:
            return None
        return (
            f"the line damages or loses frames, {lost} of the last {len(self._outcomes)} before the last answer: "
            "shorten or shield the cable, connect the grounds, or lower the baud rate at both ends"
        )

    def new_session(self) -> None:
        """Choose another session; HELLO tells the device."""
        self.session = self._random.randrange(1, 1 << 32)

    def now(self) -> float:
        """Return the time by the clock of the port."""
        return self.transport.now()

    def seq(self) -> int:
        """Return the next ``seq`` of requests that do not act."""
        self._free = (self._free + 1) % 256
        return self._free

    def number(self) -> int:
        """Return the next ``seq`` of requests that act."""
        self._number = (self._number + 1) % 256
        return self._number

    def send(self, kind: int, seq: int, payload: bytes = b"", answer_bytes: int = 16, again: bool = False) -> float:
        """Send a request; returns when its answer, of so many bytes of payload at most, should have come."""
        wire = Frame(kind, seq, self.session, payload).encode()
        if again:
            wire = _FRAME_END + wire
        self.transport.write(wire)
        self.bytes_sent += len(wire)
        if kind not in _ANSWERED_AT_LINE_START:
            self._on_way = [request for request in self._on_way if request != (kind, seq)][-_MAX_ON_WAY:]
            self._on_way.append((kind, seq))
        now, learn = self.now(), kind not in _ANSWERED_AT_LINE_START
        return now + self.pace.sent((kind, seq), now, self.transport.baud, (len(wire), answer_bytes), learn)

    def receive(self, until: float) -> list[Answer]:
        """Return the answers of this session that have come, or the first that come until then."""
        answers: list[Answer] = []
        while not answers:
            data = self.transport.read(max(until - self.now(), 0.0))
            frames = self._reader.feed(data)
            for frame in frames:
                answers += self._answer(frame)
            self._strange_bytes = 0 if frames else self._strange_bytes + len(data)
            if answers:
                self._bad_before = self._reader.bad_frames
            if self.now() >= until:
                break
        return answers

    def _answer(self, frame: Frame) -> list[Answer]:
        """Read an answer of this session; nothing where it is of another one, or an echo of a request."""
        if frame.session != self.session or not frame.type & ANSWER:
            return []
        answer = Answer(frame.type & ~ANSWER, frame.seq, frame.payload)
        if frame.type == REFUSAL:
            try:
                refusal = Refusal.unpack(frame.payload)
            except ValueError:
                return []
            if not refusal.reason:  # taken for a reason, it would say that the request was carried out
                raise NotUnderstood(f"a refusal of request {refusal.type}: reason is 0; possible: 1 to 255")
            answer = Answer(refusal.type, frame.seq, b"", refusal.reason, refusal.detail)
        self.pace.answered((answer.kind, answer.seq), self.now(), len(frame.payload))
        answer.lost = self._count_lost((answer.kind, answer.seq))
        return [answer]

    def _count_lost(self, answered: tuple[int, int]) -> tuple[tuple[int, int], ...]:
        """Count the requests that were sent before one that is answered as lost; return them."""
        if answered not in self._on_way:
            return ()
        lost = self._on_way[: self._on_way.index(answered)]
        del self._on_way[: len(lost) + 1]
        self._outcomes.extend([False] * len(lost) + [True])
        return tuple(lost)
