"""``tablegen tables`` and ``mode = "auto"`` of a scan at an angle: what is listed is what a build has."""

import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from editing import run
from turned_scans import write_turned

import tablegen
from tablegen.base.input_errors import Unphysical
from tablegen.config.schema import Table
from tablegen.html_report.turned_tables import TurnedTables, turned_tables
from tablegen.planning.frame_tables import choose_frame_tables
from tablegen.planning.table_costs import PROCESSORS, MeasuredRun, counts
from tablegen.planning.turned_plan import TurnedAxis, frame_table_search

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
        in_runs, by_tick = counts()[MeasuredRun(16, 16, False)]["cubic"]["cortex-m4"]
        assert planned["fast_instructions"]["cortex-m4"] == (in_runs if planned["bits"] >= 14 else by_tick)
        assert set(planned["fast_instructions"]) == set(PROCESSORS)
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
        assert "of the fast table\n     alone: ramp and mixing of a slow part are not measured" in text
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
