"""The sequencer under its bench: compiled once for a shape, then played with any number of scripts."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from tablegen.emit.constants import DEGREES
from tablegen.fixedpoint.program import Program
from tablegen.resources import verilog_runtime
from tablegen.verification.failures import SimulationFailed
from tablegen.verification.simulate import Compiled, Design, compile_design
from tablegen.verification.stream import Mismatch, Script, Words, compare, read_capture

TEST_MODULE = "tablegen.verification.cocotb_stream"
STREAM_BENCH = Path(str(files("tablegen.verification"))) / "stream_bench.v"
SCRIPT, CAPTURE = "script.hex", "capture.hex"  # in the folder of a bench


@dataclass(frozen=True)
class SequencerShape:
    """What a sequencer is synthesised for; the names are those of its parameters in lower case."""

    dac_bits: int
    x_interpolated: int
    x_index_bits: int
    x_word_bits: int
    y_interpolated: int
    y_index_bits: int
    y_word_bits: int

    @classmethod
    def of(cls, *programs: tuple[Program, Program]) -> "SequencerShape":
        """The smallest shape that holds programs of x and y, which have to agree on modes and widths."""
        return cls(
            programs[0][0].output.dac_bits,
            *_table(tuple(pair[0] for pair in programs)),
            *_table(tuple(pair[1] for pair in programs)),
        )

    def parameters(self) -> dict[str, int | str]:
        """As Verilog has them."""
        return {name.upper(): value for name, value in asdict(self).items()}


def _table(programs: tuple[Program, ...]) -> tuple[int, int, int]:
    longest = max(len(program.words) for program in programs)
    return DEGREES[programs[0].mode], max((longest - 1).bit_length(), 2), programs[0].bits


@dataclass(frozen=True)
class BenchRun:
    """What came of a script: the first difference, if any, and the counters of the bench."""

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
        """Everything was as the model has it."""
        return self.mismatch is None and self.faults_counted and not self.refused and not self.jitter


class SequencerBench:
    """A compiled sequencer; ``sources`` are those of the runtime unless given.

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
        self._design: Compiled = compile_design(
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


def run_bench(design: Compiled, folder: Path, clocks: int) -> dict[str, Any]:
    """Play the script of so many clocks that a compiled bench reads; the counters of the bench by name."""
    status_file = folder / "status.json"
    status_file.unlink(missing_ok=True)
    timeout = (clocks + 1000) * 10 // 1000 + 10
    tests, _ = design.run(TEST_MODULE, {"TABLEGEN_STATUS": str(status_file), "TABLEGEN_TIMEOUT_US": str(timeout)})
    if tests != 1 or not status_file.exists():
        raise SimulationFailed("the bench did not play its script to the end")
    status: dict[str, Any] = json.loads(status_file.read_text("ascii"))
    return status
