"""The Verilog sequencer with PIXEL_INDEX_BITS against the integer model, on every tick.

Programs with a table of pixels and without one take turns, in each kind of sequencer; tables that do not fit their
windows are refused.
"""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from pair_play import ALTERNATE, DRAIN, pair_sources
from pixel_scripts import PIXEL_TABLE, PixelScript, pixel_program, refuse_tables
from programs import random_dual
from sets import common
from stream_benches import equal
from stream_configurations import Configuration
from stream_scripts import flag, random_play, swaps_at_every_tick
from test_stream_modes import MODES, random_commits

from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import read_capture, read_states
from tablegen.verification.verilog.sequencer_bench import SequencerBench

SHAPE = SequencerShape(16, 1, 4, 16, 1, 3, 16)
SMALL_COUNTERS = {"TICK_BITS": 5, "LINE_BITS": 3, "PERIOD_BITS": 9}
# Parameters, paces, and samples.
KINDS: dict[str, tuple[dict[str, int | str], tuple[int, ...], int]] = {
    "pipelined": ({}, (1, 2, 3, 7), 6000),
    "low_area": ({"LOW_AREA": 1}, (41, 64), 1200),
    "alternate": (ALTERNATE, (2, 3, 5), 3000),
    "small_counters": ({"PLAIN_MULTIPLIER": 1, **SMALL_COUNTERS}, (1, 2), 3000),
    "commit_modes": ({"PLAIN_MULTIPLIER": 1, **MODES}, (1,), 3000),
}


def bench_of(
    folder: Path, parameters: dict[str, int | str], simulator: str = "icarus", states: Path | None = None
) -> SequencerBench:
    given = PIXEL_TABLE | parameters | ({} if states is None else {"STATES": str(states)})
    return SequencerBench(simulator, SHAPE, folder, given, pair_sources())


def tables_of(script: PixelScript) -> Counter[bool]:
    """How many programs were taken that have a table, and that have none."""
    return Counter(program.schedule.pixel_table is not None for program in script.swapped_programs)


@pytest.mark.common
@pytest.mark.parametrize("kind", common(["pipelined"], KINDS))
def test_random_programs(kind: str, tmp_path: Path) -> None:
    parameters, paces, samples = KINDS[kind]
    rng, script = np.random.default_rng(len(kind)), PixelScript(drain=DRAIN)
    script.tick_every(paces[0])
    script.wait_ticks(5)
    if kind == "commit_modes":
        random_commits(rng, script, Configuration(SHAPE, paces=paces, ticks=(8, 20)), samples, pixels=True)
    else:
        random_play(rng, script, SHAPE, samples, paces, (8, 32), (1, 5), pixels=True)
    played = equal(bench_of(tmp_path, parameters), script)
    seen = tables_of(script)
    assert min(seen[True], seen[False]) > 2, seen
    assert np.any(flag(played.capture, "pixel"))


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_random_programs_on_verilator(tmp_path: Path) -> None:
    script = PixelScript(drain=DRAIN)
    random_play(np.random.default_rng(12), script, SHAPE, 50_000, (1, 2, 5), pixels=True)
    equal(bench_of(tmp_path, {"PLAIN_MULTIPLIER": 1}, "verilator"), script)


@pytest.mark.rest
def test_a_swap_is_requested_at_every_tick(tmp_path: Path) -> None:
    """From a table to equal pixels and back: no pixel is one of the other program."""
    rng, script = np.random.default_rng(3), PixelScript(drain=DRAIN)
    equal_pixels, table = random_dual(rng, SHAPE, (30, 34), kind="tame"), pixel_program(rng, SHAPE, (26, 30), 2, 8)
    script.tick_every(1)
    swaps_at_every_tick(script, (equal_pixels, table))
    equal(bench_of(tmp_path, {"PLAIN_MULTIPLIER": 1}), script)
    assert script.swaps > 20


@pytest.mark.common
def test_a_table_that_does_not_fill_its_windows_is_refused(tmp_path: Path) -> None:
    """Each is taken once it was made right; the program that plays goes on meanwhile."""
    script, states = PixelScript(drain=DRAIN), tmp_path / "states.hex"
    refuse_tables(np.random.default_rng(5), script, SHAPE)
    equal(bench_of(tmp_path, {"PLAIN_MULTIPLIER": 1}, states=states), script)
    stored = read_states([int(word) for word in read_capture(states)])
    assert len(stored) > 30
    for (when, expected), state in zip(script.states, stored, strict=True):
        assert state.flags == expected.flags, when
