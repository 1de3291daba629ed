"""The Verilog sequencer with ALTERNATE against the integer model, on every tick.

Both axes go by turns through one pipeline, so a tick of either parity of the clock is played, at even and odd paces.
"""

import subprocess
from pathlib import Path

import numpy as np
import pytest
from pair_play import ALTERNATE, PAIR_PACES, PAIR_SHAPES, pair_script, pair_sources
from programs import random_dual
from sets import common, common_and_rest
from stream_benches import equal
from stream_configurations import Configuration
from stream_laws import follow_their_programs
from stream_scripts import FAULTS, flag, occurrences, random_play, swaps_at_every_tick
from test_stream_modes import MODES, random_commits, swaps_of

from tablegen.device.by_turns import not_by_turns
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import FLAGS
from tablegen.verification.verilog.sequencer_bench import SequencerBench

LATENCY = 48  # clocks from a tick to its strobe
CODES = {"X_POWER_UP_CODE": 255, "Y_POWER_UP_CODE": 77}


def bench_of(
    shape: SequencerShape, folder: Path, parameters: dict[str, int] | None = None, simulator: str = "icarus"
) -> SequencerBench:
    return SequencerBench(simulator, shape, folder, ALTERNATE | (parameters or {}), pair_sources())


@pytest.mark.common
@pytest.mark.parametrize("name", common_and_rest(["bits_16"], ["bits_8", "direct", "words_15"], PAIR_SHAPES))
def test_random_programs(name: str, tmp_path: Path) -> None:
    shape, parameters = PAIR_SHAPES[name], CODES if name == "bits_8" else {}
    script = pair_script((parameters.get("X_POWER_UP_CODE", 0), parameters.get("Y_POWER_UP_CODE", 0)))
    script.tick_every(PAIR_PACES[0])
    script.wait_ticks(5)
    random_play(np.random.default_rng(len(name)), script, shape, 6000, PAIR_PACES)
    played = equal(bench_of(shape, tmp_path, parameters), script)
    assert played.latency == LATENCY
    assert script.swaps > 20
    seen = occurrences(played.capture)
    assert all(seen[name] for name in (*FLAGS, *FAULTS[:2])), seen


@pytest.mark.common
@pytest.mark.parametrize("pace", common([2], [2, 3]))
def test_a_swap_is_requested_at_every_tick_and_taken_at_line_starts(pace: int, tmp_path: Path) -> None:
    shape, rng = SequencerShape(16, 1, 3, 16, 1, 2, 16), np.random.default_rng(pace)
    pair = tuple(random_dual(rng, shape, (16, 20), kind="smooth") for _ in range(2))
    script = pair_script()
    script.tick_every(pace)
    swaps_at_every_tick(script, (pair[0], pair[1]))
    capture = equal(bench_of(shape, tmp_path), script).capture
    assert np.sum(flag(capture, "swapped") & flag(capture, "playing")) == max(p.schedule.ticks for p in pair)
    follow_their_programs(capture, script.swapped_programs)


REFUSED = {
    "two widths": (SequencerShape(16, 1, 3, 16, 1, 3, 18), "give both tables 18 bits"),
    "short words": (SequencerShape(18, 1, 3, 16, 1, 3, 16), "give both tables 17 bits"),
    "wide codes": (SequencerShape(23, 1, 3, 24, 1, 3, 24), "LOW_AREA does"),
    "cubic": (SequencerShape(16, 1, 3, 16, 3, 3, 16), "LOW_AREA does"),
}


def test_programs_that_it_does_not_play_have_a_reason_and_a_remedy() -> None:
    def obstacle(shape: SequencerShape) -> tuple[str, str] | None:
        program = random_dual(np.random.default_rng(1), shape, (16, 20), kind="smooth")
        return not_by_turns(program.x, program.y)

    assert all(obstacle(shape) is None for shape in PAIR_SHAPES.values())
    for name, (shape, remedy) in REFUSED.items():
        found = obstacle(shape)
        assert found is not None, name
        assert found[1] == remedy, name


@pytest.mark.common
@pytest.mark.parametrize("name", REFUSED)
def test_the_sequencer_refuses_them(name: str) -> None:
    given = [f"-Pdac_sequencer.{key}={value}" for key, value in (REFUSED[name][0].parameters() | ALTERNATE).items()]
    command = ["iverilog", "-g2005", "-t", "null", "-s", "dac_sequencer", *given, *map(str, pair_sources())]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "ALTERNATE" in done.stderr


@pytest.mark.rest
def test_random_commits_of_every_mode(tmp_path: Path) -> None:
    configuration = Configuration(PAIR_SHAPES["bits_16"], paces=(2,), ticks=(8, 20))
    script = pair_script()
    random_commits(np.random.default_rng(3), script, configuration, 3000)
    seen = swaps_of(equal(bench_of(configuration.shape, tmp_path, MODES), script).capture)
    assert seen["begins"], seen
    assert seen["goes on"], seen


@pytest.mark.rest
def test_random_programs_on_verilator(tmp_path: Path) -> None:
    script = pair_script()
    random_play(np.random.default_rng(12), script, PAIR_SHAPES["bits_16"], 20_000, PAIR_PACES)
    equal(bench_of(PAIR_SHAPES["bits_16"], tmp_path, simulator="verilator"), script)


@pytest.mark.common
def test_a_tick_that_comes_too_early_is_a_fault(tmp_path: Path) -> None:
    """With a tick a clock every second one is refused, and the others go on as if alone."""
    shape = SequencerShape(16, 1, 3, 16, 1, 2, 16)
    program = random_dual(np.random.default_rng(2), shape, (20, 20), kind="tame")
    script = pair_script()
    script.load(program)
    script.request("commit", program=program)
    script.wait(5)
    script.tick_every(2)
    script.wait(1)  # the program is taken
    script.request("arm", "trigger")
    script.wait_ticks(100)
    script.commands[script.commands.index(4 << 60 | 2)] -= 1
    played = bench_of(shape, tmp_path).play(script)
    expected = np.array(script.expected, dtype=np.uint64)
    assert played.fault_counts == (0, 0, len(expected), 0)
    markers = ~np.uint64(1 << 48 + FLAGS.index("valid") | 1 << 56 + FAULTS.index("overrun"))
    assert np.array_equal(played.capture & markers, expected & markers)
    assert np.all(flag(played.capture, "overrun"))
