"""Interruptions that wait where they would leave something half done, or a process that nobody knows."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


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
