"""Long ways, slow lines and lost frames: uploads and readbacks end well, and cost little more than their bytes."""

from collections.abc import Callable
from itertools import pairwise
from random import Random
from unittest.mock import patch

import pytest
from client_line import VirtualLine
from client_rig import KEY, LARGE, LARGE_INFO, Watched, client, model
from hypothesis import example, given, settings
from hypothesis import strategies as st
from link_faults import Chances
from link_line import Line
from replacing import replace

from tablegen.link.device import Device
from tablegen.link.errors import LinkError, OutOfTime
from tablegen.link.flight import Flight, SentFrame
from tablegen.link.frames import FrameReader
from tablegen.link.messages import Request
from tablegen.link.outcome import UploadResult
from tablegen.link.pace import Pace, back_off

SIZE = len(LARGE.data)
NEVER = Chances()


def upload(
    seed: int = 1, key: bytes = b"", window: int = 8, timeout_s: float | None = None, **line_options: object
) -> tuple[UploadResult, Line]:
    """Over a line of these properties, which the client is not told."""
    device_model = model(replace(LARGE_INFO, window=window), key, milliseconds=lambda: int(1000.0 * line.now_s))
    line = Line(device_model, seed=seed, tick_hz=500_000, **line_options)  # type: ignore[arg-type]
    with Device(line.open, key=key or None, random=Random(seed), sleep=line.sleep) as device:
        device.arm()
        device.trigger()
        result = device.upload(LARGE, timeout_s=timeout_s)
    assert device_model.status().hash == LARGE.info.hash
    return result, line


@pytest.mark.common
@pytest.mark.parametrize("key", [b"", KEY], ids=["open", "key"])
@pytest.mark.parametrize("round_trip_s", [0.5, 1.0, 2.0])
def test_a_long_way(round_trip_s: float, key: bytes) -> None:
    result, line = upload(key=key, out_s=round_trip_s / 2, back_s=round_trip_s / 2)
    assert result.retransmissions == 0
    assert line.sent < 1.15 * SIZE
    round_trips = 7 if key else 6  # a window of 8 takes five, a challenge one, and bytes their time
    assert result.seconds < round_trips * round_trip_s
    assert result.slow_baud is None, "a long way is not a slow line"


@pytest.mark.common
@pytest.mark.parametrize("key", [b"", KEY], ids=["open", "key"])
@pytest.mark.parametrize("slower", [4, 12, 48])
def test_a_slow_line_is_used_and_named(slower: int, key: bytes) -> None:
    baud = 115200 // slower
    result, line = upload(key=key, baud=baud, told_baud=115200)
    assert line.sent < 1.5 * SIZE
    assert result.seconds < 1.5 * 10 * SIZE / baud
    assert result.slow_baud == pytest.approx(baud, rel=0.05)


def test_a_line_as_fast_as_it_should_be_is_not_called_slow() -> None:
    for options in ({}, {"baud": 460800, "back_s": 0.016}, {"baud": 460800, "batch_s": 0.016}, {"window": 1}):
        assert upload(**options)[0].slow_baud is None  # type: ignore[arg-type]
    for window in (2, 3):
        assert upload(window=window, out_s=0.1, back_s=0.1)[0].slow_baud is None, (
            "some answers follow each other closely"
        )


@pytest.mark.rest
@settings(max_examples=25, deadline=None)
@given(
    slower=st.integers(1, 12),
    round_trip_s=st.floats(0.0, 2.0),
    window=st.integers(1, 32),
    batch_s=st.sampled_from([0.0, 0.016]),
    seed=st.integers(0, 1000),
)
@example(slower=12, round_trip_s=2.0, window=1, batch_s=0.016, seed=1)
@example(slower=12, round_trip_s=0.0, window=32, batch_s=0.0, seed=1)
def test_no_way_costs_twice_the_bytes(slower: int, round_trip_s: float, window: int, batch_s: float, seed: int) -> None:
    _, line = upload(
        seed,
        window=window,
        baud=115200 // slower,
        told_baud=115200,
        out_s=round_trip_s / 2,
        back_s=round_trip_s / 2,
        batch_s=batch_s,
    )
    assert line.sent < 2 * SIZE


@pytest.mark.common
@pytest.mark.parametrize("key", [b"", KEY], ids=["open", "key"])
def test_lost_frames(key: bytes) -> None:
    """15 of 100, in both directions."""
    sent = [upload(seed, key, chances=Chances(lose=0.15))[1].sent for seed in range(12)]
    assert sum(sent) < 2 * SIZE * len(sent)
    assert max(sent) < 3 * SIZE


@pytest.mark.parametrize("slower", [1, 12])
def test_a_readback_through_a_slow_line(slower: int) -> None:
    device_model = model(LARGE_INFO)
    with client(VirtualLine(device_model)) as device:
        device.upload(LARGE)
    chances = NEVER if slower > 1 else Chances(lose=0.15)
    line = Line(device_model, chances=chances, baud=115200 // slower, told_baud=115200, out_s=0.2, back_s=0.2)
    with Device(line.open, random=Random(1), sleep=line.sleep) as device:
        assert device.readback() == LARGE.data
    assert line.sent < 60 * (SIZE / 240) if slower > 1 else line.sent < SIZE / 4


def test_a_request_has_several_tries_through_a_long_way() -> None:
    lost = [0]

    def lose_three(piece: bytes) -> list[bytes]:
        frames = FrameReader().feed(piece)
        lost[0] += bool(frames) and frames[0].type == Request.STATUS
        return [] if 0 < lost[0] <= 3 else [piece]

    line = VirtualLine(model(), out_s=0.5, back_s=0.5, spoil_out=lose_three)
    with client(line) as device:
        assert device.status().generation == 1
    assert lost[0] == 4


def test_a_readback_keeps_the_time_that_it_was_given() -> None:
    device_model = model(LARGE_INFO)
    with client(VirtualLine(device_model)) as device:
        device.upload(LARGE)
    line = Line(device_model, baud=9600, told_baud=115200)
    with Device(line.open, random=Random(1), sleep=line.sleep) as device:
        start = line.now_s
        with pytest.raises(
            OutOfTime, match=r"\d+ bytes of the image were read; the line is slow, answers come at about"
        ):
            device.readback(timeout_s=5.0)
        assert line.now_s - start < 5.5


def test_the_time_allowed_grows_with_the_way() -> None:
    device_model = model(LARGE_INFO)
    line = Line(device_model, baud=2400, told_baud=115200, tick_hz=500_000)
    with Device(line.open, random=Random(1), sleep=line.sleep) as device:
        before = device.upload_time_s(LARGE)
        start = line.now_s
        device.upload(LARGE)
        assert line.now_s - start > before
    with Device(line.open, random=Random(2), sleep=line.sleep) as device:
        start = line.now_s
        with pytest.raises(OutOfTime, match="the line is slow, answers come at about 2400 baud: give --baud 2400"):
            device.upload(make_other(), timeout_s=20.0)
        assert line.now_s - start < 20.5, "a time that was given is kept"


def make_other() -> object:
    """Another scan of the same size."""
    return replace(LARGE, info=replace(LARGE.info, hash=bytes(31) + b"\x01"))


# Ways that change, and buffers that overflow


def changed_way(way_s: float = 1.0) -> float:
    """Bytes in proportion, of an upload whose way is long from its first frame on: nobody knew."""
    line = Watched(model(LARGE_INFO), tick_hz=500_000)
    with client(line) as device:
        device.status()
        line._out_s = line._back_s = way_s
        device.upload(LARGE)
    return line.sent / SIZE


class Bridge(VirtualLine):
    """A bridge with a fast port, a slow line, and room for few bytes: what has no room is lost."""

    ROOM = 1200  # bytes

    def write(self, data: bytes) -> None:
        waiting = (self._out_free - self.now_s) / self._byte_s
        super().write(b"" if waiting + len(data) > self.ROOM else data)
        self.sent += len(data) if waiting + len(data) > self.ROOM else 0

    @property
    def _byte_s(self) -> float:
        return 12 * super()._byte_s


def through_a_bridge() -> float:
    """Bytes that an upload takes, in proportion."""
    line = Bridge(model(LARGE_INFO), tick_hz=500_000)
    with client(line) as device:
        device.upload(LARGE)
    return line.sent / SIZE


def test_a_way_that_becomes_long() -> None:
    assert changed_way() < 1.5


def test_a_buffer_that_is_too_small_for_the_window() -> None:
    assert through_a_bridge() < 2.0


# Broken on purpose


def _deaf_to_late(self: Flight, key: tuple[int, int], now: float) -> SentFrame | None:
    self.last_answer_at, self.in_vain = now, 0
    return self._on_way.pop(key, None)


def without_learning() -> float:
    """Bytes in proportion, through a way that is longer than any wait: late answers alone bring it on."""
    with patch("tablegen.link.pace.Pace.answered"):
        return upload(out_s=0.75, back_s=0.75, timeout_s=60.0)[1].sent / SIZE


def _capped(self: Pace, key: tuple[int, int], now: float, answer_bytes: int) -> None:
    ANSWERED(self, key, now, answer_bytes)
    self.late_s = min(self.late_s, 0.25)


ANSWERED = Pace.answered
BREAKS: dict[str, tuple[str, object, Callable[[], float]]] = {
    "lateness has a cap": ("link.pace.Pace.answered", _capped, lambda: upload(out_s=1.0, back_s=1.0)[1].sent / SIZE),
    "late answers do not count": ("link.flight.Flight.take", _deaf_to_late, without_learning),
    "waits do not double": ("link.flight.back_off", lambda wait_s, in_vain: wait_s, lambda: changed_way(2.0)),
    "the window does not shrink": ("link.flight.Flight.lost", lambda self: None, through_a_bridge),
}


@pytest.mark.common
@pytest.mark.parametrize("name", BREAKS)
def test_a_client_that_does_not_learn_is_caught(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It takes more bytes or seconds, or fails."""
    place, broken, trial = BREAKS[name]
    good = trial()
    monkeypatch.setattr(f"tablegen.{place}", broken)
    try:
        bad = trial()
    except LinkError:
        return
    assert bad > 1.2 * good


# The parts


def test_waits_double_up_to_a_bound() -> None:
    assert [back_off(0.25, count) for count in range(4)] == [0.25, 0.5, 1.0, 1.0]
    assert [back_off(2.0, count) for count in range(4)] == [2.0, 4.0, 8.0, 8.0]
    assert back_off(0.1, 10_000) == 1.0


def test_a_silent_line_is_asked_less_and_less_often() -> None:
    line = Watched(model(), spoil_out=lambda piece: [])
    times: list[float] = []
    write = line.write

    def note(data: bytes) -> None:
        times.append(line.now())
        write(data)

    line.write = note  # type: ignore[method-assign]
    with pytest.raises(LinkError):
        client(line)
    waits = [later - earlier for earlier, later in pairwise(times)]
    assert len(waits) >= 5
    assert all(later == pytest.approx(min(2 * earlier, 1.0), rel=0.01) for earlier, later in pairwise(waits))


def _answered(pace: Pace, now: float, seq: int, delay_s: float, slower: float = 1.0) -> float:
    """A STATUS that takes so long; the wait that was allowed for it."""
    wait = pace.sent((Request.STATUS, seq), now, 115200, (12, 76), True)
    pace.answered((Request.STATUS, seq), now + delay_s, 76)
    return wait


@given(st.floats(0.05, 100.0))
def test_one_answer_teaches_any_delay(delay_s: float) -> None:
    pace = Pace(0.016)
    _answered(pace, 0.0, 1, delay_s)
    assert pace.sent((Request.STATUS, 2), delay_s, 115200, (12, 76), True) > delay_s


def test_a_request_that_was_sent_twice_teaches_nothing() -> None:
    """Karn: nobody knows which of both was answered."""
    pace = Pace(0.016)
    for now in (0.0, 0.9):
        pace.sent((Request.PARK, 7), now, 115200, (12, 16), True)
    pace.answered((Request.PARK, 7), 1.0, 0)
    assert pace.late_s == 0.0


def test_small_frames_tell_no_rate() -> None:
    """Latency drowns them: sixteen answers to short requests, 10 ms apart, are no slow line."""
    for size, slow in ((20, None), (200, 20_000)):
        pace = Pace(0.016)
        for seq in range(16):
            pace.sent((Request.STATUS, seq), 0.0, 115200, (size, 8), learn=True)
        for seq in range(16):
            pace.answered((Request.STATUS, seq), 0.1 + 0.005 * seq * (size / 10), 8)
        assert pace.slow_baud(115200) == slow


def test_a_delay_that_was_once_fades() -> None:
    pace = Pace(0.016)
    _answered(pace, 0.0, 0, 2.0)
    waits = [_answered(pace, 10.0 * seq, seq, 0.03) for seq in range(1, 30)]
    assert waits[0] > waits[1] > waits[2] > 1.5, "one quick answer does not make the way short"
    assert waits[-1] < 0.2


def test_requests_on_their_way_have_a_bound_of_their_own() -> None:
    flight = Flight(8, 0.0)
    for seq in range(8):
        assert flight.has_room()
        flight.add(SentFrame(Request.DATA, seq, 0.0, 1.0))
    assert not flight.has_room()
    assert flight.take((Request.DATA, 3), 0.5) is not None
    assert [seq for seq in range(8) if flight.take((Request.DATA, seq), 0.6) is not None] == [0, 1, 2, 4, 5, 6, 7]
    flight.lost()
    flight.lost()
    for seq in range(2):
        assert flight.has_room()
        flight.add(SentFrame(Request.DATA, seq, 1.0, 2.0))
    assert not flight.has_room()
    assert [sent.seq for sent in flight.overdue(5.0)] == [0, 1]
    assert flight.take((Request.DATA, 0), 6.0) is not None, "late, and it counts"
    flight.forget(Request.DATA)
    assert flight.take((Request.DATA, 1), 6.0) is None


def test_the_window_grows_back_to_that_of_the_device_and_no_further() -> None:
    flight = Flight(3, 0.0)
    flight.lost()

    def room() -> int:
        flight.clear(0.0)
        count = 0
        while flight.has_room() and count < 10:
            flight.add(SentFrame(Request.DATA, count, 0.0, 1.0))
            count += 1
        return count

    assert room() == 2
    for _ in range(4):  # two windows of two
        flight.got_through()
    assert room() == 3
    for _ in range(100):
        flight.got_through()
    assert room() == 3


def test_one_wait_in_vain_is_no_silence() -> None:
    flight = Flight(8, 0.0)
    for count in range(2):
        flight.add(SentFrame(Request.STATUS, count, 10.0 * count, 10.0 * count + 0.1))
        assert len(flight.overdue(10.0 * count + 9.0)) == 1
        assert flight.is_silent(10.0 * count + 9.0) == (count == 1)


@pytest.mark.parametrize(("tries_in_vain", "left"), [(0, 2), (2, 1)])
def test_two_requests_stay_on_their_way_while_answers_come(tries_in_vain: int, left: int) -> None:
    flight = Flight(8, 0.0)
    for count in range(tries_in_vain):
        flight.add(SentFrame(Request.STATUS, count, 10.0 * count, 10.0 * count + 1.0))
        assert len(flight.overdue(10.0 * count + 9.0)) == 1
    for _ in range(5):
        flight.lost()
    for seq in range(left):
        assert flight.has_room()
        flight.add(SentFrame(Request.DATA, seq, 1.0, 2.0))
    assert not flight.has_room()
