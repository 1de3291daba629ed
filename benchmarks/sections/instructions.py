"""Instructions of an axis sample: the sequencer's ``fill`` beside chains of others for the same task."""

import tempfile
from importlib.metadata import version
from pathlib import Path

from editing import SCAN, edited, write_pair
from firmware import measure as measure_firmware

from sections.chains import CHAINS, OURS, Chain, counted, counted_on_avr, planned
from sections.processes import python_version, tool_version
from sections.section import EXAMPLE, Section

TITLE = "Instructions"
CORES = {"cortex-m0plus": "Cortex-M0+", "cortex-m4": "Cortex-M4", "cortex-m33": "Cortex-M33", "riscv32": "RV32IMAC"}
# An ATmega2560 has 8 kB for both tables and the buffers.
SMALL = ("- [limits]", "x.table.length = 512", "y.table.length = 512")
TEXT = """Instructions of an axis sample of the example, compiled with `-O2`, counted in emulation (unicorn; simavr
for the ATmega2560, whose tables have 512 words). The task of all: phase, linear interpolation of 16-bit words, gain,
offset, clamp, a 16-bit code; x over a line, in blocks of 250. `benchmarks/chains.c` has the chains of others: a plain
loop for this one program, whose constants the compiler knows; library functions like those of CMSIS-DSP (a call of
linear interpolation a sample, then scale, offset and clip over the block, with the 16-bit instructions of a processor
that has them); and a loop in single precision without a floating-point unit. Ours is `dac_sequencer_fill` of both
axes, the mean of a frame (of a line on the ATmega2560); beyond the task it keeps the slew guard, ends of lines and
frames, limits, and waits for another program. Error: the largest departure of a code from the integer model, in
LSB."""
HEAD = ("processor", "chain", "instructions", "over ours", "error [LSB]", "cycles")
NAMES = {OURS: "ours: `dac_sequencer_fill`", **CHAINS}


def rows_of(processor: str, chains: dict[str, Chain]) -> list[list[str]]:
    """The rows of a processor."""
    ours = chains[OURS].instructions
    return [
        [
            processor,
            NAMES[name],
            f"{chain.instructions:.1f}",
            f"{chain.instructions / ours:.2f}",
            "" if chain.error is None else str(chain.error),
            "" if chain.cycles is None else f"{chain.cycles:.0f}",
        ]
        for name in NAMES
        if (chain := chains.get(name))
    ]


def measure() -> Section:
    """Count on all processors, the same on every machine with these compilers."""
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plan = planned(EXAMPLE, folder)
        for core, processor in CORES.items():
            ours = Chain(measure_firmware(core, "-O2", folder).fill, 0)
            rows += rows_of(processor, {OURS: ours, **counted(plan, core, folder)})
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        plan = planned(write_pair(folder, edited(SCAN, *SMALL)), folder)
        rows += rows_of("ATmega2560", counted_on_avr(plan, folder))
    tools = {
        "arm-none-eabi-gcc": tool_version("arm-none-eabi-gcc"),
        "riscv64-unknown-elf-gcc": tool_version("riscv64-unknown-elf-gcc"),
        "avr-gcc": tool_version("avr-gcc"),
        "unicorn": version("unicorn"),
    }
    return Section(TITLE, TEXT, HEAD, rows, notes(rows), python_version() | tools)


def notes(rows: list[list[str]]) -> list[str]:
    """Where another takes fewer, and what a mean leaves out."""
    fewer = [f"{row[1]} on {row[0]} ({row[3]})" for row in rows if row[1] != NAMES[OURS] and float(row[3]) < 1.0]
    return [
        f"Fewer instructions than ours: {', '.join(fewer) or 'none'}.",
        "A mean is not what a driver plans with: [instructions](../docs/instructions.md) has the longest calls. "
        "`fill` is fast because it works a whole segment of the table out at a time; `step`, one tick a call, "
        "takes many more.",
    ]
