"""A program of a library as a build by itself: with the runtime, which stands once, beside all programs."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tablegen.base.reading import BUILD_FILE, read_bytes
from tablegen.manifest.format import INDEX, RECORD
from tablegen.manifest.read import read_build


@contextmanager
def whole_build(folder: Path) -> Iterator[Path]:
    """Yield the directory of a build; of a program of a library a temporary copy with the runtime in it.

    Nothing is taken from beside the folder but what its manifest lists. Raises ``NotABuild``, and ``OSError`` where
    nothing can be written.
    """
    if not ((folder / RECORD).is_file() and (folder.parent / INDEX).is_file()):
        yield folder
        return
    files = read_build(folder).manifest.files
    with tempfile.TemporaryDirectory(prefix="tablegen-", ignore_cleanup_errors=True) as name:
        for path in folder.iterdir():
            if path.is_file() and path.name != RECORD:
                (Path(name) / path.name).write_bytes(read_bytes(path, BUILD_FILE))
        for file in files:
            if "/" in file and (folder / file).is_file():
                (Path(name) / file).parent.mkdir(parents=True, exist_ok=True)
                (Path(name) / file).write_bytes(read_bytes(folder / file, BUILD_FILE))
            beside = folder.parent / file
            if not (folder / file).exists() and beside.is_file():
                (Path(name) / file).write_bytes(read_bytes(beside, BUILD_FILE))
        yield Path(name)
