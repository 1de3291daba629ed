"""Programs in which x, y or both rest, one after the other in a running scan, and what they have to play."""

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from programs import random_dual
from replacing import replace
from stream_laws import follow_their_programs
from stream_scripts import codes, flag, play

from tablegen.device.dual_program import DualProgram
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import Script, Words

AXES = ("", "x", "xy", "y", "x")  # at rest in each program of a script: an image, a line along y, a point, a line, ...


def at_rest(program: DualProgram, axes: str) -> DualProgram:
    """Return the program with tables of zeros on some axes, whose codes are then those of their offsets."""
    words = {axis: np.zeros_like(getattr(program, axis).words) for axis in axes}
    return replace(program, **{axis: replace(getattr(program, axis), words=zeros) for axis, zeros in words.items()})


def rest_script(
    rng: Generator, script: Script, shape: SequencerShape, pace: int, ticks: tuple[int, int] = (12, 20)
) -> list[DualProgram]:
    """Play programs of ``AXES``, each for some frames, in one scan; return them. A line has so many ticks."""
    programs = [at_rest(random_dual(rng, shape, ticks, kind="smooth", lines=(2, 4)), axes) for axes in AXES]
    script.tick_every(pace)
    play(script, programs[0])
    script.wait_ticks(4 * programs[0].schedule.frame_ticks)
    for program in programs[1:]:
        script.load(program)
        script.request("commit", program=program)
        script.wait_ticks(4 * program.schedule.frame_ticks + 20)
    return programs


def check_rest(capture: Words, programs: Sequence[DualProgram]) -> None:
    """Hold a capture against the programs, without the model: an axis at rest has one code, the other one moves."""
    follow_their_programs(capture, programs)
    begins = [*np.flatnonzero(flag(capture, "swapped")), len(capture)]
    for program, axes, start, stop in zip(programs, AXES, begins[:-1], begins[1:], strict=True):
        frame = capture[max(start, stop - program.schedule.frame_ticks) : stop]
        for axis in "xy":
            played = set(codes(frame, axis).tolist())
            offset = getattr(program, axis).output.code(np.zeros(1, dtype=np.int64))
            assert (played == set(offset.tolist())) == (axis in axes), (axes, axis)
