"""Compiled templates, kept in the user's cache: to compile them took a tenth of a build.

Jinja takes a file only for the text that the template has now. What else a template is compiled by, and the file's own
bytes, are in a digest at its beginning, so that a file of another version, or one that was cut short, is no file.
"""

import os
import sys
from contextlib import suppress
from hashlib import sha256
from importlib.util import MAGIC_NUMBER

import jinja2
from jinja2.bccache import Bucket, BytecodeCache

from tablegen.base.reading import BUILD_FILE, read_private_bytes
from tablegen.base.user_cache import keep_newest, private_folder

_MOST_FILES = 60  # the least recently written go
_DIGEST_BYTES = sha256().digest_size


class TemplateCache(BytecodeCache):
    """One file a template in ``tablegen/templates``; ``settings`` are those of the environment.

    Compiled text must depend on nothing else: no filter may be called with constants, which Jinja works out at once.
    """

    def __init__(self, settings: object) -> None:
        self.folder = private_folder("templates")
        self.made_by = repr((settings, jinja2.__version__, sys.version, MAGIC_NUMBER)).encode()

    def load_bytecode(self, bucket: Bucket) -> None:
        """Take the code of a template, if it is there as it was written."""
        if self.folder is None:
            return
        with suppress(OSError):
            content = read_private_bytes(self.folder / bucket.key, BUILD_FILE)
            digest, code = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
            if digest == self._digest(bucket, code):
                bucket.bytecode_from_string(code)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Keep the code of a template; where that fails it is compiled again the next time."""
        if self.folder is None:
            return
        code = bucket.bytecode_to_string()
        from tempfile import mkstemp  # here: most builds keep nothing new

        with suppress(OSError):
            handle, part = mkstemp(prefix="part-", dir=self.folder)
            try:
                with os.fdopen(handle, "wb") as file:
                    file.write(self._digest(bucket, code) + code)
                os.replace(part, self.folder / bucket.key)
            except OSError:
                os.unlink(part)
                raise
            keep_newest(self.folder, _MOST_FILES)

    def _digest(self, bucket: Bucket, code: bytes) -> bytes:
        """Of the code, its name, and what made it."""
        return sha256(b"\n".join((self.made_by, bucket.key.encode(), bucket.checksum.encode(), code))).digest()
