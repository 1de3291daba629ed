"""The virtual line and the proxy themselves: pace, latencies, and each fault alone."""

import socket
import threading
import time
from random import Random

import pytest
from limits import PATIENCE_S
from link_faults import KINDS, Chances, Spoiler, split
from link_line import Line
from link_proxy import FaultProxy

from tablegen.link.errors import LinkLost, NoPort

_FRAMES = [bytes([number + 1] * 20) + b"\0" for number in range(200)]


class _Echo:
    """Sends back what it gets, and tells when it was ticked."""

    def __init__(self) -> None:
        self.ticks = self.boots = 0
        self._out = b""

    def receive(self, data: bytes) -> None:
        self._out += data

    def transmit(self) -> bytes:
        sent, self._out = self._out, b""
        return sent

    def tick(self, ticks: int) -> None:
        self.ticks += ticks

    def reboot(self) -> None:
        self.boots += 1


def test_bytes_take_their_time() -> None:
    echo = _Echo()
    line = Line(echo, baud=10000, out_s=0.25, back_s=0.5, tick_hz=1000)
    port = line.open()
    port.write(b"\1" * 99 + b"\0")
    assert port.read(0.849) == b""
    assert line.now_s == pytest.approx(0.849)
    assert len(port.read(10.0)) == 100
    # 100 bytes of 1 ms, there and back
    assert line.now_s == pytest.approx(0.1 + 0.25 + 0.1 + 0.5, abs=1e-6)
    assert echo.ticks == pytest.approx(1000 * line.now_s, abs=1)


def test_a_second_frame_waits_for_the_first() -> None:
    line = Line(_Echo(), baud=10000, out_s=0.0, back_s=0.0)
    port = line.open()
    for _ in range(3):
        port.write(b"\1" * 9 + b"\0")
    times: list[float] = []
    while len(times) < 3:
        assert len(port.read(1.0)) == 10
        times.append(line.now_s)
    assert times == pytest.approx([0.02, 0.03, 0.04], abs=1e-6)


def test_a_bridge_delivers_at_multiples_of_its_time() -> None:
    line = Line(_Echo(), baud=None, out_s=0.0, back_s=0.001, batch_s=0.016)
    port = line.open()
    for pause in (0.003, 0.02, 0.0159):
        line.sleep(pause)
        port.write(b"\1\0")
        assert port.read(1.0) == b"\1\0"
        assert line.now_s / 0.016 == pytest.approx(round(line.now_s / 0.016), abs=1e-6)


def test_a_port_that_vanishes_comes_back() -> None:
    line = Line(_Echo(), chances=Chances(vanish=1.0, away_s=0.5))
    port = line.open()
    port.write(b"\1\0")
    with pytest.raises(LinkLost):
        port.read(0.1)
    with pytest.raises(NoPort):
        line.open()
    line.heal()
    line.sleep(0.5)
    other = line.open()
    other.write(b"\2\0")
    assert other.read(1.0) == b"\2\0"
    with pytest.raises(LinkLost):
        port.write(b"\1\0")


def test_a_device_that_was_reset_is_deaf_for_a_while() -> None:
    echo = _Echo()
    line = Line(echo, chances=Chances(reset=1.0, deaf_s=0.1), baud=None)
    port = line.open()
    port.write(b"\1\0\2\0\3\0")
    assert port.read(0.05) == b"\1\0"
    assert port.read(1.0) == b""
    assert echo.boots == line.resets == 1


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in ("reset", "vanish")])
def test_a_fault_does_what_its_name_says(kind: str) -> None:
    spoiler = Spoiler(Chances(**{kind: 0.05}), Random(1))
    spoilt = [spoiler.spoil(frame) for frame in _FRAMES]
    arrived = b"".join(piece for pieces in spoilt for _, piece in pieces)
    sent = b"".join(_FRAMES)
    done = spoiler.done[kind]
    assert done > 3
    assert spoiler.done.total() == done
    if kind in ("drop", "double", "insert"):
        assert len(arrived) == len(sent) + (-done if kind == "drop" else done)
    elif kind == "flip":
        different = [(a ^ b).bit_count() for a, b in zip(arrived, sent, strict=True) if a != b]
        assert different == [1] * done
    elif kind in ("lose", "repeat"):
        count = 0 if kind == "lose" else 2
        assert sum(len(pieces) == count for pieces in spoilt) == done
        assert len(split(arrived)) == len(_FRAMES) + (-done if kind == "lose" else done)
    elif kind == "reorder":
        assert sorted(split(arrived)) == sorted(_FRAMES)
        assert arrived != sent
    elif kind == "truncate":
        assert len(arrived) < len(sent)
        assert sum(piece != frame for pieces, frame in zip(spoilt, _FRAMES, strict=True) for _, piece in pieces) == done
    else:
        assert kind == "stall"
        assert arrived == sent
        assert sum(delay > 0.0 for pieces in spoilt for delay, _ in pieces) == done


def test_no_chance_no_fault() -> None:
    spoiler = Spoiler(Chances(), Random(1))
    assert [spoiler.spoil(frame) for frame in _FRAMES] == [[(0.0, frame)] for frame in _FRAMES]
    assert not spoiler.done.total()


def _serve_echo(listening: socket.socket) -> None:
    connection, _ = listening.accept()
    with connection:
        while part := connection.recv(4096):
            connection.sendall(part)


def _received(client: socket.socket, count: int) -> bytes:
    client.settimeout(PATIENCE_S)
    data = b""
    while len(data) < count and (part := client.recv(4096)):
        data += part
    return data


def test_the_proxy_passes_on_and_lets_clients_come_again() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        device = threading.Thread(target=_serve_echo, args=(listening,), daemon=True)
        device.start()
        with FaultProxy(listening.getsockname()[1], Chances(), 1, baud=1_000_000) as proxy:
            port = int(proxy.url.rpartition(":")[2])
            for _ in range(2):
                with socket.create_connection(("127.0.0.1", port)) as client:
                    sent = b"".join(_FRAMES[:20])
                    client.sendall(sent[:33])
                    client.sendall(sent[33:])
                    assert _received(client, len(sent)) == sent
            assert proxy.connections == 2
        device.join(PATIENCE_S)
        assert not device.is_alive()


def test_the_proxy_vanishes() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        threading.Thread(target=_serve_echo, args=(listening,), daemon=True).start()
        with FaultProxy(listening.getsockname()[1], Chances(vanish=1.0, away_s=0.1), 1) as proxy:
            port = int(proxy.url.rpartition(":")[2])
            with socket.create_connection(("127.0.0.1", port)) as client:
                client.sendall(b"\1\0")
                assert _received(client, 2) == b""
            until = time.monotonic() + PATIENCE_S
            with socket.create_connection(("127.0.0.1", port)):
                while proxy.connections < 2:
                    assert time.monotonic() < until
                    time.sleep(0.01)
