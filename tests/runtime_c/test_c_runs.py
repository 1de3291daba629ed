"""Which programs the C plays in runs: ``PlayedTable.has_runs``, which costs are read by, against ``allow_runs``."""

from collections import Counter
from ctypes import c_uint32
from pathlib import Path

import numpy as np
import pytest
from c_library import LOADED, Device, Library, compile_library, converter_of
from programs import random_dual, shaped
from test_c_slow_part import runtime_with

from tablegen.config.schema import ProcessorName
from tablegen.device.dual_program import DualProgram
from tablegen.fixedpoint.table_shape import TableShape
from tablegen.planning.table_costs import PlayedTable
from tablegen.verification.play.sequencer_shape import SequencerShape

# Two banks are derived for a load, x first.
PROBE = {
    "/* Derives the windows of dac_axis_run, if runs are possible. */": "uint32_t probe_runs;",
    "    b->park_code = p->park_code;\n    allow_runs(b, p);": (
        "    b->park_code = p->park_code;\n    allow_runs(b, p);\n    probe_runs = probe_runs << 16 | b->run_most;"
    ),
}
DEVICES: dict[
    str, tuple[ProcessorName, int, tuple[str, ...]]
] = {  # processor and bits of the widest table: the default of DAC_LONG_MULTIPLY follows from both
    "long, 16": ("cortex-m4", 16, ("-DDAC_LONG_MULTIPLY=1",)),
    "short, 16": ("riscv32", 16, ("-DDAC_LONG_MULTIPLY=0",)),
    "long, 32": ("riscv32", 32, ("-DDAC_LONG_MULTIPLY=1",)),
    "short, 32": ("cortex-m0plus", 32, ("-DDAC_LONG_MULTIPLY=0",)),
}
DEGREES = ((1, 1), (3, 1), (1, 3))  # of x and of y
SHAPES = {
    16: [SequencerShape(dac, x, 4, bits, y, 5, bits) for dac in (16, 13, 8) for x, y in DEGREES for bits in (16, 8)],
    32: [SequencerShape(dac, x, 4, bits, y, 5, bits) for dac in (24, 18, 12) for x, y in DEGREES for bits in (20, 16)],
}


def tables(program: DualProgram) -> list[PlayedTable]:
    """Return what costs are read by, of both axes."""
    axes = (program.x, program.y)
    return [
        PlayedTable(TableShape(axis.mode, len(axis.words), axis.bits), axis.phase.ticks, axis.hold, axis.output, 0.0)
        for axis in axes
    ]


@pytest.mark.common
@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("shaping", [0, 3])
def test_runs_are_where_costs_expect_them(device: str, shaping: int, tmp_path: Path) -> None:
    processor, bits, options = DEVICES[device]
    more = (*options, "-DDAC_SPLINE=1", f"-DDAC_SHAPING={shaping}")
    runtime = runtime_with(PROBE, tmp_path / "runtime")
    library = Library(compile_library(tmp_path / "runs.so", bits, bits, runtime=runtime, more=more))
    runs, seen = c_uint32.in_dll(library.dll, "probe_runs"), Counter[bool]()
    rng = np.random.default_rng(5)
    for shape in SHAPES[bits]:
        for longest in (6, 40, 300):
            program = random_dual(rng, shape, (4, longest), kind="tame")
            if shaping:
                program = shaped(rng, program, shaping)
            device = Device(library, *(converter_of(axis.output) for axis in (program.x, program.y)))
            assert device.load(program) == LOADED
            for table, most in zip(tables(program), (runs.value >> 16, runs.value & 0xFFFF), strict=True):
                assert table.has_runs(processor, bits) == (most != 0), (shape, table)
                seen[most != 0] += 1
    assert min(seen[True], seen[False]) > 5
