"""The kept programs of a device from the side of the host: what each slot has, and changes of it."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tablegen.link.claims import check_length, check_store
from tablegen.link.errors import LinkLost, Refused, Unsuitable
from tablegen.link.messages import (
    NO_SLOT,
    STORES_WHILE_PLAYING,
    DeviceStatus,
    Feature,
    ImageInfo,
    Request,
    SlotContent,
    StoreStatus,
)

if TYPE_CHECKING:
    from tablegen.link.session import LinkSession

CHANGE_S = 60.0  # time for a change: flash of large sectors is erased for seconds
_CHANGE_TRIES = 80  # of a request meanwhile, one a second


@dataclass(frozen=True, slots=True)
class Slot:
    """A slot of a device: its number, what it has, and the announcement of its program, if it has one."""

    number: int
    content: SlotContent
    image: ImageInfo | None


@dataclass(frozen=True, slots=True)
class KeptPrograms:
    """The programs that a device keeps.

    Attributes
    ----------
    slots
        All slots.
    selected
        Number of the slot whose program plays after a start; None for the program of the firmware.
    trial
        Number of the slot on trial, or None.
    started
        True if the trial was started: it is over at the next start unless it is confirmed.
    start
        Number of the slot with whose program the device started; None for the program of the firmware.
    reason
        Why it did not start with the program that was due: a ``Reason``, or 0.
    room
        Bytes of the longest program image that a slot can have.
    while_playing
        True if slots can be changed while a scan plays.
    """

    slots: tuple[Slot, ...]
    selected: int | None
    trial: int | None
    started: bool
    start: int | None
    reason: int
    room: int
    while_playing: bool

    def check(self, slot: int, image_bytes: int, playing: bool) -> None:
        """Check before an upload that its scan can be saved.

        Raises
        ------
        Unsuitable
            If there is no such slot, it is too small, or a scan plays and flash cannot be written meanwhile.
        """
        objections = []
        if slot >= len(self.slots):
            objections.append(f"there is no slot {slot}; the device has slots 0 to {len(self.slots) - 1}")
        if image_bytes > self.room:
            objections.append(f"the tables need {image_bytes} bytes; a slot has room for {self.room}")
        if playing and not self.while_playing:
            objections.append("the device cannot write its flash while a scan plays; `tablegen park --wait` first")
        if objections:
            raise Unsuitable(objections)


def read_kept(session: "LinkSession", deadline: float) -> KeptPrograms:
    """Ask a device for all of its slots.

    Raises
    ------
    Unsuitable
        If it keeps no programs.
    """
    require_store(session)
    status, _ = _ask(session, NO_SLOT, deadline)
    slots = []
    for number in range(status.slots):
        status, image = _ask(session, number, deadline)
        slots.append(Slot(number, SlotContent(status.content), image))
    selected, trial, start = (
        None if each == NO_SLOT else each for each in (status.selected, status.trial, status.start)
    )
    while_playing = bool(status.flags & STORES_WHILE_PLAYING)
    reason, room = status.reason, status.room
    return KeptPrograms(tuple(slots), selected, trial, bool(status.started), start, reason, room, while_playing)


def change_kept(session: "LinkSession", kind: Request, payload: bytes, deadline: float) -> None:
    """Send a request that changes what a device keeps.

    Raises
    ------
    Unsuitable
        If it keeps no programs.
    LinkLost
        If it restarts meanwhile, so that nobody knows whether the change was made.
    """
    require_store(session)
    session.ask(Request.STATUS, b"", DeviceStatus.LAYOUT.size, deadline)  # begins a session if it has restarted before
    restarts = session.restarts
    try:
        session.act(kind, payload, 0, deadline, tries=_CHANGE_TRIES)
    except Refused as refusal:
        if session.restarts == restarts:
            raise
        raise _restarted(kind) from refusal
    if session.restarts != restarts:
        raise _restarted(kind)


def require_store(session: "LinkSession") -> None:
    """Raise ``Unsuitable`` for a device that keeps no programs; nothing is sent."""
    if Feature.STORE not in session.info.features:
        what = "the device keeps no programs: its firmware was built without DAC_STORE, or without flash for it"
        raise Unsuitable([f"{what}; FPGAs keep none"])


def _restarted(kind: Request) -> LinkLost:
    return LinkLost(f"the device restarted during {kind.name}; `tablegen slots` tells whether it was carried out")


def _ask(session: "LinkSession", slot: int, deadline: float) -> tuple[StoreStatus, ImageInfo | None]:
    size = StoreStatus.LAYOUT.size
    payload = session.ask(Request.SLOT, bytes([slot]), size + ImageInfo.LAYOUT.size, deadline)
    check_length("SLOT", payload, size)
    status = StoreStatus.unpack(payload)
    check_store(status)
    if status.content != SlotContent.PROGRAM:
        return status, None
    check_length("SLOT", payload, size + ImageInfo.LAYOUT.size)
    return status, ImageInfo.unpack(payload[size:])
