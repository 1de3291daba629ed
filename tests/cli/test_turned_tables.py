"""``tablegen tables`` and ``mode = "auto"`` of a scan at an angle: what is listed is what a build has."""

import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from editing import run
from msgspec.structs import replace
from turned_scans import write_turned

import tablegen
from tablegen.base.input_errors import Rejected, Unphysical
from tablegen.config.load import Setup, load
from tablegen.config.schema import Table
from tablegen.html_report.turned_tables import TurnedTables, turned_tables
from tablegen.planning import turned_plan
from tablegen.planning.frame_costs import slow_counts
from tablegen.planning.frame_tables import CostLimit, choose_frame_tables
from tablegen.planning.line_plan import Plan
from tablegen.planning.played_table import PROCESSORS, MeasuredRun, PlayedTable
from tablegen.planning.turned_plan import TurnedAxis, frame_table_search, shape_costs

pytestmark = pytest.mark.common

SHORT = ("timing.lines = 16", "x.band_limit.harmonics = 12", "timing.line_rate_hz = 400")
AUTO = [f"{keep}{axis}.table.{key}" for axis in "xy" for keep, key in (("", "mode = 'auto'"), ("- ", "length"), ("- ", "bits"))]  # fmt: skip  # noqa: E501
ASKED = (*SHORT, *AUTO, "x.table.max_error_lsb = 2.5")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tablegen.TurnedBuild:
    """A build that chooses the tables: of x within 2.5 LSB, of y within 1 LSB, which none keeps."""
    folder = tmp_path_factory.mktemp("auto")
    return tablegen.build_turned(write_turned(folder, 30.0, *ASKED), folder / "out")


@pytest.fixture(scope="module")
def listed(built: tablegen.TurnedBuild) -> dict[str, TurnedTables]:
    """The tables of both axes."""
    return {axis.axis: turned_tables(built.setup, built.plan, axis) for axis in built.plan.axes}


def shape(row: dict[str, Any]) -> tuple[int, int, int]:
    return row["length"], row["bits"], row["slow_length"]


def error_of(axis: TurnedAxis, ticks: int) -> float:
    """The largest distance of all codes of a frame from the learnt drive, the slow part of which does not lead."""
    program, drive = axis.program, axis.drive
    phase = 2.0 * np.pi * np.arange(program.lines + 1) / program.lines
    n = np.arange(1.0, drive.slow.harmonics + 1.0)
    start = drive.slow.a0 + np.cos(np.outer(phase, n)) @ drive.slow.a + np.sin(np.outer(phase, n)) @ drive.slow.b
    lead = drive.at(program.lines, (np.arange(ticks) + 0.5) / ticks)
    volts = axis.known.driver.volts(lead - np.diff(start)[:, None] * (0.5 / ticks))
    ideal = (volts - axis.converter.v_zero) / axis.converter.v_per_code
    return float(np.max(np.abs(program.frame() - ideal)))


def test_the_build_takes_the_marked_row(built: tablegen.TurnedBuild, listed: dict[str, TurnedTables]) -> None:
    for axis in built.plan.axes:
        record = listed[axis.axis].record()
        (planned,) = [row for row in record["tables"] if row["planned"]]
        assert shape(planned) == (len(axis.program.fast.words), axis.program.fast.bits, len(axis.program.slow.words))
        assert planned["memory_bits"] == axis.program.memory_bits
        assert planned["max_error_lsb"] == pytest.approx(error_of(axis, 1250), rel=1e-5)
        count = slow_counts()[MeasuredRun(16, 16, False)]["cortex-m4"]
        takes = planned["instructions"]["cortex-m4"]
        assert takes > count.by_tick - 10.0 if planned["bits"] < 14 else abs(takes - count.in_runs) < 10.0
        assert set(planned["instructions"]) == set(PROCESSORS)
    x, y = (listed[axis].record() for axis in "xy")
    assert (x["max_error_lsb"], y["max_error_lsb"]) == (2.5, 1.0)
    assert [row["planned"] for row in x["tables"] if row["chosen"]] == [True]
    assert not any(row["chosen"] for row in y["tables"])
    assert built.plan.x.choice == "the least memory within 2.5 LSB"
    assert re.fullmatch(r"the least memory within 5 % of the least error, 1\.\d+ LSB", built.plan.y.choice)


def test_rows_are_a_front(listed: dict[str, TurnedTables]) -> None:
    for axis, allowed in (("x", 2.5), ("y", 1.0)):
        rows = listed[axis].record()["tables"]
        assert len(rows) > 5
        memory = [row["memory_bits"] for row in rows]
        assert memory == sorted(memory)
        free = [row["max_error_lsb"] for row in rows if not (row["planned"] or row["chosen"])]
        assert all(later < earlier for earlier, later in pairwise(free))
        chosen = [row["memory_bits"] for row in rows if row["chosen"]] or [memory[-1] + 1]
        assert all(row["max_error_lsb"] > allowed for row in rows if row["memory_bits"] < chosen[0])


def test_the_c_plays_it(built: tablegen.TurnedBuild, tmp_path: Path) -> None:
    built.write(tmp_path)
    outcome = run("verify", tmp_path)
    assert outcome.status == 0, outcome.err


def test_the_text_has_the_rows_and_keys_to_paste(listed: dict[str, TurnedTables]) -> None:
    for axis, mark in (("x", "*"), ("y", "=")):
        text = "\n".join(listed[axis].text())
        (marked,) = re.findall(r"^  ([*=]) +(\d+) +(\d+) +(\d+) +(\d+) +(\d+) +(\S+) ", text, re.M)
        (row,) = [row for row in listed[axis].record()["tables"] if row["planned"]]
        length, bits, slow = shape(row)
        stored = 16 * (2 * (length + 3) + slow + 3) + 8 * length + 17 * 48
        assert row["stored_bits"] == stored
        numbers = [length, slow, bits, row["memory_bits"], stored]
        assert marked == (mark, *map(str, numbers), f"{row['max_error_lsb']:.3f}")
        assert "     M4    M0+   RV32\n" in text
        assert re.search(rf'^  \[{axis}\.table\]\n  mode = "auto"\n  max_error_lsb = [12]\.\d+$', text, re.M)


def test_the_command_prints_them_and_keeps_those_of_shaped_output(tmp_path: Path) -> None:
    path, picture = write_turned(tmp_path, 30.0, *ASKED, "dac.shaping = 'first'"), tmp_path / "tables.svg"
    outcome = run("tables", path, "--axis", "x", "--plot", picture)
    assert outcome.status == 0, outcome.err
    assert re.search(r"^  = +64 +64 +16 ", outcome.out, re.M)
    assert "with shaped output the build keeps its own" in outcome.out
    assert 'mode = "auto"' not in outcome.out
    assert "words over the frame" in picture.read_text("utf-8")


def test_an_error_that_no_tables_keep_is_refused(built: tablegen.TurnedBuild) -> None:
    search, limits = frame_table_search(built.setup, built.plan, built.plan.x), built.setup.scan.limits
    with pytest.raises(Unphysical) as refused:
        choose_frame_tables(search, Table(max_error_lsb=0.4), limits)
    found = re.fullmatch(
        r"no tables keep 0\.4 LSB; the best, \d+ words over the line and \d+ over the frame, of 16 bits, err by up to "
        r"([\d.]+) LSB; allow that much",
        str(refused.value),
    )
    assert found, str(refused.value)
    allowed = float(found[1])
    assert choose_frame_tables(search, Table(max_error_lsb=allowed), limits).reason.endswith(f"within {allowed:g} LSB")


def limit_of(built: tablegen.TurnedBuild, most: float) -> CostLimit:
    """A limit on a Cortex-M4, which plays words of fewer than 14 bits tick by tick."""
    search = frame_table_search(built.setup, built.plan, built.plan.x)
    costs = shape_costs(built.setup, built.plan.straight.x, search, search.shapes(Table()), "cortex-m4", None)
    return CostLimit("cortex-m4", most, costs)


def test_a_limit_takes_the_least_memory_within_it(built: tablegen.TurnedBuild) -> None:
    """The tables that are taken without a limit are made too dear, and the next ones of 16 bits are taken."""
    search, limits = frame_table_search(built.setup, built.plan, built.plan.x), built.setup.scan.limits
    table = Table(max_error_lsb=2.5)
    free, limit = choose_frame_tables(search, table, limits).shape, limit_of(built, 60.0)
    limited = choose_frame_tables(search, table, limits, replace(limit, costs=limit.costs | {free: 60.5}))
    assert limited.reason == "the least memory within 2.5 LSB and 60 instructions on cortex-m4"
    assert limit.costs[limited.shape] <= 60.0
    shapes = search.shapes(table)
    between = shapes[: shapes.index(limited.shape)]
    assert free in between
    assert all(one == free or limit.costs.get(one, 1e3) > 60.0 or search.rated(one, 2.5) is None for one in between)
    assert min(one.bits for one, takes in limit.costs.items() if takes <= 60.0) == 12


def test_a_limit_that_no_tables_keep_names_the_cheapest(built: tablegen.TurnedBuild) -> None:
    search, limits = frame_table_search(built.setup, built.plan, built.plan.x), built.setup.scan.limits
    limit = limit_of(built, 20.0)
    least = min(limit.costs.values())
    limited = "the 20 instructions for a sample on cortex-m4 of cost.max_instructions; the cheapest, "
    for table, what, end in (
        (Table(max_error_lsb=4.0), "keep 4 LSB within", r"take [\d.]+; allow that many, or a larger error"),
        (Table(), "keep", rf"take {least:g}; allow that many"),
    ):
        with pytest.raises(Unphysical) as refused:
            choose_frame_tables(search, table, limits, limit)
        text = (
            rf"no tables {what} {re.escape(limited)}\d+ words over the line and \d+ over the frame, of 1\d bits, {end}"
        )
        assert re.fullmatch(text, str(refused.value)), str(refused.value)


def test_an_axis_without_runs_leaves_none_to_the_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """x is chosen alone, and again beside y, whose lines move so far that its runs are refused."""
    played = turned_plan.played_frame

    def fast_y(setup: Setup, straight: Plan, axis: TurnedAxis) -> PlayedTable:
        frame = played(setup, straight, axis)
        return frame if axis.axis == "x" else frame._replace(steepest=2000.0)

    cost = '+ [cost]\nprocessor = "cortex-m4"\nmax_instructions = 60'
    setup = load(write_turned(tmp_path, 30.0, *ASKED, cost))
    monkeypatch.setattr(turned_plan, "played_frame", fast_y)
    with pytest.raises(Rejected) as refused:
        turned_plan.make_turned_plan(setup)
    (problem,) = refused.value.problems
    assert problem.key == "x.table.max_error_lsb"
    found = re.search(r"within the 60 instructions .* the cheapest, .* take ([\d.]+); allow", problem.why)
    assert found, problem.why
    count = slow_counts()[MeasuredRun(16, 16, False)]["cortex-m4"]
    assert abs(float(found[1]) - count.refused) < 0.1 * (count.refused - count.in_runs)


def test_a_processor_has_its_column_and_its_limit(tmp_path: Path) -> None:
    """Tables that the scan file gives are not changed; their certificate has the problem."""
    cost = '+ [cost]\nprocessor = "riscv32"\nmax_instructions = '
    outcome = run("tables", write_turned(tmp_path, 30.0, *ASKED, f"{cost}60"), "--axis", "x")
    assert outcome.status == 0, outcome.err
    assert "     max    rms        riscv32\n" in outcome.out
    assert "* the least memory within 2.5 LSB and 60 instructions on riscv32. In the scan file:" in outcome.out
    (takes,) = re.findall(r"^  \*.* (\S+)$", outcome.out, re.M)
    shown = run("show", tmp_path / "scan.toml", "--all", "--no-plot")
    assert f"x takes {float(takes):g} instructions for a sample on riscv32, in C" in shown.out
    build = run("build", write_turned(tmp_path, 30.0, *SHORT, f"{cost}30"), "-o", tmp_path / "out")
    assert build.status == 3
    assert re.search(r"cost\.max_instructions: the x axis takes [\d.]+ instructions for a sample on riscv32", build.err)
