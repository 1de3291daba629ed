"""Lines that never fall silent: a far end that talks without end, in virtual time and on a real TCP socket."""

import socket
import threading
from random import Random
from types import TracebackType

from limits import PATIENCE_S

from tablegen.link.model_device import ModelDevice

NOISE = bytes(Random(1).randrange(256) for _ in range(4096))
TEXT = b"adc: 2048 counts, no frame among them " * 100  # without a 0x00, as a console writes


class Babbling:
    """A device that, from the moment ``begins`` on, says ``babble`` for ever and nothing else; it still listens."""

    def __init__(self, device: ModelDevice, babble: bytes = NOISE, begins: bool = True) -> None:
        self.device, self.begins = device, begins
        self._babble, self._at = babble, 0
        self.receive, self.tick, self.reboot = device.receive, device.tick, device.reboot

    def transmit(self) -> bytes:
        """What it says, as much as a line of 115200 baud carries in 1 ms."""
        answers = self.device.transmit()
        if not self.begins:
            return answers
        self._at = (self._at + 11) % (len(self._babble) - 11)
        return self._babble[self._at : self._at + 11]


class BabblingServer:
    """A TCP port that sends without end to whoever connects, as fast as it is taken, and never reads."""

    def __init__(self, babble: bytes = NOISE) -> None:
        self._babble = 16 * babble
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.settimeout(0.05)
        self._stop = threading.Event()
        self.listened = threading.Event()  # somebody has connected, and listens
        self.sent = 0
        self.url = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"
        self._threads = [threading.Thread(target=self._accept, daemon=True)]

    def __enter__(self) -> "BabblingServer":
        self._threads[0].start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        for thread in self._threads:
            thread.join(PATIENCE_S)
        self._listener.close()

    def _accept(self) -> None:
        while not self._stop.is_set():
            try:
                connection, _ = self._listener.accept()
            except TimeoutError:
                continue
            thread = threading.Thread(target=self._talk, args=(connection,), daemon=True)
            thread.start()
            self._threads.append(thread)

    def _talk(self, connection: socket.socket) -> None:
        connection.settimeout(0.05)
        with connection:
            while not self._stop.is_set():
                try:
                    self.sent += connection.send(self._babble)
                    self.listened.set()
                except TimeoutError:
                    continue
                except OSError:
                    return
