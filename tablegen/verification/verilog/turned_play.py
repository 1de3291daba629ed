"""A play of a top in Verilog whose axes have a slow part: it boots, and plays from the start of a frame.

It is the top of a scan at an angle, or that of the output z.

The header is compiled beside it, and its constants are written down as the simulator reads them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from tablegen.device.clocks import least_slow_clocks, slow_line_clocks
from tablegen.device.registers import program_words
from tablegen.emit.turned_content import TurnedContent
from tablegen.emit.turned_verilog import slow_parts, turned_constants, turned_memories
from tablegen.verification import process_group as worker
from tablegen.verification.build_report import differing_check
from tablegen.verification.checks.directory import copies, some
from tablegen.verification.checks.played_checks import Check
from tablegen.verification.failures import SimulationFailed
from tablegen.verification.play.stream import PROGRAM, X_TABLE, Y_TABLE
from tablegen.verification.verilog.bench import CONSTANTS, TOP, different_constants, written_constants
from tablegen.verification.verilog.outputs import Output, output_pace, output_ticks
from tablegen.verification.verilog.top_play import Write, check_top, instances, top_bench_text, write_top, writes

_X_PARTS, _Y_PARTS = 5, 6  # regions
_PART_SHIFT = 14  # of the address: second table, slow table, gains, ratios
USUAL_TICKS = {"icarus": 3_000, "verilator": 30_000}  # unless they are given
_OTHER_CLOCKS = 2000  # to boot and to drain, beside the words
_TARGET = "tablegen.verification.verilog.target"  # which has the job that compiles and runs a bench

_MODULE = """\
// The bench of tablegen verify for axes with a slow part: their header, and a play of their top.
`timescale 1ns / 1ps
`default_nettype none

module verify_bench #(
    parameter CONSTANTS = ""
);
`include "{name}.vh"
    // For the cocotb side of the bench.
    wire [{last_top}:0] tops_finished;
    wire finished = &tops_finished;
    wire refused = 1'b0;
    wire [127:0] fault_counts = 128'd0;
    wire [31:0] strobes = 32'd0, ticks = 32'd0, jitter = 32'd0, latency = 32'd0;

{tops}

    integer constants;
    initial begin
        constants = $fopen(CONSTANTS, "w");
{constants}
        $fclose(constants);
    end
endmodule

`default_nettype wire
"""


@dataclass(frozen=True)
class TurnedPlay:
    """A play of ``ticks`` ticks from the start of a frame, as close to each other as the sequencer allows.

    The modules of ``outputs`` play. The subjects of its checks have a ``suffix``.
    """

    content: TurnedContent
    ticks: int
    suffix: str = ""
    outputs: Sequence[Output] = ("top",)

    def checks(self, folder: Path, work: Path, simulator: Literal["icarus", "verilator"]) -> list[Check]:
        """Play the build in ``folder`` and return what differs; ``work`` is an empty folder, which is made."""
        name = self.content.name
        work.mkdir(exist_ok=True)
        modules = sorted(path.name for path in folder.glob("dac_*.v"))
        sources, missing = copies(folder, [*modules, *self._modules(), f"{name}.vh"], work / "rtl")
        if missing:
            return [self._failed(simulator, "nothing", some(missing))]
        memories = [f"{name}_{one.name}.mem" for one in turned_memories(self.content)]
        beside = [
            path
            for output in self.outputs
            for path in write_top(name, output, memories, self._bench_text(output), folder, work, work / simulator, [])
        ]
        bench, constants = work / f"{TOP}.v", self._constants()
        bench.write_text(
            _MODULE.format(
                name=name,
                last_top=len(self.outputs) - 1,
                tops="\n".join(instances(self.outputs)),
                constants=written_constants(name, constants),
            ),
            "ascii",
        )
        job = {
            "simulator": simulator,
            "sources": [str(path) for path in (*sources[: len(modules)], *beside, bench)],
            "includes": [str(sources[-1].parent)],
            "parameters": {"CONSTANTS": f"../{CONSTANTS}"},
            "clocks": self._clocks,
        }
        try:
            worker.run(work, _TARGET, job)
            different = different_constants(work, name, constants)
            header = differing_check(
                f"verilog header{self.suffix}", "manifest, by the simulator", f"{len(constants)} constants", different
            )
            boot, program = self._boot(), self.content.program
            tops = [check_top(name, output, boot, program, self._ticks(output), work) for output in self.outputs]
            return [header, *(replace(top, subject=f"{top.subject}{self.suffix}") for top in tops)]
        except (SimulationFailed, OSError, ValueError) as error:
            return [self._failed(simulator, f"{self.ticks} ticks", str(error))]

    def _failed(self, simulator: str, compared: str, why: str) -> Check:
        subject = f"simulation{self.suffix}"
        return Check(subject, simulator, compared, failure=f"{subject}: {why}")

    @property
    def _pace(self) -> int:
        return least_slow_clocks(self.content.program)

    @property
    def _rest(self) -> int:
        """Clocks in which line 0 is worked out, before a tick takes the program and again before the trigger."""
        return slow_line_clocks(self.content.program) + 100

    @property
    def _boot_clocks(self) -> int:
        return len(self._boot()) + _OTHER_CLOCKS // 2

    @property
    def _clocks(self) -> int:
        return self._boot_clocks + 2 * self._rest + self.ticks * self._pace + _OTHER_CLOCKS

    def _constants(self) -> dict[str, str]:
        numbers = {key: str(value) for key, value in turned_constants(self.content).items()}
        return {"HASH": self.content.hash, **numbers}

    def _modules(self) -> list[str]:
        return [f"{self.content.name}_{output}.v" for output in self.outputs]

    def _ticks(self, output: Output) -> int:
        return output_ticks(self.ticks, output)

    def _bench_text(self, output: Output) -> str:
        return top_bench_text(
            self.content.name,
            self.content.program,
            output=output,
            boot_clocks=self._boot_clocks,
            ticks=self._ticks(output),
            pace=output_pace(self._pace, self.content.program, output),
            rest=self._rest,
        )

    def _boot(self) -> list[Write]:
        """Return what the top writes at power-up: the slow parts first."""
        program, (x, y) = self.content.program, self.content.axes
        boot: list[Write] = []
        for region, axis in ((_X_PARTS, x), (_Y_PARTS, y)):
            for part, words in enumerate(slow_parts(axis)):
                boot += writes([(region, np.array(words))], part << _PART_SHIFT)
        registers = program_words(program.schedule, x, y)
        boot += [Write(PROGRAM, address, word) for address, word in enumerate(registers)]
        return boot + writes([(X_TABLE, x.fast.words), (Y_TABLE, y.fast.words)])
