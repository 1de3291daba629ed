"""A small build, and a copy of it to be damaged."""

import shutil
from pathlib import Path

import pytest
from building import VARIANTS, Build, build


@pytest.fixture(scope="session")
def short(tmp_path_factory: pytest.TempPathFactory) -> Build:
    """A build of 8 lines of 331 ticks."""
    return build(tmp_path_factory.mktemp("short"), VARIANTS["short_frame"])


@pytest.fixture
def folder(short: Build, tmp_path: Path) -> Path:
    """A copy of it."""
    shutil.copytree(short.folder, tmp_path / "out")
    return tmp_path / "out"
