"""The model of the device: undisturbed lines, swaps, settling, the slew guard, park, faults."""

from fractions import Fraction
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from variants import plan_of

from tablegen.device.dual_program import DualProgram
from tablegen.device.played_lines import play_line
from tablegen.device.schedule import Schedule, Window, pixel_starts
from tablegen.device.sequencer import Fault, Sequencer, SequencerState, Tick

SMALL = {
    "timing.lines": "6",
    "timing.pixels": "8",
    "timing.line_rate_hz": "10000.0",
    "x.band_limit.harmonics": "5",
    "y.band_limit.harmonics": "5",
    "x.table.length": "64",
    "y.table.length": "64",
    "limits.max_error_lsb": "",
    "limits.max_scaling_error_percent": "",
    "y.band_limit.window": "[0.1, 0.9]",
}


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> list[DualProgram]:
    """Three small programs of different size, place, ticks and lines."""
    folder = tmp_path_factory.mktemp("programs")
    edits: list[dict[str, str]] = [
        {},
        {"x.offset_v": "60.0", "y.offset_v": "40.0", "timing.line_rate_hz": "8000.0", "timing.lines": "5"},
        {"x.size_nm": "350.0", "timing.settle_lines": "0"},
    ]
    resonance = {"x.resonance.frequency_hz": "400e3"}
    return [plan_of(folder, SMALL | edit, resonance).program for edit in edits]


def run(sequencer: Sequencer, ticks: int) -> list[Tick]:
    return [sequencer.step() for _ in range(ticks)]


def started(program: DualProgram, frames: int = 0) -> Sequencer:
    sequencer = Sequencer(program)
    sequencer.arm(frames)
    assert sequencer.trigger()
    return sequencer


def test_undisturbed_it_plays_the_lines_of_the_program(programs: list[DualProgram]) -> None:
    program = programs[0]
    schedule = program.schedule
    sequencer = started(program)
    run(sequencer, 2 * schedule.frame_ticks)  # past catching up and settling
    frame = run(sequencer, schedule.frame_ticks)
    for j in range(schedule.lines):
        line = play_line(program, j)
        ticks = frame[j * schedule.ticks : (j + 1) * schedule.ticks]
        for name in ("x", "y", "line", "frame", "pixel", "backward", "valid"):
            assert [getattr(t, name) for t in ticks] == getattr(line, name).tolist(), (j, name)
    assert sequencer.faults is Fault.NONE


def test_markers_of_a_line(programs: list[DualProgram]) -> None:
    schedule = programs[0].schedule
    line = play_line(programs[0], 2)
    assert np.flatnonzero(line.line).tolist() == [0]
    assert not line.frame.any()
    assert play_line(programs[0], 0).frame[0]
    assert int(np.argmax(line.backward)) == schedule.turn_tick
    assert line.pixel.sum() == 2 * schedule.pixels
    assert np.flatnonzero(line.valid).tolist() == [
        *range(schedule.forward.first, schedule.forward.stop),
        *range(schedule.backward.first, schedule.backward.stop),
    ]
    assert not play_line(programs[0], 0).valid.any()  # outside the window of y
    assert not play_line(programs[0], 2, settled=False).valid.any()


@given(st.integers(1, 500), st.integers(0, 4000))
def test_pixels_start_evenly_and_by_an_accumulator(pixels: int, extra: int) -> None:
    window = Window(17, pixels + extra)
    starts = pixel_starts(window, pixels).tolist()
    # As a device does it: one addition a tick, one subtraction when it wraps; the first tick starts the first pixel.
    remainder, walked = window.count, []
    for i in range(window.count):
        if remainder >= window.count:
            remainder -= window.count
            walked.append(window.first + i)
        remainder += pixels
    assert starts == walked
    assert len(starts) == pixels
    assert max(np.diff([*starts, window.stop])) - min(np.diff([*starts, window.stop])) <= 1


@given(st.lists(st.integers(1, 300), min_size=1, max_size=60), st.randoms(use_true_random=False))
def test_pixels_of_a_table_start_where_the_counts_before_them_end(counts: list[int], random: Random) -> None:
    """As a device does it: a count down, and the next count at 0."""
    back = random.sample(counts, len(counts))
    whole = sum(counts)
    schedule = Schedule(
        2 * whole + 9, 1, Fraction(1000), 1.0, len(counts), 0, whole + 6,
        Window(3, whole), Window(whole + 6, whole), 1, Window(0, 1), Window(1, 0), (tuple(counts), tuple(back)),
    )  # fmt: skip
    for window, table, starts in zip(
        (schedule.forward, schedule.backward), (counts, back), schedule.pixel_starts, strict=True
    ):
        remaining, rest, walked = 0, list(table), []
        for tick in range(window.first, window.stop):
            if remaining == 0:
                remaining = rest.pop(0)
                walked.append(tick)
            remaining -= 1
        assert starts.tolist() == walked


@pytest.mark.common
@settings(max_examples=40, deadline=None)
@given(st.data())
def test_no_line_mixes_two_programs_and_no_step_is_too_large(programs: list[DualProgram], data: st.DataObject) -> None:
    """Programs committed at random ticks, back to back: every line is one program's, each swap at a line start."""
    sequencer = started(programs[0])
    owner, previous = programs[0], sequencer.codes
    waiting: DualProgram | None = None
    settle, line = owner.schedule.settle_lines, 0
    caught_up = False
    for _ in range(data.draw(st.integers(1, 8))):
        for _ in range(data.draw(st.integers(0, 3 * owner.schedule.ticks))):
            k = sequencer.tick
            tick = sequencer.step()
            if tick.swapped:
                assert tick.line
                assert tick.frame
                assert waiting is not None
                owner, waiting, settle, line, caught_up = waiting, None, waiting.schedule.settle_lines, 0, False
            ideal = play_line(owner, line)
            outputs = owner.x.output, owner.y.output
            for now, before, output in zip((tick.x, tick.y), previous, outputs, strict=True):
                assert abs(now - before) <= output.max_step
            reached = (tick.x, tick.y) == (
                int(ideal.x[k if not tick.swapped else 0]),
                int(ideal.y[k if not tick.swapped else 0]),
            )
            caught_up = caught_up or reached
            assert reached == caught_up  # once there, never away again
            if tick.valid:
                assert reached
                assert settle == 0
            previous = (tick.x, tick.y)
            if sequencer.tick == 0:
                settle = max(settle - 1, 0)
                line = (line + 1) % owner.schedule.lines
        waiting = data.draw(st.sampled_from(programs))
        sequencer.commit(waiting)
    assert sequencer.faults is Fault.NONE


def test_a_swap_waits_for_the_line_start_on_both_axes(programs: list[DualProgram]) -> None:
    first, second = programs[0], programs[1]
    for at in range(first.schedule.ticks):
        sequencer = started(first)
        run(sequencer, first.schedule.ticks * 3 + at)
        sequencer.commit(second)
        left = (first.schedule.ticks - at) % first.schedule.ticks
        assert not any(tick.swapped for tick in run(sequencer, left))
        tick = sequencer.step()
        assert tick.swapped
        assert tick.line
        assert tick.frame
        assert sequencer.playing is second


def test_settling_keeps_valid_low_for_settle_lines(programs: list[DualProgram]) -> None:
    program = programs[0]
    schedule = program.schedule
    assert schedule.settle_lines == 2
    sequencer = started(program)
    lines = [run(sequencer, schedule.ticks) for _ in range(schedule.lines)]
    valid = [any(t.valid for t in line) for line in lines]
    # 0 is outside the window of y as well; 1 is inside it but still settling.
    assert valid == [False, False, True, True, True, False]
    assert play_line(program, 1).valid.any()


@pytest.mark.common
def test_frames_are_counted_and_then_parked(programs: list[DualProgram]) -> None:
    program = programs[2]
    sequencer = started(program, frames=2)
    played = run(sequencer, 2 * program.schedule.frame_ticks)
    assert sum(t.frame for t in played) == 2
    assert sequencer.state is SequencerState.PARKING
    rest = run(sequencer, 70000)
    assert not any(t.line or t.pixel or t.valid for t in rest)
    assert (rest[-1].x, rest[-1].y) == (program.x.output.park_code, program.y.output.park_code)
    assert sequencer.state is SequencerState.PARKED


@pytest.mark.parametrize("next_frames", [0, 1, 5])
def test_arming_the_next_scan_leaves_the_count_of_this_one(programs: list[DualProgram], next_frames: int) -> None:
    """A counted scan that forgot to end would go on over a sample that nobody watches."""
    program = programs[2]
    sequencer = started(program, frames=2)
    run(sequencer, program.schedule.ticks)
    sequencer.arm(next_frames)
    played = run(sequencer, 2 * program.schedule.frame_ticks - program.schedule.ticks)
    assert sum(tick.frame for tick in played) == 1
    assert sequencer.state is SequencerState.PARKING
    assert sequencer.armed


def test_trigger_needs_arming_and_parking(programs: list[DualProgram]) -> None:
    sequencer = Sequencer(programs[0])
    assert not sequencer.trigger()
    sequencer.arm()
    assert sequencer.trigger()
    sequencer.arm()
    assert not sequencer.trigger()  # it is running
    sequencer.park()
    assert not sequencer.armed


def test_a_trigger_before_the_first_program_is_taken_waits_for_it(programs: list[DualProgram]) -> None:
    """The next tick takes it and plays; without a program, or if it is withdrawn, there is no scan."""
    sequencer = Sequencer(None)
    sequencer.arm(1)
    assert not sequencer.trigger()
    sequencer.commit(programs[0])
    assert sequencer.trigger()
    first = sequencer.step()
    assert (first.swapped, first.playing, first.line, first.frame) == (True, True, True, True)
    withdrawn = Sequencer(None)
    withdrawn.commit(programs[0])
    withdrawn.arm()
    assert withdrawn.trigger()
    withdrawn.withdraw()
    assert not withdrawn.step().playing


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 400), st.sampled_from(["park", "reset"]))
def test_park_and_reset_ramp_from_wherever_they_come(programs: list[DualProgram], at: int, how: str) -> None:
    program = programs[1]
    sequencer = started(program)
    played = run(sequencer, at)
    getattr(sequencer, how)()
    played += run(sequencer, 70000 // min(program.x.output.max_step, program.y.output.max_step))
    codes = np.array([(program.x.output.park_code, program.y.output.park_code)] + [(t.x, t.y) for t in played])
    steps = np.abs(np.diff(codes, axis=0)).max(axis=0)
    assert steps[0] <= program.x.output.max_step
    assert steps[1] <= program.y.output.max_step
    assert tuple(codes[-1]) == (program.x.output.park_code, program.y.output.park_code)
    assert sequencer.state is SequencerState.PARKED


def test_reset_forgets_faults_and_what_waits(programs: list[DualProgram]) -> None:
    sequencer = started(programs[0])
    sequencer.faults, sequencer.fault_counts = Fault.SLEW, {Fault.SLEW: 3, Fault.CLAMP: 0}
    run(sequencer, 5)
    sequencer.commit(programs[1])
    sequencer.reset()
    assert sequencer.faults is Fault.NONE
    assert sequencer.fault_counts == {Fault.SLEW: 0, Fault.CLAMP: 0}
    assert not any(tick.swapped for tick in run(sequencer, 200))
    assert sequencer.playing is programs[0]


def test_a_commit_while_parked_is_taken_at_once(programs: list[DualProgram]) -> None:
    sequencer = Sequencer(programs[0])
    sequencer.commit(programs[1])
    assert sequencer.step().swapped
    assert sequencer.playing is programs[1]
    assert sequencer.state is not SequencerState.RUNNING


def test_slew_and_clamp_faults_are_sticky_and_counted(programs: list[DualProgram]) -> None:
    """Programs that a build would refuse: a guard below the steepest step, limits inside the scan."""
    from replacing import replace

    good = programs[0]
    slow = replace(good, x=replace(good.x, output=replace(good.x.output, max_step=300)))
    assert int(np.max(np.abs(np.diff(play_line(good, 0).x)))) > 300
    sequencer = started(slow)
    run(sequencer, 2 * slow.schedule.frame_ticks)
    assert sequencer.faults == Fault.SLEW
    assert sequencer.fault_counts[Fault.SLEW] > 1
    tight = replace(
        good, x=replace(good.x, output=replace(good.x.output, code_max=int(play_line(good, 0).x.max()) - 50))
    )
    sequencer = started(tight)
    played = run(sequencer, tight.schedule.frame_ticks)
    assert sequencer.faults == Fault.CLAMP
    assert max(t.x for t in played) == tight.x.output.code_max
    sequencer.park()
    run(sequencer, 1000)
    assert sequencer.faults == Fault.CLAMP
    sequencer.clear_faults()
    assert sequencer.faults is Fault.NONE
