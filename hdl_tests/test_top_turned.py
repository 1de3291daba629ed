"""``NAME_top.v`` of scans with a slow part: of random programs it boots and plays the words of the integer model."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
from building import run_clean
from slow_scripts import least_ticks, random_scan, slow_pace
from test_lint import lint

from tablegen.device.clocks import least_slow_clocks
from tablegen.emit.turned_content import TurnedContent
from tablegen.emit.turned_verilog import turned_verilog_files, turned_verilog_runtime
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.verilog.turned_play import TurnedPlay

TOP = "slow_top"
SHAPES = {
    "cubic": SequencerShape(16, 3, 4, 16, 3, 3, 16),
    "cubic and lines": SequencerShape(20, 3, 4, 21, 1, 5, 9),
    "lines": SequencerShape(8, 1, 4, 12, 1, 3, 8),
    "scanner lines": SequencerShape(16, 1, 4, 16, 1, 3, 16),
}
SHAPING = {"scanner lines": 3}
LINES = 3
REFUSED = {
    "SLOW_INDEX_BITS": "SLOW_INDEX_BITS_is_less_than_the_scan_takes",
    "TICK_BITS": "TICK_BITS_is_less_than_the_scan_takes",
    "LINE_BITS": "LINE_BITS_is_less_than_the_scan_takes",
    "PERIOD_BITS": "PERIOD_BITS_is_less_than_the_scan_takes",
    "CLOCKS_PER_TICK": "CLOCKS_PER_TICK_is_less_than_the_sequencer_takes",
}


def emitted(name: str, folder: Path) -> TurnedContent:
    """The files of a random program of a shape, as a build has them."""
    shape = SHAPES[name]
    ticks, order = least_ticks(shape, slow_pace(shape)), SHAPING.get(name, 0)
    program = random_scan(np.random.default_rng(sum(name.encode())), shape, ticks, LINES, "wild", order)
    assert program.shaping_order == order
    content = TurnedContent("slow", "5" * 64, program)
    runtime = {path.name: path.read_bytes() for path in turned_verilog_runtime()}
    for file, text in (turned_verilog_files(content) | runtime).items():
        (folder / file).write_bytes(text)
    return content


@pytest.mark.rest
@pytest.mark.parametrize("name", SHAPES)
def test_a_frame_and_the_start_of_the_next_are_those_of_the_model(name: str, tmp_path: Path) -> None:
    content = emitted(name, tmp_path)
    ticks = (LINES + 1) * content.program.schedule.ticks
    checks = TurnedPlay(content, ticks).checks(tmp_path, tmp_path / "work", "icarus")
    assert [check.failure for check in checks] == [None, None]
    assert checks[1].compared.endswith(f" words booted, {ticks} ticks")


@pytest.mark.common
@pytest.mark.parametrize("name", SHAPES)
def test_no_tool_warns_of_it(name: str, tmp_path: Path) -> None:
    emitted(name, tmp_path)
    sources = [tmp_path / f"{TOP}.v", *sorted(tmp_path.glob("dac_*.v"))]
    run_clean(["iverilog", "-g2005", "-Wall", "-t", "null", "-s", TOP, *sources])
    assert lint(TOP, {}, tmp_path) == ""


def refusal(folder: Path, key: str, value: int) -> str:
    """What Icarus says of the top with a parameter that it refuses."""
    sources = [folder / f"{TOP}.v", *sorted(folder.glob("dac_*.v"))]
    command = ["iverilog", "-g2005", "-t", "null", "-s", TOP, f"-P{TOP}.{key}={value}", *sources]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    return done.stderr


@pytest.mark.common
def test_a_parameter_that_the_scan_does_not_fit_is_refused_by_name(tmp_path: Path) -> None:
    content = emitted("cubic", tmp_path)
    for key, reason in REFUSED.items():
        value = least_slow_clocks(content.program) - 1 if key == "CLOCKS_PER_TICK" else 1
        assert f"Unknown module type: {TOP}_{reason}" in refusal(tmp_path, key, value)


@pytest.mark.common
def test_an_order_below_that_of_the_scan_is_refused_and_one_above_takes_its_clocks(tmp_path: Path) -> None:
    """A sequencer that shapes takes 2 clocks more a tick, whatever it plays first."""
    shaped = emitted("scanner lines", tmp_path)
    assert least_slow_clocks(shaped.program) == slow_pace(SHAPES["lines"], 3) == 46
    assert f"{TOP}_SHAPING_is_less_than_that_of_the_scan" in refusal(tmp_path, "SHAPING", 2)
    for name, clocks in (("lines", 44), ("cubic", 93)):
        unshaped = emitted(name, tmp_path)
        assert least_slow_clocks(unshaped.program) == clocks
        text = (tmp_path / f"{TOP}.v").read_text("ascii")
        assert f"localparam CLOCKS = SHAPING != 0 ? {clocks + 2} : {clocks};" in text
