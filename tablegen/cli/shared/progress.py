"""A line on a terminal with the current step of a command that takes more than a second."""

import sys
import threading
import time
from collections.abc import Callable
from types import TracebackType

from tablegen.cli.shared.terminal import erase, redraw

_SHOW_AFTER_S = 1.0
_WIDTH = 60


class Progress:
    """A line on stderr with the current step and its time; nothing if stderr is no terminal.

    Most builds end before it appears. It runs in a thread of its own.
    """

    def __init__(self) -> None:
        self._what: str | Callable[[], str] = ""
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._tell, daemon=True) if sys.stderr.isatty() else None

    def now(self, what: str | Callable[[], str]) -> None:
        """Set the text of the current step; a function is called for it whenever the line is drawn."""
        self._what = what

    def __enter__(self) -> "Progress":
        if self._thread is not None:
            self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        if self._thread is not None:
            self._thread.join()

    def _tell(self) -> None:
        start = time.monotonic()
        visible = False
        while not self._stop.wait(_SHOW_AFTER_S):
            what = self._what if isinstance(self._what, str) else self._what()
            text = f"{what} ({time.monotonic() - start:.0f} s)"
            redraw(f"{text:<{_WIDTH}}")
            visible = True
        if visible:
            erase(_WIDTH)
