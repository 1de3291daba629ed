"""Which programs the C plays in runs, and in which windows: ``PlayedTable``, which costs are read by, and the C."""

from collections import Counter
from ctypes import c_int32, c_uint32
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from c_library import LOADED, Device, Library, Twin, compile_library, converter_of
from frame_programs import scan_program, shaped_scan
from programs import random_dual, random_schedule, shaped
from replacing import replace
from test_c_slow_part import CUBIC, LINEAR, SLOW, WIDE, library_of, runtime_with

from tablegen.config.schema import ProcessorName
from tablegen.device.dual_program import DualProgram
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.shaping import Shaping
from tablegen.fixedpoint.table_shape import TableShape
from tablegen.planning.played_table import PlayedTable, played_frame_table
from tablegen.verification.play.sequencer_shape import SequencerShape

# Two banks are derived for a load, x first.
PROBE = {
    "/* Derives the windows of dac_axis_run, if runs are possible. */": (
        "uint32_t probe_runs, probe_windows, probe_blocks; int32_t probe_x_step, probe_step;"
    ),
    "    b->park_code = p->park_code;\n    allow_runs(b, p);": (
        "    b->park_code = p->park_code;\n    allow_runs(b, p);\n    probe_runs = probe_runs << 16 | b->run_most;"
        "    probe_windows = probe_windows << 16 | b->run_bits;\n"
        "    probe_blocks = probe_blocks << 16 | b->run_block;\n"
        "    probe_x_step = probe_step;\n    probe_step = steepest_step(b, p);"
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
    32: [SequencerShape(dac, x, 4, bits, y, 5, bits) for dac in (24, 18, 12) for x, y in DEGREES for bits in (20, 16)]
    + [SequencerShape(24, 1, 12, 8, 1, 12, 8)] * 3,  # a tick moves over a thousand words
}


def tables(program: DualProgram) -> list[PlayedTable]:
    """Return what costs are read by, of both axes."""
    axes = (program.x, program.y)
    return [
        PlayedTable(TableShape(axis.mode, len(axis.words), axis.bits), axis.phase.ticks, axis.hold, axis.output, 0.0)
        for axis in axes
    ]


class Probes:
    """What the C has derived of a program that was loaded."""

    def __init__(self, library: Library) -> None:
        names = ("probe_runs", "probe_windows", "probe_blocks")
        self._probes = [c_uint32.in_dll(library.dll, name) for name in names]
        self._steps = [c_int32.in_dll(library.dll, name) for name in ("probe_x_step", "probe_step")]

    def axes(self) -> list[tuple[int, int, int, int]]:
        """Return the most ticks of a run, bits of a window, ticks of a block and the largest step, of x and of y."""
        x, y = ([probe.value >> shift & 0xFFFF for probe in self._probes] for shift in (16, 0))
        return [(*derived, step.value) for derived, step in zip((x, y), self._steps, strict=True)]


def largest_step(axis: Program) -> int:
    """Return the largest step of a code from one advance to the next, without limits and shaping."""
    top = (1 << axis.output.dac_bits) - 1
    free = replace(axis, output=replace(axis.output, code_min=0, code_max=top, shaping=Shaping()))
    codes = free.codes(np.arange(axis.phase.ticks))
    return int(np.max(np.abs(codes - np.roll(codes, 1))))


def guarded(axis: Program) -> Program:
    """Return the axis with a 50th of its gain, and a slew guard that just does not act on it."""
    small = replace(axis, output=replace(axis.output, gain_word=axis.output.gain_word // 50))
    return replace(small, output=replace(small.output, max_step=largest_step(small) + 12))


def steps_and_windows(device: str, shaping: int, folder: Path, edits: dict[str, str]) -> None:
    """Compare what the C derives of random programs with the rules of the costs, and with the codes of a period."""
    processor, bits, options = DEVICES[device]
    more = (*options, "-DDAC_SPLINE=1", f"-DDAC_SHAPING={shaping}")
    runtime = runtime_with(PROBE | edits, folder / "runtime")
    library = Library(compile_library(folder / "runs.so", bits, bits, runtime=runtime, more=more))
    probes = Probes(library)
    seen, widened, blocks = Counter[bool](), Counter[bool](), Counter[int]()
    rng = np.random.default_rng(5)
    for shape in SHAPES[bits]:
        for longest, gentle in product((6, 40, 300), (False, True)):
            program = random_dual(rng, shape, (4, longest), kind="tame")
            if shaping:
                program = shaped(rng, program, shaping)
            if gentle:
                program = replace(program, x=guarded(program.x), y=guarded(program.y))
            loading = Device(library, *(converter_of(axis.output) for axis in (program.x, program.y)))
            assert loading.load(program) == LOADED
            found = zip(tables(program), (program.x, program.y), probes.axes(), strict=True)
            for table, axis, (most, window, block, step) in found:
                assert table.has_runs(processor, bits) == (most != 0), (shape, table)
                seen[most != 0] += 1
                assert largest_step(axis) <= step, (shape, table)
                if most != 0:
                    assert table.window(processor, bits, step) == 1 << window, (shape, table, step)
                    assert table.block(processor, bits, step) == block, (shape, table, step)
                    widened[1 << window > table.window(processor, bits, 1 << 30)] += 1
                    blocks[block] += 1
    assert min(seen[True], seen[False], widened[True], widened[False]) > 5
    assert sorted(blocks) == ([16] if "long" in device else [4, 8, 16])


@pytest.mark.common
@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("shaping", [0, 3])
def test_runs_are_where_costs_expect_them(device: str, shaping: int, tmp_path: Path) -> None:
    steps_and_windows(device, shaping, tmp_path, {})


@pytest.mark.common
@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("shaping", [0, 3])
def test_blocks_at_an_angle_are_where_costs_expect_them(device: str, shaping: int, tmp_path: Path) -> None:
    """Steps of the words that are mixed in, with the largest gain of a line; and room for a ramp."""
    processor, bits, options = DEVICES[device]
    more = (*options, *SLOW, "-DDAC_SPLINE=1", f"-DDAC_SHAPING={shaping}")
    runtime = runtime_with(PROBE, tmp_path / "runtime")
    library = library_of(compile_library(tmp_path / "runs.so", bits, bits, 2, runtime=runtime, more=more))
    probes, blocks, rng = Probes(library), Counter[int](), np.random.default_rng(4)
    schedule = replace(random_schedule(rng, 90, 1), lines=5)
    shapes = (WIDE if bits == 32 else LINEAR + CUBIC) * 12
    for shape in shapes:
        program = scan_program(rng, shape, schedule)
        gentle = replace(program, x=slowed(rng, program.x), y=slowed(rng, program.y))
        if shaping:
            gentle = shaped_scan(rng, gentle, shaping)
        assert Twin(library, gentle).device.load(gentle) == LOADED
        for axis, (most, window, block, step) in zip((gentle.x, gentle.y), probes.axes(), strict=True):
            table = played_frame_table(axis, axis.output.max_step, 0.0)
            assert table.has_runs(processor, bits) == (most != 0), table
            assert table.moves == step, table
            if most != 0:
                assert table.window(processor, bits, step) == 1 << window, table
                assert table.block(processor, bits, step) == block, table
                blocks[block] += 1
    assert sorted(blocks) == ([16] if "long" in device else [4, 8, 16])


def slowed(rng: np.random.Generator, axis: FrameProgram) -> FrameProgram:
    """Return the axis with any part of its gains, and a slew guard that cannot act."""
    part = int(rng.choice([1, 2, 5, 20, 100]))
    output = replace(axis.output, gain_word=axis.output.gain_word // part, max_step=(1 << 24) - 1)
    gains = replace(axis.gains, words=axis.gains.words // part)
    return replace(axis, fast=replace(axis.fast, output=output), gains=gains)


@pytest.mark.rest
@pytest.mark.parametrize(
    ("device", "shaping", "old", "new"),
    [
        ("long, 16", 0, "CUBIC(p) ? DAC_SPLINE_UNIT :", "CUBIC(p) ? 6 :"),
        ("long, 16", 0, "UINT32_C(1) << b->guard; /* of a sample", "UINT32_C(1) << b->guard >> 1; /* of a sample"),
        ("long, 16", 0, "(CUBIC(p) ? 18 : 15)) + 3", "18) + 3"),
        ("long, 16", 0, "(largest_gain(p) * move >> p->gain_q) + 1", "(largest_gain(p) * move >> p->gain_q)"),
        ("long, 32", 3, " || codes > INT32_MAX", ""),
    ],
)
def test_a_bound_that_is_too_low_is_found(device: str, shaping: int, old: str, new: str, tmp_path: Path) -> None:
    with pytest.raises(AssertionError):
        steps_and_windows(device, shaping, tmp_path, {old: new})


@pytest.mark.rest
def test_blocks_that_are_too_long_are_found(tmp_path: Path) -> None:
    """No code would tell: a block that leaves its window is played tick by tick."""
    with pytest.raises(AssertionError):
        steps_and_windows("short, 16", 0, tmp_path, {"block = block / 2 + 1;": "block = block / 4;"})
