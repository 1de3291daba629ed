"""What is played to verify a build: power-up, a start, frames, a swap in mid-frame, and a park."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tablegen.device.dual_program import DualProgram
from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS
from tablegen.verification.placement import Placement
from tablegen.verification.stream import FLAGS, PROGRAM, X_FOURIER, X_TABLE, Y_TABLE, Script

_REQUEST_SPACING_TICKS = 8  # ticks between the requests of the beginning
VARIATION = 1  # as the argument of a commit: which program
_SWAPPED_BIT = 48 + FLAGS.index("swapped")  # bit of a captured tick
_CATCH_UP_STRIDE = 64  # ticks after which it is seen whether an output has caught up


@dataclass(frozen=True)
class Memories:
    """The words of a bank as they stand in the memory files: of x and y the table, or what it is rendered from."""

    program: Sequence[int]
    x: Sequence[int]
    y: Sequence[int]
    x_harmonics: int = 0  # where x has Fourier words
    y_harmonics: int = 0


@dataclass(frozen=True)
class BuildSession:
    """A script, and how far it came with the ticks that it was given."""

    script: Script
    whole_frame: bool
    swapped_in_frame: bool
    own: int | None  # so many ticks are of the program itself, then a variation of it plays; None if it never does


def needed_ticks(program: DualProgram) -> int:
    """Ticks in which a session plays a whole frame and all the rest."""
    schedule = program.schedule
    ramp = max(
        -(-(axis.output.code_max - axis.output.code_min) // axis.output.max_step) for axis in (program.x, program.y)
    )
    lines = 2 * schedule.settle_lines + 8
    return (
        4 * _REQUEST_SPACING_TICKS
        + schedule.frame_ticks
        + lines * schedule.ticks
        + 3 * (min(ramp, schedule.frame_ticks) + _CATCH_UP_STRIDE)
    )


def varied(program: DualProgram) -> DualProgram:
    """Half the amplitude, and a limit in its middle: a program that differs everywhere and clamps.

    The park code stays inside the limits. ``stream_bench.c`` varies the emitted program in the same way.
    """
    axes = []
    for axis in (program.x, program.y):
        output, middle = axis.output, axis.output.offset_code
        gain = abs(output.gain_word) // 2 * (1 if output.gain_word >= 0 else -1)  # towards 0, as C divides
        below = output.park_code <= middle
        limited = replace(output, code_max=middle) if below else replace(output, code_min=middle)
        axes.append(replace(axis, output=replace(limited, gain_word=gain)))
    return DualProgram(axes[0], axes[1], program.schedule)


def make_session(
    program: DualProgram, memories: Memories | None, most: int, seed: int, placement: Placement
) -> BuildSession:
    """At most ``most`` ticks of a program whose words come from ``memories``; the model plays ``program``.

    The device powers up at the park codes, takes the program, and plays a frame and some lines more, or what there are
    ticks for. At a random tick the same program is committed again from the other bank: it is taken at the next
    line start, in mid-frame, and plays while it settles and a line longer, with a tick every one to three clocks. Then
    it parks.

    Without memories the device has the program already, so nothing is written, and can make a variation of it: that is
    what is committed in mid-frame.
    """
    random, schedule = np.random.default_rng(seed), program.schedule
    parks = program.x.output.park_code, program.y.output.park_code
    harmonics = (memories.x_harmonics, memories.y_harmonics) if memories else (0, 0)
    commit_clocks = placement.commit_clocks((len(program.x.words), harmonics[0]), (len(program.y.words), harmonics[1]))
    script = Script(power_up=parks, drain=48 + placement.tick_clocks, commit_clocks=commit_clocks)
    pace = placement.tick_clocks
    most -= 2  # a script ends with one or two ticks of its own

    def played() -> int:
        return len(script.expected)

    def catch_up(until: int) -> None:
        while script.model.catching_up and played() < until:
            script.wait_ticks(min(_CATCH_UP_STRIDE, until - played()))

    if memories:
        _load(script, memories)
    script.request("commit", program=program)
    script.wait(commit_clocks)
    script.tick_every(pace)
    script.wait_ticks(min(_REQUEST_SPACING_TICKS, most))
    script.tick_every(0)
    if memories:
        _load(script, memories)
    script.tick_every(pace)
    script.request("arm")
    script.request("trigger")

    first_part = most if most >= needed_ticks(program) else most * 7 // 10
    script.wait_ticks(1)
    catch_up(first_part)
    wished = schedule.frame_ticks + int(random.integers(schedule.ticks, 2 * schedule.ticks, endpoint=True))
    script.wait_ticks(max(min(wished, first_part - played()), 0))
    whole = played() - _REQUEST_SPACING_TICKS >= schedule.frame_ticks

    if placement.fourier:  # rendering takes longer than any frame: the ticks wait for all but its end
        script.tick_every(0)
        script.request("commit", program=program)
        script.wait(commit_clocks - 8)
        script.tick_every(pace)
    elif memories:
        script.request("commit", program=program)
    else:
        script.request("commit", program=varied(program), frames=VARIATION)
    swaps = script.swaps
    script.wait_ticks(
        max(min(schedule.ticks, most - played() - _REQUEST_SPACING_TICKS), 0)
    )  # a line start is among them
    in_frame = script.swaps > swaps
    script.tick_every(0)
    script.wait(int(random.integers(1, 100)))  # ticks may stop, and come at another rate
    script.tick_every(pace * int(random.integers(1, 3, endpoint=True)))
    before_park = most - most // 20
    catch_up(before_park)
    script.wait_ticks(max(min((schedule.settle_lines + 1) * schedule.ticks, before_park - played()), 0))
    script.request("park")
    while not script.model.parked and played() < most:
        script.wait_ticks(min(_CATCH_UP_STRIDE, most - played()))
    swaps_at = [at for at, word in enumerate(script.expected) if word >> _SWAPPED_BIT & 1]
    own = None if memories or len(swaps_at) < 2 else swaps_at[1]
    return BuildSession(script, whole, in_frame, own)


def _load(script: Script, memories: Memories) -> None:
    """Write a bank, word for word as the files have it."""
    script.wait_writable()
    assert script.writable
    script.write(PROGRAM, list(memories.program))
    for axis, region, page in (("x", X_TABLE, 1), ("y", Y_TABLE, 2)):
        words, harmonics = list(getattr(memories, axis)), getattr(memories, f"{axis}_harmonics")
        script.write(X_FOURIER + region - X_TABLE if harmonics else region, words)
        if harmonics:  # 0 in the file, which is for uploaded tables
            script.write(PROGRAM, [harmonics], first=page * PAGE_WORDS + AXIS_WORDS.index("harmonics"))
