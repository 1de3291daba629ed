"""The digest of all inputs of a program, by which a second run recognises programs that are up to date."""

import hashlib
import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from tablegen.base.installation import records
from tablegen.base.reading import file_sha256
from tablegen.base.resources import PACKAGE
from tablegen.config.load import Setup
from tablegen.emit.depfile import deciding_files


class Inputs:
    """Digests of files, each read once per run, and of the package that writes the formats."""

    def __init__(self) -> None:
        self._digests: dict[Path, str] = {}
        self._tool = cache(_tool_digest)

    def digest(self, setup: Setup, values: dict[str, Any], formats: Sequence[str]) -> str:
        """Compute the digest of a setup, of the values of its scan file, and of the files that write these formats.

        Raises
        ------
        OSError
            If a file that the setup names cannot be read.
        """
        files = [path for path in setup.files if str(path) != setup.scan_file.name]
        for path in files:
            if path not in self._digests:
                self._digests[path] = file_sha256(path)
        record = {
            "scan": values,
            "files": [self._digests[path] for path in files],
            "formats": list(formats),
            "tool": self._tool(tuple(formats)),
        }
        return hashlib.sha256(json.dumps(record, sort_keys=True, default=str).encode()).hexdigest()


def _tool_digest(formats: tuple[str, ...]) -> str:
    """Compute the digest of the files that write these formats: the same wherever tablegen is installed."""
    installed = set(records(PACKAGE.parent))  # which differs between two installations of one version
    paths = [path for path in deciding_files(formats) if path not in installed and path.exists()]
    return hashlib.sha256("\n".join(sorted(f"{file_sha256(path)} {path.name}" for path in paths)).encode()).hexdigest()
