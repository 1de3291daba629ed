"""The user's cache: files that are expensive to make, by a digest of their inputs. Nothing is made twice.

Its folders stand in ``$XDG_CACHE_HOME/tablegen``, in ``~/.cache/tablegen`` by default. What is cached is run, so a
folder or file is used only where nobody else can have written it. The name of a file has two digests: its key, which
stands for everything that it was made from, and one of the key and its bytes, so that a truncated, damaged or misplaced
file is not used. Files appear by a rename, so that no reader sees half of one and no writer needs a lock. A cache that
is missing or full costs time, but changes no result.
"""

import os
import stat
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

from tablegen.base.reading import BUILD_FILE, chunks_of, is_private, read_private_bytes

_BY_OTHERS = stat.S_IRWXG | stat.S_IRWXO


class CachedFiles:
    """A folder of the cache, with at most ``most`` files; those that were not used for longest are removed."""

    __slots__ = ("folder", "most")

    def __init__(self, folder: str, most: int) -> None:
        self.folder, self.most = folder, most

    def take(self, key: str, target: Path) -> bool:
        """Copy the file of this key to ``target``; return True if there is one, unchanged since it was stored.

        The copy is compared with the digest in the name, so that a later change of the cached file does not matter.
        """
        import shutil  # here: most builds compile nothing

        with suppress(OSError):
            for path in self._stored(key):
                shutil.copy(path, target)
                if path.name == _name(key, chunks_of(target, BUILD_FILE)):
                    os.utime(path)
                    return True
                target.unlink()
                path.unlink()
        return False

    def keep(self, key: str, source: Path) -> None:
        """Copy a file into the cache."""
        import shutil

        self._store(key, lambda part: shutil.copy(source, part))

    def take_bytes(self, key: str) -> bytes | None:
        """Return the content of this key, unchanged since it was stored; None where there is none."""
        with suppress(OSError):
            for path in self._stored(key):
                content = read_private_bytes(path, BUILD_FILE)
                if path.name == _name(key, [content]):
                    os.utime(path)
                    return content
                path.unlink()
        return None

    def keep_bytes(self, key: str, content: bytes) -> None:
        """Write a content into the cache."""
        self._store(key, lambda part: part.write_bytes(content))

    def _stored(self, key: str) -> Iterator[Path]:
        """Yield the files of a key that nobody else can write; others, and links, are removed."""
        folder = private_folder(self.folder)
        for name in os.listdir(folder) if folder is not None else ():
            if folder is not None and name.startswith(f"{key}-"):
                path = folder / name
                status = path.lstat()
                if stat.S_ISREG(status.st_mode) and is_private(status):
                    yield path
                else:
                    path.unlink()

    def _store(self, key: str, fill: Callable[[Path], object]) -> None:
        """Store the file that ``fill`` writes; on a full disk none is stored."""
        folder = private_folder(self.folder)
        if folder is None:
            return
        from tempfile import NamedTemporaryFile  # here: mostly nothing new is stored

        with suppress(OSError):
            with NamedTemporaryFile(dir=folder, prefix="part-", delete=False) as part:
                path = Path(part.name)
            try:
                fill(path)
                path.chmod(stat.S_IMODE(path.stat().st_mode) & ~_BY_OTHERS)  # a compiler leaves it to the umask
                os.replace(path, folder / _name(key, chunks_of(path, BUILD_FILE)))
            finally:
                path.unlink(missing_ok=True)
            keep_newest(folder, self.most)


def private_folder(name: str) -> Path | None:
    """Return the folder of that name in the cache, made if it is missing; None where it cannot be private.

    It has to be a directory of the user's own, and no link, that nobody else can write into. Windows has no such marks;
    there the profile that the folder stands in is the user's own.
    """
    home = os.environ.get("XDG_CACHE_HOME", "")
    try:
        folder = (Path(home) if os.path.isabs(home) else Path.home() / ".cache") / "tablegen" / name
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.lstat()
    except (OSError, RuntimeError):  # a RuntimeError where the user has no home
        return None
    return folder if stat.S_ISDIR(status.st_mode) and is_private(status) else None


def keep_newest(folder: Path, most: int) -> None:
    """Remove the files of a folder that were not used for longest, so that ``most`` remain.

    Raises
    ------
    OSError
        If one cannot be removed.
    """
    by_age = sorted(folder.iterdir(), key=lambda one: one.stat().st_mtime)
    for old in by_age[:-most]:
        old.unlink(missing_ok=True)


def _name(key: str, chunks: Iterable[bytes]) -> str:
    digest = sha256(key.encode())
    for chunk in chunks:
        digest.update(chunk)
    return f"{key}-{digest.hexdigest()}"
