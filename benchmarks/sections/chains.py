"""Chains of others for the task of an axis, counted in emulation; their codes beside those of the model.

The chains are those of ``chains.c``. Arm and RISC-V run in unicorn, the AVR in simavr, whose host counts.
"""

import re
import subprocess
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tablegen.base.resources import c_runtime
from tablegen.certificate.certificate import certify
from tablegen.config.load import load
from tablegen.emit.render import render
from tablegen.numerics.arrays import Ints
from tablegen.planning.line_plan import Plan, make_plan
from tablegen.verification.c.emulate import Processor, compile_bare

BENCHMARKS = Path(__file__).resolve().parents[1]
MEMORY = BENCHMARKS.parent / "examples" / "firmware" / "memory.c"
SOURCES = [BENCHMARKS / name for name in ("chains.c", "block_functions.c")]
TICKS = 250  # of a call
SIGN = 0x8000  # of a code in two's complement
CHAINS = {"plain": "a plain loop", "library": "library functions on blocks", "float": "a loop in soft float"}
OURS = "ours"
_AVR_NAMES = {1: "plain", 2: "float", 3: "library", 4: OURS}


@dataclass(frozen=True)
class Chain:
    """Instructions (and cycles, where they are known) of an axis sample, and the largest error of its codes in LSB."""

    instructions: float
    error: int | None = None
    cycles: float | None = None


def planned(scan: Path, folder: Path) -> Plan:
    """The plan of a scan, whose files stand in ``folder`` then."""
    plan = make_plan(load(scan))
    for name, content in render(plan, certify(plan)).items():
        (folder / name).write_bytes(content)
    return plan


def error(plan: Plan, chain: str, codes: Sequence[int]) -> int:
    """The largest departure from the model, of the codes of x in a line."""
    wanted: Ints = plan.x.program.codes(np.arange(plan.schedule.ticks))
    found = np.array(codes, dtype=np.int64) ^ (SIGN if chain == "library" else 0)
    return int(np.max(np.abs(found - wanted)))


def counted(plan: Plan, core: str, folder: Path) -> dict[str, Chain]:
    """The chains over a line on a core of ``CORES``."""
    sources = [*SOURCES, MEMORY, folder / f"{plan.name}.c", folder / f"{plan.name}.h"]
    machine = Processor(compile_bare(folder / "chains.elf", sources, core, None, ("-std=gnu99", "-O2")), core)
    found = {}
    for chain in CHAINS:
        machine.call("chain_start")
        calls, codes = [], b""
        for _ in range(plan.schedule.ticks // TICKS):
            calls.append(machine.call(f"chain_{chain}").instructions)
            codes += machine.read("chain_codes")
        of = np.frombuffer(codes, dtype="<u2").tolist()
        found[chain] = Chain(sum(calls) / plan.schedule.ticks, error(plan, chain, of))
    return found


def counted_on_avr(plan: Plan, folder: Path) -> dict[str, Chain]:
    """The same on an ATmega2560, and the sequencer's ``fill`` of both axes over a line."""
    host, firmware = folder / "avr_count", folder / "chains.elf"
    _run("gcc", "-std=gnu99", "-O2", BENCHMARKS / "avr_count.c", "-o", host, "-lsimavr", "-lelf", "-lm")
    own = [path for path in c_runtime() if path.suffix == ".c"]
    sections = ("-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections")
    _run(
        *("avr-gcc", "-std=gnu99", "-mmcu=atmega2560", "-O2", *sections, f"-I{folder}", f"-I{own[0].parent}"),
        *(*SOURCES, BENCHMARKS / "avr_chains.c", *own, folder / f"{plan.name}.c", "-o", firmware),
    )
    return avr_chains(plan, _run(host, firmware).splitlines())


def avr_chains(plan: Plan, lines: Iterable[str]) -> dict[str, Chain]:
    """What the lines of ``avr_count`` say."""
    calls: dict[str, list[tuple[int, int, bytes]]] = {name: [] for name in _AVR_NAMES.values()}
    for line in lines:
        if found := re.fullmatch(r"([1-4]) (\d+) (\d+) ([0-9a-f]+)", line):
            calls[_AVR_NAMES[int(found[1])]].append((int(found[2]), int(found[3]), bytes.fromhex(found[4])))
    ticks = plan.schedule.ticks
    chains = {}
    for name, blocks in calls.items():
        codes = np.frombuffer(b"".join(told for _, _, told in blocks), dtype="<u2").tolist()
        if len(codes) != ticks:
            raise RuntimeError(f"avr_count: {len(codes)} codes of {name}, not {ticks}")
        samples = ticks * (2 if name == OURS else 1)  # a fill has both axes
        wrong = None if name == OURS else error(plan, name, codes)
        instructions, cycles = (sum(block[at] for block in blocks) / samples for at in (0, 1))
        chains[name] = Chain(instructions, wrong, cycles)
    return chains


def _run(*command: str | Path) -> str:
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{command[0]}: {done.stderr[-2000:]}")
    return done.stdout
