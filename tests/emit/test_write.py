"""The writer: whole or not at all, only what changed, nothing left behind."""

import errno
import os
from pathlib import Path

import pytest

from tablegen.emit.write import CannotWrite, write_files

FILES = {"a.h": b"one", "a.c": b"two", "manifest.json": b"three"}


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_only_what_changed_is_written(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "er"
    assert write_files(folder, FILES) == list(FILES)
    before = {path: path.stat().st_mtime_ns for path in folder.iterdir()}
    assert write_files(folder, {**FILES, "a.c": b"other"}) == ["a.c"]
    assert contents(folder) == {**FILES, "a.c": b"other"}
    touched = [path.name for path, time in before.items() if path.stat().st_mtime_ns != time]
    assert touched == ["a.c"]


@pytest.mark.parametrize("fail_at", range(6))
def test_a_failure_at_any_step_leaves_what_stood(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fail_at: int) -> None:
    """The disk fills at the n-th file that is opened for writing, or the n-th rename is refused."""
    folder = tmp_path / "out"
    write_files(folder, FILES)
    new = {name: content + b", and more" for name, content in FILES.items()}
    calls = 0

    def full(*_: object, **__: object) -> None:
        nonlocal calls
        calls += 1
        if calls > fail_at % 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    if fail_at < 3:
        real = os.fdopen
        monkeypatch.setattr(os, "fdopen", lambda *a, **k: full() or real(*a, **k))
    else:
        replace = os.replace
        monkeypatch.setattr(os, "replace", lambda *a: full() or replace(*a))
    with pytest.raises(CannotWrite, match="No space left on device"):
        write_files(folder, new)
    after = contents(folder)
    assert set(after) == set(FILES)
    assert after["manifest.json"] == FILES["manifest.json"]  # never newer than what it describes
    if fail_at <= 3:
        assert after == FILES


def test_a_new_folder_is_taken_away_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(CannotWrite):
        write_files(tmp_path / "deep" / "er", FILES)
    assert list(tmp_path.iterdir()) == []


def test_a_directory_in_the_way_is_seen_before_anything_is_written(tmp_path: Path) -> None:
    (tmp_path / "manifest.json").mkdir()
    with pytest.raises(CannotWrite, match=r"manifest\.json: is a directory"):
        write_files(tmp_path, FILES)
    assert [path.name for path in tmp_path.iterdir()] == ["manifest.json"]
