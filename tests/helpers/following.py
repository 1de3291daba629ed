"""What firmware put out against the integer model, where only the ticks tell when a request was heard."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from replacing import replace

from tablegen.device.dual_program import DualProgram
from tablegen.device.sequencer import Sequencer, Tick
from tablegen.fixedpoint.program import Program
from tablegen.planning.line_plan import Plan
from tablegen.verification.play.stream import FLAGS


class Differs(AssertionError):
    """A tick that is not what the model has."""


@dataclass
class Follower:
    """The model, which hears of a request on the tick that first shows it.

    A program is taken where a tick says so, and a scan begins or ends where one says so. The model does with that what
    it has to: it does not swap in mid-line, whatever the tick says.
    """

    model: Sequencer
    frames: int = 0
    ticks: int = 0
    swaps: int = 0

    def hear(self, markers: int, loaded: Callable[[], DualProgram]) -> Tick:
        """The model's tick."""
        shows = {name for bit, name in enumerate(FLAGS) if markers >> bit & 1}
        if "swapped" in shows:
            self.model.commit(loaded())
            self.swaps += 1
        if "playing" in shows and not self.model.running:
            self.model.arm(self.frames)
            self.model.trigger()
        if "playing" not in shows and self.model.running:
            self.model.park()
        tick = self.model.step()
        self.ticks += 1
        return tick


def markers_of(tick: Tick) -> int:
    """As the firmware has them."""
    return sum(1 << bit for bit, name in enumerate(FLAGS) if getattr(tick, name))


def programs_of(plan: Plan) -> tuple[DualProgram, DualProgram]:
    """The whole scan and the half one of ``examples/firmware/common/scan.c``."""
    whole = plan.program
    return whole, replace(whole, x=_half(whole.x), y=_half(whole.y))


def _half(program: Program) -> Program:
    word = program.output.gain_word
    return replace(program, output=replace(program.output, gain_word=int(word / 2)))  # as C divides


def follow(samples: Sequence[str], plan: Plan, frames: int) -> Follower:
    """Hold every line of a log against the model; swaps are to the other program in turn."""
    programs = programs_of(plan)
    follower = Follower(Sequencer(None, codes=(0, 0)), frames)
    x_word, y_word = plan.x.program.output.word, plan.y.program.output.word
    for at, sample in enumerate(samples):
        x, y, markers = (int(part, 16) for part in sample.split())
        tick = follower.hear(markers, lambda: programs[follower.swaps % 2])
        expected = x_word(tick.x), y_word(tick.y), markers_of(tick)
        if (x, y, markers) != expected:
            raise Differs(f"tick {at}: {(x, y, markers)} is not {expected}")
    return follower
