"""Programs for the sequencer's benches: random ones, whatever the arithmetic allows, with no plan behind them."""

from collections.abc import Iterator
from fractions import Fraction
from typing import Literal

import numpy as np
from numpy.random import Generator
from replacing import replace

from tablegen.device.dual_program import DualProgram
from tablegen.device.schedule import Schedule, Window
from tablegen.emit.constants import DEGREES
from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Mode, Program
from tablegen.fixedpoint.shaping import Shaping
from tablegen.fixedpoint.synthesis import FourierWords, synthesize
from tablegen.verification.play.sequencer_shape import SequencerShape

Kind = Literal["wild", "tame", "smooth", "held"]


def random_window(rng: Generator, length: int, least: int = 0) -> Window:
    """A window inside [0, length), often at its edges, sometimes empty."""
    edges = sorted(int(edge) for edge in rng.integers(0, length + 1, 2))
    if rng.random() < 0.3:
        edges[0] = 0
    if rng.random() < 0.3:
        edges[1] = length
    return Window(edges[0], edges[1] - edges[0])


def random_schedule(rng: Generator, ticks: int, lines: int) -> Schedule:
    turn = int(rng.integers(0, ticks + 1))
    forward = random_window(rng, turn) if turn else Window(0, 0)
    behind = random_window(rng, ticks - turn) if turn < ticks else Window(0, 0)
    most, fewest = (pick([n for n in (forward.count, behind.count) if n], default=1) for pick in (max, min))
    turn_line = int(rng.integers(0, lines + 1))
    up = random_window(rng, turn_line) if turn_line else Window(0, 0)
    down = random_window(rng, lines - turn_line) if turn_line < lines else Window(0, 0)
    return Schedule(
        ticks=ticks,
        lines=lines,
        update_rate_hz=Fraction(1000),
        requested_hz=1.0,
        pixels=min(int(rng.integers(1, most + 1)), fewest),
        settle_lines=int(rng.integers(0, 4)),
        turn_tick=turn,
        forward=forward,
        backward=Window(turn + behind.first, behind.count),
        turn_line=turn_line,
        up=up,
        down=Window(turn_line + down.first, down.count),
    )


def pixels_near_ticks(rng: Generator, most: int, cases: int) -> Iterator[tuple[int, int, int]]:
    """Pixels and the ticks of both windows, 0 to ``most``, mostly such that one more or less decides if they fit."""
    for _ in range(cases):
        near = int(rng.choice([1, 2, most >> 1, most - 1, int(rng.integers(1, most))]))
        pixels, forward, backward = rng.choice([0, 1, near - 1, near, near, near + 1, most], 3).tolist()
        yield pixels, forward, backward


def parts(rng: Generator, pixels: int, ticks: int) -> tuple[int, ...]:
    """Divide ticks at random into so many pixels."""
    cuts = np.sort(rng.choice(np.arange(1, ticks), pixels - 1, replace=False))
    return tuple(np.diff([0, *cuts.tolist(), ticks]).tolist())


def with_table(rng: Generator, schedule: Schedule) -> Schedule:
    """Give a schedule a table of pixels, where both windows have ticks."""
    fewest = min(schedule.forward.count, schedule.backward.count)
    if not fewest:
        return schedule
    pixels = int(rng.choice([1, fewest, (fewest + 2) // 3]))
    table = parts(rng, pixels, schedule.forward.count), parts(rng, pixels, schedule.backward.count)
    return replace(schedule, pixels=pixels, pixel_table=table)


MODES: dict[int, Mode] = {degree: mode for mode, degree in DEGREES.items()}  # of a shape


def random_program(rng: Generator, shape: SequencerShape, axis: str, schedule: Schedule, kind: Kind) -> Program:
    """Words over the whole range, gains of either sign.

    A wild one clamps and is held back, a tame one does neither. The guard of a smooth one lets its own largest step
    pass and no larger one: a device catches up with it. That of a held one lets half of it pass.
    """
    interpolated, index_bits, bits = (
        getattr(shape, f"{axis}_{name}") for name in ("interpolated", "index_bits", "word_bits")
    )
    hold = 1
    period = schedule.ticks
    if axis == "y":
        fits = interpolated or schedule.frame_ticks <= 1 << index_bits
        hold = int(rng.choice([1, schedule.ticks])) if fits else schedule.ticks
        period = schedule.lines if hold != 1 else schedule.frame_ticks
    length = 1 << index_bits if interpolated else period
    half = 1 << (bits - 1)
    words = rng.integers(-half, half, length)
    top = (1 << shape.dac_bits) - 1
    gain_q = 16 + bits + guard_bits(bits) - shape.dac_bits
    if kind != "wild":
        words = words // 4
        gain, offset = (
            int(rng.integers(-(1 << 15), 1 << 15)),
            int(rng.integers(top // 4 << gain_q, top * 3 // 4 << gain_q)),
        )
        low, high, step = 0, top, top
    else:
        gain = int(rng.choice([-(1 << 17), (1 << 17) - 1, int(rng.integers(-(1 << 17), 1 << 17))]))
        offset = int(rng.integers(-(1 << 10), (top << gain_q) + (1 << 10)))
        low, high = sorted(int(code) for code in rng.integers(0, top + 1, 2))
        step = int(rng.choice([1, top, int(rng.integers(1, top + 1)), int(rng.integers(1, 64))]))
    output = Output(
        gain_word=gain,
        gain_q=gain_q,
        offset_word=offset,
        code_min=low,
        code_max=high,
        max_step=step,
        park_code=int(rng.integers(low, high + 1)),
        dac_bits=shape.dac_bits,
        coding="offset-binary",
        align="right",
        word_bits=shape.dac_bits,
    )
    program = Program(RationalPhase(period), hold, MODES[interpolated], bits, words, output)
    if kind not in ("smooth", "held"):
        return program
    codes = program.codes(np.arange(program.ticks))
    largest = int(np.max(np.abs(codes - np.roll(codes, 1))))
    return replace(program, output=replace(output, max_step=max(largest if kind == "smooth" else largest // 2, 1)))


def extreme(rng: Generator, program: Program) -> Program:
    """The tame program with words at both ends of their range, and a gain that is as much less."""
    half = 1 << (program.bits - 1)
    words = rng.choice(np.array([-half, half - 1]), len(program.words))
    return replace(program, words=words, output=replace(program.output, gain_word=program.output.gain_word // 4))


def shaped(rng: Generator, program: DualProgram, highest: int) -> DualProgram:
    """The program with an order of its own for each axis, up to the highest; the guard stays as it is."""
    axes = {}
    for axis in ("x", "y"):
        order = int(rng.integers(highest + 1))
        zero = int(rng.choice([0, 1, 64, 127, 128, int(rng.integers(129))])) if order == 3 else 0
        own: Program = getattr(program, axis)
        axes[axis] = replace(own, output=replace(own.output, shaping=Shaping(order, zero)))
    return replace(program, **axes)


def random_fourier(rng: Generator, harmonics: int) -> FourierWords:
    """Words whose magnitudes sum to less than the 4.0 that the accumulator holds, half the time with clipped peaks."""
    words = rng.integers(-(1 << 31), 1 << 31, 2 * harmonics + 1)
    most = float(rng.choice([0.9, 3.9])) * 2**30
    words = np.trunc(words * min(most / float(np.sum(np.abs(words))), 1.0)).astype(np.int64)
    return FourierWords(int(words[0]), words[1 : harmonics + 1], words[harmonics + 1 :])


def rendered(program: Program, words: FourierWords) -> Program:
    """The program with the table that a device makes of Fourier words."""
    return replace(program, words=synthesize(words, len(program.words), program.bits))


def random_dual(
    rng: Generator,
    shape: SequencerShape,
    ticks: tuple[int, int] = (8, 40),
    tame: bool = False,
    kind: Kind = "wild",
    lines: tuple[int, int] = (1, 5),
) -> DualProgram:
    """Both axes and their schedule; ``ticks`` of a line and ``lines`` of a frame are inclusive bounds."""
    kind = "tame" if tame else kind
    longest = ticks[1]
    if not shape.x_interpolated:
        longest = min(longest, 1 << shape.x_index_bits)
    most = lines[1]
    if not shape.y_interpolated:
        most = min(most, 1 << shape.y_index_bits)
    schedule = random_schedule(rng, int(rng.integers(ticks[0], longest + 1)), int(rng.integers(lines[0], most + 1)))
    return DualProgram(
        random_program(rng, shape, "x", schedule, kind),
        random_program(rng, shape, "y", schedule, kind),
        schedule,
    )
