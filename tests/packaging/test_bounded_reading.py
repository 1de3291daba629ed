"""The reader itself: just as much as a kind allows, never a pipe, and no descriptor is left open."""

import errno
import hashlib
import os
from pathlib import Path

import pytest

from tablegen.base import reading
from tablegen.base.reading import Kind, file_sha256, holds, other_than_file, read_bytes, read_text, size_shown

SMALL = Kind("a small file", 3000)


def descriptors() -> set[str]:
    return set(os.listdir("/proc/self/fd"))


@pytest.mark.parametrize("chunk", [1, 7, 3000, 1 << 20])
def test_a_file_may_have_just_the_most(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, chunk: int) -> None:
    monkeypatch.setattr(reading, "_CHUNK_BYTES", chunk)
    path = tmp_path / "file"
    content = bytes(i % 251 for i in range(SMALL.most_bytes))
    for length in (0, 1, SMALL.most_bytes):
        path.write_bytes(content[:length])
        assert read_bytes(path, SMALL) == content[:length]
        assert file_sha256(path, SMALL) == hashlib.sha256(content[:length]).hexdigest()
    path.write_bytes(content + b"x")
    for read in (read_bytes, read_text, file_sha256):
        with pytest.raises(OSError, match="above 2 KiB, which is the most that a small file may have") as caught:
            read(path, SMALL)
        assert caught.value.errno == errno.EFBIG


def test_a_file_that_grows_while_it_is_read_ends_at_the_most(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"x")
    monkeypatch.setattr(reading, "_CHUNK_BYTES", 1000)
    read, count = os.read, 0

    def growing(handle: int, most: int) -> bytes:
        nonlocal count
        with path.open("ab") as file:
            file.write(bytes(most))
        got = read(handle, most)
        count += len(got)
        return got

    monkeypatch.setattr(os, "read", growing)
    with pytest.raises(OSError, match="above 2 KiB"):
        read_bytes(path, SMALL)
    assert count == SMALL.most_bytes + 1


def test_a_pipe_that_takes_the_place_of_a_file_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was a file when it was looked at, and is a pipe when it is opened."""
    file, pipe = tmp_path / "file", tmp_path / "pipe"
    file.write_bytes(b"x")
    os.mkfifo(pipe)
    stat, opened = os.stat, os.open
    monkeypatch.setattr(os, "stat", lambda path, **more: stat(file if path == pipe else path, **more))

    def at_once(path: str, flags: int) -> int:
        assert flags & os.O_NONBLOCK  # without it the next line has no end
        assert flags & os.O_CLOEXEC
        return opened(path, flags)

    monkeypatch.setattr(os, "open", at_once)
    with pytest.raises(OSError, match="a pipe, where a regular file is needed"):
        read_bytes(pipe, SMALL)


def test_no_descriptor_is_left(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(bytes(SMALL.most_bytes + 1))
    os.mkfifo(tmp_path / "pipe")
    before = descriptors()
    for other in (path, tmp_path, tmp_path / "pipe", tmp_path / "none", Path("\0")):
        with pytest.raises(OSError, match=r"\S"):
            read_bytes(other, SMALL)
    assert read_bytes(path, Kind("a file", 1 << 20))
    assert descriptors() == before


def test_what_holds_a_content(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"abc")
    os.mkfifo(tmp_path / "pipe")
    assert holds(path, b"abc")
    assert not any(holds(path, other) for other in (b"abd", b"ab", b"abcd", b""))
    assert not any(holds(tmp_path / name, b"") for name in (".", "pipe", "none", "\0"))


def test_what_stands_at_a_path(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to("pipe")
    found = [other_than_file(tmp_path / name) for name in ("file", "none", "\0", ".", "pipe", "link")]
    assert found == [None, None, None, "a directory", "a pipe", "a pipe"]
    assert other_than_file("/dev/null") == "a device"
    assert [size_shown(count) for count in (4096, 1 << 20)] == ["4 KiB", "1 MiB"]
