"""Compile C to objects that are kept by content for a session, so that a program of many tests is compiled once."""

import atexit
import os
import shutil
import tempfile
from collections.abc import Sequence
from functools import cache
from hashlib import sha256
from pathlib import Path

from building import run_clean

VARIABLE = "TABLEGEN_TEST_OBJECTS"  # names the folder that all processes of a session share


@cache
def folder() -> Path:
    """Return the folder of the session, or one of this process."""
    if VARIABLE not in os.environ:
        os.environ[VARIABLE] = tempfile.mkdtemp(prefix="objects_")
        atexit.register(shutil.rmtree, os.environ[VARIABLE], ignore_errors=True)
    return Path(os.environ[VARIABLE])


def objects(command: Sequence[str], sources: Sequence[Path]) -> list[Path]:
    """Compile the C files among the sources, with the headers in their folders; nothing is compiled twice.

    Parameters
    ----------
    command : Sequence[str]
        The compiler and its options.
    sources : Sequence[Path]
        C files and headers. What an object is made of are the command, its file and all headers beside a source.

    Returns
    -------
    list[Path]
        An object for each C file, in their order.
    """
    places = sorted({path.parent.absolute() for path in sources})
    headers = [path.read_bytes() for place in places for path in sorted(place.glob("*.h"))]
    made = []
    for source in sources:
        if source.suffix == ".c":
            content = repr((*command, source.name, source.read_bytes(), headers))
            target = folder() / f"{sha256(content.encode()).hexdigest()}.o"
            if not target.exists():
                unfinished = target.with_suffix(f".{os.getpid()}.o")
                run_clean([*command, *(f"-I{place}" for place in places), "-c", source.absolute(), "-o", unfinished])
                unfinished.replace(target)
            made.append(target)
    return made
