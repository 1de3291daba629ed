"""What messages and results claim of a device, against what it really has: nothing is claimed that was not answered."""

import re
from random import Random

import pytest
from client_line import VirtualLine
from client_rig import LARGE, LARGE_INFO, TABLE, LoseOnce, Watched, client, model
from link_faults import Chances
from link_line import Line
from link_programs import INFO
from replacing import replace

from tablegen.link.device import Device
from tablegen.link.errors import LinkError, LinkLost, OutOfTime
from tablegen.link.frames import FrameReader
from tablegen.link.messages import ANSWER, REFUSAL, Request, Upload
from tablegen.link.model_device import ModelDevice
from tablegen.link.outcome import UploadState, out_of_time
from tablegen.link.upload import Uploader

SIZE = len(TABLE.data)


def check_claims(said: str, device_model: ModelDevice) -> None:
    """Every number and state of a message; a device that has more than it said last is in order."""
    status = device_model.status()
    in_force = status.hash == TABLE.info.hash
    if "has received everything" in said:
        assert in_force or status.upload in (Upload.CHECKING, Upload.WAITING), said
    if found := re.search(r"has (\d+) of (\d+) bytes", said):
        assert int(found[2]) == SIZE
        assert in_force or int(found[1]) <= len(device_model.memory), said
        assert not in_force or "may become active" in said, said
    assert found or "everything" in said or "no longer answers" in said or "busy" in said, said


def uploads_that_end_badly(seeds: range) -> int:
    """Uploads on lines that lose most, in too short a time; how many of them ended in a message with a number."""
    told = 0
    for seed in seeds:
        chance = Random(seed)
        device_model = model(checking=chance.choice([0, 0, 4000]))
        line = Line(device_model, seed=seed)
        with Device(line.open, random=Random(seed), sleep=line.sleep) as device:
            line.out._chances = line.back._chances = Chances(lose=chance.choice([0.2, 0.4]))
            try:
                result = device.upload(TABLE, timeout_s=chance.uniform(0.05, 2.5))
            except OutOfTime as error:
                check_claims(str(error), device_model)
                told += 1
            except LinkLost:
                pass
            else:
                assert result.resumed == 0, "the device had nothing before"
            state = device.upload_state
            assert state is not None
            if device_model.status().hash != TABLE.info.hash:
                held = SIZE if device_model.status().upload in (Upload.CHECKING, Upload.WAITING) else 0
                assert state.confirmed <= max(len(device_model.memory), held)
            else:
                assert state.committed
    return told


def test_a_message_claims_what_the_device_said() -> None:
    assert uploads_that_end_badly(range(60)) > 20


def test_a_message_that_claims_more_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    """Negative control: a COMMIT that was sent taken for bytes that arrived, as it once was."""

    def hopeful(self: Uploader, now: float) -> OutOfTime:
        if self._commit is not None:
            return OutOfTime("timeout: the device has received everything")
        return HONEST(self, now)

    monkeypatch.setattr(Uploader, "_out_of_time", hopeful)
    with pytest.raises(AssertionError):
        uploads_that_end_badly(range(60))


HONEST = Uploader._out_of_time


def test_a_fresh_upload_had_nothing_though_the_first_answer_was_lost() -> None:
    """BEGIN again is answered with what DATA brought meanwhile."""
    line = VirtualLine(model(), spoil_back=LoseOnce(Request.BEGIN | 0x80, 1))
    with client(line) as device:
        result = device.upload(TABLE)
    assert (result.resumed, result.generation) == (0, 2)


def test_an_upload_of_the_same_bytes_as_another_scan_had_nothing() -> None:
    """HELLO shows the same CRC, but BEGIN begins anew."""
    device_model = model(replace(INFO, window=1))
    line = VirtualLine(device_model)
    other = replace(TABLE, info=replace(TABLE.info, hash=bytes(31) + b"\x05"))

    def stop(done: int, total: int) -> None:
        if done > 500:
            raise KeyboardInterrupt

    with client(line, 1) as device, pytest.raises(KeyboardInterrupt):
        device.upload(TABLE, stop)
    line.sleep(0.5)
    assert len(device_model.memory) > 500
    with client(line, 2) as device:
        assert device.upload(other).resumed == 0


def test_a_scan_in_force_is_not_sent_again_though_its_answer_was_lost() -> None:
    """Those to COMMIT and to the last DATA are lost, and STATUS tells: twice the same scan, once by force."""
    device_model = model(LARGE_INFO)

    def lose(piece: bytes) -> list[bytes]:
        (frame,) = FrameReader().feed(piece)
        done = len(device_model.memory) == len(LARGE.data)
        return (
            [] if frame.type == Request.COMMIT | ANSWER or (done and frame.type == Request.DATA | ANSWER) else [piece]
        )

    line = Watched(device_model, spoil_back=lose)
    with client(line) as device:
        for generation in (2, 3):
            result = device.upload(LARGE, force=generation == 3)
            assert (result.generation, result.line) == (generation, None)
            assert result.seconds < 1.5
    assert line.count(Request.BEGIN) == 2


def test_data_that_finds_no_upload_is_no_reason_to_begin_again() -> None:
    """It was repeated, and the scan became active meanwhile."""
    device_model = model(LARGE_INFO)
    lost = [0]

    def lose(piece: bytes) -> list[bytes]:
        """What answers while the scan becomes active, up to the first refusal."""
        (frame,) = FrameReader().feed(piece)
        done = len(device_model.memory) == len(LARGE.data) or device_model.status().generation == 2
        lost[0] += done and frame.type == REFUSAL
        return [] if done and not lost[0] else [piece]

    line = Watched(device_model, spoil_back=lose)
    with client(line) as device:
        assert device.upload(LARGE).generation == 2
    assert lost[0]
    assert line.count(Request.BEGIN) == 1


def test_data_waits_where_the_first_answers_are_lost() -> None:
    """Until BEGIN is answered nobody knows what answers to DATA mean."""
    line = Watched(
        model(LARGE_INFO), spoil_out=LoseOnce(Request.DATA, 1), spoil_back=LoseOnce(Request.BEGIN | ANSWER, 1)
    )
    with client(line) as device:
        result = device.upload(LARGE)
    assert result.retransmissions <= 8, "one window"


@pytest.mark.parametrize("seed", range(4))
def test_errors_of_a_line_that_loses_most_are_of_the_line(seed: int) -> None:
    line = Line(model(), chances=Chances(lose=0.7), seed=seed)

    def use() -> None:
        with Device(line.open, random=Random(seed), sleep=line.sleep) as device:
            device.upload(TABLE)
            device.readback()

    with pytest.raises(LinkError, match=r"answer|timeout"):
        use()
    assert line.now_s < 60.0


PART, ALL = UploadState(5, 9, False), UploadState(9, 9, True)


@pytest.mark.parametrize(
    ("state", "upload", "busy", "silence_s", "said"),
    [
        (PART, None, False, 0.0, "by its last answer the device has 5 of 9 bytes and keeps them: repeat the upload"),
        (PART, None, False, 7.0, "no answer for 7 s; by its last answer the device has 5 of 9 bytes and keeps them"),
        (PART, None, True, 0.0, "the device is busy with another upload; try again when that is active"),
        (UploadState(5, 9, True), None, False, 0.0, "5 of 9 bytes: repeat the upload to continue (if more has"),
        (ALL, None, False, 0.0, "9 of 9 bytes, and the scan may become active: see"),
        (ALL, Upload.CHECKING, False, 0.0, "has received everything, but has not ended its checks"),
        (ALL, Upload.WAITING, False, 0.0, "has received everything, but has not reached the start of a line"),
    ],
)
def test_what_is_said_when_the_time_is_over(
    state: UploadState, upload: Upload | None, busy: bool, silence_s: float, said: str
) -> None:
    text = str(out_of_time(state, upload, busy, silence_s, None))
    assert said in text
    assert ("no answer" in text) == (silence_s > 0.0)
    slow = str(out_of_time(state, upload, busy, silence_s, 9600))
    assert slow.startswith(text.removesuffix(", or increase --timeout"))
    assert slow.endswith("; the line is slow, answers come at about 9600 baud: give --baud 9600, or increase --timeout")
