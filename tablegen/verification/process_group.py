"""A process group for a playback, so that an interruption ends simulator, compiler and program with it.

``run_all`` starts this module as processes and waits for them; what it does and finds is passed in files of its folder.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from tablegen.base.interruption import defer_signals, deliver
from tablegen.verification.failures import SimulationFailed, ToolMissing

_JOB, _OUTCOME, _LOG = "job.json", "outcome.json", "worker.log"


def run(folder: Path, module: str, job: Mapping[str, Any]) -> dict[str, Any]:
    """Run ``play_job(folder, job)`` of a module in a process of its own; ``job`` and the result are plain data.

    Raises
    ------
    ToolMissing
        If the job needs a tool that is not installed.
    SimulationFailed
        If the job raises it, or its process ends.
    """
    return run_all(module, [(folder, job)])[0]


def run_all(module: str, jobs: Sequence[tuple[Path, Mapping[str, Any]]]) -> list[dict[str, Any]]:
    """Run several jobs at once, each in a folder of its own; raise the exception of the first that fails."""
    processes: list[subprocess.Popen[bytes]] = []
    try:
        # A signal inside Popen would leave its child running.
        with defer_signals(signal.SIGINT, signal.SIGTERM) as came:
            for folder, job in jobs:
                processes.append(_started(folder, module, job))
        deliver(came)
        for process in processes:
            process.wait()
    finally:
        for process in processes:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)  # all that it started, whether it ended or was interrupted
            process.wait()
    return [_outcome_of(folder) for folder, _ in jobs]


def _started(folder: Path, module: str, job: Mapping[str, Any]) -> subprocess.Popen[bytes]:
    (folder / _JOB).write_text(json.dumps({"module": module, "job": job}), "utf-8")
    (folder / _OUTCOME).unlink(missing_ok=True)
    scratch = folder / "tmp"  # compilers that are ended leave theirs behind
    scratch.mkdir(exist_ok=True)
    path = os.pathsep.join(os.path.abspath(entry) for entry in sys.path if entry)
    with (folder / _LOG).open("wb") as log:
        return subprocess.Popen(
            [sys.executable, "-P", "-m", "tablegen.verification.process_group", str(folder)],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            env={**os.environ, "PYTHONPATH": path, "TMPDIR": str(scratch)},
            start_new_session=True,
        )


def _outcome_of(folder: Path) -> dict[str, Any]:
    outcome = folder / _OUTCOME
    if not outcome.is_file():
        raise SimulationFailed((folder / _LOG).read_text("utf-8", "replace").strip() or "the simulation was killed")
    answer = json.loads(outcome.read_text("utf-8"))
    if "missing" in answer:
        raise ToolMissing(answer["missing"])
    if "failed" in answer:
        raise SimulationFailed(answer["failed"])
    status: dict[str, Any] = answer["status"]
    return status


def _work(folder: Path) -> dict[str, Any]:
    request = json.loads((folder / _JOB).read_text("utf-8"))
    try:
        return {"status": import_module(request["module"]).play_job(folder, request["job"])}
    except ToolMissing as error:
        return {"missing": str(error)}
    except SimulationFailed as error:
        return {"failed": str(error)}


if __name__ == "__main__":
    where = Path(sys.argv[1])
    (where / _OUTCOME).write_text(json.dumps(_work(where)), "utf-8")
