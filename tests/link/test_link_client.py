"""The client in virtual time, against the model of a device: what it asks, how fast it is, and what it survives."""

import time
from random import Random
from unittest.mock import patch

import pytest
from client_line import VirtualLine
from client_rig import BOOT, FOURIER, KEY, LARGE, LARGE_INFO, NEW, TABLE, Watched, client, model
from link_programs import INFO, LIMITS, make_scan
from replacing import replace

from tablegen.link.device import Device
from tablegen.link.errors import (
    LinkError,
    NoAnswer,
    NoPort,
    NotPlaying,
    NotUnderstood,
    OutOfTime,
    Refused,
    Silent,
)
from tablegen.link.exchange import Exchange
from tablegen.link.frames import FrameReader
from tablegen.link.messages import AxisLimits, DeviceState, Feature, More, Reason, Request, Upload
from tablegen.link.session import LinkSession


def never_answering(piece: bytes) -> list[bytes]:
    return []


# What it says of a device, and what it asks of it


def test_it_knows_the_device_after_hello() -> None:
    line = Watched(model())
    with client(line) as device:
        assert device.info == INFO
        assert device.hello == device.status()
        assert device.status().hash.hex() == BOOT.digest
        assert device.limits() == (INFO.x_limits, INFO.y_limits)
    assert [frame.type for frame in line.frames] == [Request.HELLO, Request.STATUS, Request.STATUS, Request.LIMITS]
    assert len({frame.session for frame in line.frames}) == 1


def test_further_features_follow_the_status() -> None:
    """Bits that only a later version knows are no error; without any, the answer has its old length."""
    further = More.SLOW_PARTS | More.MOVE | More(1 << 31)
    features = INFO.features | Feature.COMMIT_MODES
    info = replace(INFO, features=features, more=further, slow_knots=17, slow_index_bits=6)
    with client(VirtualLine(model(info))) as device:
        assert device.info.more == further
        hello = device.info.hello(device.hello)
        assert hello[132:] == further.to_bytes(4, "little") + bytes([17, 6])
        assert replace(device.info, more=More(0)).hello(device.hello) == hello[:132]


def test_it_plays_parks_and_clears() -> None:
    line = VirtualLine(model())
    with client(line) as device:
        assert device.wait_for(DeviceState.PARKED, 5.0).line == 0
        device.arm(0)
        device.trigger()
        device.wait_for(DeviceState.PLAYING, 5.0)
        device.park()
        device.wait_for(DeviceState.PARKED, 5.0)
        device.arm(1)
        device.trigger()
        device.clear()
        with pytest.raises(OutOfTime, match=r"the device is parked and did not become no_program within 0\.5 s"):
            device.wait_for(DeviceState.NO_PROGRAM, 0.5)


def test_it_narrows_limits_and_reads_them() -> None:
    with client(VirtualLine(model())) as device:
        narrower = AxisLimits(2000, 65000, 100, 200)
        assert device.narrow(narrower, LIMITS) == (narrower.within(LIMITS), LIMITS)
        assert device.limits() == (narrower.within(LIMITS), LIMITS)
    plain = replace(INFO, features=INFO.features & ~Feature.NARROWS)
    with client(VirtualLine(model(plain))) as device, pytest.raises(Refused) as caught:
        device.narrow(narrower, narrower)
    assert caught.value.reason == Reason.PAYLOAD


def test_a_device_without_limits_has_those_of_its_build() -> None:
    device_model = model()
    del device_model._requests[Request.LIMITS]
    with client(VirtualLine(device_model)) as device:
        assert device.limits() == (INFO.x_limits, INFO.y_limits)


@pytest.mark.parametrize("key", [b"", KEY], ids=["open", "key"])
@pytest.mark.parametrize("window", [1, 2, 8, 255])
@pytest.mark.parametrize("image", [TABLE, FOURIER], ids=["table", "fourier"])
def test_an_upload_comes_into_force_and_can_be_read_back(image: object, window: int, key: bytes) -> None:
    line = Watched(model(replace(INFO, window=window), key))
    with client(line, key=key or None) as device:
        seen: list[tuple[int, int]] = []
        result = device.upload(image, lambda done, total: seen.append((done, total)))  # type: ignore[arg-type]
        assert not result.already_running
        assert (result.generation, result.retransmissions, result.resumed) == (2, 0, 0)
        assert result.bytes == len(image.data)  # type: ignore[attr-defined]
        assert seen[-1] == (result.bytes, result.bytes)
        assert seen == sorted(seen)
        assert device.status().hash.hex() == NEW.digest
        assert device.readback() == TABLE.data  # a device keeps tables
        sent = len(line.frames)
        assert device.upload(TABLE).already_running
        assert not [frame for frame in line.frames[sent:] if frame.type in (Request.BEGIN, Request.DATA)]
        assert device.upload(TABLE, force=True).generation == 3
    assert line.count(Request.DATA) == sum(-(-len(i.data) // 240) for i in (image, TABLE))  # type: ignore[attr-defined]


def test_a_challenge_does_not_expire_while_an_image_is_on_its_way() -> None:
    """An image that takes half a minute, and a nonce that lasts ten seconds: no request is refused."""
    clock: list[VirtualLine] = []
    line = Watched(model(LARGE_INFO, KEY, milliseconds=lambda: round(1000 * clock[0].now()) if clock else 0), baud=2400)
    clock.append(line)
    with client(line, key=KEY) as device:
        assert device.upload(LARGE).generation == 2
        assert line.now() > 30.0
        assert (line.count(Request.CHALLENGE), line.count(Request.COMMIT)) == (1, 1)


def test_what_waits_for_a_line_is_asked_for_and_not_sent_again() -> None:
    """The lines of the boot program last 5 s here."""
    line = Watched(model(), tick_hz=20)
    with client(line) as device:
        device.arm()
        device.trigger()
        device.wait_for(DeviceState.PLAYING, 60.0)
        start = line.now()
        result = device.upload(TABLE, timeout_s=30.0)
        assert line.now() - start > 1.0
        assert result.line is not None
    assert line.count(Request.COMMIT) == 1
    assert line.count(Request.BEGIN) == 1
    assert line.count(Request.STATUS) > 5


def test_an_upload_that_never_comes_into_force_ends_in_time() -> None:
    line = VirtualLine(model(), tick_hz=0)
    with client(line) as device:
        start = line.now()
        with pytest.raises(OutOfTime, match="has not reached the start of a line"):
            device.upload(TABLE, timeout_s=7.0)
        assert line.now() - start == pytest.approx(7.0, abs=0.5)
        with pytest.raises(OutOfTime, match="busy with another upload"):
            device.upload(FOURIER, timeout_s=2.0)


def test_a_busy_device_is_waited_for() -> None:
    device_model = model(checking=40000)
    line = VirtualLine(device_model)
    with client(line, 1) as first:
        with pytest.raises(OutOfTime):
            first.upload(TABLE, timeout_s=0.5)
        assert first.status().upload == Upload.CHECKING
    with client(line, 2) as second:
        assert second.upload(make_scan(5).image(False)).generation == 3  # the first one is in force by then
    with client(line, 3) as third, pytest.raises(OutOfTime):
        third.upload(TABLE, timeout_s=0.5)
    with client(line, 4) as fourth:
        result = fourth.upload(TABLE)
        assert result.generation == 4
        assert fourth.status().hash.hex() == NEW.digest


# Numbers


@pytest.mark.parametrize(
    ("baud", "back_s", "batch_s", "share"),
    [(115200, 0.001, 0.0, 0.92), (460800, 0.016, 0.0, 0.85), (460800, 0.0, 0.016, 0.85)],
)
def test_most_of_the_line_rate_is_used(baud: int, back_s: float, batch_s: float, share: float) -> None:
    """Of the payload alone at 115200; of what is on the wire at 460800. Until the new scan is in force."""
    line = Watched(model(LARGE_INFO), baud=baud, back_s=back_s, batch_s=batch_s, tick_hz=500_000)
    with client(line) as device:
        device.arm()
        device.trigger()
        result = device.upload(LARGE)
    assert len(LARGE.data) == 8384
    payload = 10 * result.bytes / baud / result.seconds
    wire = 10 * result.wire_bytes / baud / result.seconds
    assert wire >= share
    assert payload >= share or baud > 115200
    assert result.retransmissions == 0
    assert line.count(Request.BEGIN) == line.count(Request.COMMIT) == 1


def test_an_early_result_is_no_matter_of_luck() -> None:
    """Negative control: a host that waits for each answer is a good part slower on the same line."""
    line = VirtualLine(model(replace(LARGE_INFO, window=1)), baud=460800, back_s=0.016, tick_hz=500_000)
    with client(line) as device:
        result = device.upload(LARGE)
    assert 10 * result.wire_bytes / 460800 / result.seconds < 0.5


@pytest.mark.parametrize("way_s", [0.03, 0.06, 0.15])
def test_a_long_way_is_learned(way_s: float) -> None:
    """As through a network, which nobody told the client of: nothing is sent twice, since the first answers tell."""
    line = Watched(model(LARGE_INFO), out_s=way_s, back_s=way_s, tick_hz=500_000)
    with client(line) as device:
        device.arm()
        device.trigger()
        result = device.upload(LARGE)
    assert result.retransmissions == 0
    assert line.count(Request.BEGIN) == line.count(Request.COMMIT) == 1


def test_the_window_of_the_device_is_kept() -> None:
    """The device's memory for bytes is finite: never more unanswered frames on their way than it says."""
    for window in (1, 3, 8):
        on_way, most = [0], [0]

        def out(piece: bytes, on_way: list[int] = on_way, most: list[int] = most) -> list[bytes]:
            on_way[0] += len(piece) > 1
            most[0] = max(most[0], on_way[0])
            return [piece]

        def back(piece: bytes, on_way: list[int] = on_way) -> list[bytes]:
            on_way[0] -= 1
            return [piece]

        line = VirtualLine(model(replace(LARGE_INFO, window=window)), spoil_out=out, spoil_back=back, back_s=0.05)
        with client(line, latency_s=0.05) as device:
            assert device.upload(LARGE).retransmissions == 0
            assert len(device.readback()) == len(LARGE.data)
        assert most[0] == window


# Wrong lines, devices and uses


def test_silence_is_no_answer_and_noise_is_a_wrong_rate() -> None:
    line = VirtualLine(model(), spoil_out=never_answering)
    with pytest.raises(NoAnswer, match=r"is it on.*TX and RX"):
        client(line)
    assert line.now() < 5.5
    chance = Random(3)
    line = VirtualLine(model(), spoil_back=lambda piece: [bytes(chance.randrange(256) for _ in piece)])
    with pytest.raises(NoAnswer, match="is --baud the rate of the device"):
        client(line)


def test_a_device_that_falls_silent_is_lost_and_the_port_is_left_alone() -> None:
    line = VirtualLine(model())
    with client(line) as device:
        line.spoil_back = never_answering
        for ask in (device.status, device.park, device.readback, lambda: device.upload(TABLE)):
            start = line.now()
            with pytest.raises(Silent, match="no longer answers"):
                ask()
            assert line.now() - start < 20.0
    assert line.opened == 1, "to open a port resets some devices"


def test_a_readback_ends_when_the_device_falls_silent() -> None:
    """Long before its time is over."""
    line = VirtualLine(model(LARGE_INFO))
    with client(line) as device:
        device.upload(LARGE)
        answers = [0]

        def stop(piece: bytes) -> list[bytes]:
            answers[0] += 1
            return [piece] if answers[0] < 12 else []

        line.spoil_back, start = stop, line.now()
        with pytest.raises(Silent, match="no longer answers"):
            device.readback(timeout_s=1000.0)
        assert line.now() - start < 20.0


def test_a_silent_device_is_given_up_when_the_time_is_over() -> None:
    line = VirtualLine(model(), spoil_out=never_answering)
    with pytest.raises(NoAnswer):
        client(line, timeout_s=0.3)
    assert line.now() == pytest.approx(0.3, abs=0.01)


def test_a_port_that_is_not_there() -> None:
    line = VirtualLine(model())
    line.there = False
    with pytest.raises(NoPort):
        client(line)


def test_another_version_is_said() -> None:
    with patch("tablegen.link.session.VERSION", 2), pytest.raises(Refused) as caught:
        client(VirtualLine(model()))
    assert (caught.value.reason, caught.value.detail) == (Reason.VERSION, 1)
    assert "speaks version 1" in str(caught.value)


@pytest.mark.parametrize("cut", [0, 10, 56, 131])
def test_answers_that_make_no_sense(cut: int) -> None:
    def shorten(piece: bytes) -> list[bytes]:
        (frame,) = FrameReader().feed(piece)
        return [replace(frame, payload=frame.payload[:cut]).encode()]

    with pytest.raises(NotUnderstood, match="invalid answer"):
        client(VirtualLine(model(), spoil_back=shorten))


def test_a_device_that_says_more_than_it_should_is_understood() -> None:
    """Later versions may append to answers."""

    def longer(piece: bytes) -> list[bytes]:
        (frame,) = FrameReader().feed(piece)
        appended = {0x82: b"\1\2", 0x83: b"\3\4", 0x84: b"\5", 0x86: b"\6" * 9, 0x8D: b"\7"}
        return [replace(frame, payload=frame.payload + appended.get(frame.type, b"")).encode()]

    with client(VirtualLine(model(), spoil_back=longer)) as device:
        assert device.upload(TABLE).generation == 2
        assert device.limits() == (LIMITS, LIMITS)


def test_the_wrong_key_is_refused_and_none_is_missed() -> None:
    line = Watched(model(key=KEY))
    with client(line) as device:
        with pytest.raises(Refused, match="give the key of this device"):
            device.upload(TABLE)
        assert not line.count(Request.BEGIN), "that is known before anything is sent"
        with pytest.raises(Refused) as caught:
            device.park()
        assert caught.value.reason == Reason.KEY
    with client(line, key=KEY[::-1]) as device:
        for ask in (device.park, lambda: device.upload(TABLE), lambda: device.narrow(LIMITS, LIMITS)):
            with pytest.raises(Refused) as caught:
                ask()
            assert caught.value.reason == Reason.KEY
        assert device.status().hash.hex() == BOOT.digest
    for key in (b"", b"short", bytes(33)):
        with pytest.raises(ValueError, match="16 to 32"):
            client(line, key=key)


def test_a_refusal_names_axis_limit_and_value() -> None:
    narrow = AxisLimits(2000, 60000, 30000, 60000)
    with client(VirtualLine(model())) as device:
        limits = device.narrow(narrow, LIMITS)
        with pytest.raises(Refused) as caught:
            device.upload(TABLE, limits=limits)
    assert caught.value.reason == Reason.CODES
    text = str(caught.value)
    assert text.startswith("the device refused COMMIT (codes): x: its codes 1500..63500 go beyond 2000..60000")


def test_an_open_interlock_keeps_the_upload() -> None:
    device_model = model()
    line = Watched(device_model)
    with client(line) as device:
        device_model.permits = False
        with pytest.raises(Refused, match="close it and try again") as caught:
            device.upload(TABLE)
        assert caught.value.reason == Reason.INTERLOCK
        sent = line.count(Request.DATA)
        device_model.permits = True
        assert device.upload(TABLE).resumed == len(TABLE.data)
        assert line.count(Request.DATA) == sent


def test_a_damaged_memory_is_uploaded_again_and_given_up_in_the_end() -> None:
    device_model = model()

    receive, left = device_model.receive, [1]

    def poked(data: bytes) -> None:
        frames = FrameReader().feed(data)
        if frames and frames[0].type == Request.COMMIT and left[0]:
            left[0] -= 1
            device_model.memory[200] ^= 1
        receive(data)

    device_model.receive = poked  # type: ignore[method-assign]
    line = VirtualLine(device_model)
    with client(line) as device:
        assert device.upload(TABLE).generation == 2
        left[0] = 100
        with pytest.raises(Refused, match="the memory may be faulty"):
            device.upload(FOURIER, force=True)
        assert device.status().hash.hex() == NEW.digest


def test_a_device_that_plays_something_else_is_caught() -> None:
    """It says that the commit was done, and kept what it had."""
    device_model = model()
    status = device_model.status

    def lie() -> object:
        return replace(status(), hash=bytes.fromhex(BOOT.digest))

    device_model.status = lie  # type: ignore[method-assign, assignment]
    with client(VirtualLine(device_model)) as device, pytest.raises(NotPlaying, match="plays 000000000000 instead of"):
        device.upload(TABLE)


def test_frames_that_cannot_be() -> None:
    with client(VirtualLine(model())) as device:
        for frames in (-1, 1 << 32):
            with pytest.raises(ValueError, match="frames"):
                device.arm(frames)


@pytest.mark.common
def test_it_waits_by_the_clock_of_the_line_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Minutes of a dead line take no time here."""
    for name in ("sleep", "monotonic"):
        monkeypatch.delattr(time, name)
    line = VirtualLine(model(), baud=300, tick_hz=0)
    with client(line, timeout_s=180.0) as device, pytest.raises(LinkError):
        device.upload(TABLE, timeout_s=180.0)
    assert line.now() > 180.0


def test_sessions_are_chosen_by_chance() -> None:
    line = VirtualLine(model())
    sessions = set()
    for _ in range(8):
        with Device(line) as device:
            sessions.add(device._session.exchange.session)
    assert len(sessions) == 8
    assert 0 not in sessions
    assert isinstance(device._session, LinkSession)
    assert isinstance(device._session.exchange, Exchange)
