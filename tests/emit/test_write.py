"""The writer: whole or not at all, only what changed, nothing left behind."""

import errno
import multiprocessing
import os
from multiprocessing.synchronize import Event
from pathlib import Path

import pytest
from limits import PATIENCE_S

from tablegen.base import directory_lock
from tablegen.base.directory_lock import locked
from tablegen.emit.write import CannotWrite, NoPlace, write_files

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


@pytest.mark.parametrize("name", ["a.h", "manifest.json"])
def test_a_pipe_in_the_way_is_neither_read_nor_replaced(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / name)
    with pytest.raises(NoPlace, match="is a pipe, where a file has to go"):
        write_files(tmp_path, FILES)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_device_is_never_replaced(tmp_path: Path) -> None:
    """Nor what a symbolic link calls one: as root, a rename would put a file in its place."""
    (tmp_path / "a.h").symlink_to("/dev/null")
    with pytest.raises(NoPlace, match="is a device, where a file has to go"):
        write_files(tmp_path, FILES)
    with pytest.raises(NoPlace, match="is a device, where a directory has to go"):
        write_files(Path("/dev/null"), FILES)


def test_what_a_killed_writer_has_left_goes_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / ".tablegen-a1b2c3_x").write_bytes(b"half")
    kept = (".tablegen-notes", ".tablegen-a1b2c3_x2", ".tablegen-A1b2c3_x", "tablegen-a1b2c3_x")
    for name in kept:
        (tmp_path / name).write_bytes(b"mine")
    (tmp_path / ".tablegen-folder_x").mkdir()
    write_files(tmp_path, FILES)
    assert {path.name for path in tmp_path.iterdir()} == {*FILES, *kept, ".tablegen-folder_x"}
    (tmp_path / ".tablegen-a1b2c3_x").write_bytes(b"half")
    assert write_files(tmp_path, FILES) == []
    assert not (tmp_path / ".tablegen-a1b2c3_x").exists()


def test_the_disk_has_every_file_before_the_manifest_names_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each content, the names, the directory, and only then the manifest and the directory again."""
    events: list[str] = []
    fsync, replace, unlink = os.fsync, os.replace, Path.unlink

    def synced(handle: int) -> None:
        events.append("directory" if os.path.isdir(f"/proc/self/fd/{handle}") else "content")
        fsync(handle)

    def renamed(old: Path, new: Path) -> None:
        events.append(new.name)
        replace(old, new)

    def removed(path: Path, missing_ok: bool = False) -> None:
        events.append(f"- {path.name}")
        unlink(path, missing_ok=missing_ok)

    (tmp_path / "old.c").write_bytes(b"old")
    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", renamed)
    monkeypatch.setattr(Path, "unlink", removed)
    write_files(tmp_path, FILES, ["old.c"])
    before = [*["content"] * 3, "a.h", "a.c", "- old.c", "directory", "manifest.json"]
    assert events[: len(before)] == before
    assert events[-1] == "directory"


def _hold(folder: Path, held: Event, go: Event) -> None:
    with locked(folder):
        held.set()
        go.wait(PATIENCE_S)


def _write(folder: Path, content: bytes, done: Event) -> None:
    write_files(folder, {f"{n}.c": content for n in range(20)} | {"manifest.json": content})
    done.set()


def test_two_writers_of_a_directory_take_turns(tmp_path: Path) -> None:
    context = multiprocessing.get_context("fork")
    held, go, done = context.Event(), context.Event(), context.Event()
    holder = context.Process(target=_hold, args=(tmp_path, held, go))
    holder.start()
    assert held.wait(PATIENCE_S)
    writer = context.Process(target=_write, args=(tmp_path, b"one", done))
    writer.start()
    assert not done.wait(0.2)
    assert list(tmp_path.iterdir()) == []  # nothing was begun either
    go.set()
    holder.join(PATIENCE_S)
    writer.join(PATIENCE_S)
    assert len(contents(tmp_path)) == 21


def test_a_lock_ends_with_its_process(tmp_path: Path) -> None:
    context = multiprocessing.get_context("fork")
    held, go = context.Event(), context.Event()
    holder = context.Process(target=_hold, args=(tmp_path, held, go))
    holder.start()
    assert held.wait(PATIENCE_S)
    holder.kill()
    holder.join(PATIENCE_S)
    assert write_files(tmp_path, FILES) == list(FILES)


@pytest.mark.parametrize("made_again", [False, True])
def test_a_directory_that_went_meanwhile_is_locked_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, made_again: bool
) -> None:
    """Another writer failed, and removed what it had made, between the opening and the lock."""
    folder, lock, calls = tmp_path / "out", directory_lock._lock, 0
    folder.mkdir()

    def late(handle: int) -> bool:
        nonlocal calls
        calls += 1
        if calls == 1:
            folder.rmdir()
            if made_again:
                folder.mkdir()
        return lock(handle)

    monkeypatch.setattr(directory_lock, "_lock", late)
    before = set(os.listdir("/proc/self/fd"))
    with locked(folder):
        assert calls == 2
        other = os.open(folder, os.O_RDONLY)
        assert not lock(other)  # it is the directory that stands there now
        os.close(other)
    assert set(os.listdir("/proc/self/fd")) == before


def test_patience_ends_with_a_word(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(directory_lock, "_PATIENCE_S", 0.0)
    with (
        locked(tmp_path),
        pytest.raises(CannotWrite, match="another program has been writing there for 0 s; end it, or take another"),
    ):
        write_files(tmp_path, FILES)


@pytest.mark.common
def test_many_writers_at_once_leave_one_build(tmp_path: Path) -> None:
    context = multiprocessing.get_context("fork")
    for turn in range(10):
        done = [context.Event() for _ in range(4)]
        writers = [
            context.Process(target=_write, args=(tmp_path / f"{turn}", bytes([n]) * 5000, done[n])) for n in range(4)
        ]
        for writer in writers:
            writer.start()
        for writer in writers:
            writer.join(PATIENCE_S)
        assert [writer.exitcode for writer in writers] == [0] * 4
        assert len(set(contents(tmp_path / f"{turn}").values())) == 1


def test_a_disk_without_locks_is_written_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(_handle: int, _how: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(directory_lock.fcntl, "flock", none)
    assert write_files(tmp_path, FILES) == list(FILES)
