"""What the modes of a table take on a device: measured, and written by ``python benchmarks/tables.py --costs``."""

from tablegen.fixedpoint.program import Mode

# Instructions of the C sequencer for a sample of one axis, mean of a frame, gcc -O2.
INSTRUCTIONS: dict[Mode, dict[str, float]] = {
    "direct": {"cortex-m4": 19.4, "cortex-m0plus": 35.6},
    "interpolated": {"cortex-m4": 19.4, "cortex-m0plus": 35.6},
    "cubic": {"cortex-m4": 26.9, "cortex-m0plus": 65.8},
}
# Cells of one axis in Verilog on an iCE40 HX8K, a sample a clock, of a cubic table one in 11.
CELLS: dict[Mode, int] = {
    "direct": 1326,
    "interpolated": 2446,
    "cubic": 2291,
}
