"""What the client does when frames are lost, ports go and devices are reset; and a control that must fail."""

from random import Random
from unittest.mock import patch

import pytest
from client_line import BadBytes, Noise, VirtualLine
from client_rig import KEY, LARGE, LARGE_INFO, NEW, LoseOnce, Watched, client, model
from link_programs import INFO, make_scan
from replacing import replace

from tablegen.link.device import Device
from tablegen.link.errors import (
    LinkError,
    LinkLost,
    NotPlaying,
    OutOfTime,
    Silent,
)
from tablegen.link.frames import Frame, FrameReader
from tablegen.link.messages import DeviceState, Request, Upload
from tablegen.link.outcome import restart_count
from tablegen.link.upload import Uploader

# What is lost, and goes


LOSSES = [
    (Request.HELLO, 1, 0),
    (Request.BEGIN, 1, 0),
    (Request.DATA, 1, 8),
    (Request.DATA, 5, 8),
    (Request.DATA, 35, 1),
    (Request.COMMIT, 1, 0),
    (Request.STATUS, 1, 0),
]


@pytest.mark.parametrize(("kind", "which", "most"), LOSSES)
@pytest.mark.parametrize("answers", [False, True], ids=["request", "answer"])
def test_one_lost_frame_costs_little(kind: Request, which: int, most: int, answers: bool) -> None:
    spoil = LoseOnce(kind | 0x80 if answers else kind, which)
    line = Watched(model(LARGE_INFO), **{"spoil_back" if answers else "spoil_out": spoil})
    with client(line) as device:
        result = device.upload(LARGE)
        assert device.status().hash == LARGE.info.hash
    assert spoil.left <= 0, "the fault did not happen"
    if answers and kind == Request.DATA:
        most = 1 if which == 35 else 0  # acknowledgements are cumulative
    # A BEGIN that is lost has all that was sent with it refused.
    assert result.retransmissions <= (8 if (kind, answers) == (Request.BEGIN, False) else most)
    assert result.seconds < 1.1


@pytest.mark.parametrize("key", [b"", KEY], ids=["open", "key"])
@pytest.mark.parametrize("seed", range(6))
def test_uploads_survive_a_bad_line(seed: int, key: bytes) -> None:
    chance = Random(seed)
    noises = [Noise(chance, 0.05, 0.05, 0.05, 0.05) for _ in range(2)]
    device_model = model(replace(INFO, window=chance.choice([1, 4, 8])), key)
    line = VirtualLine(device_model, spoil_out=noises[0], spoil_back=noises[1])
    with client(line, seed, key=key or None) as device:
        for number in range(2, 6):
            scan = make_scan(number, ticks=300, lines=20, index_bits=(8, 7))
            device.upload(scan.image(chance.random() < 0.3))
            assert device_model.status().hash.hex() == scan.digest
            assert device.readback() == scan.image(False).data
    assert all(noise.spoilt for noise in noises)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("one_of", "longest_s"), [(300, 6.0), (150, 15.0)])
def test_a_line_that_damages_bytes_gets_shorter_frames(seed: int, one_of: int, longest_s: float) -> None:
    """A DATA of 240 bytes arrives whole in 4 or 2 of 10 cases; whoever sends it again and again gives up."""
    chance = Random(seed)
    line = Watched(model(LARGE_INFO), spoil_out=BadBytes(chance, one_of), spoil_back=BadBytes(chance, one_of))
    with client(line, seed) as device:
        assert device.upload(LARGE).seconds < longest_s
        assert line.device.status().hash == LARGE.info.hash
    assert line.sent < 5 * len(LARGE.data)


def test_a_good_line_gets_long_frames_again() -> None:
    """It damages one byte of 100 at first."""
    line = Watched(model(LARGE_INFO))
    with client(line) as device:
        damaged = BadBytes(Random(1), 100)

        def spoil(piece: bytes) -> list[bytes]:
            return damaged(piece) if line.device.status().received < 2000 else [piece]

        line.spoil_out = spoil
        device.upload(LARGE)
    sizes = [len(frame.payload) - 4 for frame in line.frames if frame.type == Request.DATA]
    assert min(sizes) <= 60
    assert sizes[-2] >= 4 * min(sizes)


@pytest.mark.parametrize(
    ("one_of", "what"),
    [(60, "the line damages or loses frames, [0-9]+ of the last [0-9]+ before"), (10**9, "is it still on")],
)
def test_a_line_that_damages_frames_is_said_to(one_of: int, what: str) -> None:
    """Not that the device may be off, if what it answers comes but now and then."""
    line = VirtualLine(model(LARGE_INFO), spoil_out=BadBytes(Random(2), one_of))
    with client(line, 2) as device:

        def cut(done: int, total: int) -> None:
            if done > 400:
                line.spoil_back = lambda piece: []

        with pytest.raises(Silent, match=what) as error:
            device.upload(LARGE, cut)
        assert ("still on" in str(error.value)) == ("still on" in what)
        assert ("damages" in str(error.value)) == ("damages" in what)


def test_the_end_of_the_time_says_so_too() -> None:
    line = VirtualLine(model(LARGE_INFO), spoil_out=BadBytes(Random(1), 60))
    with client(line) as device, pytest.raises(OutOfTime, match=r"timeout: the line damages or loses .*or increase"):
        device.upload(LARGE, timeout_s=3.0)


def test_a_port_that_vanishes_is_opened_again_and_the_upload_goes_on() -> None:
    line = Watched(model(LARGE_INFO))
    with client(line) as device:
        told: list[int] = []

        def cut(done: int, total: int) -> None:
            told.append(done)
            if done > 4000 and line.there and line.opened == 1:
                line.there = False
                gone_at.append(line.now())

        gone_at: list[float] = []
        sleep = line.sleep

        def sleep_and_come_back(seconds: float) -> None:
            sleep(seconds)
            line.there = line.there or line.now() > gone_at[0] + 2.0

        device._session._sleep = sleep_and_come_back
        result = device.upload(LARGE, cut)
        assert device.status().hash == LARGE.info.hash
    assert line.opened == 2
    assert result.retransmissions <= 8
    assert result.seconds < 5.0


def test_a_port_that_stays_away_is_an_error_in_time() -> None:
    line = VirtualLine(model(LARGE_INFO))
    with client(line) as device:

        def cut(done: int, total: int) -> None:
            line.there = False

        start = line.now()
        with pytest.raises(LinkLost, match=r"the link is lost: .*it is not there"):
            device.upload(LARGE, cut, timeout_s=6.0)
        assert line.now() - start < 6.5
        with pytest.raises(LinkLost):
            device.status()


def test_without_an_opener_a_lost_port_is_the_end() -> None:
    line = VirtualLine(model())
    device = Device(line, random=Random(1))
    line.there = False
    with pytest.raises(LinkLost, match="the port disappeared"):
        device.park()


def test_a_port_lost_after_commit_is_not_uploaded_twice() -> None:
    device_model = model(LARGE_INFO)
    line = Watched(device_model)

    def cut(piece: bytes) -> list[bytes]:
        frames = FrameReader().feed(piece)
        if line.opened == 1 and frames and frames[0].type == Request.COMMIT | 0x80:
            line.there = False
            return []
        return [piece]

    line.spoil_back = cut
    with client(line) as device:
        sleep = line.sleep

        def back(seconds: float) -> None:
            sleep(seconds)
            line.there = True

        device._session._sleep = back
        result = device.upload(LARGE)
    assert (result.generation, result.line) == (2, None)
    assert line.count(Request.BEGIN) == 1
    assert device_model.status().generation == 2


def test_an_interrupted_upload_goes_on_in_another_session() -> None:
    line = Watched(model(LARGE_INFO))

    def interrupt(done: int, total: int) -> None:
        if done > 5000:
            raise KeyboardInterrupt

    with client(line, 1) as device, pytest.raises(KeyboardInterrupt):
        device.upload(LARGE, interrupt)
    line.sleep(0.2)
    before = line.count(Request.DATA)
    with client(line, 2) as device:
        assert device.status().upload == Upload.RECEIVING
        result = device.upload(LARGE)
    assert result.resumed > 5000
    assert line.count(Request.DATA) - before == -(-(len(LARGE.data) - result.resumed) // 240)


@pytest.mark.parametrize("after", [1000, 5000, 8384])
def test_a_device_that_is_reset_gets_it_again(after: int) -> None:
    device_model = model(LARGE_INFO)
    line = VirtualLine(device_model)
    with client(line) as device:
        resets: list[int] = []

        def reset(done: int, total: int) -> None:
            if done >= after and not resets:
                resets.append(done)
                device_model.reboot()

        try:
            result = device.upload(LARGE, reset)
        except NotPlaying as error:
            assert after == 8384, "reset when the scan was in force already"
            text = str(error)
        else:
            text = restart_count(result.restarts)
            assert result.generation == device_model.status().generation
            assert device_model.status().hash == LARGE.info.hash
        assert "the device restarted once meanwhile" in text
        assert device.status().boot == len(resets) == 1


@pytest.mark.parametrize("counts", [True, False], ids=["boot count", "none"])
def test_a_device_that_restarts_again_and_again_is_said_to(counts: bool) -> None:
    """Also of a device that does not count its starts, since it has taken fewer programs than before."""
    device_model = model(LARGE_INFO)
    line = VirtualLine(device_model)
    with client(line) as device:
        device.upload(NEW.image(False))

        def reset(done: int, total: int) -> None:
            if done >= 1000:
                device_model.reboot()
                device_model.boot *= counts

        with pytest.raises(LinkLost, match=f"the device restarted {'4 times' if counts else 'once'} meanwhile"):
            device.upload(LARGE, reset)


def test_a_restart_behind_the_answer_to_commit_is_no_success() -> None:
    """Though the device does not know the hash of the program that it then plays."""
    device_model = model(LARGE_INFO)
    device_model._boot_hash = bytes(32)
    line = Watched(device_model)

    def reset(piece: bytes) -> list[bytes]:
        frames = FrameReader().feed(piece)
        if frames and frames[0].type == Request.COMMIT | 0x80:
            line.spoil_back = lambda piece: [piece]
            device_model.reboot()
        return [piece]

    line.spoil_back = reset
    with client(line) as device, pytest.raises(NotPlaying, match="the device restarted once"):
        device.upload(LARGE)


def test_two_hosts_get_an_error_that_says_so() -> None:
    line = VirtualLine(model())
    with client(line) as device:
        device_model = line.device

        def steal(piece: bytes) -> list[bytes]:
            frames = FrameReader().feed(piece)
            stolen = frames and frames[0].type == Request.STATUS
            return [Frame(Request.HELLO, 9, 12345, b"\1").encode(), piece] if stolen else [piece]

        line.spoil_out = steal
        with pytest.raises(LinkLost, match="another program uses the device"):
            device.status()
        line.spoil_out = lambda piece: [piece]
        assert device.status().state == DeviceState.PARKED
    assert device_model is line.device


def test_a_trigger_that_is_repeated_starts_one_scan() -> None:
    """The answer is lost, the scan parked meanwhile by somebody: the same request again only answers."""
    device_model = model()
    line = Watched(device_model)
    with client(line) as device:
        device.arm(1)
        line.spoil_back = LoseOnce(Request.TRIGGER | 0x80, 1)
        device.trigger()
        assert line.count(Request.TRIGGER) == 2
        assert len({frame.seq for frame in line.frames if frame.type == Request.TRIGGER}) == 1


def test_requests_that_act_stay_in_order_however_many_frames_lie_between() -> None:
    line = VirtualLine(model(LARGE_INFO))
    with client(line) as device:
        for number in range(6, 12):
            device.upload(make_scan(number, ticks=1250, lines=200, index_bits=(11, 11)).image(False))
            device.arm(1)
            for _ in range(100):
                device.clear()


# Negative control


class Deaf(Uploader):
    """Takes every acknowledgement for the one it wants: each frame that was sent has arrived."""

    def _take_data(self, received: int, sent: object) -> None:
        super()._take_data(max(received, sent.end), sent)  # type: ignore[attr-defined, arg-type]


def test_a_client_that_ignores_acknowledgements_is_caught() -> None:
    """It sends on where it should go back, so that what the device commits is not complete; here a DATA is lost."""

    def run(kind: type[Uploader]) -> tuple[int, bytes]:
        line = Watched(model(LARGE_INFO), spoil_out=LoseOnce(Request.DATA, 3))
        with client(line) as device, patch("tablegen.link.device.Uploader", kind):
            try:
                result = device.upload(LARGE)
            except LinkError:
                return 1 << 30, device.status().hash
            return result.retransmissions, device.status().hash

    good, bad = run(Uploader), run(Deaf)
    assert good == (8, LARGE.info.hash) or (good[0] <= 8 and good[1] == LARGE.info.hash)
    assert bad[0] > 2 * good[0] or bad[1] != LARGE.info.hash
