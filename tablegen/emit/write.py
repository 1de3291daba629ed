"""The writer of files: a map of file name to content, on disk whole or not at all; and leftovers of earlier builds."""

import errno
import os
import re
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from tablegen.base.directory_lock import locked
from tablegen.base.reading import BUILD_FILE, file_sha256, holds, other_than_file, other_than_folder, read_bytes
from tablegen.base.reading import MANIFEST as MANIFEST_KIND
from tablegen.config.names import of_the_runtime
from tablegen.manifest.format import MANIFEST

_STAGED = ".tablegen-"
# As the tools of packages want them.
_OF_PACKAGES = {
    "CMakeLists.txt",
    "Cargo.toml",
    "build.rs",
    "idf_component.yml",
    "lib.rs",
    "library.json",
    "library.properties",
    "tablegen.dac.core",
    "tablegen.dac_pair.core",
    "tablegen.dac_slow.core",
    "tablegen_options.h",
    "zephyr/CMakeLists.txt",
    "zephyr/Kconfig",
    "zephyr/module.yml",
}
_MOST_THREADS = 64
_LITTER = re.compile(rf"{re.escape(_STAGED)}[a-z0-9_]{{8}}")  # as ``mkstemp`` names files


class CannotWrite(Exception):
    """The failure to write the output directory, whose earlier content still stands."""


class NoPlace(CannotWrite):
    """A place where the file or the directory cannot go, such as a pipe: the request is wrong, and no disk is."""


def write_files(
    folder: Path, files: Mapping[str, bytes], outdated: Sequence[str] | Callable[[], Sequence[str]] = ()
) -> list[str]:
    """Write what changed, remove what is outdated, and return the names of what was written, in order.

    Everything is first written into the directory itself and only then renamed into its place, the manifest last: a
    full disk or an interruption leaves the directory as it was, or with a manifest that ``build --check`` finds stale.
    So does a cut of power: what was renamed has reached the disk before the manifest is. Two writers of one directory
    take turns, and what one that was killed has left behind is removed.

    Parameters
    ----------
    files
        Content by name. A name may begin with sub-folders, with ``/`` between, as ``zephyr/module.yml``.
    outdated
        Names of files to remove, or a function that returns them while the directory is locked.

    Raises
    ------
    NoPlace
        If something else than a directory is at ``folder``, or in place of a sub-folder; if a name leads elsewhere.
    CannotWrite
        If the system refuses to write.
    """
    if (other := other_than_file(folder)) not in (None, "a directory"):
        raise NoPlace(f"{folder}: is {other}, where a directory has to go")
    for name in files:
        if not _is_inside(name):
            raise NoPlace(f"{name!r}: is no name of a file in {folder}")
    new_folders = [path for path in (folder, *folder.parents) if not os.path.exists(path)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with locked(folder), _removed_if_empty(new_folders):
            _remove_litter(folder)
            return _write(folder, files, list(outdated() if callable(outdated) else outdated))
    except OSError as error:
        raise CannotWrite(f"{folder}: {error.strerror or error}") from error


def _is_inside(name: str) -> bool:
    """Return True for a plain name, and for one with plain sub-folders before it, on any system."""
    return all(
        part not in ("", ".", "..") and os.path.basename(part) == part and not os.path.splitdrive(part)[0]
        for part in name.split("/")
    )


def _write(folder: Path, files: Mapping[str, bytes], outdated: Sequence[str]) -> list[str]:
    for name in files:
        if misplaced := other_than_folder(folder, name):
            raise NoPlace(f"{misplaced[0]}: is {misplaced[1]}, where a directory has to go")
    changed = [name for name in files if not holds(folder / name, files[name])]
    if not changed and not outdated:
        return []
    for name in changed:
        if other := other_than_file(folder / name):
            why = f"{folder / name}: is {other}, where a file has to go"
            raise CannotWrite(why) if other == "a directory" else NoPlace(why)
    with _removed_if_empty(_new_sub_folders(folder, changed)):
        _rename_staged(folder, {name: files[name] for name in changed}, outdated)
    return changed


def _rename_staged(folder: Path, files: Mapping[str, bytes], outdated: Sequence[str]) -> None:
    import tempfile  # here: most builds change nothing

    staged: dict[str, Path] = {}
    try:
        for name in files:
            handle, temporary = tempfile.mkstemp(prefix=_STAGED, dir=folder)
            staged[name] = Path(temporary)
            with os.fdopen(handle, "wb") as file:
                file.write(files[name])
            os.chmod(temporary, 0o666 & ~_umask())
        for parent in {(folder / name).parent for name in files}:
            parent.mkdir(parents=True, exist_ok=True)
        _settle_files(list(staged.values()))
        for name in sorted(files, key=lambda name: name == MANIFEST):
            if name == MANIFEST:  # which no longer lists them
                remove_files(folder, outdated)
                _settle_folders(folder, [*files, *outdated])
            os.replace(staged[name], folder / name)
            del staged[name]
        remove_files(folder, outdated)
        _settle_folders(folder, [*files, *outdated])
    finally:
        for temporary_path in staged.values():
            temporary_path.unlink(missing_ok=True)


def _sub_folders(folder: Path, names: Iterable[str]) -> list[Path]:
    """List the sub-folders that names have before them, the innermost first."""
    places = {place for name in names for place in (folder / name).parents if place.is_relative_to(folder)} - {folder}
    return sorted(places, key=lambda place: len(place.parts), reverse=True)


def _new_sub_folders(folder: Path, names: Iterable[str]) -> list[Path]:
    return [place for place in _sub_folders(folder, names) if not place.exists()]


def _settle_folders(folder: Path, names: Iterable[str]) -> None:
    for place in [*_sub_folders(folder, names), folder]:
        if place.is_dir():
            settle(place)


@contextmanager
def _removed_if_empty(new_folders: Sequence[Path]) -> Iterator[None]:
    """Remove new directories at the end, the innermost first, if no file came to stand in them."""
    try:
        yield
    finally:
        for path in new_folders:
            if os.path.isdir(path) and not any(path.iterdir()):
                path.rmdir()


def _settle_files(paths: Sequence[Path]) -> None:
    """Let the content of files reach the disk: all at once, which takes a disk hardly longer than one of them."""
    from concurrent.futures import ThreadPoolExecutor  # here, for the same reason

    def sync(path: Path) -> None:
        handle = os.open(path, os.O_RDWR)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)

    with ThreadPoolExecutor(max(min(len(paths), _MOST_THREADS), 1)) as pool:
        list(pool.map(sync, paths))


def settle(folder: Path) -> None:
    """Let what was renamed and removed in a directory reach the disk, where the system can.

    Raises
    ------
    OSError
        If the disk reports an error.
    """
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:  # Windows opens no directories
        return
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EBADF):  # a file system that has no such thing
            raise
    finally:
        os.close(handle)


def outdated_files(folder: Path, files: Iterable[str]) -> list[str]:
    """List the files of an earlier build that this one does not write, in order.

    They are files that a manifest of ours lists, whose hash is that of its plan; their names are those of a build, and
    their content is unchanged. A user-modified file is not among them; ``leftover_files`` names it.
    """
    files = set(files)
    try:
        if files.issuperset(os.listdir(folder)):
            return []
    except OSError:
        return []
    return sorted(name for name, digest in _listed(folder, files).items() if _digest(folder, name) == digest)


def names_of_build(build: str, names: Iterable[str]) -> list[str]:
    """Return those names that a build of this name can have: its own, the runtime's, and those of packages."""
    own, packages = (f"{build}.", f"{build}_"), {*_OF_PACKAGES, f"tablegen.{build}.pdsc"}
    return [
        name for name in names if name.startswith(own) or (of_the_runtime(name) and "/" not in name) or name in packages
    ]


def leftover_files(folder: Path, files: Iterable[str]) -> list[str]:
    """List files that look like a build's and are not of this one, nor outdated: a glob such as ``dac_*.v`` takes them.

    They begin with ``dac_`` and have the suffix of a file of the build, or an earlier manifest lists them.
    """
    files = set(files)
    try:
        present = {name for name in os.listdir(folder) if name not in files and os.path.isfile(folder / name)}
        sub_folders = any(place.is_dir(follow_symlinks=False) for place in os.scandir(folder))
    except OSError:
        return []
    if not present and not sub_folders:
        return []
    suffixes = {Path(name).suffix for name in files if name.startswith("dac_")}
    listed = _listed(folder, files)
    present |= {
        name
        for name in listed
        if "/" in name and other_than_folder(folder, name) is None and os.path.isfile(folder / name)
    }
    alike = {name for name in present if name.startswith("dac_") and Path(name).suffix in suffixes}
    outdated = {name for name, digest in listed.items() if name in present and _digest(folder, name) == digest}
    return sorted((alike | (listed.keys() & present)) - outdated)


def _listed(folder: Path, files: Iterable[str]) -> dict[str, str]:
    """Read what the manifest in a folder lists beyond these files, with digests; nothing where it is not of a build.

    A manifest of another program, or one that somebody has edited, says nothing of what may be removed.
    """
    from tablegen.manifest.read import DamagedManifest, ForeignManifest  # here: seldom needed
    from tablegen.manifest.turned import parse_any

    try:
        stored = parse_any(read_bytes(folder / MANIFEST, MANIFEST_KIND))
    except (OSError, DamagedManifest, ForeignManifest):
        return {}
    if stored.own_hash != stored.manifest.hash:
        return {}
    listed, mine = stored.manifest.files, {*files, MANIFEST}
    return {name: listed[name] for name in names_of_build(stored.manifest.name, listed) if name not in mine}


def remove_files(folder: Path, names: Iterable[str]) -> None:
    """Remove files of a directory, and the sub-folders that are empty then; nothing that a linked sub-folder leads to.

    Raises
    ------
    OSError
        If the system refuses to remove a file.
    """
    plain = [name for name in names if other_than_folder(folder, name) is None]
    for name in plain:
        (folder / name).unlink(missing_ok=True)
    for place in _sub_folders(folder, plain):
        if place.is_dir() and not any(place.iterdir()):
            place.rmdir()


def _remove_litter(folder: Path) -> None:
    """Remove what a writer that was killed has left; the directory is locked, so that none of it is somebody's."""
    for name in os.listdir(folder):
        if _LITTER.fullmatch(name) and stat.S_ISREG(os.lstat(folder / name).st_mode):
            (folder / name).unlink(missing_ok=True)


def _digest(folder: Path, name: str) -> str | None:
    if other_than_folder(folder, name):
        return None
    try:
        return file_sha256(folder / name, BUILD_FILE)
    except OSError:
        return None


def _umask() -> int:
    mask = os.umask(0o022)
    os.umask(mask)
    return mask
