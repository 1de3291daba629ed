"""``tablegen tables``: rows against certificates, lines to paste, JSON, pictures; what tells of a choice."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from editing import SCAN, edited, run, write_pair

from tablegen.certificate.certificate import certify
from tablegen.config.load import load
from tablegen.emit.constants import storage_bits
from tablegen.fixedpoint.table_shape import MODES
from tablegen.planning.line_plan import make_plan
from tablegen.planning.played_table import PROCESSORS, MeasuredRun
from tablegen.planning.table_costs import cells, counts

AUTO = ("x.table.mode = 'auto'", "- x.table.length", "- x.table.bits")


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the command says of x of the example, as JSON."""
    path = write_pair(tmp_path_factory.mktemp("scan"))
    outcome = run("tables", path, "--axis", "x", "--json")
    assert outcome.status == 0, outcome.err
    (axis,) = json.loads(outcome.out)["axes"]
    return dict(axis)


@pytest.mark.common
def test_rows_are_what_a_build_of_that_table_has(found: dict[str, Any], tmp_path: Path) -> None:
    assert len(found["tables"]) > 10
    for row in found["tables"][::4]:
        keys = (f"x.table.mode = '{row['mode']}'", f"x.table.bits = {row['bits']}", "- [limits]")
        text = edited(SCAN, *keys, f"x.table.length = {row['length']}")
        line = make_plan(load(write_pair(tmp_path, text)))
        certificate = certify(line)["x"]
        assert row["max_error_lsb"] == pytest.approx(certificate.max_error_lsb, rel=1e-5)
        assert row["rms_error_lsb"] == pytest.approx(certificate.rms_error_lsb, rel=1e-5)
        assert row["memory_bits"] == row["length"] * row["bits"]
        assert row["stored_bits"] > row["length"] * storage_bits(row["bits"])


@pytest.mark.common
def test_of_shaped_output_errors_are_those_before_the_rounding(tmp_path: Path) -> None:
    path = write_pair(tmp_path, edited(f"{SCAN}", "dac.shaping = 'second'", "x.size_nm = 20"))
    text, data = run("tables", path, "--axis", "x"), run("tables", path, "--axis", "x", "--json")
    assert (text.status, data.status) == (0, 0), text.err + data.err
    assert text.out.splitlines()[0].endswith("; shaped: errors are those before the rounding")
    (axis,) = json.loads(data.out)["axes"]
    assert axis["shaped"]
    assert axis["max_error_lsb"] == 0.01
    line = make_plan(load(path)).x
    (planned,) = [row for row in axis["tables"] if row["planned"]]
    assert planned["instructions"] == {
        name: counts()[MeasuredRun(16, 16, False, 2)]["interpolated"][name][0] for name in PROCESSORS
    }
    k = np.arange(line.program.ticks)
    angles = 2.0 * np.pi * np.outer(k / line.program.ticks, np.arange(1, line.series.harmonics + 1))
    w = line.series.a0 + np.cos(angles) @ line.series.a + np.sin(angles) @ line.series.b
    errors = line.program.output.unrounded(line.program.samples(k)) - line.float_codes(w)
    assert planned["max_error_lsb"] == pytest.approx(np.max(np.abs(errors)), rel=1e-5)
    assert planned["rms_error_lsb"] == pytest.approx(np.sqrt(np.mean(errors**2)), rel=1e-5)
    assert f"{planned['max_error_lsb']:.4f} {planned['rms_error_lsb']:.4f}" in text.out


def test_no_row_is_larger_and_worse_than_one_as_simple(found: dict[str, Any]) -> None:
    rows = [row for row in found["tables"] if not row["planned"] and not row["chosen"]]
    for i, row in enumerate(rows):
        for other in rows[:i]:
            assert other["memory_bits"] <= row["memory_bits"]
            if MODES.index(other["mode"]) <= MODES.index(row["mode"]):
                assert row["max_error_lsb"] < 0.951 * other["max_error_lsb"]


def test_the_smallest_is_marked_and_so_is_that_of_the_file(found: dict[str, Any]) -> None:
    (chosen,) = [row for row in found["tables"] if row["chosen"]]
    (planned,) = [row for row in found["tables"] if row["planned"]]
    assert found["max_error_lsb"] == 1.0
    assert chosen["max_error_lsb"] <= 1.0
    assert all(row["max_error_lsb"] > 1.0 for row in found["tables"] if row["memory_bits"] < chosen["memory_bits"])
    assert (planned["mode"], planned["length"], planned["bits"]) == ("interpolated", 2048, 16)
    assert (chosen["mode"], chosen["memory_bits"]) == ("cubic", 1792)


def test_fourier_words_are_as_long_as_they_are_uploaded(found: dict[str, Any]) -> None:
    fourier = found["fourier_words"]
    assert fourier["upload_bits"] == (2 * 32 + 1) * 32
    assert fourier["rendered"] == {"mode": "cubic", "length": 128, "bits": 14, "memory_bits": 1792}


@pytest.mark.common
def test_the_lines_to_paste_give_the_table_that_is_marked(tmp_path: Path) -> None:
    text = run("tables", write_pair(tmp_path), "--axis", "x").out
    (marked,) = re.findall(r"^  \*  (\w+) +(\d+) +(\d+) ", text, re.M)
    pasted = re.findall(r"^  (\[x\.table\]\n(?:  \w+ = .*\n)+)", text, re.M)
    assert len(pasted) == 2
    for block in pasted:
        lines = re.sub("^  ", "", block, flags=re.M)
        program = make_plan(load(write_pair(tmp_path, edited(SCAN, "- [x.table]", f"+ {lines}")))).x.program
        assert (program.mode, f"{len(program.words)}", f"{program.bits}") == marked


@pytest.mark.common
def test_both_axes_are_told_unless_one_rests_or_is_named(tmp_path: Path) -> None:
    text = f"{SCAN.split('[y]')[0]}[y]\nmotion = 'off'\noffset_v = 40.0\n"
    path = write_pair(tmp_path, text)
    assert [one["axis"] for one in json.loads(run("tables", path, "--json").out)["axes"]] == ["x"]
    outcome = run("tables", path, "--axis", "y")
    assert outcome.status == 2
    assert "y is static in this scan" in outcome.err


@pytest.mark.common
def test_the_error_asked_for_is_that_of_the_file(tmp_path: Path) -> None:
    path = write_pair(tmp_path, edited(SCAN, *AUTO, "x.table.max_error_lsb = 0.6"))
    text = run("tables", path, "--axis", "x").out
    assert "* the least memory within 0.6 LSB." in text
    assert "= the table of the scan file" not in text
    outcome = run("tables", write_pair(tmp_path, edited(SCAN, "limits.max_error_lsb = 0.3")), "--axis", "x")
    assert outcome.status == 2
    assert re.search(r"scan\.toml:\d+: x\.table: no table keeps 0\.3 LSB; the best, ", outcome.err)


@pytest.mark.common
def test_a_scan_that_breaks_a_limit_is_told_all_the_same(tmp_path: Path) -> None:
    path = write_pair(tmp_path, edited(SCAN, "x.table.length = 128"))
    assert run("build", path, "-o", tmp_path / "out").status == 3
    assert run("tables", path, "--axis", "x").status == 0


@pytest.mark.common
def test_a_picture_has_each_mode(tmp_path: Path) -> None:
    path, picture = write_pair(tmp_path), tmp_path / "tables.svg"
    assert run("tables", path, "--axis", "x", "--plot", picture).status == 0
    drawn = picture.read_text("utf-8")
    assert all(f'data-name="{mode}"' in drawn for mode in MODES)


@pytest.mark.common
@pytest.mark.parametrize(
    ("edits", "output_storage_bits", "coded"),
    [
        ((), 16, False),
        (("dac.coding = 'twos-complement'",), 16, True),
        (("dac.bits = 18", "limits.max_error_lsb = 4"), 32, False),
        (("dac.word_bits = 24", "dac.align = 'left'"), 32, True),
    ],
)
def test_instructions_are_those_of_the_widths_and_the_coding(
    tmp_path: Path, edits: tuple[str, ...], output_storage_bits: int, coded: bool
) -> None:
    path = write_pair(tmp_path, edited(SCAN, *edits))
    rows = json.loads(run("tables", path, "--axis", "x", "--json").out)["axes"][0]["tables"]
    assert {row["bits"] > 16 for row in rows} == {False, True}
    gain = abs(make_plan(load(path)).x.program.output.gain_word)
    for row in rows:
        counted = counts()[MeasuredRun(32 if row["bits"] > 16 else 16, output_storage_bits, coded)]
        loop = "cubic" if row["mode"] == "cubic" else "interpolated"
        # With products of 64 bits a run needs a gain below 2^(gain_q - 1); that of a spline is larger by 4/3.
        gain_q = 16 + row["bits"] + min(4, 25 - row["bits"]) - (18 if output_storage_bits == 32 and not coded else 16)
        by_tick = gain * (4 / 3 if loop == "cubic" else 1) >= 1 << gain_q - 1
        for name in PROCESSORS:
            slow = by_tick and (name == "cortex-m4" or (name == "riscv32" and row["bits"] > 16))
            assert row["instructions"][name] == counted[loop][name][slow], row


def test_modes_are_in_the_order_of_what_they_take() -> None:
    """In C words that are played as they are take what lines between them do: both are runs of codes.

    In Verilog a spline takes 11 clocks for a sample, and no more cells than 3000.
    """
    narrow = counts()[MeasuredRun(16, 16, False)]
    assert all(narrow["interpolated"][core][0] < narrow["cubic"][core][0] for core in PROCESSORS)
    assert cells()["direct"] < cells()["interpolated"]
    assert cells()["direct"] < cells()["cubic"] <= 3000


@pytest.mark.common
def test_show_report_compare_and_the_manifest_say_what_was_asked(tmp_path: Path) -> None:
    written = write_pair(tmp_path)
    auto = tmp_path / "auto.toml"
    auto.write_text(edited(SCAN, *AUTO), "utf-8")
    program = make_plan(load(auto)).x.program
    chosen = f"{len(program.words)} words of {program.bits} bits, {program.mode}"
    assert f"{chosen}, the least memory within 1 LSB" in run("show", auto, "--no-plot", "--all").out
    assert "the least memory within" not in run("show", written, "--no-plot", "--all").out
    manifest = json.loads(run("show", auto, "--json").out)
    assert manifest["axes"]["x"]["table"]["asked"] == {"max_error_lsb": 1.0, "free": ["mode", "length", "bits"]}
    compared = run("compare", written, auto).out
    assert re.search(r"x table, chosen for an error \[LSB\] +(not there|-)? *1", compared), compared
    page = tmp_path / "page.html"
    assert run("report", auto, "-o", page).status == 0
    assert "the least memory within 1 LSB" in page.read_text("utf-8")
