"""The model of a device against dialogues that were written by hand from docs/protocol.md."""

import struct
from collections.abc import Callable
from typing import Any

import pytest
from dialogues import GOLDEN, boot_program, dialogues, hold
from link_programs import INFO, make_scan

from tablegen.link import acceptance, model_bank
from tablegen.link.acceptance import Finding
from tablegen.link.frames import Frame, FrameReader
from tablegen.link.messages import DeviceInfo, DeviceStatus, Reason, Refusal, Request, Upload
from tablegen.link.model_bank import Bank
from tablegen.link.model_device import ModelDevice
from tablegen.link.players import LinePlayer, SequencerPlayer
from tablegen.link.program_image import ProgramImage

Players = type[LinePlayer] | type[SequencerPlayer]


def _device(dialogue: dict[str, Any], player: Players = LinePlayer) -> ModelDevice:
    made = GOLDEN["devices"][dialogue["device"]]
    nonces = iter(made["nonces"])
    return ModelDevice(
        DeviceInfo.unpack(bytes.fromhex(made["device"])),
        player(boot_program(made)),
        key=bytes.fromhex(made["key"]),
        boot=made["boot"],
        boot_hash=bytes.fromhex(made["boot_hash"]),
        nonces=lambda: bytes.fromhex(next(nonces)),
    )


@pytest.mark.parametrize("player", [LinePlayer, SequencerPlayer])
@pytest.mark.parametrize("dialogue", dialogues(), ids=lambda dialogue: dialogue["name"])
def test_the_model_answers_as_the_document_says(dialogue: dict[str, Any], player: Players) -> None:
    hold(dialogue, _device(dialogue, player))


def test_the_dialogues_are_about_everything() -> None:
    """Every request is answered, and every reason but two given: a device in Python has no `refused` of its own.

    Those devices have no modes of a COMMIT, which ``test_link_swaps.py`` is about, and keep no programs:
    ``test_link_store.py`` is about those.
    """
    answered, refused = set(), set()
    for dialogue in GOLDEN["dialogues"]:
        for answer in (answer for step in dialogue["steps"] for answer in step["answers"]):
            if answer["type"] == 0xFF:
                refused.add(Refusal.unpack(bytes.fromhex(answer["payload"])).reason)
            else:
                answered.add(answer["type"] & 0x7F)
    assert answered == {request for request in Request if request < Request.SLOT}
    assert refused == {reason for reason in Reason if reason < Reason.KEEP} - {Reason.REFUSED}


def _hold_all() -> None:
    for dialogue in dialogues():
        hold(dialogue, _device(dialogue))


def _without(reason: Reason) -> Callable[..., Finding | None]:
    """The checks of a program, but one."""
    whole = acceptance.first_objection

    def fewer(*arguments: Any) -> Finding | None:
        found = whole(*arguments)
        return None if found is not None and found[0] == reason else found

    return fewer


_CHECKS = (*range(Reason.SCHEDULE, Reason.JUMP + 1), Reason.SHAPING)


@pytest.mark.parametrize("reason", [Reason(number) for number in _CHECKS], ids=lambda reason: reason.name.lower())
def test_a_device_without_one_check_fails(monkeypatch: pytest.MonkeyPatch, reason: Reason) -> None:
    monkeypatch.setattr(model_bank, "first_objection", _without(reason))
    # some then fail at what the check protects
    with pytest.raises((AssertionError, ValueError, ZeroDivisionError, OverflowError)):
        _hold_all()


@pytest.mark.parametrize("broken", ["sequence", "payload", "tag", "nonce", "words", "settle"])
def test_a_device_that_is_broken_fails(monkeypatch: pytest.MonkeyPatch, broken: str) -> None:
    device, bank = ModelDevice, Bank
    if broken == "sequence":
        monkeypatch.setattr(device, "_is_repeated", lambda self, frame: False)
    elif broken == "payload":
        monkeypatch.setattr(device, "_check_payload", lambda self, frame: None)
    elif broken == "tag":
        monkeypatch.setattr(device, "_check_tag", lambda *arguments: None)
    elif broken == "nonce":
        monkeypatch.setattr(device, "_use_nonce", lambda self: self._nonce)
    elif broken == "words":
        monkeypatch.setattr(bank, "_check_words", lambda self, info, data: None)
    else:
        monkeypatch.setattr(device, "_settle", lambda self: None)
    with pytest.raises((AssertionError, struct.error, IndexError, ValueError)):
        _hold_all()


# What the dialogues cannot have: devices whose checks take time, or that keep images


class _Host:
    """Requests to a model with a program of its own, and what is answered."""

    def __init__(self, **more: Any) -> None:
        self.device = ModelDevice(INFO, LinePlayer(make_scan(0).program), **more)
        self.device.tick(50)
        self._reader = FrameReader()
        self.ask(Request.HELLO, b"\1")

    def ask(self, kind: Request, payload: bytes = b"", seq: int = 0, ticks: int = 0) -> list[Frame]:
        self.device.receive(Frame(kind, seq, 9, payload).encode())
        return self.later(ticks)

    def later(self, ticks: int) -> list[Frame]:
        self.device.tick(ticks)
        return self._reader.feed(self.device.transmit())

    def put(self, image: ProgramImage) -> None:
        self.ask(Request.BEGIN, image.info.pack())
        for at in range(0, len(image.data), 240):
            self.ask(Request.DATA, struct.pack("<I", at) + image.data[at : at + 240])

    def commit(self, image: ProgramImage, seq: int, ticks: int = 0) -> list[Frame]:
        return self.ask(Request.COMMIT, struct.pack("<I", image.info.image_crc), seq, ticks)

    def upload(self) -> Upload:
        (status,) = self.ask(Request.STATUS)
        return DeviceStatus.unpack(status.payload).upload


def _reason(frame: Frame) -> tuple[int, int]:
    refusal = Refusal.unpack(frame.payload)
    return refusal.type, refusal.reason


def test_checks_that_take_time() -> None:
    host, image = _Host(checking=100), make_scan(2).image(fourier=True)
    host.put(image)
    assert host.commit(image, 0, ticks=99) == []
    assert host.upload() == Upload.CHECKING
    assert host.commit(image, 0) == []
    (busy,) = host.ask(Request.BEGIN, image.info.pack())
    assert _reason(busy) == (Request.BEGIN, Reason.BUSY)
    (done,) = host.later(2)
    assert done.payload == struct.pack("<II", 2, 0)


def test_an_abort_ends_checks_at_once() -> None:
    host, image = _Host(checking=100), make_scan(2).image(fourier=False)
    host.put(image)
    assert host.commit(image, 0, ticks=5) == []
    withdrawn, aborted = host.ask(Request.ABORT, seq=1)
    assert _reason(withdrawn) == (Request.COMMIT, Reason.WITHDRAWN)
    assert aborted.payload == struct.pack("<I", 1)
    assert host.later(200) == []
    assert host.upload() == Upload.NONE


def test_the_interlock_is_looked_at_again_when_the_checks_are_over() -> None:
    host, image = _Host(checking=100), make_scan(2).image(fourier=False)
    host.put(image)
    assert host.commit(image, 0, ticks=5) == []
    host.device.permits = False
    (refused,) = host.later(200)
    assert _reason(refused) == (Request.COMMIT, Reason.INTERLOCK)
    host.device.permits = True
    assert host.upload() == Upload.RECEIVING
    assert len(host.commit(image, 1, ticks=150)) == 1
    assert host.upload() == Upload.NONE


def test_memory_that_changed_after_it_was_received() -> None:
    host, image = _Host(), make_scan(2).image(fourier=False)
    host.put(image)
    host.device.memory[300] ^= 1
    (refused,) = host.commit(image, 0)
    assert _reason(refused) == (Request.COMMIT, Reason.IMAGE)
    assert host.device.memory == b""


@pytest.mark.parametrize("staged", [False, True])
def test_reading_back_what_came_as_fourier_words(staged: bool) -> None:
    host, scan = _Host(staged=staged), make_scan(2)
    image, other = scan.image(fourier=True), make_scan(4).image(fourier=False)
    host.put(image)
    host.commit(image, 0, ticks=1)
    expected = image.data if staged else scan.image(fourier=False).data
    (read,) = host.ask(Request.READBACK, struct.pack("<IB", 0, 240))
    assert read.payload[4:] == expected[:240]
    host.ask(Request.BEGIN, other.info.pack())
    (again,) = host.ask(Request.READBACK, struct.pack("<IB", 0, 240))
    if staged:
        assert _reason(again) == (Request.READBACK, Reason.READBACK)
    else:
        assert again.payload == read.payload
