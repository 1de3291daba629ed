"""Short programs beside that of a build: they differ from it in every register, clamp, are held back, and image.

They are made from integers and a sine alone, near the park codes of the build, so that no ramp from one to the other
is long.
"""

from fractions import Fraction
from math import ceil
from typing import Literal

import numpy as np
from msgspec.structs import replace

from tablegen.device.dual_program import DualProgram
from tablegen.device.schedule import Schedule, Window
from tablegen.fixedpoint.interpolation import index_bits_of
from tablegen.fixedpoint.output import GAIN_BITS, UNIT_GAIN_BITS, Output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.shaping import MAXIMUM_ZERO, OFF, Shaping
from tablegen.numerics.arrays import Ints

Kind = Literal["free", "clamped", "held"]
_LEAST_TICKS = 8  # of a line
_RAMP_STEPS = 16  # of the build's own max_step: how far a variation leads at most
_LEAST_CODES = 12  # of its amplitude, unless the converter has fewer
_MAX_STEP = (1 << 24) - 1  # that a sequencer takes
_ROOM = 40  # of a guard above the largest step
_PEAK = 0.9  # of a table's full scale
_LIFTING_GAIN = (1 << (GAIN_BITS - 1)) - 3  # almost twice full scale
_ZERO = 45  # of a shaping of order 3: no power of 2


def variation(own: DualProgram, kind: Kind, bank: int, longer: int = 0) -> DualProgram:
    """Vary a program for the device of ``own``: tables of a bank, 0 or 1, lines ``longer`` by so many ticks.

    A ``free`` one neither clamps nor is held back, and images both ways. A ``clamped`` one is held at both limits of
    both axes, a ``held`` one by the slew guard, up and down. ``held`` ones step y once a line, and so does the
    ``clamped`` one of bank 1, whose two lines are the largest step of a phase. For a device that shapes, they
    have all orders that it has.
    """
    x_words = _room(own.x)
    ticks = min(_LEAST_TICKS + {"free": 24, "clamped": 21, "held": 23}[kind] + longer, x_words)
    lines = min({"free": 3, "clamped": 2, "held": 4}[kind], _room(own.y))
    steps = (
        kind == "held"
        or (kind == "clamped" and bank == 1)
        or (kind == "free" and longer > 0)
        or lines * ticks > _room(own.y)
    )
    schedule = _schedule(kind, bank, ticks, lines)
    y_phase, hold = RationalPhase(lines if steps else lines * ticks), ticks if steps else 1
    highest = max(own.x.output.shaping.order, own.y.output.shaping.order)
    x_shaping, y_shaping = _shapings(highest, kind, bank)
    return DualProgram(
        _axis(own.x, RationalPhase(ticks), 1, kind, bank, x_shaping, roomy=longer > 0),
        _axis(own.y, y_phase, hold, kind, bank, y_shaping, roomy=longer > 0),
        schedule,
    )


def _shapings(highest: int, kind: Kind, bank: int) -> tuple[Shaping, Shaping]:
    """Return shapings of x and y on a device of this highest order: over all variations each order and none occur."""
    x = {"free": highest, "clamped": highest - 1, "held": highest - 2}[kind] - bank
    every = [OFF, Shaping(1), Shaping(2), Shaping(3, (MAXIMUM_ZERO, _ZERO)[bank])][: highest + 1]
    return every[x % len(every)], every[(x + 1) % len(every)]


def _room(own: Program) -> int:
    """Return how many advances a period may have: a word each in a direct table, as long as the device's memory."""
    return 1 << 16 if own.mode != "direct" else 1 << max(index_bits_of(len(own.words)), 3)


def _schedule(kind: Kind, bank: int, ticks: int, lines: int) -> Schedule:
    """Return a schedule whose sweeps both image, on the last line and the one before it.

    A ``free`` one of bank 0 settles for all lines but the last; of bank 1 it images at once, on its first tick, and all
    of it is the sweep back. Windows of a ``clamped`` one end with the line, a ``held`` one has empty windows.
    """
    turn, count = ticks // 2 + 1, ticks * 3 // 8 - 1
    at_once, last = kind == "free" and bank == 1, max(lines - 1, 0)
    backward = {
        "free": Window(turn + 1, count - 1),
        "clamped": Window(turn + 1, ticks - turn - 1),
        "held": Window(2 + count // 2, 0),  # where the other sweep images
    }[kind]
    return Schedule(
        ticks=ticks,
        lines=lines,
        update_rate_hz=Fraction(1),
        requested_hz=1.0,
        pixels=max(count // 3 if at_once else count * 2 // 3, 1),
        settle_lines={"free": 0 if bank else last, "clamped": 0, "held": 2}[kind],
        turn_tick=0 if at_once else turn,
        forward=Window(0 if at_once else 1, count),
        backward=backward,
        turn_line=max(last, 1),
        up=Window(0 if at_once else max(last - 1, 0), 0 if kind == "held" else 1),
        down=Window(last, 1) if lines > 1 else Window(0, 0),
    )


def _axis(
    own: Program, phase: RationalPhase, hold: int, kind: Kind, bank: int, shaping: Shaping, roomy: bool
) -> Program:
    """Return the program of one axis; the guard of a ``roomy`` one is far above its steps, as that of a build is."""
    room = ceil(shaping.excess) if shaping.order else 0
    gain, middle = _gain(own.output, room)
    words, lifted = _words(own, phase.ticks, bank), bank == 1 and _is_lifted(own)
    gain_q = own.output.gain_q
    # Nobody's gain or offset: the sign and the bits below a code are others in each bank.
    offset = (middle << gain_q) + (((2 * bank + 1) << gain_q) // 5)
    if lifted:
        gain = _LIFTING_GAIN
        flat = Program(phase, hold, own.mode, own.bits, np.full_like(words, _lift(own)), _unlimited(own.output))
        offset += gain * int(flat.samples(np.zeros(1, dtype=np.int64))[0])
    wide = replace(own.output, gain_word=-gain if bank else gain, offset_word=offset, shaping=OFF)
    free = Program(phase, hold, own.mode, own.bits, words, _unlimited(wide))
    codes = free.codes(np.arange(free.ticks, dtype=np.int64))
    low, high = int(codes.min()), int(codes.max())
    largest = max(int(np.max(np.abs(codes - np.roll(codes, 1)))), 1)
    rest = (high - low) // 4 if kind == "clamped" else 0
    output = replace(
        wide,
        code_min=low + rest if rest else max(low - 3 - bank - room, 0),
        code_max=high - rest if rest else min(high + 5 + bank + room, (1 << wide.dac_bits) - 1),
        max_step=max(largest // 3, 1)
        if kind == "held"
        else min((_ROOM if roomy else 1) * largest + 3 + shaping.step_excess, _MAX_STEP),
        shaping=shaping,
        park_code=low + (high - low) * (2 + bank) // 6,
    )
    return replace(free, output=replace(output, park_code=min(max(output.park_code, output.code_min), output.code_max)))


def _words(own: Program, advances: int, bank: int) -> Ints:
    """Return the words of two harmonics, other ones for each bank; over most of full scale, or about code edges."""
    length = len(own.words) if own.mode != "direct" else advances
    t = np.arange(length) / length
    shape = np.sin(2.0 * np.pi * t + 1.0 + bank) + 0.25 * np.sin(6.0 * np.pi * t + 0.3)
    half = 1 << (own.bits - 1)
    if bank == 1 and _is_lifted(own):
        small: Ints = np.rint(_lift(own) + _lifted_words(own) / 1.25 * shape).astype(np.int64)
        return small
    words: Ints = np.rint(_PEAK * half / 1.25 * shape).astype(np.int64)
    return words


def _lifted_words(own: Program) -> float:
    """Return the amplitude in words of a table whose gain is ``_LIFTING_GAIN``."""
    gain, _ = _gain(own.output, 0)
    return gain * _PEAK * (1 << (own.bits - 1)) / _LIFTING_GAIN


def _is_lifted(own: Program) -> bool:
    """Test whether the table has words enough for a variation whose offset is negative."""
    lifted = -_lift(own) / (1 << (own.bits - 1))  # share of the converter's range, since the gain is almost 2
    return _lifted_words(own) >= _LEAST_CODES and own.output.park_code < (lifted - 0.1) * (1 << own.output.dac_bits)


def _lift(own: Program) -> int:
    """Return the mean of words that a negative gain lifts so far that only a negative offset takes them back."""
    return ceil(_lifted_words(own)) + 2 - (1 << (own.bits - 1))


def _gain(output: Output, room: int) -> tuple[int, int]:
    """Choose a gain whose codes are few steps of the build from its park code; return it and their middle.

    At least ``room`` codes are left to the converter's ends.
    """
    top = (1 << output.dac_bits) - 1
    amplitude = max(min(top // 5, _RAMP_STEPS * output.max_step), min(_LEAST_CODES, top // 5))
    gain = -(-(amplitude << (UNIT_GAIN_BITS + 1)) // (1 << output.dac_bits))
    gain = min(gain, (1 << (GAIN_BITS - 1)) - 1)
    reach = (gain << output.dac_bits >> (UNIT_GAIN_BITS + 1)) + 1 + room
    return gain, min(max(output.park_code + amplitude // 3, reach), top - reach)


def _unlimited(output: Output) -> Output:
    return replace(output, code_min=0, code_max=(1 << output.dac_bits) - 1)
