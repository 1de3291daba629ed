"""Signals that are deferred where they would leave half-written files, or an orphaned process."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

# The signals of an orderly end: Ctrl-C, `kill` and every supervisor, and a closed terminal.
ENDINGS = tuple(signal.Signals[name] for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


@contextmanager
def endings_interrupt() -> Iterator[None]:
    """Make all of ``ENDINGS`` raise ``KeyboardInterrupt`` inside, so that open work is put in order first.

    A signal that is ignored stays ignored, as with ``nohup``, and one that has a handler keeps it.

    Raises
    ------
    KeyboardInterrupt
        In the block, when one of the signals arrives.
    """
    before: list[signal.Signals] = []
    if threading.current_thread() is threading.main_thread():
        before = [number for number in ENDINGS if signal.getsignal(number) is signal.SIG_DFL]

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        """Handle the signal.

        Raises
        ------
        KeyboardInterrupt
            Always.
        """
        raise KeyboardInterrupt

    for number in before:
        signal.signal(number, interrupt)
    try:
        yield
    finally:
        for number in before:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def defer_signals(*numbers: signal.Signals) -> Iterator[list[int]]:
    """Defer signals that arrive inside, and yield the list of them; a second one of a kind is not deferred.

    Only signals with a Python handler are deferred, and only in the main thread: elsewhere nothing can be
    interrupted. The caller decides what becomes of them afterwards; see ``deliver``.
    """
    received: list[int] = []
    before: dict[signal.Signals, Any] = {}
    if threading.current_thread() is threading.main_thread():
        before = {number: signal.getsignal(number) for number in numbers if callable(signal.getsignal(number))}

    def record(number: int, _frame: FrameType | None) -> None:
        received.append(number)
        signal.signal(number, before[signal.Signals(number)])

    for number in before:
        signal.signal(number, record)
    try:
        yield received
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def deliver(received: list[int]) -> None:
    """Raise the signals that were deferred."""
    for number in received:
        signal.raise_signal(number)
