"""The programs that a device plays by number, from the side of the host: compiled ones, then its slots."""

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tablegen.device.commit_mode import CommitMode
from tablegen.link.claims import check_length, check_listing
from tablegen.link.errors import OutOfTime, Silent, Unsuitable
from tablegen.link.messages import DeviceStatus, Listing, Play, Request, Upload
from tablegen.link.outcome import PlayResult
from tablegen.link.refusal_reasons import lacks_mode, lacks_play

if TYPE_CHECKING:
    from tablegen.link.session import LinkSession

_TRIES = 8  # of a PLAY, and one for each second that it may take
_NUMBER = struct.Struct("<H")  # the payload of LIST
_TAKEN = struct.Struct("<2I")
_LONGEST = 255  # bytes of a name in an answer to LIST
_LOOK_S = 5.0  # time for a STATUS after a PLAY without an answer
_HASH_DIGITS = range(12, 65)  # digits of a hash that name a program


@dataclass(frozen=True, slots=True)
class DeviceProgram:
    """A program that a device plays by number.

    Attributes
    ----------
    number
        For ``Device.play``.
    name
        Of a compiled program; empty for a kept one.
    slot
        Of a kept program, or None.
    hash
        Of its plan, in hexadecimal, as the status has that of what plays.
    """

    number: int
    name: str
    slot: int | None
    hash: str


def read_programs(session: "LinkSession", deadline: float) -> tuple[DeviceProgram, ...]:
    """Ask a device for all programs that it plays by number.

    Raises
    ------
    Unsuitable
        If it plays none.
    """
    if why := lacks_play(session.info):
        raise Unsuitable([why])
    first = _ask(session, 0, deadline, None)
    programs = []
    for number in range(first.numbers):
        listing = first if number == 0 else _ask(session, number, deadline, first)
        if listing.content:
            slot = number - listing.compiled
            name, digest = listing.name.decode("ascii"), listing.hash.hex()
            programs.append(DeviceProgram(number, name, None if slot < 0 else slot, digest))
    return tuple(programs)


def named(programs: tuple[DeviceProgram, ...], name: str) -> DeviceProgram | None:
    """Return the first program that has this name, or a hash that begins with these 12 to 64 digits."""
    for program in programs:
        if name and (name == program.name or (len(name) in _HASH_DIGITS and program.hash.startswith(name))):
            return program
    return None


def play_number(session: "LinkSession", number: int, mode: CommitMode, timeout_s: float) -> PlayResult:
    """Let a device play a program of its own; return when it plays.

    Raises
    ------
    Unsuitable
        If the device plays no programs by number, or has no such mode; nothing was sent.
    Refused
        If it has no such program, or does not play it; the old one plays on.
    OutOfTime
        If the program is still checked, or waits.
    LinkLost
        If the device is gone.
    """
    if why := lacks_play(session.info) or lacks_mode(session.info, mode):
        raise Unsuitable([why])
    deadline = session.now() + timeout_s
    tries = _TRIES + int(timeout_s)
    payload = Play(number, mode).pack()
    try:
        answer = session.act(Request.PLAY, payload, _TAKEN.size, deadline, tries=tries, one_session=True)
    except Silent as silence:  # as it is until the program plays
        raise _out_of_time(session, mode) or silence from None
    check_length("PLAY", answer, _TAKEN.size)
    return PlayResult(*_TAKEN.unpack_from(answer))


def _out_of_time(session: "LinkSession", mode: CommitMode) -> OutOfTime | None:
    """Return the error where a program is still checked or waits; None where none is."""
    payload = session.ask(Request.STATUS, b"", DeviceStatus.LAYOUT.size, session.now() + _LOOK_S)
    upload = session.status_of(payload).upload
    if upload not in (Upload.CHECKING, Upload.WAITING):
        return None
    place = "a frame" if mode is CommitMode.FRAME else "a line"
    waits = "ended its checks" if upload == Upload.CHECKING else f"reached the start of {place}"
    return OutOfTime(
        f"timeout: the device has the program, but has not {waits}; it may still become active: see `tablegen status`, "
        "or increase --timeout"
    )


def _ask(session: "LinkSession", number: int, deadline: float, first: Listing | None) -> Listing:
    """Ask for a number; ``first`` is what the device said of number 0."""
    size = Listing.LAYOUT.size
    payload = session.ask(Request.LIST, _NUMBER.pack(number), size + _LONGEST, deadline)
    check_length("LIST", payload, size)
    check_length("LIST", payload, size + Listing.name_bytes(payload))
    listing = Listing.unpack(payload)
    check_listing(listing, first)
    return listing
