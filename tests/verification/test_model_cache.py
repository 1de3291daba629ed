"""What a compiled model depends on: whatever makes another model makes another key."""

from pathlib import Path

import pytest

from tablegen.verification.verilog import model_cache
from tablegen.verification.verilog.model_cache import model_key


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    folder = tmp_path / "sources"
    folder.mkdir()
    for name in "a.v", "b.v", "scan.vh":
        (folder / name).write_text(f"// {name}\n")
    return folder


def key_of(sources: Path, top: str = "top", **parameters: int | str) -> str:
    return model_key([sources / "a.v", sources / "b.v"], [sources], {"BITS": 16, **parameters}, top, "-O3")


@pytest.mark.common
def test_everything_that_a_model_is_made_of_makes_another_key(
    sources: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keys = [key_of(sources), key_of(sources, "other"), key_of(sources, BITS=17), key_of(sources, SCRIPT="../x")]
    for name in "a.v", "scan.vh":
        before = (sources / name).read_text()
        (sources / name).write_text(before + " ")
        keys.append(key_of(sources))
        (sources / name).write_text(before)
    monkeypatch.setattr(model_cache, "version", lambda name: "0.0")
    keys.append(key_of(sources))
    monkeypatch.undo()
    monkeypatch.setenv("CXXFLAGS", "-O0")
    keys.append(key_of(sources))
    monkeypatch.undo()
    compiler = tmp_path / "compiler"
    compiler.write_text("#!/bin/sh\necho another compiler\n")
    compiler.chmod(0o755)
    monkeypatch.setenv("CXX", str(compiler))
    keys.append(key_of(sources))
    assert len(set(keys)) == len(keys) == 9


@pytest.mark.common
def test_the_same_files_in_another_folder_have_the_same_key(sources: Path, tmp_path: Path) -> None:
    before = key_of(sources)
    assert key_of(sources.rename(tmp_path / "elsewhere")) == before
