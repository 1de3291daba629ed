"""``NAME_top.v``, the instance that a build emits: of every kind of scan it plays the words of the integer model."""

import subprocess
from pathlib import Path

import pytest
from building import BENCHES, NAME, Build, run_clean
from sets import common, one_of, quick
from short_scans import CUBIC, DIRECT, model_ticks, short
from test_lint import lint

TOP, BENCH = f"{NAME}_top", BENCHES / "top_bench.v"
SCANS: dict[str, dict[str, object]] = {
    "Fourier": {},
    "direct x": {"x.table": DIRECT},
    "direct": {"x.table": DIRECT, "y.table": DIRECT},
    "cubic": {"x.table": CUBIC, "y.table": CUBIC},
    "18 bits": {"dac.bits": 18, "dac.word_bits": 20, "dac.align": "left"},
    "24 bits, two's complement": {"dac.bits": 24, "dac.coding": "twos-complement"},
    "shaped": {"dac.shaping": "second"},
    "y at rest": {"y": {"motion": "off", "offset_v": 50.0}},
}
BY_TURNS = {"ALTERNATE": 1}
REFUSED: dict[str, tuple[dict[str, object], dict[str, int], str]] = {
    "shaping": ({"dac.shaping": "second"}, {"SHAPING": 1}, "SHAPING_is_less_than_that_of_the_scan"),
    "harmonics": ({}, {"HARMONICS": 4}, "HARMONICS_is_less_than_those_of_the_scan"),
    "ticks": ({}, {"TICK_BITS": 8}, "TICK_BITS_is_less_than_the_scan_takes"),
    "lines": ({}, {"LINE_BITS": 2}, "LINE_BITS_is_less_than_the_scan_takes"),
    "period": ({}, {"PERIOD_BITS": 11}, "PERIOD_BITS_is_less_than_the_scan_takes"),
    "low area": ({}, {"LOW_AREA": 1, "CLOCKS_PER_TICK": 40}, "CLOCKS_PER_TICK_is_less_than_the_sequencer_takes"),
    "scanner": ({}, {"SHAPING": 3, "CLOCKS_PER_TICK": 5}, "CLOCKS_PER_TICK_is_less_than_the_sequencer_takes"),
    "cubic": ({"x.table": CUBIC}, {"CLOCKS_PER_TICK": 10}, "CLOCKS_PER_TICK_is_less_than_the_sequencer_takes"),
    "by turns": ({}, BY_TURNS | {"CLOCKS_PER_TICK": 1}, "CLOCKS_PER_TICK_is_less_than_the_sequencer_takes"),
    "cubic by turns": ({"x.table": CUBIC}, BY_TURNS, "ALTERNATE_plays_no_cubic_table_LOW_AREA_does"),
    "shaped by turns": ({"dac.shaping": "second"}, BY_TURNS, "ALTERNATE_plays_no_shaped_output_LOW_AREA_does"),
    "two widths by turns": (
        {"y.table": {"bits": 18}},
        BY_TURNS,
        "ALTERNATE_plays_table_words_of_the_same_bits_give_both_tables_18_bits",
    ),
}
LINES = 2


def runtime(built: Build) -> list[Path]:
    return [built.folder / f"{TOP}.v", *sorted(built.folder.glob("dac_*.v"))]


@pytest.mark.common
@pytest.mark.parametrize("name", common(("direct x", "cubic", "shaped"), SCANS))
def test_it_plays_the_words_of_the_model(name: str, tmp_path: Path) -> None:
    plays_the_model(short(tmp_path, SCANS[name]), tmp_path)


@pytest.mark.common
@pytest.mark.parametrize("name", common(("Fourier",), ("Fourier", "direct x", "direct", "y at rest")))
def test_it_plays_them_by_turns(name: str, tmp_path: Path) -> None:
    """Of tables that are rendered otherwise it boots the words."""
    plays_the_model(short(tmp_path, SCANS[name]), tmp_path, pace=2, by_turns=1)


def plays_the_model(built: Build, tmp_path: Path, pace: int = 11, by_turns: int = 0) -> None:
    """Hold what a top plays, with a tick every so many clocks, against the integer model."""
    program, simulation = built.plan.program, tmp_path / "top.vvp"
    count = LINES * built.plan.schedule.ticks
    sources = [f"-I{built.folder}", "-Wall", "-s", "top_bench", BENCH, *runtime(built)]
    parameters = {"TICKS": count, "CLOCKS_PER_TICK": pace, "ALTERNATE": by_turns}
    given = [f"-Ptop_bench.{key}={value}" for key, value in parameters.items()]
    run_clean(["iverilog", "-g2005", *given, *sources, "-o", simulation])
    rows = [line.split() for line in run_clean(["vvp", "-n", simulation], built.folder).splitlines()]
    x, y = program.x.output, program.y.output
    parked = len(rows) - count
    assert 0 < parked * pace < 110
    assert rows == [
        [str(x.word(tick.x)), str(y.word(tick.y)), f"{at >= parked:b}{tick.line:b}{tick.frame:b}{tick.valid:b}"]
        for at, tick in enumerate(model_ticks(program, count, parked))
    ]


@pytest.mark.common
def test_a_host_commits_with_a_mode(tmp_path: Path) -> None:
    """A frame begins with the next line, goes on, or begins when it would have."""
    built = short(tmp_path, SCANS["direct"])
    lines = built.plan.schedule.lines
    sources = [f"-I{built.folder}", "-Wall", "-s", "top_modes_bench", BENCHES / "top_modes_bench.v", *runtime(built)]
    markers = {0: "11", 1: "10", 2: "11"}
    for mode, seen in markers.items():
        run_clean(["iverilog", "-g2005", f"-Ptop_modes_bench.MODE={mode}", *sources, "-o", tmp_path / "modes.vvp"])
        said = run_clean(["vvp", "-n", tmp_path / "modes.vvp"], built.folder).splitlines()
        assert said[0] == "can_keep 1"
        number = int(said[1].removeprefix(f"{seen} line "))
        assert (number == lines) if mode == 2 else (2 <= number < lines), said


@pytest.mark.common
@pytest.mark.parametrize("name", one_of(2, SCANS))
def test_no_tool_warns_of_it(name: str, tmp_path: Path) -> None:
    built = short(tmp_path, SCANS[name])
    run_clean(["iverilog", "-g2005", "-Wall", "-t", "null", "-s", TOP, *runtime(built)])
    assert lint(TOP, {}, built.folder) == ""


@pytest.mark.rest
@pytest.mark.parametrize("name", ["Fourier", "direct x"])
def test_no_tool_warns_of_it_by_turns(name: str, tmp_path: Path) -> None:
    built = short(tmp_path, SCANS[name])
    run_clean(["iverilog", "-g2005", "-Wall", "-t", "null", "-s", TOP, f"-P{TOP}.ALTERNATE=1", *runtime(built)])
    assert lint(TOP, BY_TURNS, built.folder) == ""


@pytest.mark.parametrize("name", quick(("shaping", "ticks"), REFUSED))
def test_a_parameter_that_the_scan_does_not_fit_is_refused_by_name(name: str, tmp_path: Path) -> None:
    scan, parameters, reason = REFUSED[name]
    built = short(tmp_path, scan)
    given = [f"-P{TOP}.{key}={value}" for key, value in parameters.items()]
    command = ["iverilog", "-g2005", "-t", "null", "-s", TOP, *given, *runtime(built)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert f"Unknown module type: {TOP}_{reason}" in done.stderr
