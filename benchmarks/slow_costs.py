"""What a sample of an axis with a slow part takes in C, as of a scan at an angle: measured in emulation.

A sample takes as many instructions as the loop has, and a share of what a line takes: its offset, gain and ratio, the
words that are mixed, and the segments of a spline. The first is measured for each coding, width and shaping that a
build has, the second once. ``short_line`` is measured for all of them, and both have to give it. ``python
benchmarks/tables.py --costs`` measures them, ``python benchmarks/slow_costs.py`` these alone; both write them into the
package, with the versions of the compilers and a digest of the C.
"""

import argparse
import hashlib
import inspect
import json
import os
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import firmware
import mode_costs
import numpy as np
from mode_costs import code_of, compiler_version, sequencer

from tablegen.config.schema import ProcessorName
from tablegen.fixedpoint.frame_words import BITS
from tablegen.fixedpoint.spline import WORDS_BEHIND
from tablegen.numerics.arrays import Floats
from tablegen.planning.frame_costs import FILE, TICKS, WORDS, LineCost
from tablegen.planning.played_table import LEAST_BLOCK, PROCESSORS, MeasuredRun
from tablegen.planning.table_costs import SampleCount
from tablegen.verification.c.emulate import Processor, compile_bare

COUNTED = Path(__file__).parent / "slow_count.c"
CUBIC = 128  # DAC_CUBIC
KNOTS = 17  # as many as a build has
SLOW_WORDS = 64
GAIN, FAST_GAIN = 1300, 13000  # of 2^16 for the whole range: the second moves far in 16 ticks
SLOW_GAIN = 3000  # 1.4 % of the range to each side
SKIPPED = 4  # fills before the first that is counted
SHORT_TICKS, LONG_WORDS = 341, 256  # of another line, and of another table
LINES = 16  # of a frame
FRAMES = {TICKS: 39, SHORT_TICKS: 20}  # ticks of a line: fills that are as long as a whole number of lines, or nearly
FILLS_BY_TICK = 5  # a line
CHECKED_WORDS = 128


class Scan(NamedTuple):
    """What is played on both axes, besides the runtime: words of a table, ticks of a line, and what is left out."""

    words: int = WORDS
    ticks: int = TICKS
    second: bool = True
    coded: bool = False
    without_runs: bool = False
    fast: bool = False  # so fast that every run is refused
    block: int = 0  # ticks of a block of a run, where they are not those of the program
    cubic: bool = True


def every_run() -> list[MeasuredRun]:
    """Return the conditions that are measured, in the order of the file: those of builds, which have narrow words."""
    return [run for run in mode_costs.every_run() if run.table_storage_bits == 16]


def slow_count(core: str, run: MeasuredRun) -> SampleCount:
    """Count a sample of an axis with both tables, of 64 words over lines of 1,250 ticks."""
    machine = _machine(core, run)
    scan = Scan(coded=run.coded)
    scans = scan, scan._replace(without_runs=True), scan._replace(fast=True), scan._replace(block=LEAST_BLOCK)
    return SampleCount(*(round(_sample(machine, run, one), 1) for one in scans))


def line_cost(core: str) -> LineCost:
    """Measure what a line takes, and each word of its table, in runs and tick by tick; and what the second one adds."""
    run = MeasuredRun(16, 16, False)
    machine = _machine(core, run)
    here, long, short = (
        _sample(machine, run, scan) for scan in (Scan(), Scan(words=LONG_WORDS), Scan(ticks=SHORT_TICKS))
    )
    word = (long - here) * TICKS / (LONG_WORDS - WORDS)
    line = (short - here) / (1.0 / SHORT_TICKS - 1.0 / TICKS) - WORDS * word
    few, many, none = (_begin(machine, run, scan) for scan in (Scan(), Scan(words=LONG_WORDS), Scan(second=False)))
    mixed = (many - few) / (LONG_WORDS - WORDS)
    alone = few - WORDS * mixed
    return LineCost(*(round(count, 1) for count in (line, word, alone, mixed, alone - none)))


def short_line(core: str, run: MeasuredRun) -> float:
    """Count a sample of a short line, of another table without a second one: what the counts have to give too."""
    scan = Scan(words=CHECKED_WORDS, ticks=SHORT_TICKS, second=False, coded=run.coded)
    return round(_sample(_machine(core, run), run, scan), 1)


def linear_count(core: str) -> float:
    """Count a sample of an axis with linear tables in runs, which no build has: see docs/tables.md."""
    run = MeasuredRun(16, 16, False)
    return round(_sample(_machine(core, run), run, Scan(cubic=False)), 1)


def expected_short_line(count: SampleCount, lines: LineCost) -> float:
    """Return what the counts give of ``short_line``."""
    here = lines.of(CHECKED_WORDS, in_runs=True, second=False) / SHORT_TICKS
    return count.in_runs + here - lines.of(WORDS, in_runs=True) / TICKS


def digest(sources: Sequence[Path] | None = None) -> str:
    """Return a digest of the C that is counted, comments and spaces aside, and of how it is."""
    paths = [*sequencer(), COUNTED] if sources is None else sources
    how = [inspect.getsource(function) for function in (slow_count, line_cost, short_line, Scan)]
    how += [inspect.getsource(function) for function in (_compiled, _sample, _begin, _start)]
    content = repr((code_of(paths), how, FRAMES, GAIN, FAST_GAIN, SLOW_GAIN, SLOW_WORDS, CHECKED_WORDS))
    return hashlib.sha256(content.encode("utf-8")).hexdigest()[:32]


def write() -> None:
    """Measure all cells, and write them where the package reads them."""
    jobs = [(core, run) for core in PROCESSORS for run in every_run()]
    with ProcessPoolExecutor(max(2, os.cpu_count() or 2)) as pool:
        lines = dict(zip(PROCESSORS, pool.map(line_cost, PROCESSORS), strict=True))
        # Two a chunk: a runtime is compiled once for straight and coded codes.
        cells = dict(zip(jobs, pool.map(_cell, *zip(*jobs, strict=True), chunksize=2), strict=True))

    def off(core: ProcessorName, run: MeasuredRun) -> float:
        count, short = cells[core, run]
        return 100.0 * abs(expected_short_line(count, lines[core]) / short - 1.0)

    head = {
        "compilers": {core: compiler_version(core) for core in PROCESSORS},
        "sources": digest(),
        "worst_percent": {core: round(max(off(core, run) for run in every_run()), 2) for core in PROCESSORS},
        "lines": lines,
    }
    rows = [run._asdict() | {core: list(cells[core, run][0]) for core in PROCESSORS} for run in every_run()]
    text = [f" {json.dumps(key)}: {json.dumps(value)}," for key, value in head.items()]
    text += [' "samples": [', ",\n".join(f"  {json.dumps(row)}" for row in rows), " ]"]
    FILE.write_text("\n".join(["{", *text, "}", ""]), "utf-8")


def _cell(core: str, run: MeasuredRun) -> tuple[SampleCount, float]:
    return slow_count(core, run), short_line(core, run)


def _machine(core: str, run: MeasuredRun) -> Processor:
    return _compiled(core, run.output_storage_bits, run.shaping_order)


@lru_cache(maxsize=2)  # a processor takes memory
def _compiled(core: str, output_storage_bits: int, order: int) -> Processor:
    macro_values = {
        "DAC_TABLE_STORAGE_BITS": 16,
        "DAC_OUTPUT_STORAGE_BITS": output_storage_bits,
        "DAC_SPLINE": 1,
        "DAC_SHAPING": order,
        "DAC_SLOW_PART": 1,
    }
    sources = [*sequencer(), COUNTED, firmware.MEMORY]
    with tempfile.TemporaryDirectory() as folder:
        program = compile_bare(Path(folder) / "count.elf", sources, core, None, ("-std=c99", "-O2"), macro_values)
    return Processor(program, core)


def _sample(machine: Processor, run: MeasuredRun, scan: Scan) -> float:
    """Return the instructions for a sample of an axis, the mean of whole lines."""
    _start(machine, run, scan)
    fills = FILLS_BY_TICK if scan.without_runs or scan.fast else FRAMES[scan.ticks]
    counts = [machine.call("count_fill").instructions for _ in range(SKIPPED + fills)][SKIPPED:]
    return sum(counts) / fills / firmware.TICKS / 2.0


def _begin(machine: Processor, run: MeasuredRun, scan: Scan) -> float:
    """Return the instructions of an axis before the first tick of a line, the mean of a frame."""
    _start(machine, run, scan)
    return sum(machine.call("count_line", line).instructions for line in range(LINES)) / LINES


def _start(machine: Processor, run: MeasuredRun, scan: Scan) -> None:
    """Write the words of a scan into memory, and start it: a sine over the line, and one over the frame."""
    code_bits = 18 if run.output_storage_bits > 16 else 16
    gain = FAST_GAIN if scan.fast else GAIN
    sine, knots = 0.8 * (1 << (BITS - 1)), np.arange(KNOTS)
    steepest = gain / (1 << 16) * (1 << code_bits) * 0.4 * 2.0 * np.pi / scan.ticks  # of the sine, codes a tick
    arrays = {
        "fast": _with_first_again(_turn(scan.words, sine)),
        "slow": _with_first_again(_turn(SLOW_WORDS, sine)),
        "second": _turn(scan.words, 100.0, 3).astype("i1"),
        "gains": np.round(gain * (1.0 + 0.08 * np.sin(knots))).astype("<i4"),
        "ratios": np.round(4096.0 * np.cos(0.5 * knots)).astype("<i2"),
    }
    words = {
        "line_ticks": scan.ticks,
        "frame_lines": LINES,
        "index_bits": (scan.words.bit_length() - 1) | (CUBIC if scan.cubic else 0),
        "slow_index_bits": SLOW_WORDS.bit_length() - 1,
        "word_bits": BITS,
        "code_bits": code_bits,
        "gain_word": SLOW_GAIN,
        "coded": int(scan.coded),
        "mixed": int(scan.second),
        "without_runs": int(scan.without_runs),
        "block": scan.block,
        "window_bits": int(2.0 * steepest + 1.0).bit_length() - 1 if scan.fast else 0,
    }
    for name, array in arrays.items():
        machine.write(name, array.tobytes())
    for name, value in words.items():
        machine.write(name, value.to_bytes(4, "little"))
    machine.call("count_start")
    if machine.word("refused"):
        raise RuntimeError(f"the runtime refuses the program: {machine.word('refused')}")


def _turn(words: int, amplitude: float, turns: int = 1) -> Floats:
    """Return a sine of so many turns over a table."""
    return np.asarray(amplitude * np.sin(2.0 * np.pi * turns * np.arange(words) / words))


def _with_first_again(values: Floats) -> np.ndarray[Any, np.dtype[Any]]:
    """Return words of a cubic table as they are in memory."""
    return np.round(np.append(values, values[:WORDS_BEHIND])).astype("<i2")


def main() -> None:
    """Write, or print what linear tables take."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--linear", action="store_true", help="print what linear tables take, and write nothing")
    if parser.parse_args().linear:
        print(*(f"{core}: {linear_count(core)}" for core in PROCESSORS), sep="\n")
    else:
        write()


if __name__ == "__main__":
    main()
