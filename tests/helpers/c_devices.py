"""Devices of the C sequencer that the checks of its functions begin with, and simple programs for them."""

from collections.abc import Callable
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from c_library import LOADED, Device, Library, converter_of
from programs import random_dual
from replacing import replace

from tablegen.device.dual_program import DualProgram
from tablegen.device.schedule import Schedule
from tablegen.device.schedule import Window as Lines
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.program import Program
from tablegen.verification.play.sequencer_shape import SequencerShape

SHAPE = SequencerShape(16, 1, 4, 16, 1, 3, 16)


class Libraries(NamedTuple):
    """Words of 16 bits, and of 32."""

    narrow: Library
    wide: Library


Check = Callable[[Libraries], None]


def gentle(seed: int, shape: SequencerShape = SHAPE, **output: object) -> DualProgram:
    """A program that neither clamps nor is held back, once it has caught up; keys are of both output stages."""
    program = random_dual(np.random.default_rng(seed), shape, (40, 60), kind="tame", lines=(3, 3))
    schedule = replace(
        program.schedule, pixels=5, settle_lines=1, turn_tick=25, forward=Lines(3, 20), backward=Lines(26, 12),
        turn_line=2, up=Lines(0, 2), down=Lines(2, 1),
    )  # fmt: skip
    x, y = (
        replace(axis, output=replace(axis.output, **{"max_step": 3000, **output})) for axis in (program.x, program.y)
    )
    return DualProgram(x, y, schedule)


def flat(code: int, schedule: Schedule | None = None, **output: int) -> DualProgram:
    """A program whose codes are all the same; keys are of both output stages."""
    schedule = schedule or Schedule(
        32, 2, Fraction(1000), 1.0, 4, 0, 16, Lines(0, 8), Lines(16, 8), 1, Lines(0, 1), Lines(1, 1)
    )
    stage = Output(1, 20, code << 20, 0, 65535, 65535, 0, 16, "offset-binary", "right", 16)
    words = np.zeros(8, np.int64)
    axes = (
        Program(RationalPhase(ticks), 1, "interpolated", 16, words, replace(stage, **output))
        for ticks in (schedule.ticks, schedule.frame_ticks)
    )
    return DualProgram(*axes, schedule)


def device_for(library: Library, program: DualProgram, power_up: int = 0) -> Device:
    """A device with the converters of a program."""
    return Device(library, *(converter_of(axis.output, power_up) for axis in (program.x, program.y)))


def playing(library: Library, program: DualProgram, frames: int = 0) -> Device:
    """A device that is about to play a program's first tick."""
    device = device_for(library, program)
    assert device.load(program) == LOADED
    assert device.commit()
    device.steps(1)
    assert device.arm(frames)
    assert device.trigger()
    return device
