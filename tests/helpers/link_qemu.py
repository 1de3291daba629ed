"""Reference firmware in QEMU with its link on a TCP port or a pseudo-terminal, and the lines that it played."""

import re
import socket
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType

from building import tool
from limits import PATIENCE_S
from line_log import PlayedLine

_RECORD = 41  # characters; a reset may cut one off, and the next one follows it at once
_PTY = re.compile(rb"redirected to (/dev/pts/\d+)")


class LinkMachine:
    """A board whose link is at ``url``, for pyserial: a socket, or a pseudo-terminal. Its log is read all the time.

    ``one_uart``: the log comes by semihosting. An instruction takes 2 ** ``shift`` ns. ``executable`` may be what a
    flash has from address 0 on.
    """

    def __init__(
        self,
        machine: str,
        executable: Path,
        pty: bool = False,
        semihosting: bool = False,
        one_uart: bool = False,
        shift: int = 3,
    ) -> None:
        self._text = b""
        self._lock = threading.Lock()
        log = socket.create_server(("127.0.0.1", 0))
        link = socket.create_server(("127.0.0.1", 0))
        monitor = socket.create_server(("127.0.0.1", 0))
        self.port = int(link.getsockname()[1])
        self._log = socket.create_connection(log.getsockname())
        self._monitor = socket.create_connection(monitor.getsockname())
        way = "pty,id=u0" if pty else f"socket,id=u0,fd={link.fileno()},server=on,wait=off,nodelay=on"
        # Time is what instructions take.
        command = [tool("qemu-system-arm"), "-M", machine, "-icount", f"shift={shift}"]
        command += ["-nodefaults", "-display", "none"]
        command += ["-semihosting"] if semihosting else []
        command += ["-chardev", way, "-serial", "chardev:u0"]
        command += ["-chardev", f"socket,id=m0,fd={monitor.fileno()},server=on,wait=on", "-mon", "chardev=m0"]
        command += ["-chardev", f"socket,id=u1,fd={log.fileno()},server=on,wait=on,nodelay=on"]
        by_debugger = ["-semihosting-config", "enable=on,target=native,chardev=u1"]
        command += by_debugger if one_uart else ["-serial", "chardev:u1"]
        self._process = subprocess.Popen(
            [*command, "-kernel", str(executable)],
            pass_fds=[one.fileno() for one in (log, link, monitor)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        for one in (log, link, monitor):
            one.close()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.url = self._pty() if pty else f"socket://127.0.0.1:{self.port}"

    def _pty(self) -> str:
        assert self._process.stdout is not None
        said = b""
        while line := self._process.stdout.readline():  # among the first lines
            said += line
            if found := _PTY.search(line):
                return found[1].decode()
        raise AssertionError(f"QEMU has ended: {said.decode(errors='replace')}")

    def _read(self) -> None:
        try:
            while part := self._log.recv(65536):
                with self._lock:
                    self._text += part
        except OSError:
            pass  # closed

    def __enter__(self) -> "LinkMachine":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.communicate()
        self._reader.join(PATIENCE_S)
        self._log.close()
        self._monitor.close()

    def reset(self) -> None:
        """Pull the processor's reset."""
        self._monitor.sendall(b"system_reset\n")

    def save_memory(self, address: int, count: int, file: Path) -> None:
        """Write the bytes at an address, as the processor reads them, to a file."""
        self._monitor.sendall(f'memsave {address:#x} {count} "{file}"\n'.encode())
        self._word(address)  # answered when the file is written

    def press_up(self) -> None:
        """Press the button "up" of lm3s6965evb, and return when it is released: bit 0 of port E is high again."""
        self._monitor.sendall(b"sendkey up 20\n")
        until = time.monotonic() + PATIENCE_S
        while self._word(0x400243FC) & 1 == 0:
            assert time.monotonic() < until, "the button is not released"

    def reset_while_receiving(self, data: bytes, status: int, raised: int, when: Callable[[int, int], bool]) -> None:
        """The same in the middle of bytes: when the registers at two addresses are so, as the monitor reads them."""
        until = time.monotonic() + PATIENCE_S
        with socket.create_connection(("127.0.0.1", self.port)) as link:
            while True:
                link.sendall(data)
                self._monitor.sendall(b"stop\n")
                if when(self._word(status), self._word(raised)):
                    break
                assert time.monotonic() < until, "the registers were never so"
                self._monitor.sendall(b"cont\n")
        self._monitor.sendall(b"system_reset\ncont\n")

    def _word(self, address: int) -> int:
        self._monitor.sendall(f"xp /1wx {address:#x}\n".encode())
        shown = b""
        while (found := re.search(rb"%016x: 0x([0-9a-f]{8})" % address, shown)) is None:
            shown += self._monitor.recv(65536)
        return int(found[1], 16)

    def lines(self) -> list[PlayedLine]:
        """Those that were logged since the last call."""
        with self._lock:
            whole, _, self._text = self._text.rpartition(b"\n")
        return [PlayedLine.parse(line[-_RECORD:]) for line in whole.decode("ascii").splitlines()]

    def octets(self) -> bytes:
        """Those that were logged since the last call, of a log that is not text."""
        with self._lock:
            octets, self._text = self._text, b""
        return octets

    def wait_for(self, good: Callable[[PlayedLine], bool], followed: Callable[[list[PlayedLine]], None]) -> None:
        """Until a line is good; all lines are followed."""
        until = time.monotonic() + PATIENCE_S
        while True:
            lines = self.lines()
            followed(lines)
            if any(good(line) for line in lines):
                return
            assert time.monotonic() < until, "the line that was waited for was not played"
            assert self._process.poll() is None, "QEMU has ended"
            time.sleep(0.02)
