"""Real ports: the actual command line, and pyserial, on a pty and on TCP, in front of a model in real time."""

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import serial
from building import Variant, build
from client_rig import BOOT, Served, info_for, model
from limits import PATIENCE_S
from link_programs import make_scan
from serial.rfc2217 import PortManager

from tablegen.link.device import Device
from tablegen.link.errors import LinkLost, NoAnswer, NoPort
from tablegen.link.messages import DeviceState
from tablegen.link.prepare import PreparedScan
from tablegen.link.transport import open_port

RATE_HZ = 500_000
PATIENT = ("--timeout", str(PATIENCE_S))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("example"), Variant({"timing.lines": 40})).folder


@pytest.fixture(scope="module")
def scan(folder: Path) -> PreparedScan:
    return PreparedScan.of_build(folder)


def tablegen(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """The command line as a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "tablegen", *map(str, arguments)],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE_S,
    )


@pytest.mark.common
@pytest.mark.parametrize("kind", ["pty", "tcp"])
def test_the_command_line_on_a_real_port(kind: str, folder: Path, scan: PreparedScan) -> None:
    with Served(model(info_for(scan)), kind, RATE_HZ) as served:
        port = ("--port", served.url)
        done = tablegen("upload", folder, "--as", "table", *port, *PATIENT)
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.startswith(f"annexin_200nm {scan.digest[:12]} is active, generation 2")
        assert served.device.status().hash.hex() == scan.digest
        done = tablegen("readback", folder, *port, *PATIENT)
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.endswith("all equal\n")
        done = tablegen("trigger", *port)
        assert (done.returncode, done.stdout) == (0, "plays until it is parked\n")
        assert served.device.player.state == DeviceState.PLAYING


def test_a_connection_that_breaks_is_made_again_and_the_upload_goes_on(folder: Path, scan: PreparedScan) -> None:
    with Served(model(info_for(scan)), "tcp", RATE_HZ, dies_after=4000) as served:
        done = tablegen("upload", folder, "--as", "table", "--port", served.url, *PATIENT)
        assert (done.returncode, done.stderr) == (0, "")
        assert served.calls == 2
        assert served.device.status().hash.hex() == scan.digest


def test_a_pty_that_goes_for_good_is_a_lost_link(folder: Path, scan: PreparedScan) -> None:
    with Served(model(info_for(scan)), "pty", RATE_HZ, dies_after=4000) as served:
        done = tablegen("upload", folder, "--as", "table", "--timeout", "2", "--port", served.url)
        assert (done.returncode, done.stdout) == (10, "")
        assert done.stderr.startswith("the link is lost: ")
        assert done.stderr.count("\n") == 1, "no traceback"
        assert served.device.status().hash.hex() == BOOT.digest


@pytest.mark.common
def test_an_interruption_leaves_what_was_received_for_the_next_time(folder: Path, scan: PreparedScan) -> None:
    """Of a device that takes its time."""
    device = model(info_for(scan, window=1))
    receive = device.receive

    def slow(data: bytes) -> None:
        time.sleep(0.05)
        receive(data)

    device.receive = slow  # type: ignore[method-assign]
    with Served(device, "tcp", RATE_HZ) as served:
        command = [sys.executable, "-m", "tablegen", "upload", str(folder), "--as", "table"]
        started = subprocess.Popen(
            [*command, "--port", served.url, *PATIENT],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
        )
        try:
            end = time.monotonic() + PATIENCE_S
            while device.status().received < 480 and time.monotonic() < end:
                time.sleep(0.005)
            started.send_signal(signal.SIGINT)
            out, err = started.communicate(timeout=PATIENCE_S)
        finally:
            started.kill()
            started.wait(PATIENCE_S)
        assert (started.returncode, out) == (130, "")
        assert err.startswith("interrupted; the device plays its old scan and keeps ")
        assert err.count("\n") == 1
        device.receive = receive  # type: ignore[method-assign]
        done = tablegen("upload", folder, "--as", "table", "--port", served.url, *PATIENT)
        assert done.returncode == 0
        assert "; the device already had " in done.stdout


def test_two_programs_do_not_share_a_port() -> None:
    with Served(model(), "pty") as served, Device(served.url) as device:
        with pytest.raises(NoPort, match="another program has it open; close that one first"):
            Device(served.url)
        assert device.status().generation == 1


@pytest.mark.parametrize("kind", ["pty", "tcp"])
def test_the_class_on_a_real_port(kind: str) -> None:
    new = make_scan(2)
    with Served(model(), kind) as served, Device(served.url) as device:
        assert device.upload(new.image(False), timeout_s=PATIENCE_S).generation == 2
        assert device.readback(timeout_s=PATIENCE_S) == new.image(False).data
        device.park()
        device.wait_for(DeviceState.PARKED, PATIENCE_S)


def test_reading_waits_no_longer_than_it_may_and_takes_all_that_has_come() -> None:
    master, slave = os.openpty()
    try:
        port = open_port(os.ttyname(slave))
        start = port.now()
        assert port.read(0.0) == b""
        assert port.read(0.05) == b""
        assert 0.05 <= port.now() - start < PATIENCE_S
        os.write(master, b"\0abc\0")
        found = b""
        while len(found) < 5:
            found += port.read(1.0)
        assert found == b"\0abc\0"
        port.write(b"\r\n\x03\x11\0")
        assert os.read(master, 100) == b"\r\n\x03\x11\0", "raw: nothing is translated"
        port.close()
        port.close()
        for call in (lambda: port.read(0.1), lambda: port.write(b"x")):
            with pytest.raises(LinkLost, match="the port disappeared"):
                call()
    finally:
        os.close(master)
        os.close(slave)


def test_a_peer_that_hangs_up_is_a_port_that_has_gone() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = open_port(f"socket://127.0.0.1:{listener.getsockname()[1]}")
        peer, _ = listener.accept()
        peer.sendall(b"last words\0")
        peer.close()
        found = bytearray()

        def read_on() -> None:
            for _ in range(100):
                found.extend(port.read(0.1))

        with pytest.raises(LinkLost, match="the port disappeared"):
            read_on()
        assert found == b"last words\0"
        port.close()


class PtyPort(serial.Serial):
    """A pty has no modem lines, which a server of RFC 2217 asks for."""

    cts = dsr = ri = cd = property(lambda self: True)

    def _update_dtr_state(self) -> None:
        pass

    def _update_rts_state(self) -> None:
        pass

    def _update_break_state(self) -> None:
        pass


class Rfc2217Server:
    """pyserial's own, between a connection and a port."""

    def __init__(self, port: serial.Serial) -> None:
        self.port = port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.settimeout(PATIENCE_S)
        self.url = f"rfc2217://127.0.0.1:{self._listener.getsockname()[1]}"
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._thread.join(PATIENCE_S)
        self._listener.close()

    def write(self, data: bytes) -> None:
        """What the manager of the port says to the other end."""
        self._connection.sendall(data)

    def _serve(self) -> None:
        self._connection, _ = self._listener.accept()
        with self._connection as connection:
            manager = PortManager(self.port, self)
            connection.settimeout(0.002)
            while True:
                try:
                    data = connection.recv(1024)
                    if not data:
                        return
                    self.port.write(b"".join(manager.filter(data)))
                except TimeoutError:
                    pass
                except OSError:
                    return
                if waiting := self.port.in_waiting:
                    connection.sendall(b"".join(manager.escape(self.port.read(waiting))))


@pytest.mark.filterwarnings("ignore::DeprecationWarning:serial.rfc2217")
def test_a_port_of_another_machine_by_rfc2217() -> None:
    new = make_scan(2)
    with Served(model(), "pty") as served, PtyPort(served.url, timeout=0.01) as port:
        server = Rfc2217Server(port)
        with Device(server.url, baud=460800) as device:
            assert device.upload(new.image(False), timeout_s=PATIENCE_S).generation == 2
            assert device.readback(timeout_s=PATIENCE_S) == new.image(False).data
            assert port.baudrate == 460800, "the rate is that of the far end"
        server.close()


def test_an_echo_is_no_device() -> None:
    with pytest.raises(NoAnswer):
        Device("loop://", timeout_s=0.3)


@pytest.mark.parametrize(
    "url", ["", "foo://bar", "socket://nowhere", "socket://127.0.0.1:0", "/", "rfc2217://127.0.0.1:1"]
)
def test_what_is_no_port(url: str) -> None:
    with pytest.raises(NoPort):
        open_port(url)
