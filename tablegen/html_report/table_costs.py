"""The cost of each table mode on a device: measured, and written by ``python benchmarks/tables.py --costs``."""

from typing import NamedTuple

from tablegen.fixedpoint.program import Mode


class MeasuredRun(NamedTuple):
    """Conditions of the instruction counts besides the mode: word memory, and the converter's coding."""

    table_storage_bits: int  # 16, or 32 if a table of either axis has words of more than 16 bits
    output_storage_bits: int  # 16, or 32 if a converter's word has more than 16 bits
    coded: bool  # two's complement or left-aligned: each code takes a step more


# Instructions of the C sequencer for a sample of one axis of the example, mean of a frame, gcc -O2.
COUNTS: dict[MeasuredRun, dict[Mode, dict[str, float]]] = {
    MeasuredRun(16, 16, False): {
        "direct": {"cortex-m4": 19.4, "cortex-m0plus": 35.6, "riscv32": 26.3},
        "interpolated": {"cortex-m4": 19.4, "cortex-m0plus": 35.6, "riscv32": 26.3},
        "cubic": {"cortex-m4": 26.9, "cortex-m0plus": 65.8, "riscv32": 38.3},
    },
    MeasuredRun(16, 16, True): {
        "direct": {"cortex-m4": 26.4, "cortex-m0plus": 43.6, "riscv32": 33.3},
        "interpolated": {"cortex-m4": 26.4, "cortex-m0plus": 43.6, "riscv32": 33.3},
        "cubic": {"cortex-m4": 33.9, "cortex-m0plus": 73.8, "riscv32": 45.3},
    },
    MeasuredRun(16, 32, False): {
        "direct": {"cortex-m4": 19.7, "cortex-m0plus": 35.8, "riscv32": 26.4},
        "interpolated": {"cortex-m4": 19.7, "cortex-m0plus": 35.8, "riscv32": 26.4},
        "cubic": {"cortex-m4": 27.1, "cortex-m0plus": 64.9, "riscv32": 38.4},
    },
    MeasuredRun(16, 32, True): {
        "direct": {"cortex-m4": 27.7, "cortex-m0plus": 44.8, "riscv32": 34.4},
        "interpolated": {"cortex-m4": 27.7, "cortex-m0plus": 44.8, "riscv32": 34.4},
        "cubic": {"cortex-m4": 35.1, "cortex-m0plus": 73.9, "riscv32": 46.4},
    },
    MeasuredRun(32, 16, False): {
        "direct": {"cortex-m4": 22.4, "cortex-m0plus": 62.6, "riscv32": 36.5},
        "interpolated": {"cortex-m4": 22.4, "cortex-m0plus": 62.6, "riscv32": 36.5},
        "cubic": {"cortex-m4": 26.8, "cortex-m0plus": 83.3, "riscv32": 43.1},
    },
    MeasuredRun(32, 16, True): {
        "direct": {"cortex-m4": 29.4, "cortex-m0plus": 70.6, "riscv32": 43.5},
        "interpolated": {"cortex-m4": 29.4, "cortex-m0plus": 70.6, "riscv32": 43.5},
        "cubic": {"cortex-m4": 33.8, "cortex-m0plus": 91.3, "riscv32": 50.1},
    },
    MeasuredRun(32, 32, False): {
        "direct": {"cortex-m4": 22.7, "cortex-m0plus": 68.0, "riscv32": 36.5},
        "interpolated": {"cortex-m4": 22.7, "cortex-m0plus": 67.9, "riscv32": 36.4},
        "cubic": {"cortex-m4": 26.9, "cortex-m0plus": 83.6, "riscv32": 42.8},
    },
    MeasuredRun(32, 32, True): {
        "direct": {"cortex-m4": 30.7, "cortex-m0plus": 77.0, "riscv32": 44.4},
        "interpolated": {"cortex-m4": 30.7, "cortex-m0plus": 76.9, "riscv32": 44.4},
        "cubic": {"cortex-m4": 34.9, "cortex-m0plus": 92.6, "riscv32": 50.7},
    },
}
INSTRUCTIONS = COUNTS[MeasuredRun(16, 16, False)]
# Cells of one axis in Verilog on an iCE40 HX8K, a sample a clock, of a cubic table one in 11.
CELLS: dict[Mode, int] = {
    "direct": 1327,
    "interpolated": 2446,
    "cubic": 2291,
}
