"""Bounded reading of files from outside: regular files only, and no more bytes than their kind may have.

A pipe would be waited for, a device may never end, and a file may be of any size: none of these stops or fills a
machine. A file that cannot be read is an ``OSError`` whose ``strerror`` gives the reason.
"""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

_CHUNK_BYTES = 1 << 20
_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH
_OPENING = os.O_RDONLY | sum(getattr(os, flag, 0) for flag in ("O_NONBLOCK", "O_NOCTTY", "O_CLOEXEC", "O_BINARY"))


class Kind(NamedTuple):
    """A kind of file: its name in messages, and the most bytes that are read of one."""

    what: str
    most_bytes: int


# docs/inputs.md has this table.
CONFIGURATION = Kind("a scan, scanner or operator file", 1 << 20)
RESPONSE = Kind("a measured response", 16 << 20)
MEASUREMENT = Kind("a file of measurements", 512 << 20)
IMAGE = Kind("an image", 256 << 20)
MANIFEST = Kind("a manifest", 8 << 20)
BUILD_FILE = Kind("a file of a build", 512 << 20)
RECORD = Kind("a record of verify", 16 << 20)
KEY = Kind("a key file", 4 << 10)
KINDS = (CONFIGURATION, RESPONSE, MEASUREMENT, IMAGE, MANIFEST, BUILD_FILE, RECORD, KEY)

_OTHERS = (
    (stat.S_ISDIR, "a directory"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
)


def other_than_file(path: str | os.PathLike[str]) -> str | None:
    """Return what stands at a path, such as "a pipe", if that is no regular file; None for a file, and for nothing."""
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return None
    return _other(mode)


def other_than_folder(folder: Path, name: str) -> tuple[Path, str] | None:
    """Return the first sub-folder of a name such as ``zephyr/module.yml`` that is no directory, and what stands there.

    A symbolic link is none: what it leads to stands elsewhere. None for directories, and where nothing stands.
    """
    place = folder
    for part in name.split("/")[:-1]:
        place = place / part
        try:
            mode = os.lstat(place).st_mode
        except (OSError, ValueError):
            return None
        if stat.S_ISLNK(mode):
            return place, "a symbolic link"
        if not stat.S_ISDIR(mode):
            return place, _other(mode) or "a file"
    return None


def read_bytes(path: str | os.PathLike[str], kind: Kind) -> bytes:
    """Read a whole file.

    Raises
    ------
    OSError
        If it cannot be read, is no regular file, or is too large.
    """
    return b"".join(chunks_of(path, kind))


def read_private_bytes(path: str | os.PathLike[str], kind: Kind) -> bytes:
    """Read a whole file of the user's own that nobody else can write.

    Raises
    ------
    OSError
        As ``read_bytes``, and if others own or can write it.
    """
    return b"".join(chunks_of(path, kind, private=True))


def read_text(path: str | os.PathLike[str], kind: Kind, encoding: str = "utf-8", errors: str = "strict") -> str:
    """Read a whole file as text.

    Raises
    ------
    OSError
        As ``read_bytes``.
    """
    return read_bytes(path, kind).decode(encoding, errors)


def file_sha256(path: str | os.PathLike[str], kind: Kind = BUILD_FILE) -> str:
    """Return the digest of a file, in hexadecimal digits, read in parts.

    Raises
    ------
    OSError
        As ``read_bytes``.
    """
    digest = sha256()
    for chunk in chunks_of(path, kind):
        digest.update(chunk)
    return digest.hexdigest()


def holds(path: Path, content: bytes) -> bool:
    """Return True if a regular file has exactly this content; False also for what cannot be read."""
    try:
        return read_bytes(path, Kind("", len(content))) == content
    except (OSError, ValueError):
        return False


def size_shown(count: int) -> str:
    """Return a limit as documents and messages show it."""
    return f"{count >> 20} MiB" if count >= 1 << 20 else f"{count >> 10} KiB"


def is_private(status: os.stat_result) -> bool:
    """Return True if a file or directory is the user's own, and nobody else can write it."""
    return not hasattr(os, "geteuid") or (status.st_uid == os.geteuid() and not status.st_mode & _BY_OTHERS)


def chunks_of(path: str | os.PathLike[str], kind: Kind, private: bool = False) -> Iterator[bytes]:
    """Yield the bytes of a file in parts; what ``read_bytes`` refuses is refused before the first part.

    Raises
    ------
    OSError
        As ``read_bytes``; with ``private`` also if others own or can write the file.
    """
    count = 0
    with _opened(path) as (handle, status):
        if private and not is_private(status):
            raise PermissionError(errno.EPERM, "others can write it, or it is another user's")
        size = status.st_size
        while count <= kind.most_bytes >= size:
            chunk = os.read(handle, min(_CHUNK_BYTES, kind.most_bytes + 1 - count))
            if not chunk:
                return
            count += len(chunk)
            yield chunk
    raise OSError(errno.EFBIG, f"above {size_shown(kind.most_bytes)}, which is the most that {kind.what} may have")


@contextmanager
def _opened(path: str | os.PathLike[str]) -> Iterator[tuple[int, os.stat_result]]:
    try:
        _require_file(os.stat(path).st_mode)  # before opening, since opening some devices has an effect
        handle = os.open(os.fspath(path), _OPENING)
    except ValueError:
        raise OSError(errno.EINVAL, "no file can have such a name") from None
    try:
        status = os.fstat(handle)
        _require_file(status.st_mode)
        yield handle, status
    finally:
        os.close(handle)


def _require_file(mode: int) -> None:
    other = _other(mode)
    if other == "a directory":
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if other is not None:
        raise OSError(errno.EINVAL, f"{other}, where a regular file is needed")


def _other(mode: int) -> str | None:
    if stat.S_ISREG(mode):
        return None
    return next((name for is_one, name in _OTHERS if is_one(mode)), "something else")
