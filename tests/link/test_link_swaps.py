"""Uploads that say when the new scan starts: the client against the model of a device, open and with a key."""

import pytest
from client_rig import KEY, Watched, client, model
from link_programs import INFO, make_scan
from replacing import replace

from tablegen.device.commit_mode import CommitMode
from tablegen.link.errors import Refused, Unsuitable
from tablegen.link.messages import DeviceState, Feature, Reason, Request

WITH_MODES = replace(INFO, features=INFO.features | Feature.COMMIT_MODES)
SAME_FRAME = make_scan(3).image(False)  # as BOOT, which is made with seed 1
OTHER_FRAME = make_scan(5, lines=8).image(False)
COMMIT_BYTES = {(False, CommitMode.LINE): 4, (False, CommitMode.KEEP): 5, (False, CommitMode.FRAME): 5}
COMMIT_BYTES |= {(True, mode): size + 16 for (_, mode), size in COMMIT_BYTES.items()}


def _scanning(line: Watched) -> None:
    """Let the device play until it is in line 2."""
    line.device.player.arm(0)
    line.device.player.trigger()
    line.device.player.advance(2 * 96 + 20)
    assert line.device.player.line == 2


@pytest.mark.parametrize("key", [b"", KEY], ids=["open", "key"])
@pytest.mark.parametrize("mode", CommitMode)
def test_the_new_scan_starts_as_asked(mode: CommitMode, key: bytes) -> None:
    line = Watched(model(WITH_MODES, key))
    _scanning(line)
    with client(line, key=key or None) as device:
        result = device.upload(SAME_FRAME, swap=mode)
        assert device.status().state == DeviceState.PLAYING
    assert (result.generation, line.device.player.swaps) == (2, 2)
    if mode is CommitMode.FRAME:
        assert result.line == 0  # that was due
    commits = [frame for frame in line.frames if frame.type == Request.COMMIT]
    assert {len(frame.payload) for frame in commits} == {COMMIT_BYTES[bool(key), mode]}


def test_a_frame_that_cannot_go_on_plays_on_and_says_so() -> None:
    line = Watched(model(WITH_MODES))
    _scanning(line)
    with client(line) as device:
        with pytest.raises(Refused, match=r"\(keep\): the frame cannot go on: .* use --swap line or") as caught:
            device.upload(OTHER_FRAME, swap=CommitMode.KEEP)
        assert caught.value.reason == Reason.KEEP
        assert line.device.player.swaps == 1
        result = device.upload(OTHER_FRAME, swap=CommitMode.FRAME)
    assert (result.generation, result.resumed, result.line) == (2, len(OTHER_FRAME.data), 0)


def test_a_parked_device_has_no_frame_to_go_on_with() -> None:
    line = Watched(model(WITH_MODES))
    with client(line) as device:
        assert device.upload(OTHER_FRAME, swap=CommitMode.KEEP).generation == 2


def test_nothing_is_sent_to_a_device_without_modes() -> None:
    line = Watched(model())
    with (
        client(line) as device,
        pytest.raises(Unsuitable, match="--swap frame: the device starts a new"),
    ):
        device.upload(SAME_FRAME, swap=CommitMode.FRAME)
    assert {frame.type for frame in line.frames} <= {Request.HELLO, Request.STATUS}


def test_an_upload_that_waits_for_a_frame_has_two_frames_of_time() -> None:
    with client(Watched(model(WITH_MODES))) as device:
        longer = device.upload_time_s(SAME_FRAME, CommitMode.FRAME) - device.upload_time_s(SAME_FRAME)
    assert longer == pytest.approx(2.0 * 5 * 96 / WITH_MODES.update_rate_hz)
