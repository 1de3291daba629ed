"""``examples/firmware/soft_core/soft_core_both.v``: z stays on the ticks of x and y, whatever is requested, and when.

The sequencers are stubs of ``dac_scan`` and ``dac_bank``, so that requests on many clocks take no time. The device
itself is in ``test_soft_core_z.py``.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import pytest
from building import BENCHES, REPOSITORY, run_clean

from tablegen.base.resources import verilog_runtime

pytestmark = pytest.mark.rest

SOURCE = REPOSITORY / "examples" / "firmware" / "soft_core" / "soft_core_both.v"
CLOCKS_PER_TICK = 8  # of the bench
SEEDS = 3
# A tick waits some clocks; with slow parts until the other line is worked out, where no scan plays.
LONGEST = CLOCKS_PER_TICK + 5, CLOCKS_PER_TICK + 70


@dataclass(frozen=True)
class Play:
    """What a run of the bench shows: ticks on which the markers differ, played ticks, waits, programs, parks."""

    apart: int
    ticks: int
    waited: int
    taken: int
    longest: int
    parks: int


def plays(folder: Path, slow_part: int, loses: int = 0, source: Path = SOURCE) -> Iterator[Play]:
    """Run the bench with random requests of one seed after the other."""
    runtime = [path for path in verilog_runtime() if path.name in ("dac_scan.v", "dac_bank.v")]
    for seed in count(1):
        values = {"SLOW_PART": slow_part, "LOSES": loses, "SEED": seed}
        given = [f"-Psoft_core_both_bench.{name}={value}" for name, value in values.items()]
        sources = [BENCHES / "soft_core_both_bench.v", source, *runtime]
        run_clean(["iverilog", "-g2005", *given, "-o", folder / "bench.vvp", *sources])
        run_clean(["vvp", folder / "bench.vvp"], folder)
        apart = len((folder / "apart.log").read_text("ascii").splitlines())
        yield Play(apart, *map(int, (folder / "result.log").read_text("ascii").split()))


@pytest.mark.parametrize("slow_part", [0, 1], ids=["tables", "slow part"])
def test_z_has_the_markers_of_x_and_y(tmp_path: Path, slow_part: int) -> None:
    for play, _ in zip(plays(tmp_path, slow_part), range(SEEDS), strict=False):
        assert (play.apart, play.parks) == (0, 0)
        assert play.ticks > 1000
        assert play.taken > 10
        assert play.waited > 0
        assert play.longest <= LONGEST[slow_part]


@pytest.mark.parametrize("slow_part", [0, 1], ids=["tables", "slow part"])
def test_both_are_parked_where_z_alone_is(tmp_path: Path, slow_part: int) -> None:
    play = next(plays(tmp_path, slow_part, loses=1))
    assert play.parks > 1
    assert play.apart <= play.parks, "a tick may come before the park"
    assert play.ticks > 500


MUTANTS = {
    "no tick waits for a trigger": ("wire waits = alone || (", "wire waits = (", 0),
    "no tick waits for a commit": ("(SLOW_PART == 0 || !plays_on));", "1'b0);", 0),
    "no tick waits where no scan plays": ("(SLOW_PART == 0 || !plays_on));", "SLOW_PART == 0);", 1),
    "x and y do not wait for z": ("(trigger && !z_trigger) || alone;", "trigger;", 0),
    "x and y do not wait for a line of z": ("(SLOW_PART != 0 || !z_commit)) || hand;", "1'b1);", 0),
    "the next tick is early": ("due ? divider : divider + 1'b1;", "divider + 1'b1;", 0),
}


@pytest.mark.parametrize("breaks", MUTANTS)
def test_faults_are_found(tmp_path: Path, breaks: str) -> None:
    right, wrong, slow_part = MUTANTS[breaks]
    text = SOURCE.read_text("utf-8")
    assert text.count(right) == 1
    mutant = tmp_path / "mutant.v"
    mutant.write_text(text.replace(right, wrong), "utf-8")
    for play, _ in zip(plays(tmp_path, slow_part, source=mutant), range(SEEDS), strict=False):
        if play.apart or play.parks or play.longest > LONGEST[slow_part]:
            return
    raise AssertionError(breaks)
