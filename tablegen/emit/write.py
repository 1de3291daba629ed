"""One writer: a map of file name to content, put on disk whole or not at all."""

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path


class CannotWrite(Exception):
    """The output directory could not be written; what stood there before still stands."""


def write_files(folder: Path, files: Mapping[str, bytes]) -> list[str]:
    """Write what changed and return its names, in order.

    Everything is first written beside its place and only then renamed into it, the manifest last: a full disk or
    an interruption leaves the directory as it was, or with a manifest that ``build --check`` finds stale.
    """
    changed = [name for name in files if _read(folder / name) != files[name]]
    if not changed:
        return []
    made = [path for path in (folder, *folder.parents) if not os.path.exists(path)]
    for name in changed:
        if os.path.isdir(folder / name):
            raise CannotWrite(f"{folder / name}: is a directory where a file has to go")
    staged: dict[str, Path] = {}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name in changed:
            handle, temporary = tempfile.mkstemp(prefix=".tablegen-", dir=folder)
            staged[name] = Path(temporary)
            with os.fdopen(handle, "wb") as file:
                file.write(files[name])
            os.chmod(temporary, 0o666 & ~_umask())
        for name in sorted(changed, key=lambda name: name == "manifest.json"):
            os.replace(staged[name], folder / name)
            del staged[name]
    except OSError as error:
        raise CannotWrite(f"{folder}: {error.strerror or error}") from error
    finally:
        for temporary_path in staged.values():
            temporary_path.unlink(missing_ok=True)
        for path in made:  # the innermost first; what holds something stays
            if not os.path.isdir(path) or any(path.iterdir()):
                break
            path.rmdir()
    return changed


def _read(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except OSError:
        return None


def _umask() -> int:
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
