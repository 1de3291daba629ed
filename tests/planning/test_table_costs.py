"""``[cost]``: what a sample takes on a processor, and the table that is chosen within it."""

import re
from pathlib import Path

import pytest
from editing import SCAN, edited, run, write_pair

from tablegen.base.input_errors import Rejected
from tablegen.config.load import load
from tablegen.fixedpoint.table_shape import TableShape
from tablegen.planning.cost_choice import played_table
from tablegen.planning.line_plan import LinePlan, Plan, make_plan
from tablegen.planning.played_table import MeasuredRun, PlayedTable
from tablegen.planning.table_costs import counts, sample_costs

AUTO = ("x.table.mode = 'auto'", "- x.table.length", "- x.table.bits")
COST = "+ [cost]\nprocessor = "


def planned(folder: Path, *edits: str, processor: str = "cortex-m4", most: float | None = None) -> Plan:
    limit = "" if most is None else f"\nmax_instructions = {most:g}"
    return make_plan(load(write_pair(folder, edited(SCAN, *edits, f'{COST}"{processor}"{limit}'))))


def played(line: LinePlan) -> PlayedTable:
    return played_table(line.program, line.steepest)


def shape(plan: Plan, axis: str = "x") -> TableShape:
    return played(getattr(plan, axis)).shape


def test_without_a_limit_the_choice_is_that_of_memory(tmp_path: Path) -> None:
    plan = planned(tmp_path, *AUTO)
    without = make_plan(load(write_pair(tmp_path, edited(SCAN, *AUTO))))
    assert shape(plan) == shape(without) == TableShape("cubic", 128, 14)
    assert without.x.sample_cost is None
    assert plan.x.sample_cost is not None
    assert plan.x.sample_cost.instructions == counts()[MeasuredRun(16, 16, False)]["cubic"]["cortex-m4"][0]


def test_a_limit_takes_the_smallest_table_within_it(tmp_path: Path) -> None:
    """Lines take fewer instructions than a spline, and 512 words of 16 bits are the fewest that keep 1 LSB."""
    plan = planned(tmp_path, *AUTO, most=25)
    assert shape(plan) == TableShape("interpolated", 512, 16)
    assert plan.x.sample_cost is not None
    assert plan.x.sample_cost.instructions <= 25
    text = run("show", tmp_path / "scan.toml", "--all", "--no-plot").out
    assert "the least memory within 1 LSB and 25 instructions on cortex-m4" in text
    assert f"{plan.x.sample_cost.instructions:g} instructions for a sample on cortex-m4, in C" in text


def test_a_table_without_runs_takes_what_ticks_take(tmp_path: Path) -> None:
    """With products of 64 bits, runs need a gain that fits 32 bits with 32 fraction bits."""
    few, enough = (played(planned(tmp_path, f"x.table.bits = {bits}", "- [limits]").x) for bits in (10, 11))
    in_runs, by_tick, *_ = counts()[MeasuredRun(16, 16, False)]["interpolated"]["cortex-m4"]
    assert (sample_costs([few], "cortex-m4"), sample_costs([enough], "cortex-m4")) == ([by_tick], [in_runs])
    assert by_tick > 5 * in_runs
    assert sample_costs([few, enough], "cortex-m4") == [by_tick, by_tick]
    assert sample_costs([few], "cortex-m0plus") == sample_costs([enough], "cortex-m0plus")
    short = played(planned(tmp_path, "x.table.mode = 'cubic'", "x.table.length = 1024").x)
    assert sample_costs([short], "riscv32") == [counts()[MeasuredRun(16, 16, False)]["cubic"]["riscv32"][1]]


FAST = ("timing.line_rate_hz = 1600", "timing.pixels = 50")  # 95 codes a tick
FASTER = ("timing.line_rate_hz = 4000", "timing.pixels = 20", "x.size_nm = 300", "- [limits]")  # 363


def counted(tmp_path: Path, processor: str, *edits: str) -> list[float]:
    """Return what both axes take on a processor."""
    plan = planned(tmp_path, *edits, processor=processor)
    return [line.sample_cost.instructions for line in plan.lines if line.sample_cost]


@pytest.mark.parametrize("processor", ["cortex-m4", "cortex-m0plus", "riscv32"])
def test_a_scan_without_a_slew_rate_takes_what_runs_take(tmp_path: Path, processor: str) -> None:
    """Its slew guard is twice its steepest step, which no words of its table reach."""
    in_runs, *_ = counts()[MeasuredRun(16, 16, False)]["interpolated"][processor]
    assert counted(tmp_path, processor, "- amplifier.max_slew_v_per_s") == [in_runs, in_runs]


def test_lines_that_move_far_take_what_short_blocks_take(tmp_path: Path) -> None:
    """With products of 32 bits the blocks of x have 8 ticks, and those of y 16, as all have on a Cortex-M4."""
    count = counts()[MeasuredRun(16, 16, False)]["interpolated"]["cortex-m0plus"]
    x, y = counted(tmp_path, "cortex-m0plus", *FAST)
    assert (x, y) == (round(count.of_block(8), 1), count.in_runs)
    assert count.in_runs == count.of_block(16) < x < count.of_block(4) == count.in_blocks
    assert counted(tmp_path, "cortex-m4", *FAST) == [19.4, 19.4]


def test_a_scan_that_moves_too_far_for_runs_takes_what_refused_runs_take(tmp_path: Path) -> None:
    """Both axes do, whatever the table; a Cortex-M4 has wider windows, and runs."""
    count = counts()[MeasuredRun(16, 16, False)]["interpolated"]["cortex-m0plus"]
    assert counted(tmp_path, "cortex-m0plus", *FASTER) == [count.refused, count.refused]
    assert counted(tmp_path, "cortex-m4", *FASTER) == [19.4, 19.4]
    assert count.in_runs < 0.2 * count.by_tick < 0.2 * count.refused
    moves = "codes in 4 ticks; a lower line rate or a smaller size gives it some"
    assert counted(tmp_path, "riscv32", *FASTER) != [29.6, 29.6]
    assert moves in " ".join(run("show", tmp_path / "scan.toml", "--all", "--no-plot").out.split())
    for auto in ((), AUTO):
        limited = write_pair(tmp_path, edited(SCAN, *FASTER, *auto, f'{COST}"cortex-m0plus"\nmax_instructions = 50'))
        outcome = run("check", limited)
        assert outcome.status != 0
        assert moves in " ".join(outcome.err.split())
    of_all = run("tables", write_pair(tmp_path, edited(SCAN, *FASTER)), "--axis", "x").out
    assert "x has no runs on cortex-m0plus and riscv32: it moves" in " ".join(of_all.split())


def test_wide_words_of_the_other_axis_count(tmp_path: Path) -> None:
    """On a Cortex-M0+ a spline beside words of 18 bits takes more than 80, lines between words of 32 bits less."""
    wide = counts()[MeasuredRun(32, 16, False)]
    alone = counts()[MeasuredRun(16, 16, False)]["cubic"]["cortex-m0plus"][0]
    most = 0.5 * (wide["interpolated"]["cortex-m0plus"][0] + wide["cubic"]["cortex-m0plus"][0])
    assert alone < most
    assert shape(planned(tmp_path, *AUTO, processor="cortex-m0plus", most=most)).mode == "cubic"
    beside = planned(tmp_path, *AUTO, "y.table.bits = 18", processor="cortex-m0plus", most=most)
    assert shape(beside).mode == "interpolated"


def test_no_table_within_the_limit_names_the_cheapest(tmp_path: Path) -> None:
    with pytest.raises(Rejected) as refused:
        planned(tmp_path, *AUTO, most=10)
    (problem,) = refused.value.problems
    assert re.search(
        r"no table keeps 1 LSB within the 10 instructions for a sample on cortex-m4 of cost\.max_instructions; the "
        r"cheapest, 512 words of 16 bits, interpolated, takes [\d.]+; allow that many, or a larger error",
        str(problem),
    ), str(problem)


def test_a_written_table_beyond_the_limit_is_refused_by_the_build(tmp_path: Path) -> None:
    path = write_pair(tmp_path, edited(SCAN, f'{COST}"cortex-m0plus"\nmax_instructions = 10'))
    outcome = run("build", path, "-o", tmp_path / "out")
    assert outcome.status == 3
    assert re.search(r"cost\.max_instructions: the x axis takes [\d.]+ instructions for a sample on", outcome.err)


def test_an_unknown_processor_names_the_known_ones(tmp_path: Path) -> None:
    path = write_pair(tmp_path, edited(SCAN, f'{COST}"cortex-m7"'))
    outcome = run("check", path)
    assert outcome.status == 2
    assert all(name in outcome.err for name in ("cost.processor", "cortex-m4", "cortex-m0plus", "riscv32"))


@pytest.mark.common
def test_tables_prints_the_column_of_the_processor(tmp_path: Path) -> None:
    path = write_pair(tmp_path, edited(SCAN, *AUTO, f'{COST}"cortex-m4"\nmax_instructions = 25'))
    text = run("tables", path, "--axis", "x").out
    assert "cortex-m4    HX8K" in text
    assert "RV32" not in text
    assert "* the least memory within 1 LSB and 25 instructions on cortex-m4." in text
    assert re.search(r"^  \*  interpolated +512 +16 ", text, re.M)
