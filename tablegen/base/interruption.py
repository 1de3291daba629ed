"""Interruptions that wait where they would leave something half done, or a process that nobody knows."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

# What ends a program in an orderly way: Ctrl-C, `kill` and every supervisor, and the terminal that was closed.
ENDINGS = tuple(signal.Signals[name] for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


@contextmanager
def endings_interrupt() -> Iterator[None]:
    """Inside, all of ``ENDINGS`` raise ``KeyboardInterrupt``, so that whatever is being done is put in order first.

    One that is ignored stays ignored, as ``nohup`` asks for, and one that somebody handles stays theirs.
    """
    before: list[signal.Signals] = []
    if threading.current_thread() is threading.main_thread():
        before = [number for number in ENDINGS if signal.getsignal(number) is signal.SIG_DFL]

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    for number in before:
        signal.signal(number, interrupt)
    try:
        yield
    finally:
        for number in before:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def held(*numbers: signal.Signals) -> Iterator[list[int]]:
    """Signals that come inside wait, and stand in the list that this yields; a second one of a kind does not wait.

    Only what a Python function would have handled is held, and only in the main thread: elsewhere nothing can be
    interrupted. What is to become of them afterwards is the caller's affair; see ``deliver``.
    """
    came: list[int] = []
    before: dict[signal.Signals, Any] = {}
    if threading.current_thread() is threading.main_thread():
        before = {number: signal.getsignal(number) for number in numbers if callable(signal.getsignal(number))}

    def hold(number: int, _frame: FrameType | None) -> None:
        came.append(number)
        signal.signal(number, before[signal.Signals(number)])

    for number in before:
        signal.signal(number, hold)
    try:
        yield came
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def deliver(came: list[int]) -> None:
    """Let the signals that were held happen now."""
    for number in came:
        signal.raise_signal(number)
