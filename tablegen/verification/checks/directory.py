"""The files of a build, compared with its manifest: digests of all, words and copies of those of its sequencer."""

import shutil
from collections.abc import Mapping
from pathlib import Path

from tablegen.base.reading import BUILD_FILE, file_sha256, read_text
from tablegen.manifest.read import StoredBuild

_MAX_SHOWN = 5


def wrong_files(folder: Path, stored: StoredBuild) -> list[str]:
    """List what is wrong with the files that the manifest names."""
    return wrong_digests(folder, stored.manifest.files)


def wrong_digests(folder: Path, files: Mapping[str, str]) -> list[str]:
    """List what is wrong with files of a folder whose SHA-256 is known."""
    wrong = []
    for name, digest in files.items():
        try:
            actual = file_sha256(folder / name)
        except OSError as error:
            wrong.append(f"{name}: {'missing' if isinstance(error, FileNotFoundError) else error.strerror or error}")
            continue
        if actual != digest:
            wrong.append(f"{name}: stale or edited: its SHA-256 is not that of the manifest")
    return wrong


def memory_words(path: Path, count: int | None) -> list[int]:
    """Read the words of a memory file as a device does; ``count`` of them, or as many as it has.

    Raises
    ------
    ValueError
        If the file has other words, or another number of them.
    """
    try:
        lines = read_text(path, BUILD_FILE, "ascii").split()
        words = [int(line, 16) for line in lines]
    except FileNotFoundError:
        raise ValueError(f"{path.name} is missing") from None
    except OSError as error:
        raise ValueError(f"{path.name} cannot be read: {error.strerror or error}") from None
    except ValueError:
        raise ValueError(f"{path.name} does not hold one hexadecimal word a line") from None
    if count is not None and len(words) != count:
        raise ValueError(f"{path.name} has {len(words)} words in place of {count}")
    return words


def copies(folder: Path, names: list[str], into: Path) -> tuple[list[Path], list[str]]:
    """Copy files of a build; return the copies, and what is wrong where files are missing.

    The copies have plain paths, since make, and with it Verilator, does not accept every path.
    """
    into.mkdir(exist_ok=True)
    wrong = []
    for name in names:
        try:
            shutil.copyfile(folder / name, into / name)
        except FileNotFoundError:
            wrong.append(f"{name} is missing")
        except OSError as error:
            wrong.append(f"{name} cannot be read: {error.strerror or error}")
    return [into / name for name in names], wrong


def some(wrong: list[str]) -> str:
    """Shorten a list of errors for a message."""
    more = [f"... and {len(wrong) - _MAX_SHOWN} more"] if len(wrong) > _MAX_SHOWN else []
    return "\n".join(wrong[:_MAX_SHOWN] + more)
