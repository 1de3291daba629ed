"""Compile the C bench and run it; this module imports little, so that its process starts fast."""

import resource
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tablegen.verification.c.objects import Objects, maker
from tablegen.verification.failures import SimulationFailed, ToolMissing

OBJECTS = "objects"


def compile_line(line: Sequence[str], place: Path | None = None) -> None:
    """Run a compiler, in a directory if one is given.

    Raises
    ------
    SimulationFailed
        If it fails or warns, with all its output.
    """
    process = subprocess.run(line, capture_output=True, text=True, check=False, cwd=place)
    if process.returncode or process.stderr:
        raise SimulationFailed(f"{' '.join(line)}\n{process.stdout}{process.stderr}".strip())


def require_headers(compiler: Sequence[str]) -> None:
    """Check that a compiler has a C library; Debian's gcc only recommends that package.

    Raises
    ------
    ToolMissing
        If it has none.
    """
    line = [*compiler, "-fsyntax-only", "-x", "c", "-"]
    process = subprocess.run(line, input="#include <stdint.h>\n", capture_output=True, text=True, check=False)
    if process.returncode and "stdint.h" in process.stderr:
        raise ToolMissing(f"{compiler[0]} finds no headers of the C library: apt-get install libc6-dev")


def run(program: Path, script: bytes, timeout: float | None = None) -> bytes:
    """Return what a bench writes while it plays a script; it fails after ``timeout`` seconds."""
    return _ended(script, timeout, [str(program)], stdout=subprocess.PIPE)


def record(command: Sequence[str], script: bytes, place: Path, most: int, timeout: float | None = None) -> None:
    """Record what a bench writes in a file; the system ends a bench that writes more than ``most`` bytes."""

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))

    with place.open("wb") as stored:
        _ended(script, timeout, command, stdout=stored, preexec_fn=limited)


def _ended(script: bytes, timeout: float | None, command: Sequence[str], **options: Any) -> bytes:
    try:
        process = subprocess.run(command, input=script, stderr=subprocess.PIPE, check=False, timeout=timeout, **options)
    except subprocess.TimeoutExpired:
        raise SimulationFailed(f"the bench did not end in {timeout:.0f} s") from None
    if process.returncode:
        raise SimulationFailed(
            process.stderr.decode("utf-8", "replace").strip() or f"the bench ended with status {process.returncode}"
        )
    return process.stdout or b""


def play_job(folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """Compile the ``objects`` of a job and its program, and play the script of ``folder`` in each of its ways.

    Places and files are named within ``folder``; a way of playing is a record, of ``most_bytes``, and arguments.

    Returns
    -------
    dict of str to str
        The message of the first playback that failed, by its record; nothing is played after that.

    Raises
    ------
    SimulationFailed
        If the compiler fails.
    ToolMissing
        If the compiler has no C library.
    """
    program = folder / job["program"]
    program.parent.mkdir(parents=True, exist_ok=True)
    try:
        _compile(folder, job["compiler"], [Objects(**one) for one in job["objects"]])
        compile_line(job["line"], folder)
    except SimulationFailed:
        require_headers(job["compiler"])
        raise
    script = (folder / job["script"]).read_bytes()
    for stored, arguments in job["plays"]:
        try:
            record([str(program), *arguments], script, folder / stored, job["most_bytes"], job["timeout"])
        except SimulationFailed as error:
            return {stored: str(error)}
    return {}


def _compile(folder: Path, compiler: list[str], objects: list[Objects]) -> None:
    """Put objects into their place in ``folder``: those that were kept, others from the compiler, to be kept."""
    place = folder / OBJECTS
    shutil.rmtree(place, ignore_errors=True)  # a directory that is kept may have those of another build
    place.mkdir()
    compiler_key = maker(compiler)
    for one in objects:
        if compiler_key is None or not one.take(compiler_key, place):
            compile_line(one.line(compiler), place)
            if compiler_key is not None:
                one.keep(compiler_key, place)
