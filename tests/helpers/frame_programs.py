"""Programs with a slow part for tests: smooth ones, whose lines take runs, and wild ones of any words."""

import numpy as np
from c_scripts import long_program, step_about, within_limits
from numpy.random import Generator
from replacing import replace

from tablegen.device.dual_program import AxisProgram, ScanProgram
from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.frame_program import RATIO_BITS, SECOND_BITS, FrameProgram, Knots, SlowTable
from tablegen.fixedpoint.output import GAIN_BITS
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.rounding import signed_limits
from tablegen.fixedpoint.spline import SPLINE_UNIT
from tablegen.numerics.arrays import Ints
from tablegen.verification.play.sequencer_shape import SequencerShape


def knots(rng: Generator, lines: int, bits: int, around: int | None = None) -> Knots:
    """Knots of any words that reach all lines, or of words within a tenth of one."""
    count = int(rng.choice([2, 3, 5, 17, 65]))
    low, high = signed_limits(bits)
    if around is not None:
        far = abs(around) // 10 + 1
        low, high = max(low, around - far), min(high, around + far)
    spacing = -(-lines // (count - 1)) + int(rng.integers(0, 3))
    return Knots(rng.integers(low, high, count, endpoint=True), spacing)


def slow_table(rng: Generator, program: Program, wild: bool) -> SlowTable:
    """A wave about the offset of a program, of a few codes or of much of its range; or any words."""
    output, half = program.output, 1 << (min(program.bits, 21) - 1)
    size = 1 << int(rng.integers(3, 8))
    if wild:
        words = rng.integers(-half, half, size)
    else:
        turn = np.arange(size) / size + rng.random()
        words = np.floor(rng.choice([0.0, 0.1, 0.9]) * half * np.sin(2 * np.pi * turn)).astype(np.int64)
    full = (1 << (output.dac_bits + output.gain_q)) // (SPLINE_UNIT * half)  # the gain of the whole range
    gain = int(rng.choice([-1, 1])) * int(min(full // 4, (1 << (GAIN_BITS - 1)) - 1))
    return SlowTable(words, gain // int(rng.choice([1, 8, 64])), output.offset_word)


def frame_program(rng: Generator, fast: Program, lines: int, kind: str = "smooth") -> FrameProgram:
    """The program of a line with a slow part about its offset, and limits about where it needs them."""
    wild = kind == "wild"
    low, high = signed_limits(SECOND_BITS)
    second = rng.integers(low, high, len(fast.words), endpoint=True)
    ratios = knots(rng, lines, RATIO_BITS)
    if not wild:
        turn = np.arange(len(second)) / len(second)
        second = np.floor(100 * np.cos(2 * np.pi * turn)).astype(np.int64)
        ratios = replace(ratios, words=ratios.words // 8)
    gains = knots(rng, lines, GAIN_BITS, None if wild else fast.output.gain_word)
    made = FrameProgram(fast, lines, gains, ratios, second, slow_table(rng, fast, wild))
    top = (1 << fast.output.dac_bits) - 1
    wide = replace(made, fast=replace(fast, output=replace(fast.output, code_min=0, code_max=top)))
    return limited(rng, made, wide.frame().ravel())


def limited(rng: Generator, made: FrameProgram, codes: Ints) -> FrameProgram:
    """The program with limits and a largest step about where these codes need them."""
    top = (1 << made.output.dac_bits) - 1
    low, high = within_limits(rng, codes, top)
    output = replace(
        made.output, code_min=low, code_max=high, max_step=step_about(rng, codes, top), park_code=(low + high) // 2
    )
    return replace(made, fast=replace(made.fast, output=output))


def scan_program(
    rng: Generator, shape: SequencerShape, schedule: Schedule, slow: str = "xy", kind: str = "smooth"
) -> ScanProgram:
    """Both axes, those that ``slow`` names with a slow part."""

    def axis(name: str) -> AxisProgram:
        if name not in slow:
            return long_program(rng, shape, name, schedule)
        as_x = {f"x_{each}": getattr(shape, f"{name}_{each}") for each in ("interpolated", "index_bits", "word_bits")}
        return frame_program(rng, long_program(rng, replace(shape, **as_x), "x", schedule), schedule.lines, kind)

    return ScanProgram(axis("x"), axis("y"), schedule)


def common_knots(rng: Generator, program: ScanProgram) -> ScanProgram:
    """The program with ratios at the lines of its gains, as a page of registers has them; the ratios are any words."""

    def axis(each: AxisProgram) -> AxisProgram:
        if not isinstance(each, FrameProgram):
            return each
        low, high = signed_limits(RATIO_BITS)
        words = rng.integers(low, high, len(each.gains.words), endpoint=True)
        return replace(each, ratios=replace(each.gains, words=words))

    return replace(program, x=axis(program.x), y=axis(program.y))
