"""Requests on their way: their number, their time-outs, and the answers that still count."""

from collections.abc import Iterable
from dataclasses import dataclass

from tablegen.link.messages import Request
from tablegen.link.pace import back_off

_MIN_SILENCE_S = 5.0  # silence before a device counts as lost, if longer than some waits
_SILENCE_WAITS = 16
_ANSWERED_IN_ORDER = (Request.BEGIN, Request.DATA, Request.CHALLENGE)

Key = tuple[int, int]  # type and seq


@dataclass(slots=True)
class SentFrame:
    """A request on its way, and its time; ``end`` is that of the bytes of a DATA, which belongs to a ``round``."""

    kind: Request
    seq: int
    at: float
    due: float
    round: int = 0
    end: int = 0


class Flight:
    """The requests on their way, at most ``window``: fewer after a loss, more again after two windows without one."""

    def __init__(self, window: int, now: float) -> None:
        self._most = self._allowed = window
        self._through = 0
        self.clear(now)

    def clear(self, now: float) -> None:
        """Empty the flight: nothing is on its way, and no answer is awaited."""
        self._on_way: dict[Key, SentFrame] = {}
        self._late: dict[Key, SentFrame] = {}  # overdue requests, whose answers may still come
        self._longest_wait = 0.0
        self.last_answer_at = self._in_order_at = now
        self.in_vain = 0

    def has_room(self) -> bool:
        """Return True if one more request may be sent."""
        return len(self._on_way) < self._allowed

    def has(self, kind: Request, of_round: int | None = None) -> bool:
        """Return True if a request of this type, of this round, is on its way."""
        return any(s.kind == kind and of_round in (None, s.round) for s in self._on_way.values())

    def add(self, sent: SentFrame) -> None:
        """Add a frame that was sent; each wait in vain doubles the next."""
        wait = sent.due - sent.at
        self._longest_wait = max(self._longest_wait, wait)
        sent.due = sent.at + back_off(wait, self.in_vain)
        self._late.pop((sent.kind, sent.seq), None)
        self._on_way[sent.kind, sent.seq] = sent

    def take(self, key: Key, now: float) -> SentFrame | None:
        """Remove and return the frame of an answer, late ones too; None without one, or where it was answered already.

        A line keeps the order, so that what was sent before it and is not answered was lost.
        """
        self.last_answer_at, self.in_vain = now, 0
        if key[0] in _ANSWERED_IN_ORDER:
            self._in_order_at = now
        if key not in self._on_way:
            return self._late.pop(key, None)
        for before in list(self._on_way):
            if before == key:
                break
            if before[0] in _ANSWERED_IN_ORDER:
                self._late[before] = self._on_way.pop(before)
        return self._on_way.pop(key)

    def lost_data(self, unanswered: Iterable[Key], received: int) -> int:
        """Return how many of these DATA did not arrive: of the others the answer was lost."""
        sent = [self._late[key] for key in unanswered if key in self._late]
        return sum(one.kind == Request.DATA and one.end > received for one in sent)

    def forget(self, *kinds: Request) -> None:
        """Drop requests of these types: their answers count no more."""
        for one in (self._on_way, self._late):
            for key in [key for key, sent in one.items() if sent.kind in kinds]:
                del one[key]

    def next_due(self) -> float | None:
        """Return the time at which the first request is overdue; None if there is none."""
        return min((self._due(sent) for sent in self._on_way.values()), default=None)

    def _due(self, sent: SentFrame) -> float:
        """Return the time at which a request is overdue.

        While answers come in order, a line is slow, and has lost nothing: the next request has half its wait again.
        """
        if sent.kind not in _ANSWERED_IN_ORDER or self._in_order_at <= sent.at:
            return sent.due
        return max(sent.due, self._in_order_at + (sent.due - sent.at) / 2.0)

    def overdue(self, now: float) -> list[SentFrame]:
        """Take away what is not answered in time; where nothing was heard since, that is all that is on its way."""
        late = [sent for sent in self._on_way.values() if self._due(sent) <= now]
        if any(sent.at >= self.last_answer_at for sent in late):
            self.in_vain += 1
            late = list(self._on_way.values())
        for sent in late:
            self._late[sent.kind, sent.seq] = self._on_way.pop((sent.kind, sent.seq))
        return late

    def is_silent(self, now: float) -> bool:
        """Return True if no answer has come for so long, in spite of several tries, that the device is lost."""
        return self.in_vain > 1 and now - self.last_answer_at > max(_MIN_SILENCE_S, _SILENCE_WAITS * self._longest_wait)

    def got_through(self) -> None:
        """Count a frame that has arrived; after twice as many as may be on their way, one more may."""
        self._through += 1
        if self._through >= 2 * self._allowed:
            self._through, self._allowed = 0, min(self._allowed + 1, self._most)

    def lost(self) -> None:
        """Count a lost frame: half as many may be on their way, so that buffers do not overflow again.

        The second of two shows that the first was lost. Where nothing is heard at all, one remains.
        """
        fewest = 1 if self.in_vain > 1 else min(2, self._most)
        self._through, self._allowed = 0, max(self._allowed // 2, fewest)
