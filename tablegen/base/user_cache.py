"""Folders of the user's cache for files that are expensive to make.

They stand in ``$XDG_CACHE_HOME/tablegen``, in ``~/.cache/tablegen`` by default. Cached programs are run, so a folder
is used only where nobody else can have written it. A cache that is missing, truncated or not private costs time, but
changes no result.
"""

import os
import stat
from pathlib import Path

_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def private_folder(name: str) -> Path | None:
    """Return the folder of that name in the cache, made if it is missing; None where it cannot be private.

    It has to be a directory of the user's own, and no link, that nobody else can write into. Windows has no such marks;
    there the profile that the folder stands in is the user's own.
    """
    home = os.environ.get("XDG_CACHE_HOME", "")
    try:
        folder = (Path(home) if os.path.isabs(home) else Path.home() / ".cache") / "tablegen" / name
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.lstat()
    except (OSError, RuntimeError):  # a RuntimeError where the user has no home
        return None
    return folder if stat.S_ISDIR(status.st_mode) and is_private(status) else None


def is_private(status: os.stat_result) -> bool:
    """Return True if a file or directory is the user's own, and nobody else can write it."""
    return not hasattr(os, "geteuid") or (status.st_uid == os.geteuid() and not status.st_mode & _BY_OTHERS)


def keep_newest(folder: Path, most: int) -> None:
    """Remove the files of a folder that were not used for longest, so that ``most`` remain.

    Raises
    ------
    OSError
        If one cannot be removed.
    """
    by_age = sorted(folder.iterdir(), key=lambda one: one.stat().st_mtime)
    for old in by_age[:-most]:
        old.unlink(missing_ok=True)
