"""LIST and PLAY: the client against the model of a device."""

import numpy as np
import pytest
from client_rig import KEY, LoseOnce, Watched, client, model
from cut_flash import CutFlash
from link_images import random_slow_program
from link_programs import INFO, make_scan
from replacing import replace

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import ScanProgram
from tablegen.link.acceptance import first_objection
from tablegen.link.errors import NotUnderstood, OutOfTime, Refused, Unsuitable
from tablegen.link.messages import (
    AxisLimits,
    AxisShape,
    AxisWords,
    DeviceInfo,
    DeviceState,
    Feature,
    Listing,
    More,
    Reason,
    Request,
)
from tablegen.link.model_device import ModelDevice
from tablegen.link.program_image import make_image, take_apart
from tablegen.link.programs import DeviceProgram, named
from tablegen.link.store import Layout
from tablegen.verification.play.sequencer_shape import SequencerShape

LAYOUT = Layout(base=0, sector_bytes=4096, place_sectors=1, slots=2)
PLAYS = replace(INFO, features=INFO.features | Feature.COMMIT_MODES, more=More.PLAY)
KEEPS = replace(PLAYS, features=PLAYS.features | Feature.STORE)
WIDEST = AxisLimits(0, (1 << 16) - 1, (1 << 24) - 1, (1 << 24) - 1)
SCANS = [make_scan(3), make_scan(5, lines=8)]
COMPILED = {f"scan_{number}": scan.image(False) for number, scan in enumerate(SCANS)}


def playing(info: DeviceInfo = PLAYS, key: bytes = b"", **options: object) -> ModelDevice:
    """A device with two compiled programs."""
    return model(info, key, compiled=COMPILED, **options)


@pytest.mark.parametrize("key", [b"", KEY], ids=["open", "key"])
def test_compiled_and_kept_programs_play_by_number(key: bytes) -> None:
    flash = CutFlash(LAYOUT.place(LAYOUT.slots + 1), LAYOUT.sector_bytes)
    line = Watched(playing(KEEPS, key, flash=(flash, LAYOUT)))
    with client(line, key=key or None) as device:
        device.upload(make_scan(7).image(False))
        device.save(1)
        programs = device.programs()
        digests = [SCANS[0].digest, SCANS[1].digest, make_scan(7).digest]
        assert programs == (
            DeviceProgram(0, "scan_0", None, digests[0]),
            DeviceProgram(1, "scan_1", None, digests[1]),
            DeviceProgram(3, "", 1, digests[2]),
        )
        for each in programs:
            before = device.status().generation
            assert device.play(each.number).generation == before + 1
            assert device.status().hash.hex() == each.hash
        for number in (2, 4, 65535):
            with pytest.raises(Refused, match=r"refused PLAY \(number\).* numbers 0 to 3") as caught:
                device.play(number)
            assert (caught.value.reason, caught.value.detail) == (Reason.NUMBER, 4)
        with pytest.raises(ValueError, match="65536"):
            device.play(65536)
    assert [len(frame.payload) for frame in line.frames if frame.type == Request.PLAY] == [3 + 16 * bool(key)] * 6


def _mixed_scan() -> ScanProgram:
    """A scan with a slow part, within the limits of its converters."""
    rng, shape = np.random.default_rng(1), SequencerShape(16, 3, 5, 16, 3, 4, 16)
    while True:
        program = random_slow_program(rng, shape)
        image = make_image(program, bytes(32).hex())
        if first_objection(take_apart(image.data, image.info.x, image.info.y), WIDEST, WIDEST, None) is None:
            return program


def test_compiled_programs_with_slow_parts_play_as_uploads_of_them() -> None:
    program = _mixed_scan()
    image = make_image(program, "ab" * 32)
    size = len(image.data)
    shapes = {"x": AxisShape(5, 16, 16, 16), "y": AxisShape(4, 16, 16, 16), "degree": 3}
    info = replace(PLAYS, **shapes, x_limits=WIDEST, y_limits=WIDEST, image_bytes=size)
    able = replace(info, more=More.PLAY | More.MOVE | More.SLOW_PARTS, slow_knots=65, slow_index_bits=7)
    for device_info, reason in ((able, None), (info, Reason.LENGTH), (replace(able, slow_knots=2), Reason.SHAPE)):
        with client(Watched(model(device_info, boot=None, compiled={"mixed": image}))) as device:
            if reason is not None:
                with pytest.raises(Refused) as caught:
                    device.play(0)
                assert (caught.value.request, caught.value.reason) == (Request.PLAY, reason)
                continue
            assert device.programs() == (DeviceProgram(0, "mixed", None, "ab" * 32),)
            generation = device.play(0).generation
            assert (device.status().hash.hex(), device.readback()) == ("ab" * 32, image.data)
            words = AxisWords(program.x.output.gain_word, program.x.output.offset_word)
            with pytest.raises(Refused, match=r"\(slow_part\)"):
                device.move(words, words, generation)


def test_a_frame_goes_on_or_ends_first() -> None:
    line = Watched(playing())
    with client(line) as device:
        device.arm()
        device.trigger()
        device.wait_for(DeviceState.PLAYING, 5.0)
        assert 0 <= device.play(0, swap=CommitMode.KEEP).line < 6
        with pytest.raises(Refused, match=r"\(keep\)"):
            device.play(1, swap=CommitMode.KEEP)
        assert device.play(1, swap=CommitMode.FRAME).line == 0  # that was due
        line.device.permits = False
        with pytest.raises(Refused, match=r"\(interlock\)"):
            device.play(0)
        assert device.status().hash.hex() == SCANS[1].digest


@pytest.mark.parametrize("lost", [Request.PLAY, Request.PLAY | 0x80])
def test_a_lost_frame_plays_a_program_once(lost: int) -> None:
    device_model = playing()
    line = Watched(device_model, **{"spoil_back" if lost & 0x80 else "spoil_out": LoseOnce(lost, 1)})
    with client(line) as device:
        assert device.play(1).generation == 2
    assert (line.count(Request.PLAY), device_model.player.swaps) == (2, 2)


def test_a_program_that_waits_too_long_may_still_become_active() -> None:
    may_become = pytest.raises(OutOfTime, match="has not ended its checks; it may still become active")
    with client(Watched(playing(checking=10**9))) as device, may_become:
        device.play(0, timeout_s=3.0)


def test_nothing_is_sent_to_a_device_that_cannot() -> None:
    line = Watched(model(INFO))
    with client(line) as device:
        for ask in (device.programs, lambda: device.play(0)):
            with pytest.raises(Unsuitable, match="DAC_LIBRARY=2"):
                ask()
    no_modes = Watched(playing(replace(INFO, more=More.PLAY)))
    with client(no_modes) as device, pytest.raises(Unsuitable, match="--swap keep"):
        device.play(0, swap=CommitMode.KEEP)
    assert line.count(Request.PLAY) + line.count(Request.LIST) + no_modes.count(Request.PLAY) == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"numbers": 0}, "LIST: numbers is 0; possible: 1 to 65535"),
        ({"compiled": 3}, "LIST: compiled is 3; possible: 0 to 2"),
        ({"content": 2}, "LIST: content is 2; possible: 0 to 1"),
        ({"name": b"a\x1b[2J"}, "LIST: a character of the name is 27; possible: 32 to 126"),
    ],
)
def test_an_impossible_listing_is_not_believed(change: dict[str, object], message: str) -> None:
    device_model = playing()
    good = Listing(2, 2, 1, bytes(32), b"scan_0")
    device_model._requests[Request.LIST] = lambda frame: replace(good, **change).pack()
    with client(Watched(device_model)) as device, pytest.raises(NotUnderstood) as caught:
        device.programs()
    assert message in str(caught.value)


@pytest.mark.parametrize("answer", [Listing(2, 2, 1, bytes(32), b"scan_0").pack()[:-1], bytes(37)])
def test_a_short_listing_is_not_believed(answer: bytes) -> None:
    device_model = playing()
    device_model._requests[Request.LIST] = lambda frame: answer
    with client(Watched(device_model)) as device, pytest.raises(NotUnderstood, match="LIST: its answer has"):
        device.programs()


def test_a_listing_that_changes_is_not_believed() -> None:
    device_model = playing()
    device_model._requests[Request.LIST] = lambda frame: Listing(2 + frame.payload[0], 2, 1, bytes(32), b"a").pack()
    with client(Watched(device_model)) as device, pytest.raises(NotUnderstood, match="numbers is 3; possible: 2"):
        device.programs()


def test_names_and_hashes_find_programs() -> None:
    programs = DeviceProgram(0, "a", None, "0123456789abcdef" * 4), DeviceProgram(1, "", 0, "f" * 64)
    found = [named(programs, name) for name in ("a", "0123456789ab", "f" * 12, "f" * 64, "b", "", "f" * 11, "F" * 12)]
    assert [None if each is None else each.number for each in found] == [0, 0, 1, 1, None, None, None, None]


def test_a_device_that_announces_numbers_has_programs() -> None:
    with pytest.raises(ValueError, match="has programs"):
        model(PLAYS)
