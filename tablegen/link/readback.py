"""The readback of the image that plays, with several requests on their way at a time."""

import struct
from dataclasses import dataclass

from tablegen.link.claims import PROGRAM_BYTES, check_length, most_bytes
from tablegen.link.errors import LinkLost, NotUnderstood, OutOfTime, Silent
from tablegen.link.exchange import Answer
from tablegen.link.frames import MAXIMUM_FRAME
from tablegen.link.messages import DATA_BYTES, Reason, Request
from tablegen.link.pace import Deadline, back_off
from tablegen.link.refusal_reasons import refused
from tablegen.link.session import LinkSession, SessionEnded

_REQUEST = struct.Struct("<IB")
_OFFSET = struct.Struct("<I")
_MAX_IN_VAIN = 8  # rounds of requests without one answer
_MAX_RESTARTS = 4


@dataclass(frozen=True, slots=True)
class Reading:
    """The pieces of an image by their offset, and the bytes that no image of the device exceeds."""

    pieces: dict[int, bytes]
    most: int

    @property
    def end(self) -> int | None:
        """The bytes of the image: the first piece that is short is its last; None where none was short so far."""
        ends = [at + len(piece) for at, piece in self.pieces.items() if len(piece) < DATA_BYTES]
        return min(ends, default=None)

    def missing(self) -> list[int]:
        """Return the offsets that were not answered, up to the end or just beyond all that an image may have."""
        end = self.most + 1 if self.end is None else self.end
        return [at for at in range(0, end, DATA_BYTES) if at not in self.pieces]

    def image(self) -> bytes:
        """Join the pieces.

        Raises
        ------
        NotUnderstood
            If they make no image.
        """
        last = max(self.pieces)
        end = last + len(self.pieces[last]) if self.end is None else self.end
        if end > self.most:
            raise NotUnderstood(
                f"READBACK: {len(self.pieces[last])} bytes at offset {last}; by the widths in HELLO no image has more "
                f"than {self.most}"
            )
        for at, piece in self.pieces.items():
            if at > end and piece:
                raise NotUnderstood(f"READBACK: {len(piece)} bytes at offset {at}, though the image ended at {end}")
        if end < PROGRAM_BYTES:
            raise NotUnderstood(f"READBACK: the image has {end} bytes; possible: {PROGRAM_BYTES} to {self.most}")
        return b"".join(self.pieces[at] for at in sorted(self.pieces))[:end]


def read_back(session: LinkSession, deadline: Deadline) -> Reading:
    """Read all pieces; the caller checks whether the scan changed meanwhile.

    Raises
    ------
    Refused
        If the device does not hold the image.
    LinkLost, OutOfTime
        If the device is gone, or takes too long.
    """
    return _ImageReader(session, deadline).read()


class _ImageReader:
    """The pieces of an image that have come, and the requests that may still be answered, however late."""

    def __init__(self, session: LinkSession, deadline: Deadline) -> None:
        self._session, self._until = session, deadline
        self._reading = Reading({}, most_bytes(session.info))
        self._pieces = self._reading.pieces
        self._offsets: dict[int, int] = {}  # offsets by seq
        self._window = session.info.window
        self._in_vain = 0

    def read(self) -> Reading:
        """Read all pieces, up to the first that is short.

        Raises
        ------
        LinkLost, OutOfTime
            If the device is gone, or takes too long.
        """
        restarts = 0
        while missing := self._reading.missing():
            if self._session.now() >= self._deadline:
                raise self._out_of_time()
            try:
                self._some(missing[: self._window])
            except Silent:
                raise
            except LinkLost as loss:
                self._session.reopen(self._deadline, loss)
                self._offsets.clear()
            except SessionEnded:
                restarts += 1
                if restarts > _MAX_RESTARTS:
                    raise self._session.contested() from None
                self._session.greet(self._deadline, new_session=True)
                self._offsets.clear()
        return self._reading

    @property
    def _deadline(self) -> float:
        return self._until.at

    def _out_of_time(self) -> OutOfTime:
        exchange = self._session.exchange
        slow = exchange.pace.slow_baud(exchange.transport.baud)
        why = f"the line is slow, answers come at about {slow} baud: give --baud {slow}" if slow else "it takes long"
        have = sum(map(len, self._pieces.values()))
        return OutOfTime(f"timeout: {have} bytes of the image were read; {why}, or increase --timeout")

    def _some(self, offsets: list[int]) -> None:
        """Read some pieces at once; reduce the window if some of them did not come."""
        exchange = self._session.exchange
        now = due = exchange.now()
        for count, at in enumerate(offsets):
            seq = exchange.seq()
            ahead = count * MAXIMUM_FRAME  # bytes of answers
            due = exchange.send(
                Request.READBACK, seq, _REQUEST.pack(at, DATA_BYTES), ahead + 4 + DATA_BYTES, self._in_vain > 0
            )
            self._offsets[seq] = at
        until = min(now + back_off(due - now, self._in_vain), self._deadline)
        any_answer = False
        while exchange.now() < until and not all(at in self._pieces for at in offsets):
            for answer in exchange.receive(until):
                any_answer = self._take(answer) or any_answer
        if not all(at in self._pieces for at in offsets):
            self._window = max(self._window // 2, 1)
        self._in_vain = 0 if any_answer else self._in_vain + 1
        if self._in_vain >= _MAX_IN_VAIN:
            raise self._session.silent()

    def _take(self, answer: Answer) -> bool:
        """Store the piece of an answer; return True if it belongs to one of the requests."""
        if answer.kind != Request.READBACK or answer.seq not in self._offsets:
            return False
        at = self._offsets.pop(answer.seq)
        if answer.reason == Reason.SESSION:
            raise SessionEnded
        if answer.reason:
            raise refused(answer.kind, answer.reason, answer.detail, self._session.info)
        self._pieces[at] = _piece(answer.payload, at)
        return True


def _piece(payload: bytes, at: int) -> bytes:
    check_length("READBACK", payload, _OFFSET.size)
    (offset,) = _OFFSET.unpack_from(payload)
    if offset != at:
        raise NotUnderstood(f"READBACK: offset is {offset} in the answer to a request for {at}")
    return payload[_OFFSET.size :]
