"""The modes of a COMMIT in the C link: dialogues against the model, and the lines that play after each swap."""

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from link_device import DeviceLibrary, HostDevice, compile_device
from link_programs import make_scan
from link_random import KEY, Dialogue, Differs
from link_talk import Talk
from test_c_link import SHAPES, STEPS

from tablegen.base.resources import c_link, c_runtime
from tablegen.device.commit_mode import CommitMode
from tablegen.link.messages import Reason, Refusal, Request

OLD, NEW, OTHER = make_scan(1), make_scan(3), make_scan(5, lines=8)
REFUSED = 0xFF
MUTANTS = {
    "a mode that is none": ("dac_link.c", "payload[4] <= DAC_COMMIT_FRAME", "true"),
    "every commit at a line": ("dac_link_upload.c", "plain == 5 ? payload[4] : (uint8_t)DAC_COMMIT_LINE", "0"),
    "the tag leaves the mode out": ("dac_link_check.c", "        bytes = 11;", "        bytes = 10;"),
    "the tag has a mode without one": ("dac_link_check.c", "if (l->commit_has_mode)", "if (true)"),
    "a frame restarts that cannot go on": ("dac_link_upload.c", "&& !dac_sequencer_can_keep(l->sequencer)", "&& false"),
    "a parked device has to continue": (
        "dac_link_upload.c",
        "markers & DAC_PLAYING) != 0",
        "markers & DAC_PLAYING) == 0",
    ),
    "an upload is lost with its mode": (
        "dac_link_upload.c",
        "                       || why.reason == DAC_LINK_KEEP;",
        "                       || false;",
    ),
    "modes are not announced": ("dac_link_requests.c", "NARROWS | HAS_MODES };", "NARROWS };"),
}


def _scan(library: DeviceLibrary | None = None) -> tuple[HostDevice, Talk]:
    """A device that plays ``OLD``, 20 ticks after the start of line 2."""
    how: dict[str, Any] = {"modes": True} if library is None else {"library": library}
    device, talk = HostDevice(OLD.program, OLD.program, **how), Talk()
    device.receive(talk.hello())
    device.tick(1000)
    device.receive(talk.acting(Request.ARM, bytes(4)) + talk.acting(Request.TRIGGER))
    device.tick(2 * 96 + 20)
    device.transmit()
    device.lines()
    return device, talk


def _swap(mode: CommitMode, scan: Any = NEW) -> tuple[list[tuple[int, int]], HostDevice, Talk]:
    """Upload a scan with a mode; returns generation and number of each line from the one that plays on."""
    device, talk = _scan()
    for wire in talk.upload(scan.image(False)):
        device.receive(wire)
    crc = scan.image(False).info.image_crc.to_bytes(4, "little")
    device.receive(talk.acting(Request.COMMIT, crc + bytes([mode])))
    device.tick(12 * 96)
    return [(line.generation, line.line) for line in device.lines()], device, talk


@pytest.mark.parametrize(
    ("mode", "lines"),
    [
        (CommitMode.LINE, [(1, 2), (2, 0), (2, 1), (2, 2)]),
        (CommitMode.KEEP, [(1, 2), (2, 3), (2, 4), (2, 5), (2, 0)]),
        (CommitMode.FRAME, [(1, 2), (1, 3), (1, 4), (1, 5), (2, 0), (2, 1)]),
    ],
)
def test_a_mode_says_on_which_line_the_new_scan_starts(mode: CommitMode, lines: list[tuple[int, int]]) -> None:
    played, device, talk = _swap(mode)
    assert played[: len(lines)] == lines
    assert [answer.type for answer in talk.answers(device.transmit())][-1] == Request.COMMIT | 0x80


def test_a_frame_that_cannot_go_on_is_not_restarted() -> None:
    """The upload stays, so that the same image can be committed with another mode."""
    played, device, talk = _swap(CommitMode.KEEP, OTHER)
    assert {generation for generation, _ in played} == {1}
    refusal = talk.answers(device.transmit())[-1]
    assert (refusal.type, Refusal.unpack(refusal.payload).reason) == (REFUSED, Reason.KEEP)
    crc = OTHER.image(False).info.image_crc.to_bytes(4, "little")
    device.receive(talk.acting(Request.COMMIT, crc + bytes([CommitMode.FRAME])))
    device.tick(8 * 96)
    assert (2, 0) in [(line.generation, line.line) for line in device.lines()]


def test_a_device_without_modes_refuses_one() -> None:
    device, talk = HostDevice(OLD.program, OLD.program), Talk()
    device.receive(talk.hello())
    device.tick(1)
    for wire in talk.upload(NEW.image(False)):
        device.receive(wire)
    device.transmit()
    crc = NEW.image(False).info.image_crc.to_bytes(4, "little")
    for mode in CommitMode:
        device.receive(talk.acting(Request.COMMIT, crc + bytes([mode])))
        (refusal,) = talk.answers(device.transmit())
        assert (refusal.type, Refusal.unpack(refusal.payload).reason) == (REFUSED, Reason.PAYLOAD)
    device.receive(talk.acting(Request.COMMIT, crc))
    device.tick(1000)
    assert talk.answers(device.transmit())[-1].type == Request.COMMIT | 0x80


def _random(library: DeviceLibrary | None, keys: tuple[bytes, ...], seeds: range) -> Counter[Any]:
    seen: Counter[Any] = Counter()
    for key in keys:
        for seed in seeds:
            how: dict[str, Any] = {} if library is None else {"library": library}
            dialogue = Dialogue(SHAPES["16 bits"], seed, key, modes=True, **how)
            dialogue.play(STEPS)
            seen += dialogue.seen
    return seen


@pytest.mark.common
def test_random_dialogues_with_modes_are_those_of_the_model() -> None:
    seen = _random(None, (b"", KEY), range(200, 212))
    assert seen[Request.COMMIT] > 10
    assert seen[Request.COMMIT, Reason.KEEP] > 0
    assert seen[Request.COMMIT, Reason.PAYLOAD] > 0


@pytest.mark.rest
@pytest.mark.parametrize("name", MUTANTS)
def test_a_wrong_link_is_noticed(name: str, tmp_path: Path) -> None:
    file, old, new = MUTANTS[name]
    sources = []
    for source in (*c_runtime(), *c_link()):
        text = source.read_text("utf-8")
        if source.name == file:
            assert text.count(old) == 1, f"{file}: {old}"
            text = text.replace(old, new)
        (tmp_path / source.name).write_text(text, "utf-8")
        sources.append(tmp_path / source.name)
    library = DeviceLibrary(compile_device(tmp_path / "device.so", sources=sources, more=["-DDAC_COMMIT_MODES=1"]))
    with pytest.raises((Differs, AssertionError)):
        _random(library, (b"", KEY), range(200, 260))
