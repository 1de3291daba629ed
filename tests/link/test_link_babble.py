"""Lines that never fall silent: whatever the client waits for, it ends in time and says what it heard."""

import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from unittest.mock import patch

import pytest
from client_line import VirtualLine
from client_rig import LARGE, LARGE_INFO, TABLE, client, model
from limits import PATIENCE_S
from link_babble import NOISE, TEXT, Babbling, BabblingServer

from tablegen.link.device import Device
from tablegen.link.errors import LinkError, NoAnswer, OutOfTime, Silent
from tablegen.link.exchange import Answer, Exchange
from tablegen.link.messages import DeviceState
from tablegen.link.transport import open_port

_FOR_EVER_S = 30.0  # of the virtual clock


class ForEver(Exception):
    """The client still waits when it should have ended long ago."""


class Watch(VirtualLine):
    """A line that loses patience. To read takes a moment, in which more arrives."""

    def read(self, timeout_s: float) -> bytes:
        if self.now() > _FOR_EVER_S:
            raise ForEver
        self.sleep(0.002)
        return super().read(timeout_s)


@pytest.mark.parametrize("babble", [NOISE, TEXT, bytes(64)], ids=["noise", "text", "zeros"])
def test_a_babbling_line_is_no_device(babble: bytes) -> None:
    line = Watch(Babbling(model(), babble))
    with pytest.raises(NoAnswer, match="is --baud the rate of the device"):
        client(line)
    assert line.now() < 6.0


REQUESTS: dict[str, tuple[Callable[[Device], object], type[LinkError]]] = {
    "status": (lambda device: device.status(), Silent),
    "park": (lambda device: device.park(), Silent),
    "limits": (lambda device: device.limits(), Silent),
    "wait": (lambda device: device.wait_for(DeviceState.PLAYING, 2.0), Silent),
    "readback": (lambda device: device.readback(), Silent),
    "upload": (lambda device: device.upload(LARGE), Silent),
    "short upload": (lambda device: device.upload(LARGE, timeout_s=2.0), OutOfTime),
}


@pytest.mark.parametrize("request_", REQUESTS)
def test_a_line_that_begins_to_babble_ends_every_request(request_: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the middle of an upload, and before other requests."""
    ask, error = REQUESTS[request_]
    far = Babbling(model(LARGE_INFO), begins=False)
    line = Watch(far)
    with client(line) as device:
        if request_ == "readback":
            device.upload(LARGE)

        def begin(done: int, total: int) -> None:
            far.begins = done > 2000

        if "upload" in request_:
            monkeypatch.setattr(device, "upload", partial(device.upload, progress=begin))
        else:
            far.begins = True
        with pytest.raises(error) as caught:
            ask(device)
        assert line.now() < 25.0
    assert isinstance(caught.value, OutOfTime) or "bytes come that are not its frames" in str(caught.value)


def _until_silence(self: Exchange, until: float) -> list[Answer]:
    """What ``Exchange.receive`` once was."""
    found: list[Answer] = []
    while not found:
        data = self.transport.read(max(until - self.now(), 0.0))
        for frame in self._reader.feed(data):
            found += self._answer(frame)
        if not data and self.now() >= until:
            break
    return found


def test_a_client_that_waits_for_silence_is_caught(monkeypatch: pytest.MonkeyPatch) -> None:
    """Negative control."""
    monkeypatch.setattr(Exchange, "receive", _until_silence)
    with pytest.raises(ForEver):
        client(Watch(Babbling(model())))


def test_answers_are_found_among_noise() -> None:
    """Bounded waits give nobody up who answers: here half of what comes is noise."""
    far = Babbling(model(LARGE_INFO), begins=False)
    answers = far.transmit

    def both() -> bytes:
        answer = answers()
        return b"\x55\xaa" * 8 + b"\0" + answer if answer else b""

    far.transmit = both  # type: ignore[method-assign]
    with client(VirtualLine(far)) as device:
        assert device.upload(LARGE).generation == 2
        assert device.readback() == LARGE.data


# Real sockets


@pytest.mark.rest
def test_a_babbling_socket_ends_the_command_line() -> None:
    """The other end sends as fast as it can, and reads nothing."""
    with BabblingServer() as server:
        done = subprocess.run(
            [sys.executable, "-m", "tablegen", "status", "--port", server.url],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
            timeout=PATIENCE_S,
        )
        assert server.sent > len(NOISE)
    assert (done.returncode, done.stdout) == (8, "")
    assert done.stderr == (
        "the port is open, but no device answers: the received bytes are not frames of the device: is --baud the rate "
        "of the device?\n"
    )


def test_ctrl_c_ends_the_command_line_on_a_babbling_socket() -> None:
    with BabblingServer() as server:
        started = subprocess.Popen(
            [sys.executable, "-m", "tablegen", "park", "--port", server.url],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )
        try:
            assert server.listened.wait(PATIENCE_S)
            started.send_signal(signal.SIGINT)
            out, err = started.communicate(timeout=PATIENCE_S)
        finally:
            started.kill()
            started.wait(PATIENCE_S)
    assert (started.returncode, out, err) == (130, "", "interrupted; the device continues as before\n")


def test_a_socket_is_not_emptied_as_it_is_opened() -> None:
    """pyserial would read until nothing comes."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = open_port(f"socket://127.0.0.1:{listener.getsockname()[1]}")
        with patch.object(type(port._port), "reset_input_buffer", side_effect=AssertionError):  # type: ignore[attr-defined]
            open_port(f"socket://127.0.0.1:{listener.getsockname()[1]}").close()
        port.close()


def test_a_peer_that_takes_no_bytes_is_lost_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its buffers are full: a write ends after a while."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        monkeypatch.setattr("tablegen.link.transport._WRITE_TIMEOUT_S", 0.2)
        port = open_port(f"socket://127.0.0.1:{listener.getsockname()[1]}")
        peer, _ = listener.accept()

        def write_on() -> None:
            for _ in range(1000):
                port.write(TABLE.data * 100)

        with peer, pytest.raises(LinkError, match=r"the other end took no bytes for 0\.2 s; is it still on"):
            write_on()
        port.close()
