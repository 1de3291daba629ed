"""The Verilog sequencer with SLOW_PART against the integer model, on every tick.

A commit of a running scan is taken a line later than without a slow part, and a trigger waits for the first line:
``SlowScript`` has both. What comes too early for the device has tests of its own.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from replacing import replace
from sets import common, long
from slow_scripts import (
    GAINS,
    SECOND,
    SLOW,
    SLOW_PART,
    X_PARTS,
    Y_PARTS,
    SlowScript,
    least_ticks,
    line_clocks,
    random_scan,
    slow_modes,
    slow_pace,
    slow_play,
    slow_sources,
    straight,
)
from stream_laws import steps_are_limited
from stream_scripts import FAULTS, flag, occurrences
from turned_scans import turned_setup

from tablegen.api.turned import build_turned
from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import ScanProgram
from tablegen.device.registers import program_words
from tablegen.fixedpoint.frame_program import FrameProgram, Knots, SlowTable
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import FLAGS, PROGRAM, X_TABLE, Sample
from tablegen.verification.verilog.sequencer_bench import BenchRun, SequencerBench

CUBIC = SequencerShape(16, 3, 4, 16, 3, 3, 16)
LINES = SequencerShape(16, 1, 4, 16, 1, 3, 16)


@dataclass(frozen=True)
class Case:
    """A shape, and how many samples of it Icarus plays."""

    shape: SequencerShape
    samples: int = 200
    parameters: dict[str, int | str] = field(default_factory=dict)

    @property
    def script(self) -> SlowScript:
        """An empty script for programs of this case."""
        codes = tuple(int(self.parameters.get(f"{axis}_POWER_UP_CODE", 0)) for axis in "XY")
        return SlowScript((codes[0], codes[1]), shape=self.shape, shaping=int(self.parameters.get("SHAPING", 0)))


CASES = {
    "cubic": Case(CUBIC),
    "lines": Case(LINES),
    "cubic_and_lines": Case(SequencerShape(20, 3, 4, 21, 1, 5, 9)),
    "dac_24_words_8": Case(SequencerShape(24, 1, 2, 8, 3, 5, 8)),
    "dac_8_words_21": Case(SequencerShape(8, 3, 3, 20, 1, 4, 21)),
    "small_counters": Case(CUBIC, parameters={"TICK_BITS": 6, "LINE_BITS": 3, "COUNT_BITS": 5}),
    "power_up_codes": Case(CUBIC, 60, {"X_POWER_UP_CODE": 5, "Y_POWER_UP_CODE": 65535}),
    "second_lines": Case(LINES, parameters={"SHAPING": 2}),
    "scanner_cubic": Case(CUBIC, parameters={"SHAPING": 3}),
    "first_dac_24_words_8": Case(SequencerShape(24, 1, 2, 8, 3, 5, 8), parameters={"SHAPING": 1}),
    "second_dac_8_words_21": Case(SequencerShape(8, 3, 3, 20, 1, 4, 21), parameters={"SHAPING": 2}),
}


def bench_of(simulator: str, shape: SequencerShape, folder: Path, **parameters: int | str) -> SequencerBench:
    return SequencerBench(simulator, shape, folder, SLOW_PART | parameters, slow_sources())


@pytest.fixture(scope="module")
def cubic(tmp_path_factory: pytest.TempPathFactory) -> SequencerBench:
    """The sequencer of cubic tables, compiled once for all that plays it."""
    return bench_of("verilator", CUBIC, tmp_path_factory.mktemp("cubic"))


def equal(bench: SequencerBench, script: SlowScript) -> BenchRun:
    """Play a script; all has to be as the model has it, and no step larger than the guard of its program."""
    run = bench.play(script)
    assert run.equal, run
    steps_are_limited(run.capture, script.played)  # type: ignore[arg-type]
    return run


def begun(program: ScanProgram, shape: SequencerShape) -> SlowScript:
    """A script that has put, committed and taken a program, and plays nothing yet."""
    script = SlowScript(shape=shape)
    script.put(program)
    script.tick_every(slow_pace(shape))
    script.swap(program)
    script.wait_ticks(3)
    return script


# Random programs.


@pytest.mark.common
@pytest.mark.parametrize("name", common(["power_up_codes"], CASES))
def test_random_programs(name: str, tmp_path: Path) -> None:
    case = CASES[name]
    script = case.script
    most = 7 if "LINE_BITS" in case.parameters else 9
    slow_play(np.random.default_rng(sum(name.encode())), script, case.samples, most)
    run = equal(bench_of("icarus", case.shape, tmp_path, **case.parameters), script)
    assert script.played
    assert occurrences(run.capture)["playing"] > 20


@pytest.mark.rest
def test_a_long_run(cubic: SequencerBench) -> None:
    script = SlowScript(shape=CUBIC)
    slow_play(np.random.default_rng(8), script, 30_000, 40)
    run = equal(cubic, script)
    assert run.samples >= 30_000
    seen = occurrences(run.capture)
    assert all(seen[name] for name in (*FLAGS, *FAULTS[:2])), seen


# Modes of a commit.


def swaps_of(run: BenchRun) -> set[str]:
    """Whether a program was swapped into a scan with line 0, or on the line that was due."""
    swapped, playing, frame = (flag(run.capture, name) for name in ("swapped", "playing", "frame"))
    return {"begins" if begins else "goes on" for begins in frame[np.flatnonzero(swapped & playing)]}


@pytest.mark.common
@pytest.mark.parametrize("name", common(["lines"], ["cubic", "lines", "small_counters", "scanner_cubic"]))
def test_random_commits_of_every_mode(name: str, tmp_path: Path) -> None:
    case = CASES[name]
    script = case.script
    slow_modes(np.random.default_rng(sum(name.encode())), script, 16)
    run = equal(bench_of("icarus", case.shape, tmp_path, COMMIT_MODES=1, **case.parameters), script)
    assert swaps_of(run) == {"begins", "goes on"}


@pytest.mark.rest
def test_commits_of_every_mode_in_a_long_run(tmp_path: Path) -> None:
    script = SlowScript(shape=CUBIC)
    slow_modes(np.random.default_rng(4), script, 300)
    run = equal(bench_of("verilator", CUBIC, tmp_path, COMMIT_MODES=1), script)
    assert swaps_of(run) == {"begins", "goes on"}
    assert np.count_nonzero(flag(run.capture, "swapped")) == 300


def swap_in_a_short_line(bench: SequencerBench, mode: CommitMode, clocks: int) -> tuple[bool, int]:
    """Whether the tick that begins a line takes the program for it, and the ticks that were lost before it.

    The program is committed in a line that is too short for the work on it, and the tick comes so many clocks later.
    """
    rng, script = np.random.default_rng(4), SlowScript(shape=LINES)
    playing, program = (random_scan(rng, LINES, 8, 3, "smooth") for _ in range(2))
    script.put(playing)
    script.tick_every(slow_pace(LINES))
    script.swap(playing)
    script.wait_ticks(3)
    script.start()
    script.tick_every(0)
    script.put(program)
    script.tick_every(500)
    while (script.model.line, script.model.tick) != (1 if mode == CommitMode.FRAME else 0, 4):
        script.wait_ticks(1)
    script.request("commit", program=program, commit_clocks=1, mode=mode)
    script.forget_commit()  # what is played from here on is the device's alone
    while script.model.tick:
        script.wait_ticks(1)
    script.come_to_rest()
    script.tick_every(slow_pace(LINES))
    script.wait_ticks(8)
    at = len(script.expected)
    script.tick_every(0)
    script.wait(clocks)
    script.tick_every(5000)
    script.wait_ticks(2)
    run = bench.play(script)
    return bool(flag(run.capture, "swapped")[at]), run.fault_counts[FAULTS.index("overrun")]


@pytest.mark.rest
@pytest.mark.parametrize("mode", long([CommitMode.KEEP], list(CommitMode)))
def test_a_line_that_begins_as_its_work_ends_has_one_program(mode: CommitMode, tmp_path: Path) -> None:
    """On every clock about that one a tick is lost, and the next one takes the program, or it takes it itself."""
    bench = bench_of("icarus", LINES, tmp_path, COMMIT_MODES=1)
    few, many = 1, line_clocks(LINES)
    while many - few > 1:
        clocks = (few + many) // 2
        taken, lost = swap_in_a_short_line(bench, mode, clocks)
        assert taken, clocks
        few, many = (clocks, many) if lost else (few, clocks)
    assert [swap_in_a_short_line(bench, mode, clocks) for clocks in (few - 1, few, many, many + 1)] == [
        *[(True, 1)] * 2,
        *[(True, 0)] * 2,
    ]


@pytest.mark.common
def test_without_the_parameter_a_mode_has_no_effect(tmp_path: Path) -> None:
    script = SlowScript(shape=LINES)
    rng, least = np.random.default_rng(5), least_ticks(LINES, slow_pace(LINES))
    programs = [random_scan(rng, LINES, least + 1, 3, "smooth") for _ in range(2)]
    script.put(programs[0])
    script.tick_every(slow_pace(LINES))
    script.swap(programs[0])
    script.wait_ticks(3)
    script.start()
    script.put(programs[1])
    script.wait_ticks(5)
    script.swap(programs[1])
    script.commands[-1] |= int(CommitMode.KEEP) << 54
    script.wait_ticks(4 * least)
    assert swaps_of(equal(bench_of("icarus", LINES, tmp_path), script)) == {"begins"}


# Words at the ends of their ranges.


def extreme(rng: np.random.Generator, program: ScanProgram) -> ScanProgram:
    """The program with the least and the greatest words everywhere."""

    def axis(each: FrameProgram) -> FrameProgram:
        half, knots = 1 << each.fast.bits - 1, len(each.gains.words)
        ends = {bits: np.array([-(1 << bits - 1), (1 << bits - 1) - 1]) for bits in (8, 16, 18)}
        return replace(
            each,
            fast=replace(each.fast, words=rng.choice([-half, half - 1], len(each.fast.words))),
            second=rng.choice(ends[8], len(each.second)),
            gains=Knots(rng.choice(ends[18], knots), each.gains.spacing),
            ratios=Knots(rng.choice(ends[16], knots), each.gains.spacing),
            slow=SlowTable(
                rng.choice([-half, half - 1], len(each.slow.words)), int(rng.choice(ends[18])), each.slow.offset_word
            ),
        )

    assert isinstance(program.x, FrameProgram)
    assert isinstance(program.y, FrameProgram)
    return replace(program, x=axis(program.x), y=axis(program.y))


@pytest.mark.rest
@pytest.mark.parametrize("name", ["cubic", "lines", "dac_24_words_8"])
def test_words_at_both_ends(name: str, cubic: SequencerBench, tmp_path: Path) -> None:
    shape = CASES[name].shape
    rng, script = np.random.default_rng(5), SlowScript(shape=shape)
    script.tick_every(slow_pace(shape))
    saturated = falls = rises = 0
    for count in (2, 3, 65):
        lines = 1 if count == 2 else 5
        program = random_scan(rng, shape, least_ticks(shape, slow_pace(shape)), lines, "wild")
        reach = {"words": np.zeros(count, dtype=np.int64), "spacing": 1 if count == 65 else 7}
        program = replace(
            program,
            **{name: replace(getattr(program, name), gains=Knots(**reach), ratios=Knots(**reach)) for name in "xy"},
        )
        program = extreme(rng, program)
        assert isinstance(program.x, FrameProgram)
        half = 1 << program.x.fast.bits - 1
        for line in range(lines):
            saturated += int(np.sum((program.x.table(line) == half - 1) | (program.x.table(line) == -half)))
        falls, rises = falls + int(np.sum(program.x.ramps() < 0)), rises + int(np.sum(program.x.ramps() > 0))
        script.put(program)
        script.swap(program)
        script.wait_ticks(2)
        script.start()
        script.wait_ticks(2 * program.schedule.frame_ticks + 3)
        script.park()
    equal(cubic if shape is CUBIC else bench_of("icarus", shape, tmp_path), script)
    assert saturated
    assert falls
    assert rises


# Programs that are made from others.


@pytest.mark.rest
def test_a_program_without_a_slow_part_plays_as_a_straight_one(cubic: SequencerBench) -> None:
    """Its x; y has to have a slow part, as of a frame it is not one of a line."""
    rng = np.random.default_rng(6)
    program = straight(random_scan(rng, CUBIC, least_ticks(CUBIC, slow_pace(CUBIC)), 3, "smooth"))
    script = begun(program, CUBIC)
    script.start()
    script.wait_ticks(2 * program.schedule.frame_ticks)
    equal(cubic, script)


@pytest.mark.rest
def test_a_plan_of_a_scan_at_an_angle(tmp_path: Path) -> None:
    setup = turned_setup(
        tmp_path, 30.0, "timing.lines = 16", "x.band_limit.harmonics = 12", "timing.line_rate_hz = 400"
    )
    program = build_turned(setup).plan.program
    assert isinstance(program.x, FrameProgram)
    assert isinstance(program.y, FrameProgram)
    shape = SequencerShape.of((program.x.fast, program.y.fast))
    script = begun(program, shape)
    script.start()
    script.wait_ticks(2 * program.schedule.frame_ticks + 5)
    script.park()
    script.wait_ticks(50)
    equal(bench_of("verilator", shape, tmp_path), script)


# What comes when.


@pytest.mark.rest
def test_a_commit_on_every_tick_of_a_line(cubic: SequencerBench) -> None:
    rng, pace = np.random.default_rng(2), slow_pace(CUBIC)
    first, other = (random_scan(rng, CUBIC, least_ticks(CUBIC, pace) + k, 2, "smooth") for k in range(2))
    script = begun(first, CUBIC)
    script.start()
    for tick in range(first.schedule.ticks + 1):
        script.wait_ticks(3 * other.schedule.ticks)
        script.put(other)
        playing = script.model.playing
        assert playing is not None
        script.wait_ticks((tick - script.model.tick) % playing.schedule.ticks)
        script.swap(other)
        script.wait_ticks(2 * playing.schedule.ticks)
        first, other = other, first
    equal(cubic, script)
    assert len(script.played) > first.schedule.ticks


@pytest.mark.rest
def test_a_withdrawal_in_time_is_not_seen(cubic: SequencerBench) -> None:
    """Before the line that would work it out, and at the start of it, of a line that is long enough for both."""
    rng, pace = np.random.default_rng(3), slow_pace(CUBIC)
    playing, other = (random_scan(rng, CUBIC, 2 * least_ticks(CUBIC, pace) + 4, 3, "smooth") for _ in range(2))
    script = begun(playing, CUBIC)
    script.start()
    ticks = playing.schedule.ticks
    for after in (1, ticks + 1):
        script.put(other)
        script.wait_ticks((3 - script.model.tick) % ticks)
        script.swap(other)
        script.wait_ticks(after)
        script.request("withdraw")
        script.wait_ticks(3 * ticks)
    script.put(other)
    script.swap(other)
    script.wait_ticks(3 * ticks)
    equal(cubic, script)
    assert len(script.played) == 2


def split(run: BenchRun, script: SlowScript) -> tuple[np.ndarray, np.ndarray]:
    """Codes and markers of a run and of the model, without the faults and what follows from them."""
    kept = ~np.uint64(0xF << 56 | 1 << 48 + FLAGS.index("valid"))
    return run.capture & kept, np.array(script.expected, dtype=np.uint64) & kept


@pytest.mark.rest
def test_a_line_that_is_not_ready_in_time_is_waited_for(cubic: SequencerBench) -> None:
    """Ticks are lost at its start, each of them a fault, and what plays is what plays without."""
    rng = np.random.default_rng(4)
    program = random_scan(rng, CUBIC, 8, 4, "smooth")
    script = begun(program, CUBIC)
    script.start()
    script.wait_ticks(3 * program.schedule.frame_ticks)
    run = cubic.play(script)
    got, expected = split(run, script)
    lost = run.fault_counts[2]
    assert lost == len(expected) - len(got) > program.schedule.frame_ticks
    assert np.array_equal(got, expected[: len(got)])
    assert flag(run.capture, "overrun")[-1]


@pytest.mark.rest
def test_a_late_withdrawal_costs_ticks_and_no_line(cubic: SequencerBench) -> None:
    rng, pace = np.random.default_rng(5), slow_pace(CUBIC)
    playing, other = (random_scan(rng, CUBIC, least_ticks(CUBIC, pace), 3, "smooth") for _ in range(2))
    script = begun(playing, CUBIC)
    script.start()
    script.put(other)
    ticks = playing.schedule.ticks
    script.wait_ticks((3 - script.model.tick) % ticks)
    script.swap(other)
    script.wait_ticks((-3 - script.model.tick) % ticks + ticks)
    script.request("withdraw")
    script.wait_ticks(4 * ticks)
    run = cubic.play(script)
    got, expected = split(run, script)
    assert 0 < run.fault_counts[2] == len(expected) - len(got) < ticks
    assert np.array_equal(got, expected[: len(got)])


@pytest.mark.rest
@pytest.mark.parametrize("ends", ["plays", "park", "reset"])
def test_a_trigger_waits_for_the_first_line(ends: str, cubic: SequencerBench) -> None:
    """In mid-line of a scan that has just been parked; another park or a reset ends the wait."""
    rng, pace = np.random.default_rng(6), slow_pace(CUBIC)
    program = random_scan(rng, CUBIC, least_ticks(CUBIC, pace), 3, "smooth")
    script = begun(program, CUBIC)
    script.start()
    script.wait_ticks(program.schedule.ticks + 5)
    script.request("park")
    script.commands.append(3 << 60 | 0b11000 << 16)  # arm and trigger, which the model does not see
    script.clocks, script._until = script.clocks + 1, script._until - 1
    parked = len(script.expected)
    script.wait_ticks(3)
    if ends == "plays":
        script.wait(line_clocks(CUBIC) + 2 * pace)
    else:
        script.request(ends)
    script.wait_ticks(2 * least_ticks(CUBIC, pace))
    run = cubic.play(script)
    playing = np.flatnonzero(flag(run.capture, "playing")[parked:])
    got, expected = split(run, script)
    if ends != "plays":
        assert not len(playing)
        assert np.array_equal(got, expected)
        return
    at = parked + int(playing[0])
    assert 3 <= int(playing[0]) <= least_ticks(CUBIC, pace) + 2
    assert np.array_equal(got[:at], expected[:at])
    assert np.all(flag(run.capture, "playing")[at:])
    line = Sample.of(int(run.capture[at]))
    assert {"line", "frame"} <= set(line.flags)


# What is refused.


def refused(bench: SequencerBench, *writes: tuple[int, int, list[int]], left_out: int | None = None) -> bool:
    """Return True if a device refuses the commit of a program after these writes of region, address, words."""
    program = random_scan(np.random.default_rng(1), CUBIC, 60, 3, "smooth")
    script = SlowScript(shape=CUBIC)
    script.put(program)
    if left_out is not None:
        del script.commands[left_out]
    for region, address, words in writes:
        script.write(region, words, address)
    script.commit_unfit()
    script.wait(line_clocks(CUBIC) + 10)
    script.tick_every(slow_pace(CUBIC))
    script.wait_ticks(2)
    run = bench.play(script)
    was_refused = not run.refused  # which says that it was not, and should have been
    assert flag(run.capture, "swapped").any() != was_refused
    return was_refused


def taken_after_a_withdrawal(bench: SequencerBench, *writes: tuple[int, list[int]]) -> bool:
    """Return True if a device takes a program that was withdrawn after the first of these writes of address, words."""
    script = SlowScript(shape=CUBIC)
    script.put(random_scan(np.random.default_rng(1), CUBIC, 60, 3, "smooth"))
    for address, words in writes:
        script.write(PROGRAM, words, address)
        script.request("withdraw")
    script.commit_unfit()
    script.wait(line_clocks(CUBIC) + 10)
    script.tick_every(slow_pace(CUBIC))
    script.wait_ticks(2)
    return bool(flag(bench.play(script).capture, "swapped").any())


@pytest.mark.rest
def test_a_withdrawal_does_not_make_a_wrong_word_right(cubic: SequencerBench) -> None:
    """A word that does not fit stays in the idle program when it is withdrawn, until a right one is written over it."""
    program = random_scan(np.random.default_rng(1), CUBIC, 60, 3, "smooth")
    words = program_words(program.schedule, program.x, program.y)
    for address, wrong in ((16 + 12, 2 | 31 << 8), (32 + 12, 0), (16 + 13, 0), (32 + 13, 1 << 17)):
        assert not taken_after_a_withdrawal(cubic, (address, [wrong]))
        assert taken_after_a_withdrawal(cubic, (address, [wrong]), (address, [words[address]]))


@pytest.mark.rest
def test_what_is_no_program_with_a_slow_part_is_refused(cubic: SequencerBench) -> None:
    x_part, x_spacing, y_part = 16 + 12, 16 + 13, 32 + 12
    for address, word, fits in (
        (x_part, 0, False),
        (y_part, 0, False),
        (x_part, 1 | 3 << 8, False),
        (x_part, 66 | 3 << 8, False),
        (x_part, 2 | 2 << 8, False),
        (x_part, 2 | 8 << 8, False),
        (x_part, 2 | 3 << 8 | 1 << 7, False),
        (x_part, 2 | 3 << 8 | 1 << 13, False),
        (x_part, 2 | 3 << 8, True),
        (x_spacing, 0, False),
        (x_spacing, 1 << 17, False),
        (x_spacing, (1 << 17) - 1, True),
    ):
        assert refused(cubic, (PROGRAM, address, [word])) != fits, (address, word)


@pytest.mark.rest
def test_a_part_of_a_program_is_refused(cubic: SequencerBench) -> None:
    program = random_scan(np.random.default_rng(1), CUBIC, 60, 3, "smooth")
    words = len(program_words(program.schedule, program.x, program.y))
    length = len(program.x.fast.words) if isinstance(program.x, FrameProgram) else 0
    for left_out in (16 + 12, 32 + 15, words + length, -1):
        assert refused(cubic, left_out=left_out), left_out
    assert not refused(cubic)


@pytest.mark.rest
def test_a_write_beyond_a_part_is_refused(cubic: SequencerBench) -> None:
    """The words at the ends of what exists, and those behind them."""
    for region, address, exists in (
        (X_PARTS, SECOND | 15, True),
        (X_PARTS, SECOND | 16, False),
        (Y_PARTS, SECOND | 8, False),
        (X_PARTS, SLOW | 127, True),
        (X_PARTS, SLOW | 128, False),
        (Y_PARTS, GAINS | 64, True),
        (Y_PARTS, GAINS | 65, False),
        (7, 0, False),
        (X_TABLE, 16, False),
    ):
        script = SlowScript(shape=CUBIC)
        script.write(region, [0], address)
        script.refused = not exists
        assert not cubic.play(script).refused, (region, address)
