"""A session of a library: each of its programs is picked while the scan of another one plays, and some picks fail."""

from collections.abc import Sequence
from dataclasses import dataclass

from tablegen.device.dual_program import DualProgram
from tablegen.device.sequencer import Sequencer, Tick

MOST_TICKS = 20_000  # of a pick
_OTHER_TICKS = 20  # beside the rest of the line that plays, and a whole line


@dataclass(frozen=True)
class Pick:
    """A pick of the program with a ``number``, and the ``ticks`` after it.

    Attributes
    ----------
    restarts
        True if the scan is parked before the pick, and started after it.
    changes
        Words that the device reads otherwise than they are in the memory: their addresses, and what it reads.
    fails
        True if the pick must fail, and what plays go on.
    """

    number: int
    ticks: int
    restarts: bool = False
    changes: tuple[tuple[int, int], ...] = ()
    fails: bool = False


def make_picks(programs: Sequence[DualProgram], failing: Sequence[Pick], most_ticks: int) -> list[Pick]:
    """Make picks of all programs by number, with those that fail after the first, and of the first again.

    After a pick play the rest of a line and a line of the new program, but at most ``most_ticks``. Where they
    are too few for the line that plays, the scan starts again.
    """
    picks: list[Pick] = []
    before = None
    for number in (*range(len(programs)), 0):
        own = programs[number].schedule.ticks
        rest = 0 if before is None else programs[before].schedule.ticks
        restarts = before is None or rest + _OTHER_TICKS > most_ticks
        picks.append(Pick(number, min(most_ticks, own + _OTHER_TICKS + (0 if restarts else rest)), restarts))
        if before is None:
            picks += failing
        before = number
    return picks


def expected_ticks(programs: Sequence[DualProgram], picks: Sequence[Pick]) -> list[list[Tick]]:
    """Return the ticks of the integer model after each pick; where the scan starts, one of rest before them."""
    model, expected = Sequencer(None), []
    for pick in picks:
        if not pick.fails:
            if pick.restarts:
                model.park()
            model.commit(programs[pick.number])
        ticks = []
        if pick.restarts:
            ticks.append(model.step())
            model.arm()
            model.trigger()
        ticks += [model.step() for _ in range(pick.ticks)]
        expected.append(ticks)
    return expected
