"""How far an upload, or a batch of images, is, on a terminal."""

import sys
import time
from collections.abc import Callable

from tablegen.cli.shared.terminal import erase, redraw

_BAR_WIDTH = 24
_WIDTH = 76
_REDRAW_S = 0.1


class Bar:
    """A line on stderr with rate and time left; nothing where stderr is no terminal.

    Call it with the bytes that are done and with all; or with images, or whatever ``unit`` says.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic, unit: str = "bytes") -> None:
        self._clock, self._unit = clock, unit
        self._shows = sys.stderr is not None and sys.stderr.isatty()
        self._start: tuple[float, int] | None = None
        self._shown_at = 0.0

    def __call__(self, done: int, total: int) -> None:
        """So many bytes are there."""
        if not self._shows:
            return
        now = self._clock()
        if self._start is None:
            self._start = now, done  # an upload that goes on has some bytes from the start
        elif now - self._shown_at < _REDRAW_S and done < total:
            return
        self._shown_at = now
        redraw(f"{self._text(now, done, total):<{_WIDTH}}")

    def hide(self) -> None:
        """Take the line away until the next call, for a message."""
        if self._start is not None:
            erase(_WIDTH)
            self._shown_at = 0.0

    def close(self) -> None:
        """Take the line away again."""
        if self._start is not None:
            erase(_WIDTH)
            self._start = None

    def _text(self, now: float, done: int, total: int) -> str:
        assert self._start is not None
        full = _BAR_WIDTH * done // total
        text = f"[{'#' * full}{'.' * (_BAR_WIDTH - full)}] {done}/{total} {self._unit}"
        if self._unit != "bytes":
            seconds, first = now - self._start[0], self._start[1]
            return f"{text}  {seconds / (done - first) * (total - done):.0f} s left" if done > first else text
        if done == total:
            return f"{text}  checked, then waiting for a line"
        seconds, first = now - self._start[0], self._start[1]
        if seconds <= 0.0 or done <= first:
            return text
        rate = (done - first) / seconds
        return f"{text}  {rate / 1000.0:.1f} kB/s  {(total - done) / rate:.1f} s left"
