"""Compile the C bench and run it: no more than a process of its own needs, which begins in little time."""

import resource
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tablegen.verification.failures import SimulationFailed


def compile_all(lines: Sequence[Sequence[str]], place: Path | None = None) -> None:
    """Run compilers, in a directory if one is given; raises ``SimulationFailed`` with all that one says."""
    for line in lines:
        done = subprocess.run(line, capture_output=True, text=True, check=False, cwd=place)
        if done.returncode or done.stderr:
            raise SimulationFailed(f"{' '.join(line)}\n{done.stdout}{done.stderr}".strip())


def run(program: Path, script: bytes, timeout: float | None = None) -> bytes:
    """What a bench writes while it plays a script; one fails that takes longer than ``timeout``, in seconds."""
    return _ended(script, timeout, [str(program)], stdout=subprocess.PIPE)


def record(program: Path, script: bytes, place: Path, most: int, timeout: float | None = None) -> None:
    """The same into a file; the system ends a bench that writes more than ``most`` bytes."""

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))

    with place.open("wb") as stored:
        _ended(script, timeout, [str(program)], stdout=stored, preexec_fn=limited)


def _ended(script: bytes, timeout: float | None, command: list[str], **options: Any) -> bytes:
    try:
        done = subprocess.run(command, input=script, stderr=subprocess.PIPE, check=False, timeout=timeout, **options)
    except subprocess.TimeoutExpired:
        raise SimulationFailed(f"the bench did not end in {timeout:.0f} s") from None
    if done.returncode:
        raise SimulationFailed(
            done.stderr.decode("utf-8", "replace").strip() or f"the bench ended with status {done.returncode}"
        )
    return done.stdout or b""


def play_job(folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """Compile the ``objects`` of a job and its ``program``, and play the script that stands in ``folder``.

    Places and files are named within ``folder``; what the bench writes stands in ``record``, of ``most_bytes``.
    """
    if job["objects"]:
        place = folder / "objects"
        shutil.rmtree(place, ignore_errors=True)  # a directory that is kept may have those of another build
        place.mkdir()
        compile_all(job["objects"], place)
    program = folder / job["program"]
    program.parent.mkdir(parents=True, exist_ok=True)
    compile_all([[*job["line"], "-o", str(program)]], folder)
    script = (folder / job["script"]).read_bytes()
    record(program, script, folder / job["record"], job["most_bytes"], job["timeout"])
    return {}
