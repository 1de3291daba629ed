"""Images for devices: of random programs, as tables and as Fourier words, and damaged with a CRC that fits."""

import zlib

import numpy as np
from c_scripts import shaped
from frame_programs import common_knots, scan_program, shaped_scan
from numpy.random import Generator
from programs import Kind, random_dual, random_fourier, random_schedule, rendered
from replacing import replace

from tablegen.device.dual_program import AxisProgram, DualProgram, ScanProgram
from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS, SCAN_WORDS, SLOW_WORDS
from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.frame_program import FrameProgram, played_extremes
from tablegen.link.messages import AxisLimits
from tablegen.link.program_image import PROGRAM_BYTES, ProgramImage, make_image, parts_of
from tablegen.numerics.arrays import Ints
from tablegen.verification.play.sequencer_shape import SequencerShape

SCAN_PLACES = [SCAN_WORDS.index(name) for name in SCAN_WORDS]
AXIS_PLACES = [
    page * PAGE_WORDS + AXIS_WORDS.index(name) for page in (1, 2) for name in AXIS_WORDS if name != "harmonics"
]


SLOW_PLACES = [page * PAGE_WORDS + len(AXIS_WORDS) + at for page in (1, 2) for at in range(1, len(SLOW_WORDS))]


def digest(rng: Generator) -> str:
    """What names a plan."""
    return bytes(rng.integers(0, 256, 32, dtype=np.uint8).tolist()).hex()


def random_image(
    rng: Generator, shape: SequencerShape, harmonics: int = 0, kind: Kind = "smooth", order: int = 0
) -> tuple[ProgramImage, DualProgram]:
    """An image and the program in it; with ``harmonics`` some axes are Fourier words, where they are interpolated.

    With an ``order`` both axes are shaped up to it, some of them with less room for their steps than that needs.
    """
    program = random_dual(rng, shape, kind=kind)
    words: dict[str, Ints | None] = {"x": None, "y": None}
    for axis, interpolated in (("x", shape.x_interpolated), ("y", shape.y_interpolated)):
        if harmonics and interpolated and rng.random() < 0.7:
            fourier = random_fourier(rng, int(rng.integers(1, harmonics + 1)))
            changed = rendered(getattr(program, axis), fourier)
            program = replace(program, **{axis: _guarded(changed)})
            words[axis] = fourier.in_order
    if order:
        program = shaped(rng, program, order)
        for axis in "xy":
            output = getattr(program, axis).output
            room = output.shaping.step_excess - int(rng.random() < 0.2)
            output = replace(output, max_step=max(output.max_step + room, 1))
            program = replace(program, **{axis: replace(getattr(program, axis), output=output)})
    return make_image(program, digest(rng), words["x"], words["y"]), program


def random_slow_program(rng: Generator, shape: SequencerShape, order: int = 0) -> ScanProgram:
    """A small program with a slow part of one axis or of both; in two of three its limits are those of its codes.

    With an ``order`` both axes are shaped up to it.
    """
    schedule = replace(random_schedule(rng, int(rng.choice([1, 9, 40, 90])), 1), lines=int(rng.choice([1, 2, 5, 12])))
    slow, kind = str(rng.choice(["xy", "xy", "x", "y"])), str(rng.choice(["smooth", "smooth", "wild"]))
    program = common_knots(rng, scan_program(rng, shape, schedule, slow, kind))
    if order:
        program = shaped_scan(rng, program, order)
    if rng.random() < 0.3:
        return program
    return replace(program, x=_fitted(rng, program.x), y=_fitted(rng, program.y))


def random_z_program(rng: Generator, shape: SequencerShape, schedule: Schedule) -> ScanProgram:
    """A program for a second sequencer, of this schedule; mostly of two slow parts, as that of z is."""
    slow, kind = str(rng.choice(["xy", "xy", "xy", "x", "y"])), str(rng.choice(["smooth", "smooth", "smooth", "wild"]))
    program = common_knots(rng, scan_program(rng, shape, replace(schedule, pixel_table=None), slow, kind))
    if rng.random() < 0.2:
        return program
    return replace(program, x=_fitted(rng, program.x), y=_fitted(rng, program.y))


def _fitted(rng: Generator, axis: AxisProgram) -> AxisProgram:
    """The axis with the range and the step of its codes, or a little more or less."""
    if not isinstance(axis, FrameProgram):
        return replace(axis, output=_guarded(axis).output)
    top = (1 << axis.output.dac_bits) - 1
    small = replace(axis.gains, words=axis.gains.words // 4), replace(axis.ratios, words=axis.ratios.words // 8)
    axis = replace(axis, gains=small[0], ratios=small[1])
    least, most, step = played_extremes(axis)
    slack = int(rng.choice([0, 0, 0, 1, 50, -1]))
    code_min, code_max = min(max(least - slack, 0), top), max(min(most + slack, top), 0)
    output = replace(
        axis.output,
        code_min=min(code_min, code_max),
        code_max=code_max,
        park_code=code_max,
        max_step=max(min(step + slack, (1 << 24) - 1), 1),
    )
    return replace(axis, fast=replace(axis.fast, output=output))


def _guarded(program):  # type: ignore[no-untyped-def]
    """A gain and an offset that keep the codes inside, and a guard that lets the largest step pass."""
    output = program.output
    top = (1 << output.dac_bits) - 1
    output = replace(output, gain_word=1 << 14, offset_word=(top // 2) << output.gain_q, code_min=0, code_max=top)
    program = replace(program, output=replace(output, park_code=min(max(output.park_code, 0), top)))
    codes = program.rounded.codes(np.arange(program.ticks))
    largest = int(np.max(np.abs(codes - np.roll(codes, 1)))) + output.shaping.step_excess
    return replace(program, output=replace(program.output, max_step=max(largest, 1)))


def resealed(image: ProgramImage, data: bytes) -> ProgramImage:
    """An image with other bytes and a CRC that fits them."""
    return ProgramImage(replace(image.info, image_crc=zlib.crc32(data)), data)


def _other_word(rng: Generator, word: int, bits: int) -> int:
    """Near a word, or far from it."""
    mask = (1 << bits) - 1
    how = int(rng.integers(0, 6))
    if how == 0:
        return word ^ 1 << int(rng.integers(0, bits))
    if how == 1:
        return int(rng.integers(0, mask + 1))
    if how == 2:
        return int(rng.choice([0, 1, mask, mask >> 1, (mask >> 1) + 1]))
    return (word + int(rng.choice([-1, 1])) * int(rng.choice([1, 1, 2, 7, 100, 3000]))) & mask


def damaged(rng: Generator, image: ProgramImage) -> ProgramImage:
    """An image with some words changed, as if somebody meant it; of the same length."""
    data = bytearray(image.data)
    for _ in range(int(rng.choice([1, 1, 1, 2, 5]))):
        rest = len(data) - PROGRAM_BYTES
        if rng.random() < 0.5:
            places = SCAN_PLACES if rng.random() < 0.2 else AXIS_PLACES
            at, size = 4 * int(rng.choice(places)), 4
        else:
            size = int(rng.choice([1, 2, 4]))
            at = PROGRAM_BYTES + int(rng.integers(0, rest - size + 1))
        word = int.from_bytes(data[at : at + size], "little")
        data[at : at + size] = _other_word(rng, word, 8 * size).to_bytes(size, "little")
    return resealed(image, bytes(data))


def damaged_slow(rng: Generator, image: ProgramImage) -> ProgramImage:
    """An image with a slow part and some words changed, half of them those of the slow part; of the same length."""
    if rng.random() < 0.5:
        return damaged(rng, image)
    data, words = bytearray(image.data), np.frombuffer(image.data, "<u4", PROGRAM_BYTES // 4).tolist()
    at, size = 4 * int(rng.choice(SLOW_PLACES)), 4
    if rng.random() < 0.6:
        x, y = (parts_of(words, page, shape) for page, shape in ((1, image.info.x), (2, image.info.y)))
        parts, at = [*x, *y], PROGRAM_BYTES
        number = int(rng.choice([at for at, part in enumerate(parts) if part.name in ("slow table", "gain")]))
        at += sum(part.length * part.size for part in parts[:number])
        size = parts[number].size
        at += size * int(rng.integers(0, parts[number].length))
    word = int.from_bytes(data[at : at + size], "little")
    data[at : at + size] = _other_word(rng, word, 8 * size).to_bytes(size, "little")
    return resealed(image, bytes(data))


def random_limits(rng: Generator, program: ScanProgram) -> tuple[AxisLimits, AxisLimits]:
    """Limits around what a program needs, now and then less."""
    limits = []
    for axis in (program.x, program.y):
        output = axis.output
        slack = int(rng.choice([0, 0, 1, 1000, 1 << 24])) - (rng.random() < 0.1)
        code_min = max(output.code_min - slack, 0) + int(rng.choice([0, 0, 40]))
        code_max = output.code_max + slack - int(rng.choice([0, 0, 40]))
        limits.append(
            AxisLimits(
                code_min,
                max(min(code_max, (1 << output.dac_bits) - 1), code_min),
                max(output.max_step + slack, 1),
                int(rng.choice([0, 1, 1 << 24, *rng.integers(0, 1 << output.dac_bits, 4)])),
            )
        )
    return limits[0], limits[1]
