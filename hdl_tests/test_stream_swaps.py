"""What a swap must never do in Verilog, read off the capture by itself; and lines that do not drift."""

from pathlib import Path

import numpy as np
import pytest
from programs import random_dual
from sets import LONG_TEST
from stream_benches import equal
from stream_configurations import (
    SMALL,
    SWAPS,
    SWAPS_SLOW,
    random_changes,
    random_swaps,
)
from stream_laws import Broken, follow_their_programs, steps_are_limited
from stream_scripts import (
    codes,
    flag,
    play,
    swaps_at_every_tick,
)

from tablegen.device.schedule import Schedule
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import Script, Words
from tablegen.verification.verilog.sequencer_bench import SequencerBench

SAMPLES_ON_VERILATOR = 1_000_000


@pytest.fixture(scope="module")
def small_on_verilator(tmp_path_factory: pytest.TempPathFactory) -> SequencerBench:
    return SequencerBench("verilator", SMALL, tmp_path_factory.mktemp("small"))


@pytest.mark.common
@pytest.mark.parametrize("pace", [1, 3])
def test_a_swap_is_requested_at_every_tick_and_taken_at_line_starts(pace: int, tmp_path: Path) -> None:
    shape = SequencerShape(16, 1, 3, 16, 1, 2, 16)
    rng = np.random.default_rng(pace)
    pair = tuple(random_dual(rng, shape, (20, 30), kind="smooth") for _ in range(2))
    script = Script()
    script.tick_every(pace)
    swaps_at_every_tick(script, (pair[0], pair[1]))
    capture = equal(SequencerBench("icarus", shape, tmp_path), script).capture
    swapped, line, playing = (flag(capture, name) for name in ("swapped", "line", "playing"))
    assert np.sum(swapped & playing) == max(program.schedule.ticks for program in pair)
    assert np.all(line[swapped & playing])
    starts = np.flatnonzero(line)
    for at in np.flatnonzero(swapped & playing):
        before = starts[starts < at][-1]
        assert at - before in {program.schedule.ticks for program in pair}  # the line before was whole
    follow_their_programs(capture, script.swapped_programs)


@pytest.mark.rest
@pytest.mark.parametrize("swaps", [SWAPS // 2, pytest.param(SWAPS_SLOW, marks=LONG_TEST)])
def test_no_line_mixes_programs_and_no_step_is_above_the_limit(swaps: int, small_on_verilator: SequencerBench) -> None:
    rng = np.random.default_rng(swaps)
    samples = 0
    for _ in range(0, swaps, SWAPS // 2):
        script, programs = random_swaps(rng, SWAPS // 2)
        played = equal(small_on_verilator, script)
        samples += played.samples
        assert np.sum(flag(played.capture, "swapped")) == SWAPS // 2 == len(programs)
        follow_their_programs(played.capture, programs)
    assert samples >= SAMPLES_ON_VERILATOR * swaps // SWAPS


@pytest.mark.rest
@pytest.mark.parametrize("changes", [SWAPS // 2, pytest.param(SWAPS_SLOW, marks=LONG_TEST)])
def test_no_change_begins_a_frame_again(changes: int, tmp_path: Path) -> None:
    """Commits that keep the frame, at any tick: each line is whole, and each frame has all of its lines."""
    bench = SequencerBench("verilator", SMALL, tmp_path, {"COMMIT_MODES": 1})
    rng = np.random.default_rng(changes)
    for _ in range(0, changes, SWAPS // 2):
        script, schedule = random_changes(rng, SWAPS // 2)
        capture = equal(bench, script).capture
        assert np.sum(flag(capture, "swapped")) == SWAPS // 2
        assert frames_are_whole(capture, schedule)


def frames_are_whole(capture: Words, schedule: Schedule) -> bool:
    """Whether lines and frames begin when those of one schedule do that nobody changes."""
    playing = capture[flag(capture, "playing")]
    lines, frames = (np.flatnonzero(flag(playing, name)) for name in ("line", "frame"))
    return np.array_equal(lines, np.arange(0, len(playing), schedule.ticks)) and np.array_equal(
        frames, np.arange(0, len(playing), schedule.frame_ticks)
    )


@pytest.mark.common
def test_a_frame_that_begins_again_is_not_whole() -> None:
    script, schedule = random_changes(np.random.default_rng(0), 40)
    capture = np.array(script.expected, dtype=np.uint64)
    assert frames_are_whole(capture, schedule)
    at = int(np.flatnonzero(flag(capture, "swapped") & ~flag(capture, "frame"))[20])
    begins_again = np.concatenate([capture[:at], capture[np.flatnonzero(flag(capture, "frame"))[0] :]])
    assert not frames_are_whole(begins_again, schedule)
    assert not frames_are_whole(np.delete(capture, at), schedule)


@pytest.mark.common
def test_laws_of_swaps_can_be_broken() -> None:
    script, programs = random_swaps(np.random.default_rng(0), 40)
    script.text()
    capture = np.array(script.expected, dtype=np.uint64)
    follow_their_programs(capture, programs)
    steps_are_limited(capture, programs)
    swapped = np.flatnonzero(flag(capture, "swapped"))
    at = int(swapped[20])

    one_axis_late = capture.copy()  # y plays the program before for one tick more
    before = programs[19]
    k = at - int(swapped[19])
    y_code = int(before.y.codes(np.array([k % before.schedule.frame_ticks]))[0])
    assert y_code != codes(capture, "y")[at]
    one_axis_late[at] = capture[at] & ~np.uint64(0xFFFFFF << 24) | np.uint64(y_code << 24)
    with pytest.raises(Broken):
        follow_their_programs(one_axis_late, programs)

    in_mid_line = np.delete(capture, at - 1)
    with pytest.raises(Broken):
        follow_their_programs(in_mid_line, programs)

    jumps = capture.copy()
    jumps[at] = capture[at] ^ np.uint64(0x8000)
    with pytest.raises(Broken):
        steps_are_limited(jumps, programs)


@pytest.mark.rest
@pytest.mark.parametrize(("ticks", "lines", "played_lines"), [(211, 1009, 1010), (65537, 5, 6)])
def test_no_line_drifts(ticks: int, lines: int, played_lines: int, small_on_verilator: SequencerBench) -> None:
    rng = np.random.default_rng(ticks)
    program = random_dual(rng, SMALL, (ticks, ticks), kind="tame", lines=(lines, lines))
    script = Script()
    script.tick_every(1)
    play(script, program)
    script.wait_ticks(played_lines * ticks + 1)
    capture = equal(small_on_verilator, script).capture
    playing = capture[flag(capture, "playing")][: played_lines * ticks]
    line_by_line = codes(playing, "x").reshape(played_lines, ticks)
    assert np.all(line_by_line == line_by_line[0])
    y = codes(playing, "y")
    frame = lines * ticks
    assert np.array_equal(y[frame:], y[: len(y) - frame])
    assert np.array_equal(np.flatnonzero(flag(playing, "line")), np.arange(played_lines) * ticks)
    assert np.array_equal(np.flatnonzero(flag(playing, "frame")), [0, frame])
