"""The check of played lines: it takes whatever the model plays, and nothing that was changed in it."""

import struct
import zlib

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from line_log import LineCheck, PlayedLine, WrongLine
from link_programs import make_scan
from replacing import replace

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import DualProgram
from tablegen.device.sequencer import Tick
from tablegen.link.messages import DeviceState
from tablegen.link.players import LinePlayer, SequencerPlayer
from tablegen.verification.play.stream import FLAGS

_PROGRAMS = {scan.digest: scan.program for scan in (make_scan(seed, ticks=40, lines=5) for seed in range(1, 6))}
_BOOT = make_scan(0, ticks=40, lines=5).program


class Log:
    """A log as firmware keeps it, of the model's ticks."""

    def __init__(self) -> None:
        self.lines: list[PlayedLine] = []
        self._open: PlayedLine | None = None

    def __call__(self, generation: int, line: int, tick: Tick) -> None:
        if self._open is not None and (tick.line or not tick.playing):
            self.lines.append(self._open)
            self._open = None
        if tick.line:
            self._open = PlayedLine(generation, line, 0, 0, 0, 0)
        if self._open is not None:
            markers = sum(1 << bit for bit, name in enumerate(FLAGS) if getattr(tick, name))
            crc = zlib.crc32(struct.pack("<IIB", tick.x, tick.y, markers), self._open.crc)
            before = self._open
            self._open = replace(
                before, ticks=before.ticks + 1, crc=crc, markers=before.markers | markers, faults=int(tick.faults)
            )


Step = tuple[str, int]  # a request, and ticks after it
_REQUESTS = ("trigger", "trigger", "commit", "commit", "park", "withdraw", "frames", "wait", "wait")
_STEPS = st.lists(st.tuples(st.sampled_from(_REQUESTS), st.integers(0, 130)), min_size=1, max_size=14)


def _ask(player: SequencerPlayer | LinePlayer, request: str, number: int, mode: CommitMode = CommitMode.LINE) -> None:
    if request == "commit" and player.writable:
        player.commit(list(_PROGRAMS.values())[number % len(_PROGRAMS)], mode)
    elif request == "trigger":
        player.arm(0)
        player.trigger()
    elif request == "frames":
        player.arm(2)
        player.trigger()
    elif request == "park":
        player.park()
    elif request == "withdraw":
        player.withdraw()


def _played(steps: list[Step], mode: CommitMode = CommitMode.LINE) -> list[PlayedLine]:
    log = Log()
    player = SequencerPlayer(_BOOT, on_tick=log)
    parking = False
    for number, (request, ticks) in enumerate([("wait", 60), *steps, ("park", 60)]):
        if request == "commit" and parking:
            player.advance(
                60
            )  # a swap on the way to the park codes begins another way there, which the check does not follow
        parking = request == "park" or (parking and request != "commit")
        _ask(player, request, number, mode)
        player.advance(ticks)
    return log.lines


def _check(keeps: bool = False) -> LineCheck:
    check = LineCheck(_BOOT, keeps=keeps)
    for name, program in _PROGRAMS.items():
        check.offer(name, program)
    return check


@given(_STEPS)
@example([("trigger", 0), ("commit", 1)])
@example([("commit", 1), ("trigger", 0), ("commit", 1)])
@settings(max_examples=60)
def test_what_the_model_plays_is_right(steps: list[Step]) -> None:
    lines = _played(steps)
    check = _check()
    check.follow(lines)
    assert check.lines == len(lines)


_SOME: list[Step] = [
    ("trigger", 130),
    ("commit", 200),
    ("park", 70),
    ("trigger", 150),
    ("commit", 170),
    ("commit", 100),
]


def test_a_log_of_many_things() -> None:
    lines = _played(_SOME)
    check = _check()
    check.follow(lines)
    assert len(lines) > 12
    assert len(check.taken) == 4


def test_a_frame_that_goes_on_with_another_program() -> None:
    """A check that does not allow it finds it, as it finds the frame on another line."""
    lines = _played(_SOME, CommitMode.KEEP)
    check = _check(keeps=True)
    check.follow(lines)
    assert (check.lines, len(check.taken)) == (len(lines), 4)
    assert check.kept
    with pytest.raises(WrongLine):
        _check().follow(lines)
    at = next(number for number, line in enumerate(lines) if line.generation in check.kept)
    with pytest.raises(WrongLine):
        _check(keeps=True).follow([*lines[: at - 1], *lines[at:]])


_CHANGES = [("crc", 1), ("ticks", -1), ("ticks", 1), ("line", 1), ("generation", 1), ("markers", 32), ("faults", 1)]


@pytest.mark.common
@pytest.mark.parametrize(("name", "by"), _CHANGES)
def test_a_number_that_is_another_one_is_found(name: str, by: int) -> None:
    lines = _played(_SOME)
    for at, line in enumerate(lines):
        if name == "markers":
            changed = replace(line, markers=line.markers ^ by)
        else:
            changed = replace(line, **{name: getattr(line, name) + by})
        with pytest.raises(WrongLine):
            _check().follow([*lines[:at], changed, *lines[at + 1 :]])


def test_a_line_that_is_missing_or_there_twice_is_found() -> None:
    lines = _played(_SOME)
    for at in range(len(lines) - 1):
        # the last before a new start or program may leave no trace
        if lines[at + 1].line != 0:
            with pytest.raises(WrongLine):
                _check().follow(lines[:at] + lines[at + 1 :])
    for at in range(len(lines)):
        # a scan may be parked where a line ends, and started again
        if lines[at].line != 0:
            with pytest.raises(WrongLine):
                _check().follow([*lines[: at + 1], *lines[at:]])


def test_a_program_that_was_not_uploaded_is_found() -> None:
    check = LineCheck(_BOOT)
    with pytest.raises(WrongLine):
        check.follow(_played(_SOME))


@given(_STEPS, st.lists(st.sampled_from(CommitMode), min_size=15, max_size=15))
@settings(max_examples=60)
def test_the_player_of_lines_does_what_the_player_of_ticks_does(steps: list[Step], modes: list[CommitMode]) -> None:
    """But for how long it takes to park while a swap is caught up with."""
    players: list[SequencerPlayer | LinePlayer] = [SequencerPlayer(_BOOT), LinePlayer(_BOOT)]
    for number, (request, ticks) in enumerate([("wait", 60), *steps]):
        seen = []
        for player in players:
            _ask(player, request, number, modes[number])
            player.advance(ticks)
            state = DeviceState.PARKED if player.state is DeviceState.PARKING else player.state
            seen.append((player.swaps, player.line, player.swapped_at, state, player.writable, _name(player.playing)))
        assert seen[0] == seen[1]


def _name(program: DualProgram | None) -> int:
    return 0 if program is None else id(program)
