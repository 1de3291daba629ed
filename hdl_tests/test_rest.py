"""Programs in which x rests, as y does in a line scan, or both, against the model on every tick.

Each kind of table and of sequencer plays an image, a line along y, a point, a line along x and a line along y again,
in one scan: what rests is part of a program, and changes with its first sample.
"""

from pathlib import Path

import numpy as np
import pytest
from pair_play import ALTERNATE, PAIR_PACES, PAIR_SHAPES, pair_script, pair_sources
from resting import at_rest, check_rest, rest_script
from sets import common_and_rest
from stream_benches import equal
from stream_configurations import CONFIGURATIONS
from stream_laws import Broken

from tablegen.verification.play.stream import Script
from tablegen.verification.verilog.sequencer_bench import SequencerBench

KINDS = ("bits_16", "bits_16_plain", "bits_18_plain", "bits_12", "low_area", "cubic", "cubic_low_area")


@pytest.mark.common
@pytest.mark.parametrize("name", common_and_rest(KINDS[:1], KINDS[1:], KINDS))
def test_x_rests_as_y_does(name: str, tmp_path: Path) -> None:
    configuration = CONFIGURATIONS[name]
    placement = configuration.placement
    script = Script(drain=placement.drain_clocks if placement.spline else Script.drain)
    programs = rest_script(np.random.default_rng(7), script, configuration.shape, configuration.paces[0])
    bench = SequencerBench("icarus", configuration.shape, tmp_path, dict(configuration.parameters))
    check_rest(equal(bench, script).capture, programs)


@pytest.mark.rest
def test_x_rests_where_both_axes_go_by_turns(tmp_path: Path) -> None:
    shape, script = PAIR_SHAPES["bits_16"], pair_script()
    programs = rest_script(np.random.default_rng(8), script, shape, PAIR_PACES[0])
    bench = SequencerBench("icarus", shape, tmp_path, dict(ALTERNATE), pair_sources())
    check_rest(equal(bench, script).capture, programs)


@pytest.mark.common
def test_an_x_that_moves_would_be_seen(tmp_path: Path) -> None:
    """The capture held against programs of which another axis rests."""
    shape, script = CONFIGURATIONS["bits_16"].shape, Script()
    programs = rest_script(np.random.default_rng(9), script, shape, 1)
    capture = equal(SequencerBench("icarus", shape, tmp_path, {}), script).capture
    check_rest(capture, programs)
    with pytest.raises(Broken):
        check_rest(capture, [at_rest(programs[0], "x"), *programs[1:]])
