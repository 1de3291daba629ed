"""Compiled templates in the user's cache, in ``tablegen/templates``: to compile them takes a tenth of a build."""

import sys
from hashlib import sha256
from importlib.util import MAGIC_NUMBER

import jinja2
from jinja2.bccache import Bucket, BytecodeCache

from tablegen.base.user_cache import CachedFiles

TEMPLATES = CachedFiles("templates", 60)


class TemplateCache(BytecodeCache):
    """One file a template of ``firmware_templates``; ``settings`` are those of the environment.

    Compiled text must depend on nothing else: no filter may be called with constants, which Jinja works out at once.
    """

    def __init__(self, settings: object) -> None:
        self.made_by = repr((settings, jinja2.__version__, sys.version, MAGIC_NUMBER)).encode()

    def load_bytecode(self, bucket: Bucket) -> None:
        """Take the code of a template, if it is there as it was stored."""
        code = TEMPLATES.take_bytes(self._key(bucket))
        if code is not None:
            bucket.bytecode_from_string(code)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Keep the code of a template; where that fails it is compiled again the next time."""
        TEMPLATES.keep_bytes(self._key(bucket), bucket.bytecode_to_string())

    def _key(self, bucket: Bucket) -> str:
        """Return the digest of a template's name, its text, and what compiles it."""
        return sha256(b"\n".join((self.made_by, bucket.key.encode(), bucket.checksum.encode()))).hexdigest()
