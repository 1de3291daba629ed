"""A scan at an angle in Verilog that is moved, zoomed and turned at random while it plays, on every tick."""

from collections.abc import Callable

import numpy as np
import pytest
from sets import LONG_TEST
from slow_scripts import SLOW_PART, slow_sources
from turned_changes import PARK_CODES, Broken, Seen, shape_of_plans
from turned_scripts import TurnedScript, turned_script

from tablegen.device.commit_mode import CommitMode
from tablegen.verification.verilog.sequencer_bench import SequencerBench

pytestmark = pytest.mark.rest

CHUNK = 2000  # changes of a script
MODE_AT = 54  # in a request


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> SequencerBench:
    codes = {f"{axis}_POWER_UP_CODE": code for axis, code in zip("XY", PARK_CODES, strict=True)}
    parameters = {**SLOW_PART, **codes, "COMMIT_MODES": 1}
    folder = tmp_path_factory.mktemp("turned")
    return SequencerBench("verilator", shape_of_plans(), folder, parameters, slow_sources())


def play(bench: SequencerBench, made: TurnedScript) -> Seen:
    """Every tick has to be that of the model, and to keep the laws."""
    run = bench.play(made.script)
    assert run.equal, run
    assert run.fault_counts[2:] == (0, 0)
    return made.follow(run.capture)


@pytest.mark.parametrize("changes", [300, pytest.param(100_000, marks=LONG_TEST)])
def test_no_change_leaves_a_limit_or_begins_a_frame_again(
    changes: int, bench: SequencerBench, record_property: Callable[[str, object], None]
) -> None:
    """Commits at any tick: every code inside its limits, every line of one program, each frame with all its lines."""
    seen = Seen()
    for chunk, left in enumerate(range(changes, 0, -CHUNK)):
        made = turned_script(np.random.default_rng([changes, chunk]), min(left, CHUNK))
        seen.counts += play(bench, made).counts
    record_property("seen", str(seen))
    taken = sum(seen.counts[kind] for kind in ("goes on", "begins again"))
    assert changes * 0.95 < taken <= changes  # but those that are taken at rest
    assert seen.counts["goes on"] > 0.9 * changes
    assert seen.counts["whole lines of an axis"] > changes


def test_a_frame_that_begins_again_is_found(bench: SequencerBench) -> None:
    """The control: one commit of many is sent with another mode, by which the device begins at line 0."""
    made = turned_script(np.random.default_rng(5), 40)
    commands = made.script.commands
    keeping = [at for at, word in enumerate(commands) if word >> 60 == 3 and word >> MODE_AT & 3 == CommitMode.KEEP]
    commands[keeping[20]] &= ~(3 << MODE_AT)
    run = bench.play(made.script)
    assert run.mismatch is not None
    with pytest.raises(Broken, match=r"line \d is due"):
        made.follow(run.capture)
