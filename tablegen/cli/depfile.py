"""``tablegen build --depfile``: the files that a build has read, for make, CMake and Ninja."""

import os
import stat
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tablegen.cli.shared.common import fail, written
from tablegen.cli.shared.exit_status import ExitStatus

if TYPE_CHECKING:
    from tablegen.config.load import Setup


class Depfile:
    """A dependency file that exists only while the last build succeeded: it is removed first and written last.

    It thus serves as the stamp of the build as well. Its time is that of the start, so that a file which is edited
    while it is being read is newer.
    """

    def __init__(self, path: Path, target: str, scan: Path) -> None:
        self._path = path
        self._target = target
        self._prerequisites: list[Path] = []
        self._started_ns = time.time_ns()
        _remove(path, scan)

    def note(self, setup: "Setup", formats: Sequence[str]) -> None:
        """Note the files that were read, and those of the package that decide these formats.

        A name that cannot be written for make and Ninja ends the command before anything is written.
        """
        from tablegen.emit.depfile import deciding_files, why_unsafe

        own = deciding_files(formats)
        self._prerequisites = [*setup.files, *own]
        problems = [
            document.problem(key, f"{str(path)!r} {why}; rename it") if key else f"{str(path)!r}: {why}; rename it"
            for path, document, key in setup.named_files
            if (why := why_unsafe(str(path)))
        ]
        for name in (self._target, *map(str, own)):
            if why := why_unsafe(name):
                problems.append(f"{name!r}: {why}; rename it")
        if problems:
            fail(problems, ExitStatus.WRONG_INPUT)

    def write(self) -> None:
        """Write the file; the last step of a build."""
        from tablegen.emit.depfile import depfile

        times = {path: _changed_ns(path) for path in self._prerequisites}
        written(self._path.parent, {self._path.name: depfile(self._target, self._prerequisites)})
        newest = max(times, key=lambda path: times[path])
        ahead_ns = times[newest] - _changed_ns(self._path)
        if ahead_ns > 0:  # its target would be out of date as soon as it is built, and make would not end
            self._path.unlink()
            why = (
                f"was changed {ahead_ns * 1e-9:.1f} s in the future by its time stamp; set the clock, or touch the file"
            )
            fail([f"{newest}: {why}"], ExitStatus.WRONG_INPUT)
        os.utime(self._path, ns=(self._started_ns, self._started_ns))


def _changed_ns(path: Path) -> int:
    """Return the time of the last change of a file; 0 for one that has been removed meanwhile."""
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


def _remove(path: Path, scan: Path) -> None:
    from tablegen.emit.write import settle

    try:
        if not stat.S_ISREG(path.lstat().st_mode):
            fail([f"{path}: is not a regular file; --depfile needs its own file"], ExitStatus.WRONG_INPUT)
        if scan.exists() and path.samefile(scan):
            fail([f"{path}: is the scan file; --depfile needs its own file"], ExitStatus.WRONG_INPUT)
        path.unlink()
        settle(path.parent)  # before anything else: the file must not come back after a power failure
    except FileNotFoundError:
        pass
    except OSError as error:
        fail([f"{path}: {error.strerror or error}"], ExitStatus.CANNOT_WRITE)
