"""What tests of several files share."""

import signal
from collections.abc import Iterator
from pathlib import Path

import kept_objects
import pytest
from hypothesis import settings
from installing import install, make_wheel, told_pythons
from real_files import VARIABLE, real_folder
from tool_paths import pytest_runtest_setup, pytest_unconfigure  # noqa: F401

# Without deadlines: how long an example takes is the machine's affair. In CI Hypothesis's examples are fixed.
settings.register_profile("tablegen", settings(), deadline=None)
settings.load_profile("tablegen")

# The run says so at its end.
collect_ignore = [] if real_folder() else [f"calibration/test_real_{of}.py" for of in ("files", "images", "traces")]

# A shell that starts the tests in the background has SIGINT ignored, and nohup SIGHUP. Whatever the tests start would
# ignore it too, but for a handler, which is not handed on.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
    signal.signal(signal.SIGHUP, lambda *_: None)


# The processes that run the tests share what was compiled; the first of them makes the folder and removes it.
kept_objects.folder()


@pytest.fixture(scope="session", autouse=True)
def tracebacks() -> Iterator[None]:
    """What a command that a test starts does not expect is seen whole."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TABLEGEN_TRACEBACK", "1")
        yield


@pytest.fixture(scope="session", autouse=True)
def cache_of_the_session(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No test finds or leaves anything in the user's cache."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel of this tree."""
    return make_wheel(tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="session")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """That wheel, installed into a folder of packages of its own; to be copied before it is changed."""
    return install(wheel, tmp_path_factory.mktemp("installed"))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say which other Pythons and real files were at hand: tests for those that were not are not there."""
    terminalreporter.write_line(told_pythons())
    if real_folder() is None:
        terminalreporter.write_line(f"no folder of real files: {VARIABLE} does not name one, so that none was read")
