"""A scan at an angle on the integer model that is moved, zoomed and turned at random while it plays."""

from collections.abc import Callable

import numpy as np
import pytest
from replacing import replace
from sets import LONG_TEST
from turned_changes import BIT, PARK_CODES, Broken, Change, RandomHost, Seen, Ticks, follow, frame_codes
from turned_sessions import CHUNK, Session

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import ScanProgram
from tablegen.fixedpoint.frame_program import FrameProgram

pytestmark = pytest.mark.common

FEW = range(60, 64)  # the commits of a session of controls that are others


@pytest.mark.parametrize("changes", [300, pytest.param(100_000, marks=LONG_TEST)])
def test_no_change_leaves_a_limit_or_begins_a_frame_again(
    changes: int, record_property: Callable[[str, object], None]
) -> None:
    """Every code inside its limits, every step inside its guard, every line of one program, all lines of a frame."""
    seen = Seen()
    for chunk, left in enumerate(range(changes, 0, -CHUNK)):
        seen.counts += Session([changes, chunk], min(left, CHUNK)).follow().counts
    record_property("seen", str(seen))
    assert seen.counts["goes on"] > 0.8 * changes
    assert seen.counts["begins again"] > 0.02 * changes
    assert seen.counts["whole lines of an axis"] > changes
    assert all(seen.counts[kind] for kind in ("move", "zoom", "turn", "plan", "rate", "withdrawals"))


def test_the_codes_of_the_laws_are_those_of_the_programs() -> None:
    """They are computed apart from those of the model."""
    host = RandomHost(np.random.default_rng(2))
    for change in [host.change() for _ in range(30)]:
        for axis, codes in zip(change.outputs, change.codes, strict=True):
            assert np.array_equal(codes, frame_codes(axis))
            assert np.array_equal(codes, axis.frame())
            assert len(np.unique(codes)) > 20


# Controls: what each law finds.


class _Other(Session):
    """The model plays other programs than the host asks for, a few times or always."""

    def __init__(self, seed: int, other: Callable[[Change], tuple[ScanProgram, CommitMode]], always: bool) -> None:
        self._other, self._always, self._commits = other, always, 0
        super().__init__([seed], 100)

    def commit(self, change: Change) -> None:
        self._commits += 1
        program, mode = change.program, change.mode
        if self._always or self._commits in FEW:
            program, mode = self._other(change)
        self.model.commit(program, mode)


def _begins_again(change: Change) -> tuple[ScanProgram, CommitMode]:
    return change.program, CommitMode.LINE


def _with_guard_one_wider(change: Change) -> tuple[ScanProgram, CommitMode]:
    x, y = (axis.guarded(axis.output.max_step + 1) for axis in change.outputs)
    return replace(change.program, x=x, y=y), change.mode


def _with_limits_one_wider(change: Change) -> tuple[ScanProgram, CommitMode]:
    def wider(axis: FrameProgram) -> FrameProgram:
        output = replace(axis.output, code_min=axis.output.code_min - 1, code_max=axis.output.code_max + 1)
        return replace(axis, fast=replace(axis.fast, output=output))

    x, y = map(wider, change.outputs)
    return replace(change.program, x=x, y=y), change.mode


def _with_another_gain(change: Change) -> tuple[ScanProgram, CommitMode]:
    """A knot of the gain of y is larger by one part in a hundred, or by one."""
    x, y = change.outputs
    words = y.gains.words.copy()
    words[3] += words[3] // 100 + 1
    return replace(change.program, x=x, y=replace(y, gains=replace(y.gains, words=words))), change.mode


@pytest.mark.parametrize(
    ("other", "always", "law"),
    [
        (_begins_again, False, r"line \d is due"),
        (_with_guard_one_wider, True, "steps by"),
        (_with_limits_one_wider, True, "outside its limits"),
        (_with_another_gain, True, "y is not that of its program"),
    ],
)
def test_another_program_is_found(
    other: Callable[[Change], tuple[ScanProgram, CommitMode]], always: bool, law: str
) -> None:
    with pytest.raises(Broken, match=law):
        _Other(7, other, always).follow()


@pytest.fixture(scope="module")
def session() -> Session:
    return Session([7], 100)


EDITS = {
    "half a line of x is of the program before": "x is not that of its program|x leaves its program",
    "a line of y is of the program before": "y is not that of its program|y leaves its program",
    "a code is another": "x is not that of its program|x leaves its program|x steps by",
    "a tick is missing": "begins inside the line",
    "a tick is there twice": "begins inside the line",
    "the scan stops for a tick": "the scan begins",
    "a program is taken in a line": "begins inside the line",
    "a program is not taken": "not that of its program|leaves its program|steps by",
    "programs change places": "not that of its program|leaves its program|steps by",
    "nobody committed the last program": "nobody committed",
}


def changed_line(session: Session) -> tuple[int, int, int]:
    """A line with a new program that goes on with the frame, and that both axes play whole; as ``whole_lines``."""
    swapped = session.ticks["markers"] & BIT["swapped"] != 0
    for tick, line, number in session.follow().whole_lines:
        before, after = (session.taken[each].codes for each in (max(number - 1, 0), number))
        same = before[0].shape == after[0].shape
        if line and same and swapped[tick] and all(np.any(before[axis][line] != after[axis][line]) for axis in (0, 1)):
            return tick, line, number
    raise AssertionError("no such line")


def edited(session: Session, how: str) -> tuple[Ticks, list[Change]]:
    """The ticks and the programs of a session, with a fault."""
    ticks, taken = session.ticks.copy(), list(session.taken)
    tick, line, number = changed_line(session)
    before, after = taken[number - 1], taken[number]
    period = after.program.schedule.ticks
    match how:
        case "half a line of x is of the program before":
            ticks["x"][tick + period // 2 : tick + period] = before.codes[0][line][period // 2 :]
        case "a line of y is of the program before":
            ticks["y"][tick : tick + period] = before.codes[1][line]
        case "a code is another":
            ticks["x"][tick + 5] += 1
        case "a tick is missing":
            ticks = np.delete(ticks, tick - 1)
        case "a tick is there twice":
            ticks = np.insert(ticks, tick - 1, ticks[tick - 1])
        case "the scan stops for a tick":
            ticks["markers"][tick + 3] = 0
        case "a program is taken in a line":
            ticks["markers"][tick] &= 255 - BIT["swapped"]
            ticks["markers"][tick + 1] |= BIT["swapped"]
        case "a program is not taken":
            ticks["markers"][tick] &= 255 - BIT["swapped"]
        case "programs change places":
            taken[number - 1 : number + 1] = [after, before]
        case "nobody committed the last program":
            del taken[-1]
    return ticks, taken


@pytest.mark.parametrize("how", EDITS)
def test_a_fault_in_the_ticks_is_found(how: str, session: Session) -> None:
    ticks, taken = edited(session, how)
    law = EDITS[how]
    with pytest.raises(Broken, match=law):
        follow(ticks, taken, session.starts, session.parks, PARK_CODES)
