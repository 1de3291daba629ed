"""A lock that gives a directory one writer at a time: on the directory itself, released with its owner."""

import errno
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

try:
    import fcntl
except ImportError:  # pragma: no cover - Windows, where directories cannot be locked
    fcntl = None  # type: ignore[assignment]

_PATIENCE_S = 60.0  # a build writes for far less than a second
_POLL_S = 0.02
_BUSY = (errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES)
_NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.EBADF, errno.EINVAL, errno.ENOSYS)  # file systems of some networks


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a directory for writing; wait while another writer has it.

    ``make -j`` may start two builds into one directory: the second writes after the first, and sees complete files.

    Raises
    ------
    OSError
        If the other writer takes longer than a minute.
    """
    handle = _locked(folder)
    try:
        yield
    finally:
        if handle is not None:
            os.close(handle)


def _locked(folder: Path) -> int | None:
    if fcntl is None:
        return None
    until = time.monotonic() + _PATIENCE_S
    while True:
        handle = os.open(folder, os.O_RDONLY)
        acquired = False
        try:
            acquired = _lock(handle) and _is_still(folder, handle)
            if acquired:
                return handle
        except OSError as error:
            if error.errno in _NO_LOCKS:
                return None
            raise
        finally:
            if not acquired:
                os.close(handle)
        if time.monotonic() >= until:
            why = f"another program has been writing there for {_PATIENCE_S:g} s; end it, or take another directory"
            raise OSError(errno.EBUSY, why)
        time.sleep(_POLL_S)
        folder.mkdir(parents=True, exist_ok=True)  # another writer may have made it, failed and removed it


def _lock(handle: int) -> bool:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in _BUSY:
            return False
        raise
    return True


def _is_still(folder: Path, handle: int) -> bool:
    try:
        return os.path.samestat(os.stat(folder), os.fstat(handle))
    except FileNotFoundError:
        return False
