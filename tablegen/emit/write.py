"""One writer: a map of file name to content, put on disk whole or not at all; and what an earlier build has left."""

import json
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256
from pathlib import Path

from tablegen.manifest.format import MANIFEST


class CannotWrite(Exception):
    """The output directory could not be written; what stood there before still stands."""


def write_files(folder: Path, files: Mapping[str, bytes], outdated: Sequence[str] = ()) -> list[str]:
    """Write what changed, remove what is ``outdated``, and return the names of what was written, in order.

    Everything is first written beside its place and only then renamed into it, the manifest last: a full disk or
    an interruption leaves the directory as it was, or with a manifest that ``build --check`` finds stale.
    """
    changed = [name for name in files if _read(folder / name) != files[name]]
    if not changed and not outdated:
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
        for name in sorted(changed, key=lambda name: name == MANIFEST):
            if name == MANIFEST:  # which no longer lists them
                _remove(folder, outdated)
            os.replace(staged[name], folder / name)
            del staged[name]
        _remove(folder, outdated)
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


def outdated_files(folder: Path, files: Iterable[str]) -> list[str]:
    """Files of an earlier build that this one does not make, in order: its manifest lists them, and they are unchanged.

    A file that somebody has edited since is not among them; ``leftover_files`` names it.
    """
    files = set(files)
    try:
        if {path.name for path in folder.iterdir()} <= files:
            return []
    except OSError:
        return []
    return sorted(name for name, digest in _listed(folder, files).items() if _digest(folder / name) == digest)


def leftover_files(folder: Path, files: Iterable[str]) -> list[str]:
    """Files that look like a build's and are not of this one, nor outdated: a glob such as ``dac_*.v`` takes them.

    They begin with ``dac_`` and have the suffix of a file of the build, or an earlier manifest lists them.
    """
    files = set(files)
    suffixes = {Path(name).suffix for name in files if name.startswith("dac_")}
    try:
        present = {path.name for path in folder.iterdir() if path.is_file()}
    except OSError:
        return []
    if present <= files:
        return []
    listed = _listed(folder, files)
    alike = {name for name in present if name.startswith("dac_") and Path(name).suffix in suffixes}
    outdated = {name for name, digest in listed.items() if name in present and _digest(folder / name) == digest}
    return sorted((alike | (listed.keys() & present)) - files - outdated)


def _listed(folder: Path, files: Iterable[str]) -> dict[str, str]:
    """What the manifest in a folder lists beyond these files, with digests; nothing where it cannot be read."""
    try:
        found = json.loads(_read(folder / MANIFEST) or b"{}")
        listed = found["files"] if isinstance(found, dict) else {}
        pairs = listed.items() if isinstance(listed, dict) else ()
    except (ValueError, KeyError, RecursionError):
        return {}
    mine = {*files, MANIFEST}
    return {
        name: digest
        for name, digest in pairs
        if isinstance(digest, str) and name not in mine and name == os.path.basename(name) and not name.startswith(".")
    }


def _remove(folder: Path, names: Iterable[str]) -> None:
    for name in names:
        (folder / name).unlink(missing_ok=True)


def _digest(path: Path) -> str | None:
    content = _read(path)
    return None if content is None else sha256(content).hexdigest()


def _read(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except (OSError, ValueError):  # ValueError: no file can have such a name
        return None


def _umask() -> int:
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
