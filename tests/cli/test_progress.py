"""The line that long work shows on a terminal, and nowhere else."""

import io
import sys
import threading

import pytest
from limits import PATIENCE_S

from tablegen.cli.shared import progress as module
from tablegen.cli.shared.progress import Progress
from tablegen.cli.shared.progress_bar import Bar


class Screen(io.StringIO):
    """A stream that remembers what it was told and lets others wait for it."""

    def __init__(self, terminal: bool) -> None:
        super().__init__()
        self._terminal = terminal
        self.written = threading.Event()

    def isatty(self) -> bool:
        return self._terminal

    def write(self, text: str) -> int:
        count = super().write(text)
        self.written.set()
        return count


def test_long_work_is_named_and_the_line_goes_again(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen(terminal=True)
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(module, "_SHOW_AFTER_S", 0.01)
    with Progress() as progress:
        progress.now("shaping")
        assert screen.written.wait(PATIENCE_S)
        screen.written.clear()
        progress.now("measuring")
        while "measuring" not in screen.getvalue():
            assert screen.written.wait(PATIENCE_S)
            screen.written.clear()
    shown = screen.getvalue()
    assert shown.startswith("\rshaping (0 s)")
    assert "\rmeasuring (" in shown
    assert shown.endswith("\r" + " " * 60 + "\r")
    assert "\n" not in shown


def test_short_work_shows_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen(terminal=True)
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(module, "_SHOW_AFTER_S", 3600.0)
    with Progress() as progress:
        progress.now("shaping")
    assert screen.getvalue() == ""


def test_a_pipe_sees_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen(terminal=False)
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(module, "_SHOW_AFTER_S", 0.001)
    before = threading.active_count()
    with Progress() as progress:
        progress.now("shaping")
        assert threading.active_count() == before
        assert not screen.written.wait(0.05)
    assert screen.getvalue() == ""


def test_a_failure_takes_the_line_away_too(monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen(terminal=True)
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(module, "_SHOW_AFTER_S", 0.01)

    def interrupted() -> None:
        with Progress() as progress:
            progress.now("shaping")
            assert screen.written.wait(PATIENCE_S)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert screen.getvalue().endswith("\r")


def test_a_batch_has_a_bar_that_messages_interrupt(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of images: how many, and the seconds that are left by those that are done; hidden for a message."""
    screen = Screen(terminal=True)
    monkeypatch.setattr(sys, "stderr", screen)
    clock = [0.0]
    bar = Bar(lambda: clock[0], unit="images")
    for done in range(3):
        clock[0] = 2.0 * done
        bar(done, 4)
        bar.hide()
    bar.close()
    shown = [part.strip() for part in screen.getvalue().split("\r") if part.strip()]
    assert shown == [
        "[........................] 0/4 images",
        "[######..................] 1/4 images  6 s left",
        "[############............] 2/4 images  4 s left",
    ]
    assert screen.getvalue().endswith("\r")
