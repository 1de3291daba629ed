"""A conversation with a device: HELLO, requests that are repeated until they are answered, ports that come back."""

import hashlib
from collections.abc import Callable
from dataclasses import replace
from random import Random

from tablegen.link.claims import check_device, check_length, check_status, check_unchanged, has_restarted
from tablegen.link.errors import LinkError, LinkLost, NoAnswer, NoPort, NotUnderstood, Refused, Silent
from tablegen.link.exchange import Answer, Exchange
from tablegen.link.messages import (
    NONCE_BYTES,
    TAG_BYTES,
    VERSION,
    DeviceInfo,
    DeviceStatus,
    Feature,
    Reason,
    Request,
    ZStatus,
)
from tablegen.link.outcome import restart_count
from tablegen.link.pace import back_off
from tablegen.link.refusal_reasons import keyless, refused
from tablegen.link.transport import Opener, Transport

HELLO_BYTES = DeviceInfo.LAYOUT.size + DeviceStatus.LAYOUT.size
_MAX_TRIES = 12  # tries of a request, the wait doubling: seconds, at usual rates
_MAX_RESTARTS = 4  # new sessions or challenges for one request
_REOPEN_INTERVAL_S = 0.25


class SessionEnded(Exception):
    """The end of a session: the device knows another one, or none, and the next request has to be HELLO. Internal."""


class LinkSession:
    """A session of a host with a device; requests end in an answer or an error before a deadline, a time of ``now``."""

    def __init__(
        self,
        transport: Transport,
        opener: Opener | None,
        key: bytes | None,
        latency_s: float,
        random: Random,
        sleep: Callable[[float], None],
    ) -> None:
        self.exchange = Exchange(transport, latency_s, random)
        self.key = key
        self.info: DeviceInfo
        self.status: DeviceStatus  # status at the last answer to HELLO
        self.status_at = 0.0
        self.restarts = 0  # restarts of the device since the first HELLO
        self.acts: dict[Request, None] = {}  # requests that act which were sent, in order, each once
        self._opener = opener
        self._sleep = sleep
        self._has_answered = False

    def now(self) -> float:
        """Return the time by the clock of the port."""
        return self.exchange.now()

    def close(self) -> None:
        """Give the port back."""
        self.exchange.transport.close()

    def hello(self, deadline: float, new_session: bool = False) -> None:
        """Send HELLO, and store ``info`` and ``status``; ``new_session`` begins another session."""
        if new_session:
            self.exchange.new_session()
        payload = self._repeat(Request.HELLO, None, bytes([VERSION]), HELLO_BYTES, deadline)
        size = DeviceInfo.LAYOUT.size
        check_length("HELLO", payload, HELLO_BYTES)
        info = DeviceInfo.unpack(payload)
        check_device(info)
        if self._has_answered:
            check_unchanged(self.info, info)
        self.info = info
        status = self.status_of(payload[size:], "HELLO")
        if self._has_answered and has_restarted(self.status, status):
            self.restarts += 1
        self.status, self.status_at = status, self.now()
        self._has_answered = True

    def status_of(self, payload: bytes, source: str = "STATUS") -> DeviceStatus:
        """Unpack a status that answered the request ``source``.

        Raises
        ------
        NotUnderstood
            If the status is impossible.
        """
        check_length(source, payload, DeviceStatus.LAYOUT.size)
        try:
            status = DeviceStatus.unpack(payload)
            if source == "STATUS" and self.info.z is not None:
                size = DeviceStatus.LAYOUT.size
                check_length(source, payload, size + ZStatus.LAYOUT.size)
                status = replace(status, z=ZStatus.unpack(payload[size:]))
        except ValueError as error:
            raise NotUnderstood(f"{source}: {error}") from None
        check_status(status, self.info, source)
        return status

    def greet(self, deadline: float, new_session: bool = False) -> None:
        """Send HELLO again, on a port that may have gone meanwhile.

        Raises
        ------
        LinkLost
            If the port does not come back before the deadline.
        """
        try:
            self.hello(deadline, new_session)
        except Silent:
            raise
        except LinkLost as loss:
            self.reopen(deadline, loss)

    def reopen(self, deadline: float, why: LinkLost) -> None:
        """Open a lost port again, and HELLO; repeat it until the deadline.

        Raises
        ------
        LinkLost
            ``why``, or what failed last.
        """
        if self._opener is None:
            raise why
        while True:
            self.close()
            if self.now() + _REOPEN_INTERVAL_S >= deadline:
                raise why
            self._sleep(_REOPEN_INTERVAL_S)
            try:
                self.exchange.use(self._opener())
                self._hello_patiently(deadline)
                return
            except (NoPort, LinkLost) as error:
                why = LinkLost(f"the link is lost: {error}")

    def _hello_patiently(self, deadline: float) -> None:
        """Repeat HELLO: some devices restart when their port is opened, and opening it again would not help."""
        while True:
            try:
                return self.hello(deadline)
            except Silent:
                if self.now() >= deadline:
                    raise

    def ask(self, kind: Request, payload: bytes, answer_bytes: int, deadline: float) -> bytes:
        """Send a request that does not act, and return the payload of its answer.

        Raises
        ------
        Refused
            If the device refuses the request.
        LinkLost
            If the device is gone, or does not answer before the deadline.
        """
        for _ in range(_MAX_RESTARTS):
            try:
                return self._repeat(kind, None, payload, answer_bytes, deadline)
            except Silent:
                raise
            except LinkLost as loss:
                self.reopen(deadline, loss)
            except Refused as refusal:
                if refusal.reason != Reason.SESSION:
                    raise
                self.greet(deadline, new_session=True)
        raise self.contested()

    def act(
        self,
        kind: Request,
        payload: bytes,
        answer_bytes: int,
        deadline: float,
        tagged: bool = True,
        tries: int = _MAX_TRIES,
        one_session: bool = False,
    ) -> bytes:
        """Send a request that acts, with a tag where the device needs one; it is carried out once.

        It is sent at most ``tries`` times without an answer; with ``one_session`` not in another session either, since
        the device may have restarted.

        Raises
        ------
        Refused
            If the device refuses the request.
        LinkLost
            If the device is gone, or does not answer before the deadline.
        """
        number, body = self.exchange.number(), None
        last: LinkError = self.contested()
        for _ in range(_MAX_RESTARTS):
            try:
                if body is None:
                    body = payload + (self.tag(kind, number, payload, deadline) if tagged else b"")
                self.acts[kind] = None
                return self._repeat(kind, number, body, answer_bytes, deadline, tries)
            except Silent:
                raise
            except LinkLost as loss:
                self.reopen(deadline, loss)  # with the same number and bytes a device that has acted only answers
            except Refused as refusal:
                if refusal.reason == Reason.KEY and self.key is not None:
                    last, body = refusal, None  # a repeated frame may have used up the challenge
                elif refusal.reason in (Reason.SESSION, Reason.OLD):
                    self.greet(deadline, new_session=True)
                    if one_session:
                        raise self.contested() from None
                    last, body = self.contested(), None
                else:
                    raise
        raise last

    def tag(self, kind: Request, number: int, payload: bytes, deadline: float) -> bytes:
        """Return the tag of a request, after a CHALLENGE; nothing for a device without a key."""
        if not self.needs_key(kind):
            return b""
        nonce = self.ask(Request.CHALLENGE, b"", NONCE_BYTES, deadline)
        return self.tag_of(nonce, kind, number, payload, b"")

    def needs_key(self, kind: Request) -> bool:
        """Return True if a request that acts needs a tag.

        Raises
        ------
        Refused
            If it does and there is no key.
        """
        if not self.info.features & Feature.KEY:
            return False
        if self.key is None:
            raise keyless(kind)
        return True

    def tag_of(self, nonce: bytes, kind: int, number: int, payload: bytes, digest: bytes) -> bytes:
        """Return the BLAKE2s tag of a request under the key; ``digest`` is that of the image, with COMMIT."""
        assert self.key is not None
        check_length("CHALLENGE", nonce, NONCE_BYTES)
        head = bytes([kind, number]) + self.exchange.session.to_bytes(4, "little")
        message = nonce[:NONCE_BYTES] + head + payload + digest
        return hashlib.blake2s(message, key=self.key, digest_size=TAG_BYTES).digest()

    def contested(self) -> LinkError:
        """Return the error where sessions do not last."""
        if self.restarts:
            return LinkLost(restart_count(self.restarts))
        return LinkLost("another program uses the device, or the device resets repeatedly; close the other program")

    def silent(self) -> LinkError:
        """Return the error where nobody answers."""
        if self._has_answered and (why := self.exchange.bad_line):
            return Silent(f"the device no longer answers; {why}")
        if self._has_answered and self.exchange.noise:
            return Silent(
                "the device no longer answers, and bytes come that are not its frames: does its console write to the "
                "same line, or did it restart with another baud rate?"
            )
        if self._has_answered:
            return Silent("the device no longer answers; is it still on?")
        if self.exchange.noise:
            why = "the received bytes are not frames of the device: is --baud the rate of the device?"
        else:
            why = "is it on, does its firmware include the link, are port and --baud right, are TX and RX crossed?"
        return NoAnswer(f"the port is open, but no device answers: {why}")

    def _repeat(
        self,
        kind: Request,
        number: int | None,
        payload: bytes,
        answer_bytes: int,
        deadline: float,
        tries: int = _MAX_TRIES,
    ) -> bytes:
        """Send a request until it is answered.

        A request that acts has its ``number``; any other has a new one each time, so that answers show the delay.

        Raises
        ------
        Refused
            If the device refuses the request.
        LinkLost, NoAnswer
            If no answer comes before the deadline.
        """
        sent = set()
        for count in range(tries):
            again = count > 0 or kind == Request.HELLO
            seq = self.exchange.seq() if number is None else number
            sent.add(seq)
            due = self.exchange.send(kind, seq, payload, answer_bytes, again)
            now = self.now()
            until = min(now + back_off(due - now, count), deadline)
            while self.now() < until:
                for answer in self.exchange.receive(until):
                    if answer.kind == kind and answer.seq in sent:
                        return self._payload(answer)
            if self.now() >= deadline:
                break
        raise self.silent()

    def _payload(self, answer: Answer) -> bytes:
        if answer.reason:
            info = self.info if self._has_answered else None
            raise refused(answer.kind, answer.reason, answer.detail, info)
        return answer.payload
