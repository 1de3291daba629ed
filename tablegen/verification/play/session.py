"""The session that verifies a build: requests and faults on short programs, then frames of the build's own.

The own program follows a variation of it in mid-line, plays a frame and more, gives way to a variation in mid-frame,
takes over again, and parks.
"""

from dataclasses import dataclass

import numpy as np

from tablegen.device.dual_program import DualProgram
from tablegen.verification.play.loading import Loader, Memories
from tablegen.verification.play.placement import Placement
from tablegen.verification.play.requests import Requests
from tablegen.verification.play.stream import Script
from tablegen.verification.play.variation import variation

_CATCH_UP_STRIDE = 64  # ticks between checks whether an output has caught up
_PARK_TICKS = 500  # ticks in which most programs have parked
_POWER_UP_STEPS = 20  # of max_step, from the codes of power-up to the park codes
WIRED_TICKS = 24  # ticks so far apart that a serial converter gets each of them
WIRED_CLOCKS = 240  # clocks between them
_MANY_TICKS = 20_000  # of a session in C that has long lines too
_TAKING_OVER_TICKS = 1500  # more ticks than pass while the words of a program are written


@dataclass(frozen=True)
class BuildSession:
    """A script, and its extent within the ticks that it may take."""

    script: Script
    whole_frame: bool
    swapped_in_frame: bool
    wired_ticks: int  # at least so many samples came slowly enough for a serial converter


def needed_ticks(program: DualProgram) -> int:
    """Return the ticks in which a session plays a whole frame of the build's program, and all that follows."""
    schedule = program.schedule
    ramp = max(
        -(-(axis.output.code_max - axis.output.code_min) // axis.output.max_step) for axis in (program.x, program.y)
    )
    lines = 2 * schedule.settle_lines + 8
    return (
        _TAKING_OVER_TICKS
        + schedule.frame_ticks
        + lines * schedule.ticks
        + 3 * (min(ramp, schedule.frame_ticks) + _CATCH_UP_STRIDE)
    )


def power_up_codes(program: DualProgram) -> tuple[int, int]:
    """Return codes at power-up from which the first ramp leads up in x and down in y, where there is room.

    That of y takes longer, and ends with a step of one code.
    """
    x, y = program.x.output, program.y.output
    top = (1 << x.dac_bits) - 1
    return (
        max(x.park_code - _POWER_UP_STEPS * x.max_step - 1, 0),
        min(y.park_code + (_POWER_UP_STEPS + 2) * y.max_step + 1, top),
    )


class _Own:
    """The part of a session that is the build's own program."""

    def __init__(self, script: Script, loader: Loader, most: int, seed: int, pace: int) -> None:
        self.script, self.loader, self.most = script, loader, most
        self.spare = most // 20  # for the park at the end
        self.random, self.pace = np.random.default_rng(seed), pace

    @property
    def played(self) -> int:
        return len(self.script.expected)

    def take_over(self) -> None:
        """Commit it while a variation plays, in mid-line, or after a rest where it has to be rendered."""
        script, rendered = self.script, self.loader.own_commit_clocks > 8
        variation = script.model.playing
        assert variation is not None
        self.loader.load_own()
        script.pace(self.pace, self.pace)
        if rendered:
            script.tick_every(0)
            self.loader.commit_own()
            script.wait(self.loader.own_commit_clocks - 8)
            script.pace(self.pace, self.pace)
            script.wait_ticks(8 + 2 * variation.schedule.ticks)
            return
        script.wait_ticks((variation.schedule.ticks // 2 - script.model.tick) % variation.schedule.ticks + 1)
        self.loader.commit_own()
        script.wait_ticks(variation.schedule.ticks)  # a line start is among them

    def catch_up(self, until: int) -> None:
        """Play until the output is at the waveform, or so many ticks of the session are over."""
        while self.script.model.catching_up and self.played < until:
            self.script.wait_ticks(min(_CATCH_UP_STRIDE, until - self.played))

    def play_until(self, ticks: int) -> None:
        self.script.wait_ticks(max(ticks - self.played, 0))


def make_session(
    program: DualProgram,
    memories: Memories | None,
    most: int,
    seed: int,
    placement: Placement,
    requests: bool = True,
    wired: bool = True,
) -> BuildSession:
    """Make requests, and then some ``most`` ticks at most of a program whose words come from ``memories``.

    Without memories the device has the program already, as the C of a build does, and a driver reports overruns.
    Without ``requests`` the own program alone is played. A swap in mid-frame comes at a random tick, ticks then come
    every one to three clocks. If ``wired``, the end is played so slowly that a serial converter gets every sample.
    """
    pace, schedule = placement.tick_clocks, program.schedule
    codes = power_up_codes(variation(program, "free", 0) if requests else program)
    script = Script(power_up=codes, drain=placement.drain_clocks, commit_clocks=placement.commit_clocks())
    loader = Loader(script, program, memories, placement)
    own = _Own(script, loader, most - WIRED_TICKS, seed, pace)

    if requests:
        in_c = memories is None
        Requests(script, loader, placement, in_c, in_c and most >= _MANY_TICKS).play()
        own.most += own.played
        script.request("arm", "trigger")
        script.wait_ticks(2)
        own.take_over()
    else:
        loader.load_own()
        loader.commit_own()
        script.pace(pace, pace)
        script.wait_ticks(2)
        script.request("arm", "trigger")

    begun = own.played
    first_part = own.most if most >= needed_ticks(program) else begun + max(own.most - begun, 0) * 7 // 10
    own.catch_up(first_part)
    wished = begun + schedule.frame_ticks + int(own.random.integers(schedule.ticks, 2 * schedule.ticks, endpoint=True))
    own.play_until(min(wished, first_part))
    whole = own.played - begun >= schedule.frame_ticks
    in_frame = requests and _swap_and_back(own, schedule.ticks, schedule.settle_lines)

    script.request("park")
    script.pace(pace, pace)
    until = max(own.most, own.played + _PARK_TICKS)
    while not script.model.parked and own.played < until:
        script.wait_ticks(min(_CATCH_UP_STRIDE, until - own.played))
    if wired:
        _slowly(own)
    script.state("at the end")
    return BuildSession(script, whole, in_frame, WIRED_TICKS if wired else 0)


def _slowly(own: _Own) -> None:
    """Play a start with ticks so far apart that a serial converter gets every sample."""
    script = own.script
    script.request("arm", "trigger")
    script.tick_every(0)
    script.wait(WIRED_CLOCKS)
    script.pace(max(WIRED_CLOCKS, own.pace), own.pace)
    script.wait_ticks(WIRED_TICKS)
    script.tick_every(0)
    script.wait(WIRED_CLOCKS)
    script.request("park")
    script.pace(own.pace, own.pace)
    script.wait_ticks(1)


def _swap_and_back(own: _Own, line: int, settle_lines: int) -> bool:
    """Swap to a variation in mid-frame and back; return True if both swaps came in mid-frame."""
    script = own.script
    variation = own.loader.load("free")
    script.pace(own.pace, own.pace)
    swaps = script.swaps
    own.loader.commit(variation)
    budget = own.most - own.spare
    script.wait_ticks(max(min(line, budget - own.played), 0))  # a line start is among them
    if script.swaps == swaps:
        script.request("withdraw")
        script.wait_ticks(1)
        return False
    script.wait_ticks(variation.schedule.frame_ticks)
    script.state("with a variation in mid-frame")
    script.pace(own.pace, own.pace)
    if own.loader.own_commit_clocks > 8:  # rendered once is enough: it takes longer than all the rest
        script.request("park")
        return True
    own.take_over()
    script.tick_every(0)
    script.wait(int(own.random.integers(1, 100)))  # ticks may stop, and come at another rate
    script.pace(own.pace * int(own.random.integers(1, 3, endpoint=True)), own.pace)
    own.catch_up(budget)
    script.wait_ticks(max(min(line, budget - own.played), 0))
    script.pace(own.pace, own.pace)
    script.wait_ticks(max(min(settle_lines * line, budget - own.played), 0))
    return True
