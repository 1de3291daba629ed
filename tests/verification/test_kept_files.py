"""Files that were compiled and kept in the user's cache: what is taken again, what is not, and what is not kept."""

import os
import shutil
from pathlib import Path

import pytest

from tablegen.base.user_cache import CachedFiles

MODELS = CachedFiles("models", 20)
KEY, OTHER = "1" * 64, "2" * 64


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
def copy(tmp_path: Path) -> Path:
    """Where what is taken goes."""
    return tmp_path / "copy"


def test_what_was_kept_is_taken_and_can_be_run(model: Path, cache: Path, copy: Path) -> None:
    assert not MODELS.take(KEY, copy)
    model.chmod(0o775)  # as the umask of some has it
    MODELS.keep(KEY, model)
    assert MODELS.take(KEY, copy)
    assert copy.read_bytes() == model.read_bytes()
    assert os.access(copy, os.X_OK)
    assert cache.stat().st_mode & 0o077 == 0
    assert not MODELS.take(OTHER, copy)


@pytest.mark.parametrize("content", [b"", b"\x7fELF a mode", b"\x7fELF b model"])
def test_a_file_that_is_not_what_was_written_is_taken_out(model: Path, cache: Path, copy: Path, content: bytes) -> None:
    MODELS.keep(KEY, model)
    (path,) = cache.iterdir()
    path.write_bytes(content)
    assert not MODELS.take(KEY, copy)
    assert list(cache.iterdir()) == []
    assert not copy.exists()


def test_a_file_that_has_another_ones_key_is_taken_out(model: Path, cache: Path, copy: Path) -> None:
    """Whole as it is, it is not what was made of that."""
    MODELS.keep(KEY, model)
    (path,) = cache.iterdir()
    path.rename(cache / path.name.replace(KEY, OTHER))
    assert not MODELS.take(OTHER, copy)
    assert list(cache.iterdir()) == []
    assert not copy.exists()


@pytest.mark.parametrize("link", [False, True])
def test_what_others_can_write_is_taken_out(model: Path, cache: Path, copy: Path, link: bool) -> None:
    """And what leads to somewhere else."""
    MODELS.keep(KEY, model)
    (path,) = cache.iterdir()
    if link:
        path.rename(cache.parent / "elsewhere")
        path.symlink_to(cache.parent / "elsewhere")
    else:
        path.chmod(0o777)
    assert not MODELS.take(KEY, copy)
    assert list(cache.iterdir()) == []
    assert not copy.exists()


def test_a_folder_that_others_can_write_is_neither_read_nor_written(model: Path, cache: Path, copy: Path) -> None:
    MODELS.keep(KEY, model)
    cache.chmod(0o777)
    assert not MODELS.take(KEY, copy)
    MODELS.keep(OTHER, model)
    assert len(list(cache.iterdir())) == 1


def test_the_least_recently_used_go(model: Path, cache: Path, copy: Path) -> None:
    keys = [f"{number:064d}" for number in range(25)]
    for age, key in enumerate(keys[:20]):
        MODELS.keep(key, model)
        (path,) = cache.glob(f"{key}-*")
        os.utime(path, (1000 + age, 1000 + age))
    MODELS.take(keys[0], copy)
    for key in keys[20:]:
        MODELS.keep(key, model)
    assert [key for key in keys if MODELS.take(key, copy)] == [keys[0], *keys[6:]]


def test_a_folder_that_cannot_be_made_costs_nothing(model: Path, cache: Path, copy: Path) -> None:
    cache.parent.parent.mkdir()
    cache.parent.write_text("a file in its place")
    MODELS.keep(KEY, model)
    assert not MODELS.take(KEY, copy)


def test_a_full_disk_leaves_no_half_of_a_model(model: Path, cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(source: Path, target: Path) -> None:
        target.write_bytes(source.read_bytes()[:3])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(shutil, "copy", full)
    MODELS.keep(KEY, model)
    assert list(cache.iterdir()) == []
