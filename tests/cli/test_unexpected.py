"""What no command expects: a message with a status of its own, never status 1, which means that output is stale."""

import errno
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from unittest.mock import patch

import pytest
from editing import Outcome, run, write_pair

from tablegen.base.plugins import PluginFailed
from tablegen.cli.shared.exit_status import ExitStatus
from tablegen.cli.shared.unexpected import VARIABLE


@pytest.fixture(autouse=True)
def _as_for_users(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)


def broken(tmp_path: Path, error: BaseException | Callable[[], object], *command: str) -> Outcome:
    """The outcome of a command whose planning raises an exception."""

    def fail(*_: object, **__: object) -> object:
        if isinstance(error, BaseException):
            raise error
        return error()

    scan = write_pair(tmp_path)
    with patch("tablegen.certificate.certified_scan.make_plan", fail):
        return run(*(command or ("check",)), scan, explains=True)


def endless() -> object:
    return endless()


@pytest.mark.common
@pytest.mark.parametrize(
    ("error", "status", "why"),
    [
        (TypeError("no such thing"), 70, "internal error: TypeError: no such thing (certificate/certified_scan.py:"),
        (AssertionError(), 70, "internal error: AssertionError (certificate/certified_scan.py:"),
        (KeyError("x"), 70, "internal error: KeyError: 'x' ("),
        (IndexError("out of range"), 70, "internal error: IndexError: out of range"),
        (ZeroDivisionError("division by zero"), 70, "internal error: ZeroDivisionError"),
        (NotImplementedError(), 70, "internal error: NotImplementedError"),
        (EOFError("of what?"), 70, "internal error: EOFError: of what?"),
        (endless, 70, "internal error: RecursionError: maximum recursion depth exceeded"),
        (lambda: "\ud800".encode(), 70, "internal error: UnicodeEncodeError: 'utf-8' codec can't encode"),
        (lambda: b"\xff".decode(), 70, "internal error: UnicodeDecodeError: 'utf-8' codec can't decode byte 0xff"),
        (BaseExceptionGroup("two", [SystemExit(), KeyError()]), 70, "internal error: BaseExceptionGroup: two"),
        (GeneratorExit(), 70, "internal error: GeneratorExit"),
        (SystemExit(), 70, "internal error: SystemExit"),
        (SystemExit(0), 70, "internal error: SystemExit: 0"),
        (SystemExit("stop"), 70, "internal error: SystemExit: stop"),
        (MemoryError("of 9 GB"), 70, "not enough memory: MemoryError: of 9 GB (certificate/certified_scan.py:"),
        (
            OSError(errno.ENOSPC, "No space left on device", "/x/y.c"),
            4,
            "/x/y.c: cannot write: No space left on device;",
        ),
        (OSError(errno.EDQUOT, "Disk quota exceeded", b"/x/y.c"), 4, "/x/y.c: cannot write: Disk quota exceeded;"),
        (
            OSError(errno.EMFILE, "Too many open files", "a"),
            70,
            "a: Too many open files (certificate/certified_scan.py:",
        ),
        (
            PermissionError(errno.EACCES, "Permission denied", "a"),
            70,
            "a: Permission denied (certificate/certified_scan.py:",
        ),
        (OSError("without a number"), 70, "without a number (certificate/certified_scan.py:"),
        (TimeoutError(), 70, "TimeoutError (certificate/certified_scan.py:"),
        (ValueError("steers\x1b[2J\nlines"), 70, "internal error: ValueError: steers\\x1b[2J\\nlines ("),
        (ValueError("x" * 10_000), 70, "internal error: ValueError: xxx"),
        (PluginFailed("'a' of b failed"), 2, "'a' of b failed"),
    ],
    ids=lambda value: getattr(value, "__name__", repr(value))[:40],  # no address: workers have to agree on it
)
def test_it_has_a_message_and_a_status(
    tmp_path: Path, error: BaseException | Callable[[], object], status: int, why: str
) -> None:
    outcome = broken(tmp_path, error)
    assert (outcome.status, outcome.out) == (status, "")
    assert outcome.err.lstrip().startswith(why)  # click ends the line of an interruption, and of an EOFError
    assert "Traceback" not in outcome.err
    assert f"set {VARIABLE}=1 and run the command again to see the traceback" in outcome.err
    assert 1 <= outcome.err.strip().count("\n") + 1 <= 2
    assert len(outcome.err) < 1500


def test_an_internal_error_says_what_to_report(tmp_path: Path) -> None:
    said = broken(tmp_path, KeyError("x")).err
    assert "this is a fault of tablegen, not of your input; please report it with the command" in said
    assert f"Python {sys.version.split()[0]}" in said
    assert "tablegen 0." in said


@pytest.mark.parametrize(("value", "shown"), [("1", True), ("", False), ("0", False)])
def test_the_traceback_is_there_when_it_is_wanted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, value: str, shown: bool
) -> None:
    monkeypatch.setenv(VARIABLE, value)
    outcome = broken(tmp_path, KeyError("x"))
    assert outcome.status == ExitStatus.UNEXPECTED
    assert outcome.err.startswith("Traceback (most recent call last):") == shown
    assert (f"set {VARIABLE}=1" in outcome.err) != shown
    assert "internal error: KeyError: 'x'" in outcome.err


@pytest.mark.parametrize("command", ["build", "show"])
def test_other_commands_end_so_too(tmp_path: Path, command: str) -> None:
    assert broken(tmp_path, KeyError("x"), command).status == ExitStatus.UNEXPECTED


def test_a_build_that_is_checked_is_not_called_stale(tmp_path: Path) -> None:
    assert broken(tmp_path, KeyError("x"), "build", "--check", "-o", str(tmp_path / "out")).status == 70


@pytest.mark.parametrize("error", [BrokenPipeError(errno.EPIPE, "Broken pipe"), OSError(errno.EPIPE, "Broken pipe")])
def test_a_pipe_that_is_not_stdout_is_no_success(tmp_path: Path, error: OSError) -> None:
    """Of a simulator or a worker that died. Where the reader of stdout has gone, there is nothing left to say."""
    outcome = broken(tmp_path, error, "build", "-o", str(tmp_path / "out"))
    assert (outcome.status, outcome.err.startswith("Broken pipe (certificate/certified_scan.py:")) == (70, True)
    assert not (tmp_path / "out").exists()


def test_an_interruption_is_still_one(tmp_path: Path) -> None:
    outcome = broken(tmp_path, KeyboardInterrupt())
    assert (outcome.status, outcome.err.lstrip()) == (130, "interrupted\n")


def test_without_what_the_report_needs_there_is_a_message(tmp_path: Path) -> None:
    with patch.dict("sys.modules", {"tablegen.cli.shared.unexpected": None}):
        outcome = broken(tmp_path, KeyError("x"))
    assert (outcome.status, outcome.err) == (70, "internal error: KeyError: 'x'\n")


@pytest.mark.common
def test_a_process_of_its_own_ends_so(tmp_path: Path) -> None:
    """Through the entry point, and with a text that ASCII cannot say."""
    scan = write_pair(tmp_path)
    code = (
        "import sys, tablegen.certificate.certified_scan as b\n"
        "def fail(*_, **_options): raise KeyError('µ')\n"
        "b.make_plan = fail\n"
        f"sys.argv = ['tablegen', 'check', {str(scan)!r}]\n"
        "from tablegen.cli import main\nmain()"
    )
    environment = {"PYTHONIOENCODING": "ascii", "PATH": "/usr/bin:/bin"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment)
    assert (done.returncode, done.stdout) == (70, "")
    assert done.stderr.startswith("internal error: KeyError: '\\xb5' (")
