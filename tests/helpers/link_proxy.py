"""A line with faults in real time: between a client that connects to it and a device that it connects to."""

import socket
import threading
import time
from collections import Counter
from random import Random
from types import TracebackType

from limits import PATIENCE_S
from link_faults import Chances, Spoiler, split

_BYTE_BITS = 10
_POLL_S = 0.05


class FaultProxy:
    """Listens at ``url``; what a client sends goes to ``port`` of this machine, and what comes from there goes to it.

    ``baud`` paces both ways. ``vanish`` closes the client's connection and, for ``away_s``, serves no other one; there
    is no ``reset`` here. A client that has gone may come again.
    """

    def __init__(self, port: int, chances: Chances, seed: int, baud: int = 115200) -> None:
        self._port, self._chances, self._byte_s = port, chances, _BYTE_BITS / baud
        self._out = Spoiler(chances, Random(seed))
        self._back = Spoiler(chances, Random(seed + 1))
        self._listening = socket.create_server(("127.0.0.1", 0))
        self._listening.settimeout(_POLL_S)
        self.url = f"socket://127.0.0.1:{self._listening.getsockname()[1]}"
        self._ended = threading.Event()
        self.connections = 0
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> "FaultProxy":
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended.set()
        self._thread.join(PATIENCE_S)
        self._listening.close()

    @property
    def done(self) -> Counter[str]:
        """The faults there were."""
        return self._out.done + self._back.done

    def _serve(self) -> None:
        with socket.create_connection(("127.0.0.1", self._port)) as device:
            while not self._ended.is_set():
                try:
                    client, _ = self._listening.accept()
                except TimeoutError:
                    continue
                self.connections += 1
                with client:
                    self._connect(client, device)

    def _connect(self, client: socket.socket, device: socket.socket) -> None:
        """Until one of the ends, or the port, has gone."""
        gone = threading.Event()
        back = threading.Thread(target=self._pass_on, args=(device, client, self._back, gone), daemon=True)
        back.start()
        vanished = self._pass_on(client, device, self._out, gone)
        gone.set()
        back.join(PATIENCE_S)
        if vanished:
            client.close()
            self._ended.wait(self._chances.away_s)

    def _pass_on(self, here: socket.socket, there: socket.socket, spoiler: Spoiler, gone: threading.Event) -> bool:
        """Frames from here to there; True if the port is to vanish."""
        begun, free = b"", 0.0
        here.settimeout(_POLL_S)
        while not gone.is_set() and not self._ended.is_set():
            try:
                part = here.recv(4096)
            except TimeoutError:
                continue
            except OSError:
                break
            if not part:
                break
            *frames, begun = [*split(begun + part), b""] if part.endswith(b"\0") else split(begun + part)
            for frame in frames:
                if spoiler is self._out and spoiler.happens("vanish"):
                    return True
                for delay, piece in spoiler.spoil(frame):
                    free = max(free, time.monotonic()) + delay + self._byte_s * len(piece)
                    gone.wait(max(free - time.monotonic(), 0.0))
                    try:
                        there.sendall(piece)
                    except OSError:
                        return False
        return False
