"""Records of programs that this user's sweeps have written: what stands in a library does not vouch for itself.

Of each record its digest is kept in the user's cache, as the name of an empty file. A record has the digests of all
files of its program, so that one that is known vouches for them, wherever the library stands. Where nothing is known,
after a change of machine for example, a program is made again and compared, which costs time and changes no file.
"""

import os
from contextlib import suppress
from hashlib import sha256

from tablegen.base.user_cache import keep_newest, private_folder

_MOST = 20_000  # the least recently used go


class WrittenRecords:
    """The records that are known."""

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
        """Keep a record that was written just now; where that fails its program is made again the next time."""
        if self._folder is not None:
            with suppress(OSError):
                (self._folder / _name(record)).touch(mode=0o600)

    def prune(self) -> None:
        """Forget those that were not used for longest."""
        if self._folder is not None:
            with suppress(OSError):
                if len(os.listdir(self._folder)) > _MOST:
                    keep_newest(self._folder, _MOST)


def _name(record: bytes) -> str:
    return sha256(record).hexdigest()
