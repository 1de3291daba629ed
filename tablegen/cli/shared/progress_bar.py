"""A progress bar of an upload, or a batch of images, on a terminal."""

import sys
import time
from collections.abc import Callable

from tablegen.cli.shared.terminal import erase, redraw

_BAR_WIDTH = 24
_WIDTH = 76
_REDRAW_S = 0.1


class Bar:
    """A line on stderr with rate and remaining time; nothing if stderr is no terminal.

    Call it with the number of transferred bytes, or of images or another ``unit``, and with the total.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic, unit: str = "bytes") -> None:
        self._clock, self._unit = clock, unit
        self._shows = sys.stderr is not None and sys.stderr.isatty()
        self._start: tuple[float, int] | None = None
        self._draw_time = 0.0

    def __call__(self, count: int, total: int) -> None:
        """Draw the bar for a count of a total."""
        if not self._shows:
            return
        now = self._clock()
        if self._start is None:
            self._start = now, count  # a resumed upload has some bytes from the start
        elif now - self._draw_time < _REDRAW_S and count < total:
            return
        self._draw_time = now
        redraw(f"{self._text(now, count, total):<{_WIDTH}}")

    def hide(self) -> None:
        """Erase the line until the next call, for a message."""
        if self._start is not None:
            erase(_WIDTH)
            self._draw_time = 0.0

    def close(self) -> None:
        """Erase the line."""
        if self._start is not None:
            erase(_WIDTH)
            self._start = None

    def _text(self, now: float, count: int, total: int) -> str:
        assert self._start is not None
        full = _BAR_WIDTH * count // total
        text = f"[{'#' * full}{'.' * (_BAR_WIDTH - full)}] {count}/{total} {self._unit}"
        if self._unit != "bytes":
            seconds, first = now - self._start[0], self._start[1]
            return f"{text}  {seconds / (count - first) * (total - count):.0f} s left" if count > first else text
        if count == total:
            return f"{text}  checked, then waiting for a line"
        seconds, first = now - self._start[0], self._start[1]
        if seconds <= 0.0 or count <= first:
            return text
        rate = (count - first) / seconds
        return f"{text}  {rate / 1000.0:.1f} kB/s  {(total - count) / rate:.1f} s left"
