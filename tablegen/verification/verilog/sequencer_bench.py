"""The sequencer under its bench: compiled once for a shape, then played with any number of scripts."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from tablegen.base.resources import verilog_runtime
from tablegen.verification.failures import SimulationFailed
from tablegen.verification.play.sequencer_shape import CAPTURE, SCRIPT, SequencerShape
from tablegen.verification.play.stream import Mismatch, Script, Words, compare, read_capture
from tablegen.verification.verilog.simulate import CompiledDesign, Design, compile_design

TEST_MODULE = "tablegen.verification.verilog.cocotb_stream"
STREAM_BENCH = Path(str(files("tablegen.verification.verilog"))) / "stream_bench.v"


@dataclass(frozen=True)
class BenchRun:
    """The result of a script: the first difference, if any, and the counters of the bench."""

    samples: int
    mismatch: Mismatch | None
    faults_counted: bool  # the counters of the device are those of the model
    refused: bool  # a write was refused, and should not have been; or the other way round
    jitter: int
    latency: int
    fault_counts: tuple[int, ...]  # counts of slew, clamp, overrun and underrun
    capture: Words = field(repr=False, compare=False)

    @property
    def equal(self) -> bool:
        """True if every tick equals the model's."""
        return self.mismatch is None and self.faults_counted and not self.refused and not self.jitter


class SequencerBench:
    """A compiled sequencer; ``sources`` are by default those of the runtime.

    Another ``top`` than the bench itself has an instance of it and passes its counters on.
    """

    def __init__(
        self,
        simulator: str,
        shape: SequencerShape,
        folder: Path,
        parameters: Mapping[str, int | str] | None = None,
        sources: Iterable[Path] | None = None,
        top: str = "stream_bench",
    ) -> None:
        self.folder = folder.resolve()
        self.folder.mkdir(parents=True, exist_ok=True)
        self._script, self._capture = self.folder / SCRIPT, self.folder / CAPTURE
        runtime = verilog_runtime() if sources is None else list(sources)
        self._most_counted = (1 << int((parameters or {}).get("COUNT_BITS", 32))) - 1
        self._design: CompiledDesign = compile_design(
            simulator,
            Design(
                [*runtime, STREAM_BENCH],
                top,
                {
                    **shape.parameters(),
                    **(parameters or {}),
                    "SCRIPT": str(self._script),
                    "CAPTURE": str(self._capture),
                },
            ),
            self.folder / simulator,
        )

    def play(self, script: Script) -> BenchRun:
        """Play a script to its end, and hold the capture against the model."""
        self._script.write_text(script.text(), "ascii")
        status = self.run(script.clocks)
        capture, counts = read_capture(self._capture), tuple(status["counts"])
        return BenchRun(
            samples=len(capture),
            mismatch=compare(script.expected, capture),
            faults_counted=counts[:2] == tuple(min(count, self._most_counted) for count in script.counts),
            refused=bool(status["refused"]) != script.refused,
            jitter=status["jitter"],
            latency=status["latency"],
            fault_counts=counts,
            capture=capture,
        )

    def run(self, clocks: int) -> dict[str, Any]:
        """Play the script that stands in the folder, of so many clocks; the counters of the bench by name."""
        self._capture.unlink(missing_ok=True)
        return run_bench(self._design, self.folder, clocks)


def run_bench(design: CompiledDesign, folder: Path, clocks: int) -> dict[str, Any]:
    """Play the script of so many clocks that a compiled bench reads, and return the counters of the bench by name.

    Raises
    ------
    SimulationFailed
        If the bench does not play its script to the end.
    """
    status_file = folder / "status.json"
    status_file.unlink(missing_ok=True)
    timeout = (clocks + 1000) * 10 // 1000 + 10
    tests, _ = design.run(TEST_MODULE, {"TABLEGEN_STATUS": str(status_file), "TABLEGEN_TIMEOUT_US": str(timeout)})
    if tests != 1 or not status_file.exists():
        raise SimulationFailed("the bench did not play its script to the end")
    status: dict[str, Any] = json.loads(status_file.read_text("ascii"))
    return status
