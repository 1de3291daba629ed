"""Compare a directory with the files that a build would write, for ``build --check``."""

from collections.abc import Mapping
from difflib import unified_diff
from pathlib import Path

from tablegen.base.reading import BUILD_FILE, other_than_folder, read_bytes

_MAX_LINES = 12  # lines of each file: enough to see what changed, without whole tables
_WIDTH = 120


def differences(folder: Path, files: Mapping[str, bytes]) -> list[str]:
    """Return a unified diff of every file that is missing or stale; empty if the directory is up to date."""
    out: list[str] = []
    for name, content in files.items():
        path = folder / name
        if misplaced := other_than_folder(folder, name):
            out.append(f"{misplaced[0]}: is {misplaced[1]}, where a directory has to go")
            continue
        try:
            old = read_bytes(path, BUILD_FILE)
        except FileNotFoundError:
            out.append(f"{path}: missing")
            continue
        except OSError as error:
            out.append(f"{path}: cannot be read: {error.strerror or error}")
            continue
        if old == content:
            continue
        before = old.decode("utf-8", "replace").splitlines()
        after = content.decode("utf-8", "replace").splitlines()
        diff = list(unified_diff(before, after, str(path), f"{name} as it would be built", n=0, lineterm=""))
        if not diff:
            out.append(f"{path}: differs in line ends only")
        out += [line if len(line) <= _WIDTH else line[: _WIDTH - 3] + "..." for line in diff[:_MAX_LINES]]
        if len(diff) > _MAX_LINES:
            out.append(f"... {len(diff) - _MAX_LINES} more lines of difference in {name}")
    return out
