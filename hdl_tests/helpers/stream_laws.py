"""What a swap must never do, read off a capture by itself: no model of the sequencer is in here.

All that is taken from elsewhere is which programs were committed, in order, and what one of them plays by itself on
tick k of its own line and frame.
"""

from collections.abc import Sequence

import numpy as np
from stream_scripts import codes, flag

from tablegen.device.dual_program import DualProgram
from tablegen.verification.play.stream import Words


class Broken(Exception):
    """A law was; says which and on which tick."""


def _programs_by_tick(capture: Words, programs: Sequence[DualProgram]) -> np.ndarray:
    """The index of the program that plays on every tick, -1 before the first: each swap is one more."""
    index = np.cumsum(flag(capture, "swapped")) - 1
    if len(index) and index[-1] + 1 != len(programs):
        raise Broken(f"{index[-1] + 1} swaps for {len(programs)} programs")
    return index


def steps_are_limited(capture: Words, programs: Sequence[DualProgram]) -> None:
    """No code is further from the one before than the program that plays allows, in any state."""
    index = _programs_by_tick(capture, programs)
    for axis in ("x", "y"):
        limits = np.array([0, *(getattr(program, axis).output.max_step for program in programs)])
        steps = np.abs(np.diff(codes(capture, axis)))
        wrong = np.flatnonzero(steps > limits[index + 1][1:])
        if len(wrong):
            raise Broken(f"tick {wrong[0] + 1}: {axis} steps by {steps[wrong[0]]}")


def follow_their_programs(capture: Words, programs: Sequence[DualProgram]) -> None:
    """Of one scan without end: programs change at line starts, on both axes, and from line 0 of the new program.

    The programs are smooth. A code is that of its own program, or on its way there by the largest step; once it has
    been there it stays; only where both are there anything is valid.
    """
    playing = np.flatnonzero(flag(capture, "playing"))
    index = _programs_by_tick(capture, programs)
    capture, index = capture[playing[0] :], index[playing[0] :]
    if not np.all(flag(capture, "playing")):
        raise Broken("the scan stops")
    begins = np.flatnonzero(np.diff(index, prepend=-1))
    line, frame, valid = (flag(capture, name) for name in ("line", "frame", "valid"))
    for start, stop in zip(begins, [*begins[1:], len(capture)], strict=True):
        program = programs[index[start]]
        schedule = program.schedule
        k = np.arange(stop - start)
        if stop != len(capture) and (stop - start) % schedule.ticks:
            raise Broken(f"tick {stop}: a swap after {(stop - start) % schedule.ticks} ticks of a line")
        if not np.array_equal(line[start:stop], k % schedule.ticks == 0):
            raise Broken(f"tick {start} and on: lines do not start where they should")
        if not np.array_equal(frame[start:stop], k % schedule.frame_ticks == 0):
            raise Broken(f"tick {start} and on: frames do not start where they should")
        there = np.ones(stop - start, dtype=bool)
        for axis, period in (("x", schedule.ticks), ("y", schedule.frame_ticks)):
            axis_program = getattr(program, axis)
            wanted = axis_program.codes(np.arange(period))[k % period]
            code = codes(capture[start:stop], axis)
            before = np.append(codes(capture[max(start - 1, 0) :][:1], axis), code[:-1])
            arrived = code == wanted
            step = axis_program.output.max_step
            on_the_way = code - before == np.sign(wanted - before) * step
            if start == 0:
                on_the_way[0] = True  # from where the capture does not say
            wrong = ~(arrived | on_the_way) | (~arrived & np.logical_or.accumulate(arrived))
            if np.any(wrong):
                raise Broken(f"tick {start + int(np.argmax(wrong))}: {axis} is not that of its program")
            there &= arrived
        if np.any(valid[start:stop] & ~there):
            raise Broken(f"tick {start} and on: valid before both axes are there")
