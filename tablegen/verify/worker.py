"""A simulation in a process group of its own, so that an interruption ends the simulator and its compiler with it.

``run`` starts this module as a process and waits for it; what it does and finds is passed in files of its folder.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tablegen.verify.bench import SequencerBench, Shape
from tablegen.verify.simulate import SimulationFailed, ToolMissing

_JOB, _OUTCOME, _LOG = "job.json", "outcome.json", "worker.log"


def run(
    folder: Path,
    simulator: str,
    shape: Shape,
    sources: Sequence[Path],
    parameters: Mapping[str, int | str],
    clocks: int,
) -> dict[str, Any]:
    """Play the script in ``folder`` on a sequencer compiled from ``sources`` with ``parameters``.

    Returns the bench's counters; raises ``ToolMissing`` and ``SimulationFailed``.
    """
    job = {
        "simulator": simulator,
        "shape": asdict(shape),
        "sources": [str(path) for path in sources],
        "parameters": dict(parameters),
        "clocks": clocks,
    }
    (folder / _JOB).write_text(json.dumps(job), "utf-8")
    outcome = folder / _OUTCOME
    outcome.unlink(missing_ok=True)
    scratch = folder / "tmp"  # compilers that are ended leave theirs behind
    scratch.mkdir(exist_ok=True)
    path = os.pathsep.join(os.path.abspath(entry) for entry in sys.path if entry)
    with (folder / _LOG).open("wb") as log:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "tablegen.verify.worker", str(folder)],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            env={**os.environ, "PYTHONPATH": path, "TMPDIR": str(scratch)},
            start_new_session=True,
        )
        try:
            process.wait()
        finally:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(process.pid, signal.SIGKILL)  # all that it started, whether it ended or was interrupted
            process.wait()
    if not outcome.is_file():
        raise SimulationFailed((folder / _LOG).read_text("utf-8", "replace").strip() or "the simulation was killed")
    found = json.loads(outcome.read_text("utf-8"))
    if "missing" in found:
        raise ToolMissing(found["missing"])
    if "failed" in found:
        raise SimulationFailed(found["failed"])
    status: dict[str, Any] = found["status"]
    return status


def _work(folder: Path) -> dict[str, Any]:
    job = json.loads((folder / _JOB).read_text("utf-8"))
    try:
        sources = [Path(source) for source in job["sources"]]
        bench = SequencerBench(job["simulator"], Shape(**job["shape"]), folder, job["parameters"], sources)
        return {"status": bench.run(job["clocks"])}
    except ToolMissing as error:
        return {"missing": str(error)}
    except SimulationFailed as error:
        return {"failed": str(error)}


if __name__ == "__main__":
    where = Path(sys.argv[1])
    (where / _OUTCOME).write_text(json.dumps(_work(where)), "utf-8")
