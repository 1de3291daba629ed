"""The C of a build on an emulated Cortex-M4."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tablegen.base.reading import BUILD_FILE, read_bytes
from tablegen.verification import process_group as worker
from tablegen.verification.c.bench import CRecord
from tablegen.verification.c.program import MOST_FILLED, OPTIONS, CProgram
from tablegen.verification.play.sequencer_shape import SCRIPT, SequencerShape

EMULATED = "arm-none-eabi-gcc, Cortex-M4"


class EmulatedPlayer:
    """A player on an emulator: it compiles a program for each way of playing, and plays the script in ``work``."""

    def __init__(self, work: Path, program: CProgram, shape: SequencerShape) -> None:
        self._work, self._program, self._shape = work, program, shape

    def played(self, fills: bool) -> CRecord:
        """Return what the bench captured, one tick or (``fills``) many ticks a call.

        Raises
        ------
        SimulationFailed
            If the bench does not end by itself.
        """
        fill = MOST_FILLED if fills else 0
        job = {
            "shape": asdict(self._shape),
            "sources": [str(path) for path in self._program.sources],
            "fill": fill,
            "defines": self._program.defines | ({"BENCH_FILL": fill} if fill else {}),
        }
        status = worker.run(self._work, __name__, job)
        capture = np.frombuffer(read_bytes(self._work / _record(fill), BUILD_FILE), dtype="<u8")
        return CRecord(capture, **status)


def play_job(folder: Path, job: dict[str, Any]) -> dict[str, Any]:
    """Compile and play the script that stands in ``folder``; in a process that can be ended."""
    from tablegen.verification.c.emulate import CortexMBench

    fill = job["fill"]
    sources = [Path(source) for source in job["sources"]]
    place = folder / ("fill" if fill else "step")
    bench = CortexMBench(SequencerShape(**job["shape"]), place, None, [*OPTIONS, "-w"], sources, fill, job["defines"])
    played = bench.run((folder / SCRIPT).read_text("ascii"))
    (folder / _record(fill)).write_bytes(played.capture.tobytes())
    return {"counts": played.counts, "states": played.states, "constants": played.constants}


def _record(fill: int) -> str:
    return "fill_capture.bin" if fill else "step_capture.bin"
