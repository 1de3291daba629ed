"""Signals that wait: for how long, which, and that none is lost."""

import signal
import threading
from collections.abc import Iterator

import pytest

from tablegen.base.interruption import defer_signals, deliver


@pytest.fixture
def heard() -> Iterator[list[int]]:
    """What a handler of two signals has heard; they are those of this process, and put back."""
    numbers: list[int] = []
    before = {number: signal.getsignal(number) for number in (signal.SIGUSR1, signal.SIGUSR2)}
    for number in before:
        signal.signal(number, lambda number, _frame: numbers.append(number))
    yield numbers
    for number, handler in before.items():
        signal.signal(number, handler)


def test_what_comes_inside_waits_and_is_delivered(heard: list[int]) -> None:
    with defer_signals(signal.SIGUSR1) as came:
        signal.raise_signal(signal.SIGUSR1)
        assert (heard, came) == ([], [signal.SIGUSR1])
    assert heard == []
    deliver(came)
    assert heard == [signal.SIGUSR1]


def test_a_second_one_does_not_wait(heard: list[int]) -> None:
    with defer_signals(signal.SIGUSR1, signal.SIGUSR2) as came:
        for number in (signal.SIGUSR1, signal.SIGUSR2, signal.SIGUSR1):
            signal.raise_signal(number)
        assert (heard, came) == ([signal.SIGUSR1], [signal.SIGUSR1, signal.SIGUSR2])


def test_other_signals_and_those_outside_do_not_wait(heard: list[int]) -> None:
    with defer_signals(signal.SIGUSR1) as came:
        signal.raise_signal(signal.SIGUSR2)
    signal.raise_signal(signal.SIGUSR1)
    assert (heard, came) == ([signal.SIGUSR2, signal.SIGUSR1], [])


def test_handlers_are_put_back_after_an_exception(heard: list[int]) -> None:
    before = signal.getsignal(signal.SIGUSR1)

    def fail() -> None:
        with defer_signals(signal.SIGUSR1):
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert signal.getsignal(signal.SIGUSR1) is before


@pytest.mark.parametrize("handler", [signal.SIG_IGN, signal.SIG_DFL])
def test_what_no_function_handles_is_left_alone(heard: list[int], handler: signal.Handlers) -> None:
    signal.signal(signal.SIGUSR1, handler)
    with defer_signals(signal.SIGUSR1):
        assert signal.getsignal(signal.SIGUSR1) is handler


def test_other_threads_hold_nothing(heard: list[int]) -> None:
    """Handlers run in the main thread, and only that may set them."""
    handlers = []

    def hold() -> None:
        with defer_signals(signal.SIGUSR1):
            handlers.append(signal.getsignal(signal.SIGUSR1))

    before = signal.getsignal(signal.SIGUSR1)
    thread = threading.Thread(target=hold)
    thread.start()
    thread.join()
    assert handlers == [before]
