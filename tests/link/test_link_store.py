"""Kept programs: the client against the model of a device with a flash, open and with a key, over many starts."""

from collections.abc import Callable
from typing import Any

import pytest
from client_rig import BOOT, KEY, Watched, client, model
from cut_flash import CutFlash
from link_programs import INFO, SmallScan, make_scan
from link_talk import Talk
from replacing import replace

from tablegen.device.commit_mode import CommitMode
from tablegen.link.errors import LinkLost, NotUnderstood, Refused, Unsuitable
from tablegen.link.kept import KeptPrograms
from tablegen.link.messages import (
    NO_SLOT,
    DeviceInfo,
    DeviceState,
    Feature,
    Reason,
    Request,
    SlotContent,
    StoreStatus,
)
from tablegen.link.model_device import ModelDevice
from tablegen.link.players import LinePlayer, SequencerPlayer
from tablegen.link.store import Layout

LAYOUT = Layout(base=0, sector_bytes=256, place_sectors=3, slots=3)
WITH_STORE = replace(INFO, features=INFO.features | Feature.STORE)
FIRST, SECOND = make_scan(4), make_scan(3)  # y of the second one is faster
LONG = make_scan(5, index_bits=(8, 7))  # of 960 bytes
BOTH = pytest.mark.parametrize("key", [b"", KEY], ids=["open", "key"])


def storing(key: bytes = b"", info: DeviceInfo = WITH_STORE, flash: CutFlash | None = None, **more: Any) -> ModelDevice:
    """A device with a flash, which is empty unless it is given."""
    if flash is None:
        flash = CutFlash(LAYOUT.place(LAYOUT.slots + 1), LAYOUT.sector_bytes)
    device = model(info, key, flash=(flash, LAYOUT), **more)
    device.tick(1)
    return device


def restart(line: Watched) -> None:
    """Restart the device, and let a tick pass."""
    line.device.reboot()
    line.device.tick(1)


def plays(line: Watched) -> str:
    """Return the hash of what the device plays."""
    return line.device.status().hash.hex()


@BOTH
def test_a_kept_scan_plays_after_a_start_once_it_is_selected(key: bytes) -> None:
    line = Watched(storing(key))
    with client(line, key=key or None) as device:
        assert [slot.content for slot in device.slots().slots] == [SlotContent.EMPTY] * 3
        result = device.upload(FIRST.image(True))
        device.save(1, result.generation)
        restart(line)
        assert plays(line) == BOOT.digest
        device.select(1)
        restart(line)
        assert plays(line) == FIRST.digest
        kept = device.slots()
        assert device.readback() == FIRST.image(False).data
    assert (kept.selected, kept.trial, kept.start, kept.reason, kept.room) == (1, None, 1, 0, LAYOUT.room)
    assert [slot.content for slot in kept.slots] == [SlotContent.EMPTY, SlotContent.PROGRAM, SlotContent.EMPTY]
    image = kept.slots[1].image
    assert image is not None
    assert (image.hash.hex(), image.image_bytes) == (FIRST.digest, len(FIRST.image(False).data))
    tagged = {Request.SAVE: 5, Request.SELECT: 2}
    for kind, size in tagged.items():
        sizes = {len(frame.payload) for frame in line.frames if frame.type == kind}
        assert sizes == {size + (16 if key else 0)}


@BOTH
def test_a_trial_is_over_at_the_second_start_unless_it_is_confirmed(key: bytes) -> None:
    line = Watched(storing(key))
    with client(line, key=key or None) as device:
        for slot, scan in enumerate((FIRST, SECOND)):
            device.upload(scan.image(False))
            device.save(slot)
        device.select(0)
        device.select(1, trial=True)
        seen = []
        for _ in range(3):
            restart(line)
            seen.append((plays(line), device.slots().started))
        assert seen == [(SECOND.digest, True), (FIRST.digest, True), (FIRST.digest, True)]
        assert device.slots().trial is None
        with pytest.raises(Refused, match=r"\(trial\): no trial plays since the last start"):
            device.confirm()
        device.select(1, trial=True)
        with pytest.raises(Refused, match=r"\(trial\)"):
            device.confirm()  # it has not been started
        restart(line)
        device.confirm()
        restart(line)
        assert plays(line) == SECOND.digest
        kept = device.slots()
    assert (kept.selected, kept.trial, kept.start) == (1, None, 1)


def test_what_is_deleted_does_not_play() -> None:
    line = Watched(storing())
    with client(line) as device:
        device.upload(FIRST.image(False))
        device.save(2)
        device.select(2)
        restart(line)
        device.delete(2)
        assert (device.slots().selected, device.slots().start, plays(line)) == (None, None, FIRST.digest)
        with pytest.raises(Refused, match=r"\(slot\): there is no such slot, or no program in it; .* slots 0 to 2"):
            device.delete(2)
        restart(line)
    assert plays(line) == BOOT.digest


def test_the_program_of_the_firmware_is_selected_by_none() -> None:
    line = Watched(storing())
    with client(line) as device:
        device.upload(FIRST.image(False))
        device.save(0)
        device.select(0)
        device.select(None)
        restart(line)
    assert plays(line) == BOOT.digest


REFUSED: dict[str, tuple[Reason, Callable[[Any], Any]]] = {
    "no slot to save to": (Reason.SLOT, lambda device: device.save(3)),
    "an empty slot": (Reason.SLOT, lambda device: device.select(1)),
    "a trial of nothing": (Reason.SLOT, lambda device: device.select(None, trial=True)),
    "another generation": (Reason.GENERATION, lambda device: device.save(0, 7)),
    "nothing to confirm": (Reason.TRIAL, lambda device: device.confirm()),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refusals_change_nothing(name: str) -> None:
    reason, request = REFUSED[name]
    line = Watched(storing())
    with client(line) as device:
        device.upload(FIRST.image(False))
        device.save(0)
        before = device.slots()
        with pytest.raises(Refused) as caught:
            request(device)
        assert caught.value.reason == reason
        assert device.slots() == before


def test_the_program_of_the_firmware_cannot_be_saved() -> None:
    with (
        client(Watched(storing())) as device,
        pytest.raises(Refused, match=r"\(readback\): there is nothing to"),
    ):
        device.save(0)


def test_a_scan_that_a_slot_has_no_room_for_is_not_saved() -> None:
    with client(Watched(storing())) as device:
        device.upload(LONG.image(True))
        with pytest.raises(Refused, match=r"\(room\): a slot has room for 704 bytes"):
            device.save(0)


@pytest.mark.parametrize("while_playing", [False, True])
def test_a_device_says_whether_it_writes_flash_while_a_scan_plays(while_playing: bool) -> None:
    line = Watched(storing(stores_while_playing=while_playing))
    with client(line) as device:
        device.upload(FIRST.image(False), swap=CommitMode.LINE)
        device.arm()
        device.trigger()
        line.device.tick(200)
        assert device.status().state == DeviceState.PLAYING
        if while_playing:
            device.save(0)
            return
        for request in (lambda: device.save(0), lambda: device.select(0), device.confirm, lambda: device.delete(0)):
            with pytest.raises(Refused, match=r"\(playing\): it cannot write .*; `tablegen park --wait`"):
                request()
        device.park()
        device.wait_for(DeviceState.PARKED, 5.0)
        device.save(0)


@pytest.mark.parametrize("player", [LinePlayer, SequencerPlayer])
def test_a_trigger_that_waits_for_its_tick_plays_already(player: type[LinePlayer | SequencerPlayer]) -> None:
    """No change between a TRIGGER and its tick; an ARM, or a PARK with or without a TRIGGER in front, is no reason."""
    flash = CutFlash(LAYOUT.place(LAYOUT.slots + 1), LAYOUT.sector_bytes)
    device, talk = ModelDevice(WITH_STORE, player(BOOT.program), flash=(flash, LAYOUT)), Talk()
    device.receive(talk.hello())
    device.tick(1000)

    def reasons(*kinds: Request) -> list[int]:
        payloads = {Request.ARM: bytes(4), Request.SELECT: bytes([NO_SLOT, 0])}
        device.transmit()
        device.receive(b"".join(talk.acting(kind, payloads.get(kind, b"")) for kind in kinds))
        return [reason for reason, _ in talk.refusals(device.transmit())]

    assert reasons(Request.SELECT, Request.PARK, Request.SELECT, Request.ARM, Request.SELECT) == []
    assert reasons(Request.TRIGGER, Request.SELECT, Request.CONFIRM) == [Reason.PLAYING, Reason.PLAYING]
    assert reasons(Request.PARK, Request.SELECT) == []
    device.tick(1)
    assert reasons(Request.ARM, Request.TRIGGER, Request.ARM, Request.SELECT) == [Reason.PLAYING]
    device.tick(1)
    assert reasons(Request.SELECT, Request.PARK, Request.SELECT) == [Reason.PLAYING, Reason.PLAYING]
    device.tick(1000)
    assert reasons(Request.ARM, Request.TRIGGER) == []
    device.reboot()
    device.receive(talk.hello())
    assert reasons(Request.SELECT) == []


def test_nothing_is_sent_to_a_device_that_keeps_nothing() -> None:
    line = Watched(model())
    with client(line) as device:
        for request in (device.slots, lambda: device.save(0), lambda: device.select(0), device.confirm):
            with pytest.raises(Unsuitable, match="the device keeps no programs: its firmware was built without"):
                request()
    assert {frame.type for frame in line.frames} == {Request.HELLO}


# What a start begins with


def _kept(scan: SmallScan = FIRST, trial: bool = False) -> CutFlash:
    """A flash that has a scan selected in slot 0, or on trial in slot 1 while slot 0 has the other one."""
    flash = CutFlash(LAYOUT.place(LAYOUT.slots + 1), LAYOUT.sector_bytes)
    line = Watched(storing(flash=flash))
    with client(line) as device:
        device.upload(scan.image(False))
        device.save(0)
        device.select(0)
        if trial:
            device.upload(SECOND.image(False))
            device.save(1)
            device.select(1, trial=True)
    return flash


def _starts(flash: CutFlash, **more: Any) -> tuple[str, KeptPrograms]:
    """Return what a device plays that starts with a flash, and what it says of its slots."""
    line = Watched(storing(flash=flash, **more))
    with client(line) as device:
        return plays(line), device.slots()


def _narrow(scan: SmallScan) -> DeviceInfo:
    """Return a device for which y of a scan is too fast."""
    return replace(WITH_STORE, y_limits=replace(WITH_STORE.y_limits, max_step=scan.program.y.output.max_step - 1))


def test_a_start_has_the_checks_of_an_upload() -> None:
    hash_played, kept = _starts(_kept(), info=_narrow(FIRST))
    assert (hash_played, kept.start, kept.selected, kept.reason) == (BOOT.digest, None, 0, Reason.STEP)
    hash_played, kept = _starts(_kept(), info=WITH_STORE)
    assert (hash_played, kept.start, kept.reason) == (FIRST.digest, 0, 0)


def test_a_slot_of_tables_of_another_device_is_not_played() -> None:
    other = replace(WITH_STORE, x=replace(WITH_STORE.x, index_bits=6))
    hash_played, kept = _starts(_kept(), info=other)
    assert (hash_played, kept.start, kept.reason) == (BOOT.digest, None, Reason.SHAPE)


def test_the_selected_scan_plays_where_a_trial_does_not_pass() -> None:
    hash_played, kept = _starts(_kept(trial=True), info=_narrow(SECOND))
    assert (hash_played, kept.start, kept.reason, kept.trial) == (FIRST.digest, 0, Reason.STEP, 1)


def test_a_trial_that_did_not_pass_cannot_be_confirmed() -> None:
    line = Watched(storing(flash=_kept(trial=True), info=_narrow(SECOND)))
    with client(line) as device, pytest.raises(Refused, match=r"\(trial\)"):
        device.confirm()


def test_a_damaged_slot_is_reported_and_can_be_deleted() -> None:
    flash = _kept()
    first = LAYOUT.place(0) + 64
    flash.cells[first] ^= 1
    line = Watched(storing(flash=flash))
    with client(line) as device:
        kept = device.slots()
        assert (plays(line), kept.start, kept.reason) == (BOOT.digest, None, Reason.IMAGE)
        assert kept.slots[0].content is SlotContent.DAMAGED
        device.delete(0)
        assert device.slots().slots[0].content is SlotContent.EMPTY


def test_a_trial_whose_slot_was_saved_to_again_cannot_be_confirmed() -> None:
    line = Watched(storing(flash=_kept(trial=True)))
    with client(line) as device:
        assert device.slots().start == 1
        device.upload(FIRST.image(False), force=True)
        device.save(1)
        assert device.slots().start is None
        with pytest.raises(Refused, match=r"\(trial\)"):
            device.confirm()


# Failures on the way


def test_a_flash_that_fails_is_reported() -> None:
    flash = _kept()
    line = Watched(storing(flash=flash))
    with client(line) as device:
        device.upload(SECOND.image(False))
        flash.cut(5, "mixed")
        with pytest.raises(Refused, match=r"\(flash\): its flash was not written as it should be"):
            device.save(1)
        assert plays(line) == SECOND.digest


def test_a_restart_during_a_save_is_no_success() -> None:
    """After the restart generations are small again, and another scan may have the number."""
    line = Watched(storing(flash=_kept()))
    with client(line) as device:
        generation = device.upload(FIRST.image(False), force=True).generation
        write = line.write

        def cut(data: bytes) -> None:
            if line.count(Request.SAVE) == 0:
                before = len(line.frames)
                write(data)
                if any(frame.type == Request.SAVE for frame in line.frames[before:]):
                    restart(line)
            else:
                write(data)

        line.write = cut  # type: ignore[method-assign]
        with pytest.raises(LinkLost, match="the device restarted during SAVE; `tablegen slots` tells"):
            device.save(1, generation)


def test_a_flash_may_take_its_time() -> None:
    """No answer comes for 40 s; the request is repeated, and carried out once."""
    line = Watched(storing())
    with client(line) as device:
        device.upload(FIRST.image(False))
        silent_until = line.now() + 40.0

        def late(piece: bytes) -> list[bytes]:
            return [piece] if line.now() >= silent_until or not line.count(Request.SAVE) else []

        line.spoil_back = late
        device.save(1)
        assert line.now() >= silent_until
        assert line.count(Request.SAVE) < 50
        assert len({frame.seq for frame in line.frames if frame.type == Request.SAVE}) == 1
        assert line.device._store._store.state.counter == 3  # the copy of an empty record, and one change


@pytest.mark.parametrize(
    ("field", "value"), [("slots", 0), ("slots", 16), ("selected", 16), ("started", 2), ("content", 3)]
)
def test_a_store_that_cannot_be_is_not_believed(field: str, value: int, monkeypatch: pytest.MonkeyPatch) -> None:
    line = Watched(storing())
    good = StoreStatus(3, NO_SLOT, NO_SLOT, 0, NO_SLOT, 0, 0, 0, 704)
    with client(line) as device:
        wrong = replace(good, **{field: value}).pack()
        monkeypatch.setitem(line.device._requests, Request.SLOT, lambda frame: wrong)
        with pytest.raises(NotUnderstood, match=f"SLOT: {field} is {value}"):
            device.slots()
