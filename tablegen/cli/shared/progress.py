"""What is being done, on a terminal, while it takes longer than a moment."""

import sys
import threading
import time
from collections.abc import Callable
from types import TracebackType

from tablegen.cli.shared.terminal import erase, redraw

_SHOW_AFTER_S = 1.0
_WIDTH = 60


class Progress:
    """A line on stderr that says what is being done and for how long; nothing where stderr is no terminal.

    Most builds end before it appears. It runs beside the work, which need not know of it.
    """

    def __init__(self) -> None:
        self._what: str | Callable[[], str] = ""
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._tell, daemon=True) if sys.stderr.isatty() else None

    def now(self, what: str | Callable[[], str]) -> None:
        """Name what is being done from here on; a function is asked whenever the line is shown."""
        self._what = what

    def __enter__(self) -> "Progress":
        if self._thread is not None:
            self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._done.set()
        if self._thread is not None:
            self._thread.join()

    def _tell(self) -> None:
        start = time.monotonic()
        shown = False
        while not self._done.wait(_SHOW_AFTER_S):
            what = self._what if isinstance(self._what, str) else self._what()
            text = f"{what} ({time.monotonic() - start:.0f} s)"
            redraw(f"{text:<{_WIDTH}}")
            shown = True
        if shown:
            erase(_WIDTH)
