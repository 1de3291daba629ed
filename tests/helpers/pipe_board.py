"""An emulated board behind a pipe: bytes to its UART and back, and the words at its converters, in its own time.

Its program reads lines "CYCLES BYTES" and answers "SENT WORDS COUNTS..", all but the numbers in hexadecimal; see
``rp2040/board.mjs`` and ``avr_board.c``. It is the far end of a ``link_line.Line``, so that time is virtual.
"""

import subprocess
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

from building import tool


class PipeBoard:
    """A running board. ``words`` are the pairs at the converters of x and y so far.

    ``counts`` are those that its program adds to each answer, the last ones.
    """

    def __init__(self, command: Sequence[str | Path], cycles_per_tick: int, folder: Path | None = None) -> None:
        self.words: list[tuple[int, int]] = []
        self.counts: list[int] = []
        self._cycles = cycles_per_tick
        self._waiting = b""
        self._sent = b""
        self._process = subprocess.Popen(
            [tool(str(command[0])), *map(str, command[1:])], cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )

    def __enter__(self) -> "PipeBoard":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.communicate()

    def receive(self, data: bytes) -> None:
        """Bytes that leave the host; they arrive one by one, at the board's baud rate."""
        self._waiting += data

    def transmit(self) -> bytes:
        """What the UART has sent."""
        sent, self._sent = self._sent, b""
        return sent

    def tick(self, ticks: int) -> None:
        """As many cycles as so many samples take."""
        if not ticks:
            return
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        stdin.write(f"{ticks * self._cycles} {self._waiting.hex() or '-'}\n".encode())
        stdin.flush()
        self._waiting = b""
        answer = stdout.readline().split()
        assert len(answer) > 2, f"the board has ended: {answer}"
        sent, words, *counts = answer
        if sent != b"-":
            self._sent += bytes.fromhex(sent.decode())
        if words != b"-":
            codes = [int(words[at : at + 4], 16) for at in range(0, len(words), 4)]
            self.words += zip(codes[::2], codes[1::2], strict=True)
        self.counts = [int(count) for count in counts]

    def reboot(self) -> None:
        """There is no reset in this emulation."""
        raise NotImplementedError
