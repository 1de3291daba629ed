"""Compiled files in the user's cache, by a digest of their inputs: nothing is compiled twice.

The name of a file has two digests: its key, which stands for everything that it was made from, and one of the key and
its bytes, so that a truncated or misplaced file is not used. What cannot be stored is not: a full disk costs time, but
changes no result.
"""

import os
import shutil
import stat
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from tablegen.base.reading import BUILD_FILE, chunks_of
from tablegen.base.user_cache import is_private, keep_newest, private_folder

_BY_OTHERS = stat.S_IRWXG | stat.S_IRWXO


@dataclass(frozen=True)
class CachedFiles:
    """A folder of the cache, with at most ``most`` files; those that were not used for longest are removed."""

    folder: str
    most: int

    def take(self, key: str, target: Path) -> bool:
        """Copy the file of this key to ``target``; return True if there is one, unchanged since it was stored.

        The copy is compared with the digest in the name, so that a later change of the cached file does not matter.
        """
        folder = private_folder(self.folder)
        with suppress(OSError):
            for name in os.listdir(folder) if folder is not None else ():
                if folder is not None and name.startswith(f"{key}-") and _copied_out(key, folder / name, target):
                    return True
        return False

    def keep(self, key: str, source: Path) -> None:
        """Copy a file into the cache."""
        folder = private_folder(self.folder)
        if folder is None:
            return
        from tempfile import NamedTemporaryFile  # here: mostly nothing new is kept

        with suppress(OSError):
            with NamedTemporaryFile(dir=folder, prefix="part-", delete=False) as part:
                path = Path(part.name)
            try:
                shutil.copy(source, path)
                path.chmod(stat.S_IMODE(path.stat().st_mode) & ~_BY_OTHERS)  # a compiler leaves the mode to the umask
                path.rename(folder / _name(key, path))
            finally:
                path.unlink(missing_ok=True)
            keep_newest(folder, self.most)


def _copied_out(key: str, path: Path, target: Path) -> bool:
    """Copy a file of the cache; return True if it is what its name states. Remove it otherwise."""
    status = path.lstat()
    if stat.S_ISREG(status.st_mode) and is_private(status):
        shutil.copy(path, target)
        if path.name == _name(key, target):
            os.utime(path)
            return True
        target.unlink()
    path.unlink()
    return False


def _name(key: str, path: Path) -> str:
    digest = sha256(key.encode())
    for chunk in chunks_of(path, BUILD_FILE):
        digest.update(chunk)
    return f"{key}-{digest.hexdigest()}"
