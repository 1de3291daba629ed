"""The modes of a commit in Verilog: every tick equal to the model, at commits on any tick; and what each mode does."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from programs import Kind, random_dual, random_fourier, rendered, shaped, with_table
from replacing import replace
from sets import common_and_rest
from stream_benches import HARMONICS, equal, with_sine
from stream_configurations import CONFIGURATIONS, SMALL, Configuration
from stream_scripts import flag, play, rendering_clocks

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import DualProgram
from tablegen.device.schedule import Window
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import Script
from tablegen.verification.verilog.sequencer_bench import SequencerBench

MODES = {"COMMIT_MODES": 1}
# Pipelined and in low area, tables of each kind, and the shapers, which begin anew where a frame goes on.
PLAYED = ("bits_16", "low_area", "cubic", "bits_12", "low_area_dac_24", "scanner_low_area",
          "cubic_low_area", "small_counters", "second", "scanner")  # fmt: skip
TICKS, LINES = 12, 4
_KINDS: tuple[Kind, ...] = ("tame", "smooth", "wild")


def swaps_of(capture: np.ndarray) -> Counter[str]:
    """How often a program was swapped into a running scan: in the middle of a frame that goes on, or not."""
    swapped, playing, frame = (flag(capture, name) for name in ("swapped", "playing", "frame"))
    seen = Counter[str]()
    for at in np.flatnonzero(swapped & playing):
        seen["begins" if frame[at] else "goes on"] += 1
    return seen


def random_commits(
    rng: np.random.Generator, script: Script, configuration: Configuration, samples: int, pixels: bool = False
) -> None:
    """Commits of every mode at any tick of a scan that seldom stops; most programs have the frame of the last one.

    With ``pixels`` most have a table of pixels.
    """
    ticks, lines = configuration.ticks, (2, max(configuration.lines[1], 3))
    shape, (pace, *_) = configuration.shape, configuration.paces
    size = ticks, lines
    script.tick_every(pace)
    while len(script.expected) < samples:
        if script.waiting:
            script.request("withdraw")
            script.wait(1)
        program = random_dual(rng, shape, size[0], kind=_KINDS[int(rng.integers(3))], lines=size[1])
        if configuration.shaping:
            program = shaped(rng, program, configuration.shaping)
        if pixels and rng.random() < 0.7:
            program = replace(program, schedule=with_table(rng, program.schedule))
        own = program.schedule.ticks, program.schedule.lines
        size = ((own[0],) * 2, (own[1],) * 2) if rng.random() < 0.9 else (ticks, lines)
        script.load(program)
        script.wait(int(rng.integers(ticks[1])) * pace + int(rng.integers(pace)))
        script.request("commit", program=program, mode=CommitMode(int(rng.choice([0, 1, 1, 2]))))
        script.wait(2)
        if rng.random() < 0.1:
            script.request(str(rng.choice(["park", "reset"])))
        if not script.model.running:
            script.request("arm", "trigger", frames=int(rng.choice([0, 0, 2])))
        script.wait_ticks(int(rng.integers(1, own[0] * int(rng.choice([2, own[1] + 1])))))


@pytest.mark.common
@pytest.mark.parametrize(
    "name", common_and_rest(PLAYED[:2], ("cubic", "bits_12", "scanner_low_area", "small_counters", "second"), PLAYED)
)
def test_random_commits_of_every_mode(name: str, tmp_path: Path) -> None:
    configuration = CONFIGURATIONS[name]
    script = Script(drain=configuration.placement.drain_clocks if configuration.placement.spline else Script.drain)
    samples = 3000 if configuration.samples > 2000 else 900
    random_commits(np.random.default_rng(len(name)), script, configuration, samples)
    bench = SequencerBench("icarus", configuration.shape, tmp_path, dict(configuration.parameters) | MODES)
    seen = swaps_of(equal(bench, script).capture)
    assert seen["begins"], seen
    assert seen["goes on"], seen


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_random_commits_on_verilator(tmp_path: Path) -> None:
    configuration = Configuration(SequencerShape(20, 1, 4, 24, 0, 5, 18), {"PLAIN_MULTIPLIER": 1})
    script = Script()
    random_commits(np.random.default_rng(8), script, configuration, 40_000)
    bench = SequencerBench("verilator", configuration.shape, tmp_path, dict(configuration.parameters) | MODES)
    seen = swaps_of(equal(bench, script).capture)
    assert min(seen["begins"], seen["goes on"]) > 40, seen


@pytest.mark.rest
def test_a_program_is_rendered_before_its_frame_goes_on(tmp_path: Path) -> None:
    """The mode is that of the clock of the commit, many clocks before the program waits."""
    shape, rng, script = SequencerShape(16, 1, 4, 16, 1, 3, 14), np.random.default_rng(3), Script()
    script.tick_every(1)
    for number in range(8):
        program = random_dual(rng, shape, (30, 30), kind="tame", lines=(20, 20))
        x, y = random_fourier(rng, HARMONICS), random_fourier(rng, HARMONICS)
        program = replace(program, x=rendered(program.x, x), y=rendered(program.y, y))
        clocks = rendering_clocks(shape, x, y, multiplier=1)
        script.load(program, x, y)
        script.request("commit", program=program, commit_clocks=clocks, mode=CommitMode.KEEP)
        script.wait(clocks + 50 + int(rng.integers(30)))
        if number == 0:
            script.request("arm", "trigger")
    bench = SequencerBench("icarus", shape, tmp_path, {**with_sine(tmp_path, shape), "PLAIN_MULTIPLIER": 1, **MODES})
    assert swaps_of(equal(bench, script).capture)["goes on"]


def pair(seed: int) -> tuple[DualProgram, DualProgram]:
    """Two programs of one frame, which image other lines of it."""
    rng = np.random.default_rng(seed)
    programs: list[DualProgram] = []
    while len(programs) < 2:
        program = random_dual(rng, SMALL, (TICKS, TICKS), kind="smooth", lines=(LINES, LINES))
        first = len(programs)
        lines = {"settle_lines": first, "up": Window(first, 2), "turn_line": 3, "down": Window(3, 1)}
        imaging = replace(program, schedule=replace(program.schedule, **lines))
        if imaging.schedule.forward.count and (not programs or imaging.y.hold == programs[0].y.hold):
            programs.append(imaging)
    return programs[0], programs[1]


@pytest.mark.common
def test_each_mode_at_every_tick_of_a_frame(tmp_path: Path) -> None:
    script = Script()
    script.tick_every(1)
    now, other = pair(2)
    play(script, now)
    for tick in range(TICKS * LINES):
        for mode in CommitMode:
            script.load(other)
            model = script.model
            script.wait_ticks((tick - model.line * TICKS - model.tick) % (TICKS * LINES))
            script.request("commit", program=other, mode=mode)
            script.wait_ticks(LINES * TICKS + 3)
            now, other = other, now
    bench = SequencerBench("icarus", SMALL, tmp_path, MODES)
    seen = swaps_of(equal(bench, script).capture)
    assert seen.total() == len(CommitMode) * TICKS * LINES
    assert seen["goes on"] >= TICKS * (LINES - 1)


def test_without_the_parameter_a_mode_has_no_effect(tmp_path: Path) -> None:
    script = Script()
    script.tick_every(1)
    now, other = pair(3)
    play(script, now)
    script.load(other)
    script.wait_ticks(TICKS + 3)
    script.request("commit", program=other)
    for mode in (CommitMode.KEEP, CommitMode.FRAME):
        commands = list(script.commands)
        assert commands[-1] >> 60 == 3
        script.commands[-1] |= int(mode) << 54
    script.wait_ticks(LINES * TICKS)
    assert swaps_of(equal(SequencerBench("icarus", SMALL, tmp_path), script).capture) == {"begins": 1}
