"""Transports: bytes to a device, bytes from it, and a clock. pyserial opens real ones."""

import errno
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Protocol

from tablegen.link.errors import LinkLost, NoPort, SerialMissing

_POLL_S = 0.01  # pyserial's own wait; changing it for every read would configure the port again each time
_WRITE_TIMEOUT_S = 5.0  # a port that takes no bytes for so long has no device behind it
_MAX_READ_BYTES = 4096  # bytes per read, so that a noisy line cannot block it
_BITS_PER_BYTE = 10  # bits of a byte on the wire: start, 8, stop


class Transport(Protocol):
    """The interface of a port for the client; ``write`` and ``read`` raise ``LinkLost`` when it has gone."""

    baud: int | None  # bits a second, for time-outs; None where bytes take no time

    def write(self, data: bytes) -> None:
        """Pass on bytes; may return before they have left."""

    def read(self, timeout_s: float) -> bytes:
        """Read what has come, at once if there is something; b"" when nothing came for ``timeout_s`` seconds."""

    def close(self) -> None:
        """Give the port back. It can be called twice."""

    def now(self) -> float:
        """Return the seconds of a clock that never goes back."""


Opener = Callable[[], Transport]


def byte_s(baud: int | None) -> float:
    """Return the seconds that a byte takes on the wire."""
    return _BITS_PER_BYTE / baud if baud else 0.0


def open_port(url: str, baud: int = 115200) -> Transport:
    """Open a port of pyserial: /dev/ttyUSB0, COM3, socket://host:port, rfc2217://host:port, or any other URL of it.

    Raises
    ------
    NoPort
        If it cannot be opened.
    SerialMissing
        If pyserial is not installed.
    """
    try:
        import serial
    except ImportError:
        raise SerialMissing from None
    # pyserial's RFC 2217 takes no time-out for writing, and has one of its own.
    write_s = None if url.lower().startswith("rfc2217:") else _WRITE_TIMEOUT_S
    try:
        # Two programs on one port would take each other's answers.
        port = serial.serial_for_url(
            url, baud, timeout=_POLL_S, write_timeout=write_s, exclusive=True, do_not_open=True
        )
        # pyserial empties a connection as it opens it, which has no end where the other end never falls silent.
        port.reset_input_buffer = lambda: None
        port.open()
    except (OSError, ValueError, OverflowError, NotImplementedError) as error:  # SerialException is an OSError
        raise NoPort(_why_not(url, error)) from None
    return SerialTransport(port, url, baud)


def _why_not(url: str, error: Exception) -> str:
    why = str(error)
    remedy = "`tablegen ports` lists the ports of this machine"
    number = getattr(error, "errno", None)
    if number == errno.ENOENT or "FileNotFoundError" in why:
        why = "there is no such port"
    elif number == errno.EACCES or "PermissionError" in why:
        why, remedy = "you may not", "is another program using it, or is your user not in its group (dialout)?"
    elif number in (errno.EAGAIN, errno.EBUSY):
        why, remedy = "another program has it open", "close that one first"
    elif "://" in url:
        why = why.rpartition("] ")[2] or why
        remedy = "is the other end listening, and is this a URL that pyserial supports?"
    return f"{url}: cannot be opened: {why}; {remedy}"


class SerialTransport:
    """A port of pyserial."""

    def __init__(self, port: Any, name: str, baud: int | None) -> None:
        self.baud = baud
        self._port = port
        self._name = name

    def write(self, data: bytes) -> None:
        """Write bytes to the port.

        Raises
        ------
        LinkLost
            If the port is gone or takes none.
        """
        try:
            self._port.write(data)
        except Exception as error:  # a port that vanishes raises OSError, TypeError and others
            raise self._lost(error) from None

    def read(self, timeout_s: float) -> bytes:
        """Read what has come within ``timeout_s`` seconds.

        Raises
        ------
        LinkLost
            If the port is gone.
        """
        end = self.now() + timeout_s
        received = bytearray()
        try:
            while True:
                # socket:// says 0 or 1 whatever waits, and a read of more than there is waits for the rest.
                while len(received) < _MAX_READ_BYTES and (waiting := self._port.in_waiting):
                    received += self._port.read(min(waiting, _MAX_READ_BYTES))
                if received or self.now() >= end:
                    return bytes(received)
                received += self._port.read(1)
        except Exception as error:
            if received:
                return bytes(received)  # the next read reports that the port disappeared
            raise self._lost(error) from None

    def close(self) -> None:
        """Give the port back. It can be called twice."""
        with suppress(Exception):  # it may have gone already
            self._port.close()

    def now(self) -> float:
        """Return seconds of a clock that never goes back."""
        return time.monotonic()

    def _lost(self, error: Exception) -> LinkLost:
        if "timeout" in type(error).__name__.lower():
            return LinkLost(f"{self._name}: the other end took no bytes for {_WRITE_TIMEOUT_S:g} s; is it still on?")
        return LinkLost(f"{self._name}: the port disappeared: {error}; is the cable connected, and the device on?")
