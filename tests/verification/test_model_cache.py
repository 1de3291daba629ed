"""The cache of compiled models: what makes another model, what is not run, and what is not kept."""

import os
from pathlib import Path

import pytest

from tablegen.verification import model_cache
from tablegen.verification.model_cache import keep_model, kept_model, model_key


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "tablegen" / "models"


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "model"
    path.write_bytes(b"\x7fELF a model")
    path.chmod(0o755)
    return path


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    folder = tmp_path / "sources"
    folder.mkdir()
    for name in "a.v", "b.v", "scan.vh":
        (folder / name).write_text(f"// {name}\n")
    return folder


def key_of(sources: Path, top: str = "top", **parameters: int | str) -> str:
    return model_key([sources / "a.v", sources / "b.v"], [sources], {"BITS": 16, **parameters}, top, "-O3")


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


def test_the_same_files_in_another_folder_have_the_same_key(sources: Path, tmp_path: Path) -> None:
    before = key_of(sources)
    assert key_of(sources.rename(tmp_path / "elsewhere")) == before


def test_what_was_kept_is_found_and_can_be_run(model: Path, cache: Path) -> None:
    assert kept_model("1" * 64) is None
    keep_model("1" * 64, model)
    found = kept_model("1" * 64)
    assert found is not None
    assert found.read_bytes() == model.read_bytes()
    assert os.access(found, os.X_OK)
    assert cache.stat().st_mode & 0o077 == 0
    assert kept_model("2" * 64) is None


@pytest.mark.parametrize("content", [b"", b"\x7fELF a mode", b"\x7fELF b model"])
def test_a_file_that_is_not_what_was_written_is_taken_out(model: Path, cache: Path, content: bytes) -> None:
    keep_model("1" * 64, model)
    (path,) = cache.iterdir()
    path.write_bytes(content)
    assert kept_model("1" * 64) is None
    assert list(cache.iterdir()) == []


def test_the_least_recently_used_go(model: Path, cache: Path) -> None:
    keys = [f"{number:064d}" for number in range(25)]
    for age, key in enumerate(keys[:20]):
        keep_model(key, model)
        (path,) = cache.glob(f"{key}-*")
        os.utime(path, (1000 + age, 1000 + age))
    kept_model(keys[0])
    for key in keys[20:]:
        keep_model(key, model)
    assert [key for key in keys if kept_model(key)] == [keys[0], *keys[6:]]


def test_a_folder_that_cannot_be_made_costs_nothing(model: Path, cache: Path) -> None:
    cache.parent.parent.mkdir()
    cache.parent.write_text("a file in its place")
    keep_model("1" * 64, model)
    assert kept_model("1" * 64) is None


def test_a_full_disk_leaves_no_half_of_a_model(model: Path, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(source: Path, target: Path) -> None:
        target.write_bytes(source.read_bytes()[:3])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(model_cache.shutil, "copy", full)
    keep_model("1" * 64, model)
    assert list(cache.iterdir()) == []
