"""What an axis sample takes in C by processor and table: measured in emulation, for `tablegen tables` and `[cost]`.

``python benchmarks/tables.py --costs`` measures every cell and writes them into the package, with the versions of the
compilers and a digest of the C: a change of it is then noticed without a compiler.
"""

import hashlib
import inspect
import json
import os
import re
import subprocess
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path

import firmware
from msgspec import structs

from tablegen.base.resources import c_runtime
from tablegen.certificate.certificate import certify
from tablegen.config.load import load
from tablegen.config.schema import Table
from tablegen.emit.render import render
from tablegen.fixedpoint.program import Mode
from tablegen.planning.line_plan import make_plan
from tablegen.planning.played_table import LEAST_BLOCK, PROCESSORS, MeasuredRun
from tablegen.planning.table_costs import FILE, SampleCount
from tablegen.verification.c.emulate import COMPILERS, CORES, Processor, compile_bare

HERE = Path(__file__).parent
EXAMPLE = HERE.parent / "examples" / "annexin_200nm.toml"
COUNTED = HERE / "table_count.c"
# Words of the tables that are counted: how many changes nothing.
LENGTHS: dict[Mode, int | None] = {"direct": None, "interpolated": 512, "cubic": 128}
MEASURED: tuple[Mode, ...] = ("interpolated", "cubic")  # a direct table is played by the loop of lines
SKIPPED, FILLS = 5, 49  # fills of 256 ticks: after the first ones, ten lines of 1250 ticks
FILLS_BY_TICK = 5  # a line
REFUSED_STEPS = 4.0  # steepest steps of the line in a window that no 16 ticks keep


def every_run() -> list[MeasuredRun]:
    """Return the conditions that are measured, in the order of the file."""
    return [
        MeasuredRun(table, output, coded, order)
        for order in range(4)
        for table in (16, 32)
        for output in (16, 32)
        for coded in (False, True)
    ]


def instructions(core: str, run: MeasuredRun, mode: Mode) -> SampleCount:
    """Count an axis sample of ``fill``: of x, which both axes play."""
    return _fills(core, mode, run.table_storage_bits, run.output_storage_bits, run.shaping_order)[run.coded]


@cache
def _fills(
    core: str, mode: Mode, table_storage_bits: int, output_storage_bits: int, order: int
) -> tuple[SampleCount, SampleCount]:
    """Return the means of samples, straight and coded."""
    setup = load(EXAMPLE)
    bits = 18 if table_storage_bits > 16 else 16
    x = structs.replace(setup.scan.x, table=Table(mode=mode, length=LENGTHS[mode], bits=bits))
    assert setup.scan.dac is not None
    dac = structs.replace(setup.scan.dac, bits=18 if output_storage_bits > 16 else 16)
    plan = make_plan(structs.replace(setup, scan=structs.replace(setup.scan, x=x, dac=dac)))
    macro_values = {
        "DAC_TABLE_STORAGE_BITS": table_storage_bits,
        "DAC_OUTPUT_STORAGE_BITS": output_storage_bits,
        "DAC_SPLINE": int(mode == "cubic"),  # a runtime has splines only if it is compiled for them
        "DAC_SHAPING": order,
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, content in render(plan, certify(plan), ["c"]).items():
            (folder / file).write_bytes(content)
        sources = [*sequencer(), COUNTED, folder / f"{plan.name}.c", folder / f"{plan.name}.h", firmware.MEMORY]
        options = ("-std=c99", "-O2")
        program = compile_bare(folder / "count.elf", sources, core, None, options, macro_values)
    machine = Processor(program, core)
    window_bits = int(REFUSED_STEPS * (1.0 + plan.x.steepest) + 1.0).bit_length() - 1
    ways = (0, 0, 0), (1, 0, 0), (0, window_bits, 0), (0, 0, LEAST_BLOCK)
    straight, coded = (SampleCount(*(_mean(machine, coded, *way) for way in ways)) for coded in (False, True))
    return straight, coded


def sequencer() -> list[Path]:
    """Return the sources that play a program: all but the one that renders Fourier words."""
    return [path for path in c_runtime() if path.name != "dac_fourier.c"]


def _mean(machine: Processor, coded: bool, by_tick: int, window_bits: int, block: int) -> float:
    """Count fills of a program from its start, in windows of so many bits of a code and blocks of so many ticks.

    Where they are 0, as the program has them.
    """
    machine.call("count_start", int(coded), by_tick, window_bits, block)
    if machine.word("refused"):
        raise RuntimeError(f"the runtime refuses the program: {machine.word('refused')}")
    fills = FILLS_BY_TICK if by_tick or window_bits else FILLS
    counts = [machine.call("count_fill").instructions for _ in range(SKIPPED + fills)][SKIPPED:]
    return round(sum(counts) / fills / firmware.TICKS / 2.0, 1)


def digest(sources: Sequence[Path] | None = None) -> str:
    """Return a digest of the C that is counted, comments and spaces aside, and of how it is."""
    paths = [*sequencer(), COUNTED] if sources is None else sources
    code = code_of(paths)
    how = [inspect.getsource(function) for function in (instructions, _fills, _mean)]
    content = repr((code, how, LENGTHS, SKIPPED, FILLS, FILLS_BY_TICK, REFUSED_STEPS))
    return hashlib.sha256(content.encode("utf-8")).hexdigest()[:32]


def code_of(sources: Sequence[Path]) -> list[str]:
    """Return the C of sources without comments and spaces."""
    return [re.sub(r"//.*|/\*.*?\*/|\s+", "", path.read_text("utf-8"), flags=re.DOTALL) for path in sources]


def compiler_version(core: str) -> str:
    """Return the first line of what the compiler of a processor says of itself."""
    command = [COMPILERS[CORES[core].architecture], "--version"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[0]


def write(cells: dict[Mode, int]) -> None:
    """Measure all instructions, and write them with the cells of Verilog where the package reads them."""
    jobs = [(core, run, mode) for core in PROCESSORS for mode in MEASURED for run in every_run()]
    with ProcessPoolExecutor(max(2, os.cpu_count() or 2)) as pool:
        # Two a chunk: a runtime is compiled once for straight and coded codes.
        found = dict(zip(jobs, pool.map(instructions, *zip(*jobs, strict=True), chunksize=2), strict=True))
    rows = [
        {**run._asdict(), "mode": mode} | {core: list(found[core, run, mode]) for core in PROCESSORS}
        for run in every_run()
        for mode in MEASURED
    ]
    head = {
        "compilers": {core: compiler_version(core) for core in PROCESSORS},
        "sources": digest(),
        "cells": cells,
    }
    lines = [f" {json.dumps(key)}: {json.dumps(value)}," for key, value in head.items()]
    lines += [' "instructions": [', ",\n".join(f"  {json.dumps(row)}" for row in rows), " ]"]
    FILE.write_text("\n".join(["{", *lines, "}", ""]), "utf-8")
