"""Kept programs through the C link: a device with a flash, what it plays after a start, and cuts of its power."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

from cut_flash import MODES, CutFlash
from link_device import CompiledProgram, DeviceLibrary, HostDevice
from link_programs import SmallScan, make_scan
from link_talk import Talk
from store_cuts import Kept, Step

from tablegen.link.messages import (
    NO_SLOT,
    REFUSAL,
    AxisLimits,
    DeviceStatus,
    Refusal,
    Request,
    StoreStatus,
)
from tablegen.link.store import Layout

LAYOUT = Layout(base=0, sector_bytes=256, place_sectors=3, slots=3)
FIRMWARE = make_scan(1)
SCANS = {number: make_scan(number + 1) for number in range(1, 6)}  # by the number of ``Kept``
COMPILED = tuple(
    CompiledProgram(f"scan_{number}".encode(), scan.digest.encode(), scan.program) for number, scan in SCANS.items()
)
HASHES = {bytes.fromhex(scan.digest): number for number, scan in SCANS.items()}
REQUESTS = {"save": Request.SAVE, "select": Request.SELECT, "try": Request.SELECT, "delete": Request.DELETE}
# Before each step the device starts.
SCRIPT: tuple[Step, ...] = (
    ("save", 0, 1), ("select", 0), ("save", 1, 2), ("try", 1), ("confirm",), ("save", 1, 3), ("try", 0), ("delete", 1),
)  # fmt: skip


def new_flash() -> CutFlash:
    """An empty flash."""
    return CutFlash(LAYOUT.place(LAYOUT.slots + 1), LAYOUT.sector_bytes)


@dataclass
class StoreDevice:
    """A device that has just started with a flash, and its host."""

    flash: CutFlash
    library: DeviceLibrary | None = None
    limits: tuple[AxisLimits, AxisLimits] | None = None
    key: bytes = b""
    while_playing: bool = False
    compiled: tuple[CompiledProgram, ...] = ()
    by_number: bool = False

    def __post_init__(self) -> None:
        program = FIRMWARE.program
        self.talk = Talk(key=self.key)
        self.device = HostDevice(
            program,
            program,
            library=self.library,
            limits=self.limits,
            key=self.key,
            flash=(self.flash, LAYOUT),
            stores_while_playing=self.while_playing,
            compiled=self.compiled,
            plays=self.by_number,
        )
        self._begin()

    def _begin(self) -> None:
        self.device.receive(self.talk.hello())
        self.device.tick(1000)  # parked
        self.device.transmit()

    def restart(self) -> None:
        """The supply comes back, or is switched off and on."""
        self.flash.power_up()
        self.device.reboot()
        self._begin()

    def ask(self, kind: int, payload: bytes = b"") -> bytes:
        """The answer to a request that does not act."""
        self.device.receive(self.talk.request(kind, payload))
        (answer,) = self.talk.answers(self.device.transmit())
        assert answer.type == kind | 0x80, Refusal.unpack(answer.payload)
        return answer.payload

    def act(self, kind: int, payload: bytes = b"") -> int:
        """Send a request that acts; the reason why it was refused, or 0."""
        nonce = self.ask(Request.CHALLENGE) if self.key else b""
        self.device.receive(self.talk.acting(kind, payload, nonce))
        (answer,) = self.talk.answers(self.device.transmit())
        return Refusal.unpack(answer.payload).reason if answer.type == REFUSAL else 0

    def upload(self, scan: SmallScan, fourier: bool = False) -> None:
        """A scan, until it plays."""
        image = scan.image(fourier)
        for wire in self.talk.upload(image):
            self.device.receive(wire)
        self.device.transmit()
        nonce = self.ask(Request.CHALLENGE) if self.key else b""
        self.device.receive(self.talk.commit(image, nonce))
        self.device.tick(1000)
        assert [answer.type for answer in self.talk.answers(self.device.transmit())] == [Request.COMMIT | 0x80]

    def status(self) -> DeviceStatus:
        """What it does."""
        return DeviceStatus.unpack(self.ask(Request.STATUS))

    def store(self, slot: int = NO_SLOT) -> StoreStatus:
        """What it keeps."""
        return StoreStatus.unpack(self.ask(Request.SLOT, bytes([slot])))

    def save(self, slot: int) -> int:
        """Keep what plays; the reason of a refusal, or 0."""
        return self.act(Request.SAVE, struct.pack("<BI", slot, self.status().generation))

    def take(self, step: Step, before: bool = False) -> int:
        """Take a step of a script, or what comes in front of its request."""
        name, *numbers = step
        if name == "save" and before:
            self.upload(SCANS[numbers[1]])
        if before:
            return 0
        if name == "save":
            return self.save(numbers[0])
        if name == "confirm":
            return self.act(Request.CONFIRM)
        return self.act(REQUESTS[name], bytes([numbers[0], *([name == "try"] if name != "delete" else [])]))

    def plays(self) -> int:
        """The number of the scan that plays, 0 of that of the firmware; all of its bytes are read back."""
        number = HASHES.get(self.status().hash, 0)
        if number:
            image = SCANS[number].image(False).data
            parts = [self.ask(Request.READBACK, struct.pack("<IB", at, 240)) for at in range(0, len(image) + 1, 240)]
            assert b"".join(part[4:] for part in parts) == image, f"a mixture in place of scan {number}"
        return number

    def kept(self) -> Kept:
        """What is kept, as its user sees it."""
        images = []
        for slot in range(LAYOUT.slots):
            answer = self.ask(Request.SLOT, bytes([slot]))
            images.append(HASHES[answer[12:44]] if len(answer) > StoreStatus.LAYOUT.size else 0)
        store = self.store()
        return Kept(tuple(images), store.selected, store.trial, store.started)


def faults(library: DeviceLibrary | None = None, modes: tuple[str, ...] = MODES) -> Iterator[str]:
    """Yield what goes wrong after a cut in each word that a request or the start after it writes or erases."""
    flash = new_flash()
    for number, step in enumerate(SCRIPT):
        whole = flash.copy()
        device = StoreDevice(whole, library)
        state = device.kept()  # the start of a trial has been noted
        started = whole.copy()
        device.take(step, before=True)
        whole.power_up()
        refused, request_events = device.take(step), whole.events
        later = state.after(step)
        if refused or device.kept() != later:
            yield f"step {number} {step}: {device.kept()} without a cut, refused by {refused}"
            return
        rest = whole.copy()
        rest.power_up()
        StoreDevice(rest, library)
        for mode in modes:
            for event in range(request_events):
                cut = started.copy()
                other = StoreDevice(cut, library)
                other.take(step, before=True)
                cut.cut(event, mode)
                other.take(step)
                yield from _wrong(other, (state, later), f"step {number} {step}, {mode}, event {event}")
            for event in range(rest.events):
                cut = whole.copy()
                cut.power_up()
                cut.cut(event, mode)
                other = StoreDevice(cut, library)
                yield from _wrong(other, (later, later.start()[0]), f"start after {step}, {mode}, event {event}")
        flash = whole


def _wrong(device: StoreDevice, before: tuple[Kept, Kept], where: str) -> Iterator[str]:
    """Yield what a device does after a cut that it may not do: before the start it had one of two states."""
    device.restart()
    found, allowed = (device.kept(), device.plays()), [each.start() for each in before]
    if found not in allowed:
        yield f"{where}: {found}; may be {allowed}"
