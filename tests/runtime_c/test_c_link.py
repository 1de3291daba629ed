"""The C link as a whole: frames, dialogues written by hand, and random ones against the model of a device."""

import json
from collections import Counter
from typing import Any

import pytest
from building import HELPERS
from dialogues import GOLDEN, boot_program, dialogues, hold
from link_device import HostDevice
from link_programs import make_scan
from link_random import KEY, Dialogue
from link_talk import Talk

from tablegen.link.messages import DeviceInfo, DeviceStatus, Feature, Reason, Request
from tablegen.verification.play.sequencer_shape import SequencerShape

FRAMES: dict[str, Any] = json.loads((HELPERS / "golden_frames.json").read_text("utf-8"))
SHAPES = {
    "16 bits": SequencerShape(16, 1, 5, 16, 1, 4, 16),
    "12 bits": SequencerShape(12, 1, 4, 10, 1, 3, 14),
    "24 bits": SequencerShape(24, 1, 4, 20, 1, 3, 24),
    "direct": SequencerShape(16, 0, 5, 16, 0, 5, 16),
    "cubic": SequencerShape(16, 3, 5, 16, 3, 4, 16),
    "mixed": SequencerShape(16, 1, 3, 16, 0, 4, 12),
}
SEEDS, STEPS = 6, 250


def golden_shaping(name: str) -> int:
    """The highest order of a device of the golden dialogues."""
    return DeviceInfo.unpack(bytes.fromhex(GOLDEN["devices"][name]["device"])).shaping


def golden_device(name: str) -> HostDevice:
    """One of the devices of the golden dialogues."""
    made = GOLDEN["devices"][name]
    info, boot = DeviceInfo.unpack(bytes.fromhex(made["device"])), boot_program(made)
    nonces = iter(made["nonces"])
    return HostDevice(
        boot,
        boot,
        limits=(info.x_limits, info.y_limits),
        index_bits=(info.x.index_bits, info.y.index_bits),
        harmonics=info.harmonics,
        window=info.window,
        update_rate_hz=info.update_rate_hz,
        key=bytes.fromhex(made["key"]),
        boot_hash=bytes.fromhex(made["boot_hash"]),
        boot_count=made["boot"],
        interlock=Feature.INTERLOCK in info.features,
        nonces=lambda: bytes.fromhex(next(nonces)),
        shaping=info.shaping,
    )


@pytest.mark.parametrize("dialogue", dialogues(), ids=lambda dialogue: dialogue["name"])
def test_golden_dialogues(dialogue: dict[str, Any]) -> None:
    hold(dialogue, golden_device(dialogue["device"]))


# Frames


def bad_frames(device: HostDevice) -> int:
    """What STATUS counts."""
    talk = Talk()
    device.receive(b"\0" + talk.hello() + talk.request(Request.STATUS))
    return DeviceStatus.unpack(talk.answers(device.transmit())[-1].payload).bad_frames


@pytest.mark.parametrize("golden", FRAMES["good"], ids=lambda golden: golden["name"])
def test_a_good_frame_is_answered_or_is_no_request(golden: dict[str, Any]) -> None:
    device = HostDevice(make_scan(1).program)
    device.receive(bytes.fromhex(golden["wire"]))
    answers = Talk().answers(device.transmit())
    assert len(answers) == (0 if golden["type"] & 0x80 else 1)
    for answer in answers:
        assert (answer.seq, answer.session) == (golden["seq"], golden["session"])
    assert bad_frames(device) == 0


@pytest.mark.parametrize("golden", FRAMES["bad"], ids=lambda golden: golden["name"])
def test_what_is_no_frame_is_counted_once(golden: dict[str, Any]) -> None:
    device = HostDevice(make_scan(1).program)
    device.receive(bytes.fromhex(golden["wire"]))
    assert device.transmit() == b""
    assert bad_frames(device) == 1


@pytest.mark.parametrize("golden", FRAMES["empty"], ids=lambda golden: golden["name"])
def test_nothing_is_not_counted(golden: dict[str, Any]) -> None:
    device = HostDevice(make_scan(1).program)
    device.receive(bytes.fromhex(golden["wire"]))
    assert bad_frames(device) == 0


# Random dialogues


@pytest.mark.rest
@pytest.mark.parametrize("key", [b"", KEY], ids=["open", "keyed"])
@pytest.mark.parametrize("name", SHAPES)
def test_a_random_dialogue_is_that_of_the_model(name: str, key: bytes) -> None:
    for seed in range(SEEDS):
        Dialogue(SHAPES[name], seed, key).play(STEPS)


@pytest.mark.rest
def test_a_random_dialogue_of_a_device_that_shapes() -> None:
    for name, order in (("16 bits", 3), ("24 bits", 1), ("direct", 2), ("cubic", 2)):
        for seed in range(SEEDS):
            Dialogue(SHAPES[name], seed, order=order).play(STEPS)


@pytest.mark.common
def test_random_dialogues_are_about_everything() -> None:
    """A control of the test above: every request is answered in them, and refused for most reasons."""
    seen: Counter[Any] = Counter()
    for key in (b"", KEY):
        for seed in range(100, 112):
            dialogue = Dialogue(SHAPES["16 bits"], seed, key)
            dialogue.play(STEPS)
            seen += dialogue.seen
    # test_c_link_store.py is about kept programs.
    assert {kind for kind in Request if seen[kind] > 0} == {kind for kind in Request if kind < Request.SLOT}
    reasons = {each[1] for each in seen if isinstance(each, tuple)}
    rare = {
        Reason.IMAGE,
        Reason.TICKS,
        Reason.REFUSED,
        Reason.SHAPING,
        Reason.KEEP,
        *range(Reason.SCHEDULE, Reason.WITHDRAWN),
        *(reason for reason in Reason if reason > Reason.KEEP),
    }  # by others
    assert set(Reason) - reasons <= rare, sorted(set(Reason) - reasons)
