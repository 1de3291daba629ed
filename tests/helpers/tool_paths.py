"""Hooks of pytest: a test finds on PATH only the tools that the Makefile's list of its set installs.

So a test that calls another one fails on every machine, not only on one where that tool is missing.
"""

import os
import tempfile
from pathlib import Path

import pytest
from listed_tools import BASE, PROGRAMS, allowed_programs, programs_of


class Paths:
    """PATH for each set of tests: a folder with a program that the set has not is replaced by one with links."""

    def __init__(self) -> None:
        self._before = os.environ.get("PATH", os.defpath)
        self._links: tempfile.TemporaryDirectory[str] | None = None
        self._made: dict[frozenset[str], str] = {}

    def path(self, allowed: frozenset[str]) -> str:
        """PATH without the programs of the table that are not among these."""
        hidden = programs_of(PROGRAMS) - allowed - BASE
        if hidden not in self._made:
            places: dict[Path, str] = {}
            for entry in filter(None, self._before.split(os.pathsep)):
                real = Path(entry).resolve()
                if real not in places:
                    places[real] = self._without(hidden, real) or entry
            self._made[hidden] = os.pathsep.join(places.values())
        return self._made[hidden]

    def remove(self) -> None:
        """Remove the links, and set PATH as it was."""
        if self._links is not None:
            os.environ["PATH"] = self._before
            self._links.cleanup()
        self._links, self._made = None, {}

    def _without(self, hidden: frozenset[str], folder: Path) -> str | None:
        if not any((folder / name).exists() for name in hidden):
            return None
        self._links = self._links or tempfile.TemporaryDirectory(prefix="tablegen-tools-")
        links = tempfile.mkdtemp(dir=self._links.name)
        for program in os.scandir(folder):
            if program.name not in hidden:
                os.symlink(program.path, os.path.join(links, program.name))
        return links


_PATHS = Paths()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Choose the PATH of a test, and of the fixtures that it is the first to need."""
    marks = (mark.name for mark in item.iter_markers())
    os.environ["PATH"] = _PATHS.path(allowed_programs(marks, hdl="hdl_tests" in item.path.parts))


def pytest_unconfigure() -> None:
    """Remove the links."""
    _PATHS.remove()
