"""Records of programs that this user's sweeps have written: the contents of a library are not trusted by themselves.

The digest of each record is stored in the user's cache, as the name of an empty file. A record has the digests of all
files of its program, so that a known record vouches for them, wherever the library is. Without the cache, for example
on another machine, a program is built again and compared, which costs time and changes no file.
"""

import os
from contextlib import suppress
from hashlib import sha256

from tablegen.base.user_cache import keep_newest, private_folder

_MOST = 20_000  # the least recently used beyond it are removed


class WrittenRecords:
    """The records in the cache."""

    def __init__(self) -> None:
        self._folder = private_folder("programs")

    def __contains__(self, record: bytes) -> bool:
        if self._folder is None:
            return False
        try:
            os.utime(self._folder / _name(record))
        except OSError:
            return False
        return True

    def note(self, record: bytes) -> None:
        """Store a record that was just written; if that fails its program is built again the next time."""
        if self._folder is not None:
            with suppress(OSError):
                (self._folder / _name(record)).touch(mode=0o600)

    def prune(self) -> None:
        """Remove the least recently used records."""
        if self._folder is not None:
            with suppress(OSError):
                if len(os.listdir(self._folder)) > _MOST:
                    keep_newest(self._folder, _MOST)


def _name(record: bytes) -> str:
    return sha256(record).hexdigest()
