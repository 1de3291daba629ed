"""What docs/tables.md says of memory and error, measured again; its figure, and the keys that it shows."""

import importlib
import re
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from building import REPOSITORY
from editing import SCAN, edited, run, write_pair

from tablegen.config.load import load
from tablegen.planning import frame_costs
from tablegen.planning.line_plan import Plan, make_plan
from tablegen.planning.played_table import MeasuredRun
from tablegen.planning.table_costs import cells, counts, measured

PAGE = (REPOSITORY / "docs" / "tables.md").read_text("utf-8")
ROWS = [row for row in PAGE.splitlines() if re.match(r"\| (?:[xy]|\d+ bits, \d+ ticks) \|", row)]


@pytest.fixture(scope="module")
def benchmark() -> ModuleType:
    """The benchmark, which is no package."""
    sys.path.insert(0, str(REPOSITORY / "benchmarks"))
    try:
        return importlib.import_module("tables")
    finally:
        sys.path.remove(str(REPOSITORY / "benchmarks"))


@pytest.fixture(scope="module")
def example() -> Plan:
    return make_plan(load(REPOSITORY / "examples" / "annexin_200nm.toml"))


def test_the_page_has_every_row(benchmark: ModuleType) -> None:
    names = [f"{axis} | {error:g}" for axis in "xy" for error in benchmark.ERRORS]
    names += [f"{bits} bits, {ticks} ticks | {error:g}" for bits, ticks, error in benchmark.SINES]
    assert [row.split(" | ")[:2] for row in ROWS] == [f"| {name}".split(" | ") for name in names]


def test_rows_of_x_are_measured(benchmark: ModuleType, example: Plan) -> None:
    assert [benchmark.row("x", example.x, error) for error in benchmark.ERRORS] == ROWS[: len(benchmark.ERRORS)]


@pytest.mark.common
def test_rows_of_y_are_measured(benchmark: ModuleType, example: Plan) -> None:
    count = len(benchmark.ERRORS)
    assert [benchmark.row("y", example.y, error) for error in benchmark.ERRORS] == ROWS[count : 2 * count]


@pytest.mark.common
def test_rows_of_sines_are_measured(benchmark: ModuleType) -> None:
    rows = [
        benchmark.row(f"{bits} bits, {ticks} ticks", benchmark.sine(bits, ticks), error)
        for bits, ticks, error in benchmark.SINES
    ]
    assert rows == ROWS[2 * len(benchmark.ERRORS) :]


@pytest.mark.common
def test_the_figure_is_what_the_benchmark_draws(benchmark: ModuleType) -> None:
    assert benchmark.FIGURE.read_bytes() == benchmark.figure()


def test_what_the_modes_take_is_what_the_command_says(benchmark: ModuleType) -> None:
    assert f"<!-- costs -->\n{benchmark.costs()}<!-- /costs -->" in PAGE


def test_what_a_scan_at_an_angle_takes_is_what_the_command_says(benchmark: ModuleType) -> None:
    assert f"<!-- slow -->\n{benchmark.slow()}<!-- /slow -->" in PAGE


def _whole(mark: str) -> list[list[str]]:
    table = PAGE.split(f"<!-- {mark} -->", 1)[1].split(f"<!-- /{mark} -->", 1)[0]
    return [line.strip("| ").split(" | ") for line in table.splitlines()[3:]]


def test_emitted_scans_take_what_they_are_told() -> None:
    """In runs, of all processors, and tick by tick."""
    rows = _whole("whole")
    assert len(rows) > 8
    for name, *pairs in rows:
        for counted, told in (map(float, pair.split(", ")) for pair in pairs):
            assert abs(told / counted - 1.0) <= 0.012, (name, counted, told)


def test_emitted_scans_at_0_degrees_take_what_they_are_told() -> None:
    """Without the slew rate of the amplifier they take 2 % more at most, and fast lines 10 %."""
    rows = {name: [tuple(map(float, pair.split(", "))) for pair in pairs] for name, *pairs in _whole("straight")}
    assert len(rows) == 4
    for name, pairs in rows.items():
        for counted, told in pairs:
            assert -0.01 <= 1.0 - told / counted < 0.03, name
    for name, most in (("no `max_slew_v_per_s`", 1.02), ("lines of 313 ticks", 1.1)):
        for (counted, _), (example, _) in zip(rows[name], rows["the example"], strict=True):
            assert counted < most * example, name


@pytest.mark.rest
@pytest.mark.parametrize(
    ("core", "run_of", "mode"),
    [
        ("cortex-m4", MeasuredRun(16, 16, False), "cubic"),
        ("riscv32", MeasuredRun(32, 32, True), "interpolated"),
        ("cortex-m0plus", MeasuredRun(16, 16, False, 3), "interpolated"),
    ],
)
def test_instructions_are_counted(benchmark: ModuleType, core: str, run_of: MeasuredRun, mode: str) -> None:
    """A cubic table of 16 bits may take 30 on a Cortex-M4."""
    counted = benchmark.mode_costs.instructions(core, run_of, mode)
    assert counted == counts()[run_of][mode][core]
    assert mode != "cubic" or counted.in_runs <= 30.0


@pytest.mark.rest
def test_a_direct_table_takes_what_lines_take(benchmark: ModuleType) -> None:
    """In runs the same loop plays both; a tick that is played by itself takes one or two instructions less."""
    run_of = MeasuredRun(16, 16, False)
    counted = benchmark.mode_costs.instructions("cortex-m4", run_of, "direct")
    in_runs, by_tick, *_ = counts()[run_of]["interpolated"]["cortex-m4"]
    assert counted.in_runs == pytest.approx(in_runs, abs=0.2)
    assert 0.0 <= by_tick - counted.by_tick < 2.0


def test_instructions_are_of_this_c(benchmark: ModuleType) -> None:
    """What is counted follows from what the digest is of, and from the versions of the compilers."""
    assert measured()["sources"] == benchmark.mode_costs.digest(), "run `python benchmarks/tables.py --costs`"


def test_instructions_at_an_angle_are_of_this_c(benchmark: ModuleType) -> None:
    digest = benchmark.slow_costs.digest()
    assert frame_costs.measured()["sources"] == digest, "run `python benchmarks/slow_costs.py`"


@pytest.mark.rest
def test_instructions_at_an_angle_are_counted(benchmark: ModuleType) -> None:
    run_of = MeasuredRun(16, 16, True)
    counted = benchmark.slow_costs.slow_count("cortex-m4", run_of)
    assert counted == frame_costs.slow_counts()[run_of]["cortex-m4"]


@pytest.mark.rest
@pytest.mark.parametrize(
    ("core", "name", "most"), [("cortex-m4", "M4", 26.0), ("cortex-m0plus", "M0+", 48.0), ("riscv32", "RV32", 35.0)]
)
def test_linear_tables_at_an_angle_take_what_the_page_says(
    benchmark: ModuleType, core: str, name: str, most: float
) -> None:
    """Samples and codes in loops of their own, with a check of each code, would take 29.7, 49.4 and 30.8."""
    counted = benchmark.slow_costs.linear_count(core)
    assert counted <= most
    assert f"{counted} on {'a Cortex-' if core != 'riscv32' else ''}{name}" in " ".join(PAGE.split())


@pytest.mark.parametrize("counts_of", ["mode_costs", "slow_costs"])
def test_a_change_of_the_c_changes_the_digest(benchmark: ModuleType, counts_of: str, tmp_path: Path) -> None:
    module, copies = getattr(benchmark, counts_of), []
    digest = module.digest
    for path in [*module.sequencer(), module.COUNTED]:
        copies.append(tmp_path / path.name)
        copies[-1].write_text(path.read_text("utf-8"), "utf-8")
    (axis,) = (copy for copy in copies if copy.name == "dac_axis.c")
    text = axis.read_text("utf-8")
    axis.write_text(f"/* another comment */\n{text}", "utf-8")
    assert digest(copies) == digest()
    axis.write_text(text.replace("done += length", "done += 1", 1), "utf-8")
    assert digest(copies) != digest()


def test_a_cortex_m0_plays_wide_words_without_long_products() -> None:
    """A spline of 21 bits takes less than 120 instructions a sample, and a line between words of 24 bits 90."""
    takes = counts()[MeasuredRun(32, 16, False)]
    assert takes["cubic"]["cortex-m0plus"][0] < 120
    assert takes["interpolated"]["cortex-m0plus"][0] < 90


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_cells_are_counted(benchmark: ModuleType) -> None:
    """Those of the tables that interpolate are rows of docs/resources.md, which has a digest of the Verilog."""
    assert benchmark.cells() == cells()


@pytest.mark.common
def test_the_output_is_that_of_the_command(benchmark: ModuleType) -> None:
    shown = re.search(r"<!-- output -->\n```text\n\$ tablegen (.*)\n((?:.*\n)*?)```\n<!-- /output -->", PAGE)
    assert shown is not None
    words = shown[1].replace("examples/", f"{REPOSITORY}/examples/").split()
    outcome = run(*words)
    assert outcome.status == 0
    assert [line.rstrip() for line in outcome.out.splitlines()] == shown[2].splitlines()
    assert benchmark.output() in PAGE


def test_a_plain_sine_takes_less_than_was_asked() -> None:
    """A sine of 16 bits below 1 LSB in 656 bits; of 18 bits below 0.6 LSB in 2 kbit."""
    least = {row.split(" | ")[0][2:]: int(row.split(" | ")[-1].split(":")[0]) for row in ROWS}
    assert least["16 bits, 1000 ticks"] <= 656
    assert least["16 bits, 65536 ticks"] <= 656
    assert least["18 bits, 1000 ticks"] <= 2048
    assert least["18 bits, 65536 ticks"] <= 2048
    text = " ".join(PAGE.split())
    assert "Below 1 LSB of 16 bits it takes 512 bits;" in text
    assert "Below 0.6 LSB of 18 bits it takes 1344 bits." in text


def test_what_it_shows_of_a_scan_file_is_one(tmp_path: Path) -> None:
    blocks = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    assert len(blocks) == 3
    assert set(tomllib.loads(blocks.pop())) == {"cost"}
    for block in blocks:
        assert set(tomllib.loads(block)) == {"x"}
        line = make_plan(load(write_pair(tmp_path, edited(SCAN, "- [x.table]", f"+ {block}")))).x
        assert line.table_request is not None
