"""Objects of C that most builds share, cached in the user's folder by everything that decides their content.

Where an object may depend on more than is known here, such as files that options name, it is compiled every time.
"""

import os
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from tablegen.base.reading import file_sha256
from tablegen.base.user_cache import CachedFiles

_CACHE = CachedFiles("objects", 300)
# Environment variables that change what compilers find or produce.
_SETTINGS = (
    *("CFLAGS", "CPATH", "C_INCLUDE_PATH", "COMPILER_PATH", "GCC_EXEC_PREFIX", "CCC_OVERRIDE_OPTIONS"),
    *("SDKROOT", "MACOSX_DEPLOYMENT_TARGET"),
)


@dataclass(frozen=True)
class Objects:
    """Sources that are compiled alike, with ``words`` of options and macros; they can include all of ``files``.

    Paths are absolute; headers are found in the folders of ``files``.
    """

    sources: list[str]
    words: list[str]
    files: list[str]

    @property
    def names(self) -> list[str]:
        """The file names of the objects."""
        return [f"{Path(source).stem}.o" for source in self.sources]

    def line(self, compiler: Sequence[str]) -> list[str]:
        """Return the command that compiles these objects, for the folder where it runs."""
        places = sorted({os.path.dirname(path) for path in self.files})
        return [*compiler, *self.words, *(f"-I{place}" for place in places), "-c", *self.sources]

    def take(self, compiler_key: str, place: Path) -> bool:
        """Put the objects there that a compiler would make; whether all of them were kept."""
        keys = self._keys(compiler_key)
        return all(_CACHE.take(key, place / name) for name, key in keys.items())

    def keep(self, compiler_key: str, place: Path) -> None:
        """Keep them for the next time."""
        for name, key in self._keys(compiler_key).items():
            _CACHE.keep(key, place / name)

    def _keys(self, compiler_key: str) -> dict[str, str]:
        files = [(Path(path).name, file_sha256(path)) for path in self.files]
        common = repr((compiler_key, self.words, sorted(files)))
        return {name: sha256(f"{common}\n{name}".encode()).hexdigest() for name in self.names}


def maker(compiler: Sequence[str]) -> str | None:
    """Return what tells a compiler from others; None where its objects may depend on more than that."""
    compiler_path = shutil.which(compiler[0])
    if compiler_path is None or len(compiler) > 1 or any(os.environ.get(name) for name in _SETTINGS):
        return None
    output = subprocess.run(
        [compiler_path, "-v"], capture_output=True, text=True, errors="replace", check=False, stdin=subprocess.DEVNULL
    )
    path = os.path.realpath(compiler_path)
    status = os.stat(path)
    version = output.stdout + output.stderr
    return repr((path, status.st_size, status.st_mtime_ns, os.uname().machine, version)) if version else None
