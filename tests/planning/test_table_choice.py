"""The least memory that keeps an error: against every table that there is, with floats of numpy; refusals; advice."""

import re
from pathlib import Path

import numpy as np
import pytest
from editing import SCAN, edited, write_pair
from replacing import replace
from variants import plan_of, setup_of

from tablegen.base.input_errors import Rejected
from tablegen.certificate.certificate import certify
from tablegen.certificate.line_errors import EmittedPeriod
from tablegen.config.load import load
from tablegen.emit.render import render
from tablegen.fixedpoint import runs as runs_module
from tablegen.fixedpoint.runs import long_runs
from tablegen.fixedpoint.table_shape import MODES, TableShape
from tablegen.manifest.record import plan_record
from tablegen.numerics.arrays import Ints
from tablegen.planning import emitted_error
from tablegen.planning.emitted_error import IdealCodes
from tablegen.planning.line_plan import LinePlan, Plan, make_plan
from tablegen.planning.other_table import maker_of, shape_of, with_table
from tablegen.planning.table_search import TableSearch

AUTO = {"x.table.mode": '"auto"', "x.table.length": "", "x.table.bits": ""}
FEW = {"x.band_limit.harmonics": "3", "limits.max_scaling_error_percent": ""}
COARSE = {**FEW, "dac.bits": "12"}


def asking(error: float, **keys: str) -> dict[str, str]:
    """x with an error that its table has to keep, and with these keys of its table alone."""
    given = {f"x.table.{key}": keys.get(key, "") for key in ("mode", "length", "bits")}
    return {**given, "x.table.max_error_lsb": repr(error)}


def written(shape: TableShape) -> dict[str, str]:
    """x with a table as it is."""
    return {"x.table.mode": f'"{shape.mode}"', "x.table.length": f"{shape.length}", "x.table.bits": f"{shape.bits}"}


def every_shape(line: LinePlan, longest: int) -> list[TableShape]:
    """Whatever carries the harmonics, up to a length."""
    powers = [1 << p for p in range(3, 17) if 2 * line.series.harmonics + 2 <= 1 << p <= longest]
    lengths = {"direct": [line.program.phase.ticks], "interpolated": powers, "cubic": powers}
    bits = {"direct": 24, "interpolated": 24, "cubic": 21}
    return [TableShape(mode, n, b) for mode in MODES for n in lengths[mode] for b in range(8, bits[mode] + 1)]


def worst_of(line: LinePlan, shape: TableShape) -> float:
    """By numpy's cosine, tick by tick: none of the bounds, runs and expansions of the search.

    Of shaped output what is rounded: codes cut to 12 bits of fraction, at 16 bits.
    """
    program, series = maker_of(line).quantise(shape).program, line.series
    k = np.arange(program.ticks)
    t, n = k // program.hold / program.phase.ticks, np.arange(1, series.harmonics + 1)
    angle = 2.0 * np.pi * np.outer(t, n)
    w = series.a0 + np.cos(angle) @ series.a + np.sin(angle) @ series.b
    shaped = program.output.shaping.order > 0
    played = np.floor(program.output.unrounded(program.samples(k)) * 4096) / 4096 if shaped else program.codes(k)
    return float(np.max(np.abs(played - line.float_codes(w))))


@pytest.mark.common
@pytest.mark.parametrize("error", [0.55, 0.7, 1.0, 2.5])
def test_no_table_is_smaller(tmp_path: Path, error: float) -> None:
    plan = plan_of(tmp_path, {**COARSE, **asking(error)})
    found, line = shape_of(plan.x), plan.x
    assert certify(plan)["x"].max_error_lsb <= error
    keeping = [shape for shape in every_shape(line, 1 << 12) if worst_of(line, shape) <= error]
    assert found == min(keeping, key=lambda shape: shape.order)
    assert found.memory_bits == min(shape.length * shape.bits for shape in keeping)


@pytest.mark.common
@pytest.mark.parametrize(("asked", "error"), [(None, 0.01), (0.002, 0.002)])
def test_of_shaped_output_it_is_the_error_before_the_rounding(
    tmp_path: Path, asked: float | None, error: float
) -> None:
    """A table within 1 LSB would be the whole error of what shaping leaves."""
    edits = {**FEW, "x.size_nm": "20.0", "dac.shaping": '"second"', **(asking(asked) if asked else AUTO)}
    plan = plan_of(tmp_path, edits)
    found, line = shape_of(plan.x), plan.x
    keeping = [shape for shape in every_shape(line, 1 << 12) if worst_of(line, shape) <= error]
    assert found == min(keeping, key=lambda shape: shape.order)
    assert line.table_request is not None
    assert str(line.table_request) == f"the least memory within {error:g} LSB before the rounding"
    finest = certify(plan_of(tmp_path, {**edits, **asking(0.0005)}))["x"]
    assert certify(plan)["x"].rms_error_lsb < 1.05 * finest.rms_error_lsb


def test_few_tables_are_made_and_fewer_measured(tmp_path: Path) -> None:
    line = plan_of(tmp_path).x
    search, shapes = TableSearch(maker_of(line)), every_shape(line, 1 << 16)
    found = search.smallest(shapes, 1.0)
    assert found is not None
    assert len(shapes) > 180
    assert search.quantised <= 60
    assert search.measured <= 4


@pytest.mark.parametrize(("mode", "most_bits"), [("interpolated", 24), ("cubic", 21)])
def test_a_table_one_step_smaller_breaks_the_error(tmp_path: Path, mode: str, most_bits: int) -> None:
    eight = {"x.band_limit.harmonics": "8", "limits.max_error_lsb": "", "limits.max_scaling_error_percent": ""}
    plan = plan_of(tmp_path, {**eight, **asking(1.0, mode=f'"{mode}"')})
    found = shape_of(plan.x)
    assert certify(plan)["x"].max_error_lsb <= 1.0
    for smaller in (
        TableShape(found.mode, found.length, found.bits - 1),
        TableShape(found.mode, found.length // 2, found.bits),
        TableShape(found.mode, found.length // 2, most_bits),
    ):
        assert certify(plan_of(tmp_path, {**eight, **written(smaller)}))["x"].max_error_lsb > 1.0


@pytest.mark.parametrize(
    "edits",
    [
        {},
        {"y.motion": '"step"'},
        {"timing.lines": "9000", "timing.line_rate_hz": "40"},
        {"dac.bits": "20", "y.table.bits": "20", "limits.max_error_lsb": ""},
        {"amplifier.gain": "-10.0", "x.table.mode": '"direct"', "x.table.length": ""},
        {"x.table.mode": '"cubic"', "x.table.length": "128", "y.table.mode": '"cubic"', "y.motion": '"step"'},
    ],
)
def test_the_error_that_decides_is_that_of_the_certificate(tmp_path: Path, edits: dict[str, str]) -> None:
    for line in plan_of(tmp_path, edits).lines:
        asked, found = IdealCodes(maker_of(line)), EmittedPeriod(line).largest_error()
        worst = asked.worst_error(line.program) / 65536
        assert worst == pytest.approx(found, abs=1.0 / 65536)
        assert asked.least_error(line.program) / 65536 <= worst


def test_a_long_period_is_measured_piece_by_piece(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    line = plan_of(tmp_path, {"y.table.mode": '"cubic"', "y.table.length": "256"}).y
    asked = IdealCodes(maker_of(line))
    assert long_runs(line.program) is None  # every tick is looked at
    whole = asked.worst_error(line.program)
    monkeypatch.setattr(emitted_error, "_CHUNK_TICKS", 9973)
    assert asked.worst_error(line.program) == whole


@pytest.mark.common
def test_of_a_slow_frame_few_ticks_are_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The worst error of a cubic table is found where runs begin and end, and is that of all ticks."""
    slow = {"timing.line_rate_hz": "20", "y.table.mode": '"cubic"', "y.table.length": "256", "y.table.bits": "14"}
    line = plan_of(tmp_path, slow).y
    asked, looked = IdealCodes(maker_of(line)), []

    def counting(k: Ints) -> Ints:
        looked.append(len(k))
        return IdealCodes._at(asked, k)

    monkeypatch.setattr(asked, "_at", counting)
    by_runs = asked.worst_error(line.program)
    assert sum(looked) < line.program.ticks / 4
    monkeypatch.setattr(runs_module, "_MIN_TICKS_PER_RUN", 10**9)
    looked.clear()
    assert asked.worst_error(line.program) == by_runs
    assert sum(looked) == line.program.ticks


def test_what_is_given_is_kept(tmp_path: Path) -> None:
    free = shape_of(plan_of(tmp_path, asking(0.7)).x)
    for keys in ({"bits": "20"}, {"length": "4096"}, {"mode": '"direct"'}, {"mode": '"interpolated"', "bits": "18"}):
        plan = plan_of(tmp_path, asking(0.7, **keys))
        found = shape_of(plan.x)
        assert certify(plan)["x"].max_error_lsb <= 0.7
        assert found.memory_bits >= free.memory_bits
        for key, value in keys.items():
            assert getattr(found, key) == (value.strip('"') if key == "mode" else int(value))
        assert plan.x.table_request is not None
        assert set(plan.x.table_request.free) == {"mode", "length", "bits"} - set(keys)


def test_a_table_that_is_given_whole_is_checked(tmp_path: Path) -> None:
    keys = {"mode": '"interpolated"', "length": "2048", "bits": "16"}
    assert shape_of(plan_of(tmp_path, asking(0.6, **keys)).x) == TableShape("interpolated", 2048, 16)
    with pytest.raises(
        Rejected, match=r"x\.table\.max_error_lsb: no table keeps 0\.55 LSB; the best, 2048 words of 16"
    ):
        plan_of(tmp_path, asking(0.55, **keys))


def test_less_memory_for_more_error(tmp_path: Path) -> None:
    line = plan_of(tmp_path, COARSE).x
    search, shapes = TableSearch(maker_of(line)), every_shape(line, 1 << 12)
    found = [search.smallest(shapes, error) for error in (0.51, 0.55, 0.6, 0.8, 1.0, 2.0, 4.0, 100.0)]
    memory = [shape.memory_bits for shape in found if shape is not None]
    assert len(memory) == len(found)
    assert memory == sorted(memory, reverse=True)
    assert memory[-1] == 8 * 8


@pytest.mark.common
def test_an_error_that_no_table_keeps_is_refused_and_the_advice_holds(tmp_path: Path) -> None:
    with pytest.raises(Rejected) as refused:
        plan_of(tmp_path, {**COARSE, **asking(0.45)})
    told = re.search(r"errs by up to (\S+) LSB; allow that much", str(refused.value))
    assert told is not None
    kept = certify(plan_of(tmp_path, {**COARSE, **asking(float(told[1]))}))["x"].max_error_lsb
    assert 0.45 < kept <= float(told[1])
    best = min(worst_of(line, shape) for line in (plan_of(tmp_path, COARSE).x,) for shape in every_shape(line, 1 << 16))
    assert best <= float(told[1]) <= best + 0.0002


def test_auto_keeps_1_lsb_or_the_limit_of_the_scan(tmp_path: Path) -> None:
    def errors(plan: Plan) -> tuple[float, float]:
        assert plan.x.table_request is not None
        return plan.x.table_request.max_error_lsb, certify(plan)["x"].max_error_lsb

    for limit, asked in (("", 1.0), ("3.0", 1.0), ("0.6", 0.6)):
        edits = {**AUTO, "limits.max_error_lsb": limit, "y.table.bits": "20"}
        stated, reached = errors(plan_of(tmp_path, edits))
        assert stated == asked
        assert 0.8 * asked < reached <= asked


@pytest.mark.parametrize("name", ["c", "verilog"])
def test_every_mode_is_emitted(tmp_path: Path, name: str) -> None:
    plan = make_plan(setup_of(tmp_path, {**AUTO, "+ [emit]\nformats": f'["{name}"]'}))
    assert shape_of(plan.x).mode == "cubic"
    for mode in MODES:
        length = plan.x.program.phase.ticks if mode == "direct" else 128
        other = replace(plan, x=with_table(plan.x, TableShape(mode, length, 16)))
        assert render(other, certify(other), [name])


def test_words_are_fine_enough_for_the_amplifier(tmp_path: Path) -> None:
    free = {**FEW, **asking(40.0), "limits.max_error_lsb": ""}
    coarse, fine = plan_of(tmp_path, free), plan_of(tmp_path, {**free, "amplifier.max_slew_v_per_s": "2.2e4"})
    assert shape_of(fine.x).memory_bits > shape_of(coarse.x).memory_bits
    assert certify(fine)["x"].largest_step <= fine.x.program.output.max_step
    assert certify(coarse)["x"].largest_step > fine.x.program.output.max_step


def test_harmonics_are_carried(tmp_path: Path) -> None:
    plan = plan_of(tmp_path, {**asking(100.0), "x.band_limit.harmonics": "31", "limits.max_error_lsb": ""})
    assert shape_of(plan.x).length >= 64
    with pytest.raises(Rejected, match="a table of 32 words carries 15"):
        plan_of(tmp_path, {**asking(100.0, length="32"), "x.band_limit.harmonics": "16"})


def test_a_length_has_to_be_a_power_of_two(tmp_path: Path) -> None:
    with pytest.raises(Rejected, match="1250 is not a power of two"):
        plan_of(tmp_path, asking(1.0, length="1250"))


def test_an_axis_at_rest_has_no_table_to_choose(tmp_path: Path) -> None:
    text = edited(SCAN, "x.table.mode = 'auto'", "- x.table.length", "- x.table.bits")
    text = f"{text.split('[y]')[0]}[y]\nmotion = 'off'\nlike = 'x'\n"
    line = make_plan(load(write_pair(tmp_path, text))).y
    assert line.drive.resting
    assert line.table_request is None


def test_the_plan_says_what_was_asked(tmp_path: Path) -> None:
    record = plan_record(plan_of(tmp_path, AUTO))
    assert record["axes"]["x"]["table"]["asked"] == {"max_error_lsb": 1.0, "free": ["mode", "length", "bits"]}
    assert "asked" not in record["axes"]["y"]["table"]
