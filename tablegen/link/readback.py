"""The image of the program that plays, read out of a device: several requests on their way at a time."""

import struct

from tablegen.link.errors import LinkLost, NotUnderstood, OutOfTime, Silent
from tablegen.link.frames import MAXIMUM_FRAME
from tablegen.link.messages import DATA_BYTES, DeviceInfo, Reason, Request
from tablegen.link.reasons import refused
from tablegen.link.session import LinkSession

_REQUEST = struct.Struct("<IB")
_OFFSET = struct.Struct("<I")
_PROGRAM_BYTES = 192  # as tablegen.link.image has it, without numpy
_WORD_BYTES = 4  # at most, bytes per word


def read_back(session: LinkSession, deadline: float) -> bytes:
    """The whole image.

    Raises ``Refused`` where the device does not hold it, ``OutOfTime``, and what lines raise.
    """
    most = _most(session.info)
    parts: dict[int, bytes] = {}
    end, first = most, 0
    while first < end:
        wanted = range(first, end, DATA_BYTES)[: session.info.window]
        parts |= _some(session, wanted, deadline)
        for at in wanted:
            if len(parts[at]) < DATA_BYTES:
                end = min(end, at + len(parts[at]))
        first = wanted[-1] + DATA_BYTES
    return b"".join(parts[at] for at in sorted(parts))[:end]


def _most(info: DeviceInfo) -> int:
    """Bytes that no image exceeds: tables may be longer than what was uploaded for them."""
    tables = sum(_WORD_BYTES << axis.index_bits for axis in (info.x, info.y))
    return max(info.image_bytes, _PROGRAM_BYTES + tables)


def _some(session: LinkSession, wanted: range, deadline: float) -> dict[int, bytes]:
    """So many pieces at once, and what was lost of them one by one."""
    try:
        found = _at_once(session, wanted, deadline)
    except Silent:
        raise
    except LinkLost as lost:
        session.reopen(deadline, lost)
        found = {}
    for at in wanted:
        if at in found:
            continue
        if session.now() >= deadline:
            raise OutOfTime("timeout: reading back takes as long as an upload; increase --timeout")
        payload = session.ask(Request.READBACK, _REQUEST.pack(at, DATA_BYTES), 4 + DATA_BYTES, deadline)
        found[at] = _piece(payload, at)
    return found


def _at_once(session: LinkSession, wanted: range, deadline: float) -> dict[int, bytes]:
    """As far as they come."""
    exchange, found = session.exchange, dict[int, bytes]()
    waiting: dict[int, int] = {}
    until = session.now()
    for at in wanted:
        seq = exchange.seq()
        until = exchange.send(Request.READBACK, seq, _REQUEST.pack(at, DATA_BYTES), 16 + len(wanted) * MAXIMUM_FRAME)
        waiting[seq] = at
    until = min(until, deadline)
    while waiting and session.now() < until:
        for answer in exchange.receive(until):
            if answer.kind == Request.READBACK and answer.seq in waiting:
                at = waiting.pop(answer.seq)
                if not answer.reason:
                    found[at] = _piece(answer.payload, at)
                elif answer.reason != Reason.SESSION:  # `ask` begins a new session
                    raise refused(answer.kind, answer.reason, answer.detail, session.info)
    return found


def _piece(payload: bytes, at: int) -> bytes:
    if len(payload) < _OFFSET.size or _OFFSET.unpack_from(payload)[0] != at:
        raise NotUnderstood("READBACK of another offset")
    return payload[_OFFSET.size :]
