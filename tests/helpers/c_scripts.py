"""Scripts for the C sequencer: those of the Verilog one, and long smooth lines, on which it plays many ticks at once.

The fast path of the runtime (``dac_axis_run``) plays many ticks with one check where neither clamp nor slew guard can
act. The lines here take it and leave it in every way: at limits, at steps that the guard holds back, at the last word
of a table, at the ends of lines and frames, and where a bank has no runs at all.
"""

import numpy as np
from numpy.random import Generator
from programs import MODES, Kind, random_dual, random_fourier, random_schedule, rendered
from replacing import replace
from stream_configurations import CONFIGURATIONS, SMALL
from stream_scripts import play, random_requests, swaps_at_every_tick, sweep

from tablegen.device.dual_program import DualProgram
from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.shaping import MAXIMUM_ZERO, Shaping
from tablegen.numerics.arrays import Ints
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import Script

LEAST_INDEX_BITS = 3  # of an interpolated table in C; the Verilog has tables of 4 words as well


def shape_in_c(shape: SequencerShape) -> SequencerShape:
    """The shape, or the one nearest to it that the C runtime takes."""
    least = {
        f"{axis}_index_bits": LEAST_INDEX_BITS
        for axis in "xy"
        if getattr(shape, f"{axis}_interpolated") and getattr(shape, f"{axis}_index_bits") < LEAST_INDEX_BITS
    }
    return replace(shape, **least)


IN_C = {name: replace(each, shape=shape_in_c(each.shape)) for name, each in CONFIGURATIONS.items()}
SMALL_IN_C = shape_in_c(SMALL)

# Name: shape, and the bounds of a line's ticks. Beside the usual ones: gains for which there are no runs (a gain_q of
# 4 and of 33), tables with a word a tick, and the longest table.
LONG: dict[str, tuple[SequencerShape, tuple[int, int]]] = {
    "bits_16": (SequencerShape(16, 1, 8, 16, 1, 6, 16), (100, 3000)),
    "bits_8": (SequencerShape(8, 1, 5, 8, 1, 4, 8), (100, 700)),
    "bits_12": (SequencerShape(12, 1, 6, 12, 1, 5, 14), (100, 2000)),
    "bits_20": (SequencerShape(20, 1, 10, 18, 1, 7, 20), (100, 2000)),
    "bits_24": (SequencerShape(24, 1, 9, 24, 1, 7, 24), (100, 2000)),
    "dac_24_words_8": (SequencerShape(24, 1, 6, 8, 1, 5, 8), (100, 700)),
    "dac_8_words_24": (SequencerShape(8, 1, 6, 24, 1, 5, 24), (100, 700)),
    "x_runs_y_does_not": (SequencerShape(8, 1, 6, 12, 1, 5, 24), (100, 700)),
    "direct": (SequencerShape(16, 0, 11, 16, 0, 13, 16), (100, 1200)),
    "longest_table": (SequencerShape(16, 1, 16, 16, 1, 12, 16), (1000, 3000)),
    "many_lines": (SequencerShape(16, 1, 8, 16, 1, 8, 16), (40, 60)),
    "cubic": (SequencerShape(16, 3, 5, 14, 3, 4, 16), (100, 700)),
    "cubic_and_lines": (SequencerShape(20, 3, 6, 21, 1, 5, 18), (100, 700)),
    "cubic_with_few_ticks": (SequencerShape(16, 1, 6, 16, 3, 8, 16), (100, 200)),
}
MANY_LINES = {"many_lines": (300, 400)}  # so that y, held for a line each, steps by little
LONG_PERIODS = SequencerShape(16, 1, 8, 16, 1, 16, 16)
STEEP = ("exact", "one less", "half", "twice", "wide", "all", "one")
LIMITS = ("all", "tight", "cut", "one code")


def long_program(rng: Generator, shape: SequencerShape, axis: str, schedule: Schedule) -> Program:
    """A smooth wave of few harmonics, its limits and its largest step anywhere about where the wave needs them."""
    interpolated, index_bits, bits = (
        getattr(shape, f"{axis}_{name}") for name in ("interpolated", "index_bits", "word_bits")
    )
    hold, period = 1, schedule.ticks
    if axis == "y":
        fits = interpolated or schedule.frame_ticks <= 1 << index_bits
        hold = int(rng.choice([1, schedule.ticks])) if fits else schedule.ticks
        period = schedule.lines if hold != 1 else schedule.frame_ticks
    length = 1 << index_bits if interpolated else period
    half, top = 1 << (bits - 1), (1 << shape.dac_bits) - 1
    t = np.arange(length) / length
    wave = sum(np.cos(2 * np.pi * (n * t + rng.random())) * rng.random() / n for n in range(1, 4))
    wave = np.asarray(wave) / max(float(np.max(np.abs(wave))), 1e-9) * rng.choice([0.9, 0.999, 0.3, 0.01])
    words = np.clip(np.floor(wave * half + 0.5), -half, half - 1).astype(np.int64)
    gain_q = 16 + bits + guard_bits(bits) - shape.dac_bits
    gain = int(rng.choice([-1, 1])) * int(rng.choice([1 << 14, (1 << 16) - 1, int(rng.integers(1, 1 << 16)), 5]))
    output = Output(
        gain_word=gain,
        gain_q=gain_q,
        offset_word=int(rng.integers(top // 3 << gain_q, top * 2 // 3 << gain_q)),
        code_min=0,
        code_max=top,
        max_step=top,
        park_code=0,
        dac_bits=shape.dac_bits,
        coding="offset-binary",
        align="right",
        word_bits=shape.dac_bits,
    )
    program = Program(RationalPhase(period), hold, MODES[interpolated], bits, words, output)
    codes = program.codes(np.arange(program.ticks))
    low, high = within_limits(rng, codes, top)
    step = step_about(rng, codes, top)
    park = int(rng.choice([low, high, (low + high) // 2]))
    return replace(program, output=replace(output, code_min=low, code_max=high, max_step=step, park_code=park))


def within_limits(rng: Generator, codes: Ints, top: int) -> tuple[int, int]:
    lowest, highest = int(np.min(codes)), int(np.max(codes))
    match str(rng.choice(LIMITS, p=[0.4, 0.3, 0.25, 0.05])):
        case "tight":
            return lowest, highest
        case "cut":
            return int(np.quantile(codes, 0.1)), int(np.quantile(codes, 0.95))
        case "one code":
            return highest, highest
        case _:
            return 0, top


def step_about(rng: Generator, codes: Ints, top: int) -> int:
    largest = int(np.max(np.abs(codes - np.roll(codes, 1))))
    steps = dict(zip(STEEP, (largest, largest - 1, largest // 2, 2 * largest, 40 * largest, top, 1), strict=True))
    return min(max(steps[str(rng.choice(STEEP))], 1), top)


def long_dual(
    rng: Generator, shape: SequencerShape, ticks: tuple[int, int], lines: tuple[int, int] = (1, 5)
) -> DualProgram:
    """Both axes of it."""
    longest = ticks[1] if shape.x_interpolated else min(ticks[1], 1 << shape.x_index_bits)
    schedule = random_schedule(rng, int(rng.integers(ticks[0], longest + 1)), int(rng.integers(lines[0], lines[1] + 1)))
    return DualProgram(long_program(rng, shape, "x", schedule), long_program(rng, shape, "y", schedule), schedule)


def wave_program(shape: SequencerShape, codes: int, ticks: int = 499) -> DualProgram:
    """A sine of so many codes up and down on both axes, slow enough for runs."""
    rng = np.random.default_rng(0)
    schedule = replace(random_schedule(rng, ticks, 1), lines=1)
    axis = long_program(rng, replace(shape, y_index_bits=shape.x_index_bits), "x", schedule)
    half = 1 << shape.x_word_bits - 1
    t = np.arange(len(axis.words)) / len(axis.words)
    words = np.floor(0.99 * half * np.sin(2 * np.pi * t) + 0.5).astype(np.int64)
    output = replace(axis.output, gain_word=codes * 2, offset_word=20000 << axis.output.gain_q, max_step=40)
    axis = replace(axis, words=words, output=output)
    return DualProgram(axis, replace(axis, words=np.roll(words, 3)), schedule)


def any_shaping(rng: Generator, output: Output, order: int = 3) -> Output:
    """The output with any shaping up to an order, off too."""
    of = int(rng.integers(0, order + 1))
    zero = int(rng.choice([0, MAXIMUM_ZERO, rng.integers(0, MAXIMUM_ZERO + 1)])) if of == 3 else 0
    return replace(output, shaping=Shaping(of, zero))


def shaped(rng: Generator, program: DualProgram, order: int = 3) -> DualProgram:
    """The program with any shaping of both axes up to an order, off too."""
    x, y = (replace(axis, output=any_shaping(rng, axis.output, order)) for axis in (program.x, program.y))
    return replace(program, x=x, y=y)


def long_play(name: str, samples: int, seed: int = 0, order: int = 0) -> Script:
    """Long lines back to back, with requests at any tick; shaped up to an order."""
    shape, ticks = LONG[name]
    rng = np.random.default_rng([seed, *name.encode()])
    script = Script()
    script.tick_every(1)
    while len(script.expected) < samples:
        program = long_dual(rng, shape, ticks, MANY_LINES.get(name, (1, 5)))
        if order:
            program = shaped(rng, program, order)
        script.request("withdraw")
        quiet = len(program.x.words) > 2000 or rng.random() < 0.5
        script.tick_every(0 if quiet else 1)
        script.load(program)
        script.tick_every(1)
        script.request("commit", program=program)
        if not script.model.running:
            script.wait_ticks(3)
            script.request("arm", "trigger", frames=int(rng.choice([0, 0, 1, 2])))
        for _ in range(int(rng.integers(1, 4))):
            script.wait(int(rng.integers(1, 3 * max(program.schedule.ticks, 600))))
            if rng.random() < 0.3:
                random_requests(rng, script)
    return script


def shaped_short_lines(shape: SequencerShape, samples: int, order: int = 3) -> Script:
    """Random programs of all kinds, shaped, that take each other's place while they play."""
    rng, script = np.random.default_rng([order, shape.dac_bits]), Script()
    script.tick_every(1)
    kinds: tuple[Kind, ...] = ("wild", "tame", "smooth", "held")
    while len(script.expected) < samples:
        program = shaped(rng, random_dual(rng, shape, kind=kinds[int(rng.integers(0, 4))]), order)
        script.request("withdraw")
        script.load(program)
        script.request("commit", program=program)
        script.wait_ticks(3)
        script.request("arm", "trigger", frames=int(rng.choice([0, 1])))
        script.wait(int(rng.integers(1, 400)))
    return script


def refused_by_y(samples: int) -> Script:
    """Shaped lines whose y jumps in the middle of runs of x, which x has to take back."""
    shape, rng, script = LONG["many_lines"][0], np.random.default_rng(8), Script()
    script.tick_every(1)
    while len(script.expected) < samples:
        program = shaped(rng, wave_program(shape, 900, int(rng.integers(1500, 2500))))
        words = np.zeros(len(program.y.words), np.int64)
        words[int(rng.integers(30, 200)) :] = 20000
        play(script, replace(program, y=replace(program.y, words=words)))
        script.wait_ticks(3 * program.schedule.ticks)
        script.request("park")
        script.wait_ticks(2000)
    return script


def catching_up(script: Script, program: DualProgram) -> None:
    """Runs and steps in turn: stopped and started again all along a line."""
    play(script, program)
    for tick in range(0, program.schedule.ticks, 7):
        script.wait_ticks(tick + 1)
        script.request("park")
        script.wait_ticks(tick % 40)
        script.request("arm", "trigger")


def long_periods(ticks: int, lines: int, samples: int = 20_000) -> Script:
    """A frame so long that the table of y has thousands of ticks a word; the longest have no runs."""
    shape, script, rng = LONG_PERIODS, Script(), np.random.default_rng(lines)
    script.tick_every(1)
    schedule = replace(random_schedule(rng, ticks, 1), lines=lines)
    x = long_program(rng, shape, "x", schedule)
    output = replace(x.output, gain_word=1 << 15, code_min=0, code_max=65535, max_step=2000, park_code=0)
    words = rng.integers(-(1 << 15), 1 << 15, 1 << shape.y_index_bits)
    y = Program(RationalPhase(schedule.frame_ticks), 1, "interpolated", 16, words, output)
    play(script, DualProgram(x, y, schedule))
    script.wait_ticks(samples)
    return script


def every_tick(shape: SequencerShape) -> Script:
    """A swap at every tick of lines longer than a run."""
    rng, script = np.random.default_rng(5), Script()
    script.tick_every(1)
    pair = [long_dual(rng, shape, (40, 90), lines=(2, 3)) for _ in range(2)]
    swaps_at_every_tick(script, (pair[0], pair[1]))
    return script


def renderings(shape: SequencerShape, programs: int, harmonics: int) -> Script:
    """Programs of which one axis or both are rendered from Fourier words, one after the other."""
    rng, script = np.random.default_rng(harmonics), Script()
    script.tick_every(1)
    for _ in range(programs):
        program = random_dual(rng, shape, kind="tame" if rng.random() < 0.5 else "wild")
        x, y = (random_fourier(rng, int(rng.integers(1, harmonics + 1))) if rng.random() < 0.8 else None for _ in "xy")
        program = replace(
            program,
            x=rendered(program.x, x) if x else program.x,
            y=rendered(program.y, y) if y else program.y,
        )
        script.load(program, x, y)
        script.request("commit", "arm", program=program)
        script.wait(3)
        script.request("trigger", "clear_faults")
        script.wait(150)
    return script


def everything(shape: SequencerShape, seed: int, samples: int = 1500) -> Script:
    """All that a host may ask."""
    return sweep(np.random.default_rng(seed), shape, samples)
