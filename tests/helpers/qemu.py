"""Firmware in QEMU, its two serial lines as sockets."""

import select
import socket
import subprocess
import time
from pathlib import Path
from types import TracebackType

from building import tool
from limits import PATIENCE_S


class Machine:
    """A board that runs an executable: lines to and from its console, and the lines of its log."""

    def __init__(self, machine: str, executable: Path) -> None:
        # The sockets listen, and are connected to, before QEMU starts, which waits for both: nothing is lost.
        listening = [socket.create_server(("127.0.0.1", 0)) for _ in range(2)]
        self._sockets = [socket.create_connection(one.getsockname()) for one in listening]
        self._received = [b"", b""]
        # Time is what instructions take, 8 ns each, so that a busy machine of ours makes no underrun.
        command = [
            tool("qemu-system-arm"),
            "-M",
            machine,
            "-icount",
            "shift=3",
            "-nodefaults",
            "-display",
            "none",
            "-monitor",
            "none",
        ]
        for number, one in enumerate(listening):
            options = f"socket,id=u{number},fd={one.fileno()},server=on,wait=on,nodelay=on"
            command += ["-chardev", options, "-serial", f"chardev:u{number}"]
        self._process = subprocess.Popen(
            [*command, "-kernel", str(executable)],
            pass_fds=[one.fileno() for one in listening],
            stdin=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        for one in listening:
            one.close()
        for one in self._sockets:
            one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def __enter__(self) -> "Machine":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.communicate()
        for one in self._sockets:
            one.close()

    def send(self, line: str) -> None:
        """A line to the console."""
        self._sockets[0].sendall(line.encode() + b"\n")

    def ask(self, line: str) -> str:
        """A line to the console, and the next one that comes back."""
        self.send(line)
        return self.console()

    def console(self) -> str:
        """The next line of the console."""
        return self._line(0)

    def sample(self) -> str:
        """The next line of the log."""
        return self._line(1)

    def _line(self, number: int) -> str:
        """The next line of one; the other is received meanwhile, since a full log stops the samples."""
        until = time.monotonic() + PATIENCE_S
        while b"\n" not in self._received[number]:
            ready, _, _ = select.select(self._sockets, [], [], max(until - time.monotonic(), 0))
            assert ready, "QEMU has nothing to say"
            assert time.monotonic() < until, f"QEMU says nothing on line {number}, and much on the other"
            for one in ready:
                part = one.recv(65536)
                assert part, f"QEMU has ended: {self._process.communicate()[1].decode(errors='replace')}"
                self._received[self._sockets.index(one)] += part
        line, _, self._received[number] = self._received[number].partition(b"\n")
        return line.decode("ascii")
