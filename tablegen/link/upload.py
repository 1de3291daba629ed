"""An upload: BEGIN, DATA within the device's window, and COMMIT, on their way at once, and repeated after a loss."""

import hashlib
import struct
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from tablegen.device.commit_mode import CommitMode
from tablegen.link.claims import check_length
from tablegen.link.data_size import DataSize
from tablegen.link.errors import LinkError, LinkLost, NotUnderstood, OutOfTime, Refused, Silent, Unsuitable
from tablegen.link.exchange import Answer
from tablegen.link.flight import Flight, SentFrame
from tablegen.link.messages import DATA_BYTES, NONCE_BYTES, DeviceStatus, Reason, Request, Upload
from tablegen.link.outcome import ProgressCall, UploadResult, UploadState, out_of_time, restart_count
from tablegen.link.pace import Deadline
from tablegen.link.refusal_reasons import Limits, lacks_mode, refused
from tablegen.link.session import LinkSession, SessionEnded

if TYPE_CHECKING:
    from tablegen.link.program_image import ProgramImage

_POLL_S = (0.03, 0.25)  # between two STATUS while a COMMIT is in progress: first, and at most
_BUSY_S = 0.05
_MAX_RESTARTS = 4  # restarts of an upload for the same reason
_MAX_KEY_RESTARTS = 2
_LAYOUT_REASONS = (Reason.SHAPE, Reason.LENGTH, Reason.HARMONICS)  # when the program words are complete
_CRC = struct.Struct("<I")
_COMMITTED = struct.Struct("<2I")


class Uploader:
    """An upload in a session, until it is active or has failed."""

    def __init__(
        self,
        session: LinkSession,
        image: "ProgramImage",
        deadline: Deadline,
        progress: ProgressCall | None,
        limits: Limits | None,
        swap: CommitMode = CommitMode.LINE,
    ) -> None:
        if why := lacks_mode(session.info, swap):
            raise Unsuitable([why])
        self._session, self._image, self._swap = session, image, swap
        self._exchange = session.exchange
        self._start, self._until = session.now(), deadline
        self._progress = progress
        self._limits = limits
        self._data_size = DataSize(min(session.info.data_bytes, DATA_BYTES))
        self._digest = hashlib.blake2s(image.data).digest() if session.needs_key(Request.COMMIT) else b""
        self._committed = False  # a COMMIT may have reached the device
        self._sent_to = 0  # bytes that were sent at least once
        self._resumed: int | None = None
        self._retransmissions = 0
        self._restarts: dict[int, int] = {}
        self._flight = Flight(session.info.window, self._start)
        self._before, self._restarts_before = session.status, session.restarts
        self._had = self._received(session.status)  # bytes that the device had before
        self._restart(session.status)

    def run(self) -> UploadResult:
        """Upload the image, and return the result.

        Raises
        ------
        LinkError
            If the device refuses it, is gone, or takes too long.
        """
        sent = self._exchange.bytes_sent
        while True:
            try:
                generation, line = self._attempt()
            except Silent:
                raise
            except LinkLost as loss:
                self._session.reopen(self._deadline, loss)
            except SessionEnded:
                self._count(Reason.SESSION, self._session.contested())
                self._session.greet(self._deadline, new_session=True)
            else:
                break
            self._restart(self._session.status)
            if self._in_force(self._session.status):
                generation, line = self._session.status.generation, None
                break
        return UploadResult(
            already_running=False,
            generation=generation,
            line=line,
            bytes=len(self._image.data),
            wire_bytes=self._exchange.bytes_sent - sent,
            resumed=self._resumed or 0,
            retransmissions=self._retransmissions,
            seconds=self._session.now() - self._start,
            slow_baud=self._slow_baud(),
            restarts=self._device_restarts,
        )

    @property
    def state(self) -> UploadState:
        """The progress of the upload."""
        return UploadState(self._confirmed, len(self._image.data), self._committed)

    @property
    def _deadline(self) -> float:
        return self._until.at

    def _slow_baud(self) -> int | None:
        return self._exchange.pace.slow_baud(self._exchange.transport.baud)

    # State of the device

    @property
    def _device_restarts(self) -> int:
        """The restarts of the device since the upload began."""
        return self._session.restarts - self._restarts_before

    def _received(self, status: DeviceStatus) -> int:
        """Return the bytes of this upload that the device has."""
        same = status.image_crc == self._image.info.image_crc and status.upload == Upload.RECEIVING
        return min(status.received, len(self._image.data)) if same else 0

    def _restart(self, status: DeviceStatus) -> None:
        """Start again after HELLO: nothing is on its way, and ``status`` has the bytes of the device."""
        self._flight.clear(self._session.now())
        self._begun = False  # BEGIN was answered
        self._pipelined = True  # DATA need not wait for that
        self._next, self._confirmed, self._round = self._received(status), 0, 0
        self._commit: SentFrame | None = None
        self._commit_body = b""
        self._nonce: bytes | None = None
        self._status: DeviceStatus | None = None  # last status since COMMIT, or since the device was busy
        self._asked_again = False  # the same COMMIT was sent though the scan is active
        self._poll_s = _POLL_S[0]
        self._poll_at = self._pause_until = 0.0
        self._busy = False  # BEGIN was refused as busy: STATUS comes before the next one

    def _in_force(self, status: DeviceStatus) -> bool:
        """Return True if this upload is active, and not an earlier one of the same scan."""
        same, before = status.hash == self._image.info.hash, self._before
        return self._committed and same and (before.hash, before.generation) != (status.hash, status.generation)

    def _count(self, reason: int, error: LinkError) -> None:
        """Count an error that may happen by chance, but not without end."""
        self._restarts[reason] = self._restarts.get(reason, 0) + 1
        if self._restarts[reason] > (_MAX_KEY_RESTARTS if reason == Reason.KEY else _MAX_RESTARTS):
            raise error

    # The loop

    def _attempt(self) -> tuple[int, int | None]:
        while True:
            now = self._session.now()
            if now >= self._deadline:
                raise self._out_of_time(now)
            self._overdue(now)
            self._fill(now)
            for answer in self._exchange.receive(self._wake()):
                if result := self._take(answer):
                    return result

    def _fill(self, now: float) -> None:
        """Send whatever may be on its way now."""
        size, flight = len(self._image.data), self._flight
        if now < self._pause_until:
            return
        while flight.has_room():
            if self._busy:
                if flight.has(Request.STATUS):
                    return
                self._send(Request.STATUS, b"", DeviceStatus.LAYOUT.size)
            elif not self._begun and not flight.has(Request.BEGIN):
                self._send(Request.BEGIN, self._image.info.pack())
            elif not self._begun and not self._pipelined:
                return
            elif self._next < size:
                self._send_data()
            elif self._digest and self._nonce is None and not flight.has(Request.CHALLENGE):
                flight.forget(Request.CHALLENGE)  # a new challenge replaces the nonce of the lost one
                self._send(Request.CHALLENGE, b"")  # as late as possible, since it expires
            elif self._commit is None and (self._nonce is not None or not self._digest):
                self._send_commit()
            elif self._poll_at and now >= self._poll_at and not flight.has(Request.STATUS):
                self._poll_at = 0.0
                self._send(Request.STATUS, b"", DeviceStatus.LAYOUT.size)
            else:
                return

    def _send(self, kind: Request, payload: bytes, answer_bytes: int = NONCE_BYTES) -> None:
        seq = self._exchange.seq()
        due = self._exchange.send(kind, seq, payload, answer_bytes, again=self._flight.in_vain > 0)
        self._flight.add(SentFrame(kind, seq, self._session.now(), due))

    def _send_data(self) -> None:
        offset = self._next
        data = self._image.data[offset : offset + self._data_size.next(self._flight.in_vain)]
        seq, end = self._exchange.seq(), offset + len(data)
        due = self._exchange.send(Request.DATA, seq, _CRC.pack(offset) + data, again=self._flight.in_vain > 0)
        self._flight.add(SentFrame(Request.DATA, seq, self._session.now(), due, self._round, end))
        self._retransmissions += offset < self._sent_to
        self._sent_to = max(self._sent_to, end)
        self._next = end

    def _send_commit(self) -> None:
        number = self._exchange.number()
        body = _CRC.pack(self._image.info.image_crc)
        if self._swap is not CommitMode.LINE:  # which devices without modes have too
            body += bytes([self._swap])
        if self._nonce is not None:
            body += self._session.tag_of(self._nonce, Request.COMMIT, number, body, self._digest)
        self._commit_body = body
        self._commit = SentFrame(Request.COMMIT, number, 0.0, 0.0, self._round)
        self._repeat_commit(again=False)

    def _repeat_commit(self, again: bool = True) -> None:
        """Send the same COMMIT again: a device that is at work, or is done, does not act twice."""
        assert self._commit is not None
        self._committed = True
        if not again:
            self._session.acts[Request.COMMIT] = None
        self._commit.due = self._exchange.send(Request.COMMIT, self._commit.seq, self._commit_body, again=again)
        self._commit.at = self._session.now()
        self._flight.add(self._commit)

    def _wake(self) -> float:
        """Return the time of the next action without an answer."""
        due = self._flight.next_due()
        times = [self._deadline] if due is None else [self._deadline, due]
        times += [at for at in (self._poll_at, self._pause_until) if at > self._session.now()]
        return min(times)

    def _overdue(self, now: float) -> None:
        """Take requests without an answer in time for lost, until their answers come."""
        for sent in self._flight.overdue(now):
            if sent.kind in (Request.COMMIT, Request.STATUS):
                self._poll_at = now
            elif sent.kind == Request.BEGIN:
                self._pipelined = False
            elif sent.kind == Request.DATA and sent.round == self._round and sent.end > self._confirmed:
                self._lost()
        if self._flight.is_silent(now):
            raise self._session.silent()
        self._go_on()

    def _go_on(self) -> None:
        """Send again what no request on its way could confirm."""
        if (
            self._begun
            and self._commit is None
            and self._confirmed < self._next
            and not self._flight.has(Request.DATA, self._round)
        ):
            self._go_back(self._confirmed)

    def _lost(self) -> None:
        self._flight.lost()
        self._go_back(self._confirmed)

    def _go_back(self, to: int) -> None:
        self._next = to
        self._round += 1

    # Answers

    def _take(self, answer: Answer) -> tuple[int, int | None] | None:
        sent = self._flight.take((answer.kind, answer.seq), self._session.now())
        if sent is None:
            if self._commit is None or (answer.kind, answer.seq) != (Request.COMMIT, self._commit.seq):
                return None
            sent = self._commit  # it was late, and STATUS had been asked
        if answer.reason in (Reason.SESSION, Reason.OLD):
            raise SessionEnded
        if sent.kind == Request.COMMIT:
            return self._take_commit(answer, sent)
        if answer.reason:
            self._take_refusal(answer, sent)
            return None
        if sent.kind == Request.STATUS:
            return self._take_status(self._session.status_of(answer.payload))
        if sent.kind == Request.CHALLENGE:
            self._nonce = answer.payload
            return None
        check_length(sent.kind.name, answer.payload, _CRC.size)
        (received,) = _CRC.unpack_from(answer.payload)
        if sent.kind == Request.BEGIN:
            self._take_begin(received)
        else:
            self._take_data(received, sent)
            self._data_size.learn(self._flight.lost_data(answer.lost, received))
        return None

    def _take_begin(self, received: int) -> None:
        if received > len(self._image.data):
            raise NotUnderstood(f"BEGIN: received is {received}; the image has {len(self._image.data)} bytes")
        self._begun = True
        if self._resumed is None:
            self._resumed = min(received, self._had)  # an answer that was lost, and DATA, may have come before this one
        if not self._pipelined:
            self._go_back(received)
        self._next = max(self._next, received)
        self._confirm(received, lower=True)

    def _take_data(self, received: int, sent: SentFrame) -> None:
        if not self._begun or received > len(self._image.data):
            self._pipelined = False  # BEGIN, or its answer, was lost
            if self._begun:  # it may belong to the upload before, but not again and again
                what = f"DATA: received is {received}; the image has {len(self._image.data)} bytes"
                self._count(Reason.LENGTH, NotUnderstood(what))
            return
        self._confirm(received)
        if received < sent.end and sent.round == self._round:
            self._lost()
        self._next = max(self._next, self._confirmed)
        self._go_on()

    def _confirm(self, received: int, lower: bool = False) -> None:
        if received > self._confirmed:
            self._flight.got_through()
        if received > self._confirmed or lower:
            self._confirmed = received
            if self._progress is not None:
                self._progress(received, len(self._image.data))

    def _take_commit(self, answer: Answer, sent: SentFrame) -> tuple[int, int | None] | None:
        if not answer.reason:
            self._confirm(len(self._image.data))
            check_length("COMMIT", answer.payload, _COMMITTED.size)
            generation, line = _COMMITTED.unpack_from(answer.payload)
            return generation, line
        # The number is used up, but for a wrong key.
        self._commit, self._nonce, self._poll_at = None, None, 0.0
        self._poll_s = _POLL_S[0]
        error = self._error(answer)
        if answer.reason == Reason.INCOMPLETE:
            received = answer.detail
            if received >= len(self._image.data):
                raise NotUnderstood(
                    f"COMMIT refused as incomplete: received is {received}; the image has {len(self._image.data)} bytes"
                )
            self._confirm(received, lower=True)
            if sent.round == self._round:
                self._go_back(received)
            self._next = max(self._next, received)
            self._go_on()
        elif answer.reason == Reason.BUSY:
            self._wait_for_others()
        elif answer.reason in (Reason.KEY, Reason.UPLOAD, Reason.IMAGE):
            self._count(answer.reason, error)
            self._begin_again()
        else:
            raise error
        return None

    def _take_refusal(self, answer: Answer, sent: SentFrame) -> None:
        error = self._error(answer)
        if sent.kind == Request.BEGIN and answer.reason == Reason.BUSY:
            self._wait_for_others()
        elif sent.kind == Request.DATA and answer.reason == Reason.UPLOAD:
            if self._commit is not None:  # COMMIT may have ended the upload, which STATUS and the same COMMIT tell
                self._next, self._poll_at = len(self._image.data), self._session.now()
            elif sent.round == self._round:
                self._count(answer.reason, error)
                self._begin_again()
        elif sent.kind == Request.DATA and answer.reason in _LAYOUT_REASONS and not self._begun:
            pass  # it belongs to the upload before
        else:
            raise error

    def _begin_again(self) -> None:
        """Send BEGIN, and wait for what it says before anything else is sent."""
        self._flight.forget(Request.BEGIN, Request.DATA)  # their answers belong to the upload before
        self._begun = self._pipelined = False
        self._go_back(0)

    def _wait_for_others(self) -> None:
        self._begin_again()
        self._busy = True
        self._pause_until = self._session.now() + _BUSY_S

    def _take_status(self, status: DeviceStatus) -> tuple[int, int | None] | None:
        now, self._status = self._session.now(), status
        at_work = status.upload in (Upload.CHECKING, Upload.WAITING)
        if self._commit is None:
            if self._in_force(status):
                return status.generation, None
            self._busy = self._busy and at_work
            self._pause_until = now + _BUSY_S if self._busy else 0.0
        elif at_work:
            self._poll_at = now + self._poll_s
            self._poll_s = min(2.0 * self._poll_s, _POLL_S[1])
        elif self._in_force(status) and self._asked_again:
            return status.generation, None
        else:
            self._asked_again = self._in_force(status)
            self._repeat_commit()  # it was lost, or its answer was
        return None

    # Errors

    def _error(self, answer: Answer) -> Refused:
        from tablegen.link.program_image import take_apart

        first, contents = self._image.first, None
        with suppress(ValueError):  # a damaged image is refused without its contents
            contents = take_apart(first.data, first.info.x, first.info.y)
        return refused(answer.kind, answer.reason, answer.detail, self._session.info, contents, self._limits)

    def _out_of_time(self, now: float) -> OutOfTime:
        silence_s = now - self._flight.last_answer_at
        received = 0 if self._status is None else self._received(self._status)
        ours = self._status is not None and self._status.image_crc == self._image.info.image_crc
        return out_of_time(
            replace(self.state, confirmed=max(self._confirmed, received)),
            self._status.upload if self._status is not None and ours else None,
            self._busy,
            silence_s,
            self._slow_baud(),
            self._causes(),
        )

    def _causes(self) -> list[str]:
        causes = [restart_count(self._device_restarts)] if self._device_restarts else []
        return causes + ([line] if (line := self._exchange.bad_line) else [])
