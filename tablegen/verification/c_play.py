"""Compile the C bench and run it: no more than a process of its own needs, which begins in little time."""

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
    try:
        done = subprocess.run([str(program)], input=script, capture_output=True, check=False, timeout=timeout)
    except subprocess.TimeoutExpired:
        raise SimulationFailed(f"the bench did not end in {timeout:.0f} s") from None
    if done.returncode:
        raise SimulationFailed(
            done.stderr.decode("utf-8", "replace").strip() or f"the bench ended with status {done.returncode}"
        )
    return done.stdout


def play_job(folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """Compile the ``objects`` of a job and its ``program``, and play the script that stands in ``folder``.

    Places and files are named within ``folder``; what the bench writes stands in ``record``.
    """
    if job["objects"]:
        place = folder / "objects"
        shutil.rmtree(place, ignore_errors=True)  # a directory that is kept may have those of another build
        place.mkdir()
        compile_all(job["objects"], place)
    program = folder / job["program"]
    program.parent.mkdir(parents=True, exist_ok=True)
    compile_all([[*job["line"], "-o", str(program)]], folder)
    (folder / job["record"]).write_bytes(run(program, (folder / job["script"]).read_bytes(), job["timeout"]))
    return {}
