"""One remedy a code: every command says the same one for a scan, in its first lines, its notes and its JSON."""

import json
import re
from pathlib import Path

import pytest
from editing import SCAN, SCANNER, edited, run, write_pair

import tablegen
from tablegen.base.remedies import CAUSE_REMEDIES, IN_TEXT, REMEDIES
from tablegen.base.warnings import Finding

FREE = ("- limits.max_error_lsb", "- limits.max_scaling_error_percent")
# Edits of the scan and of the scanner, the code of x's most serious finding, and its remedy.
CASES: dict[str, tuple[tuple[str, ...], tuple[str, ...], str, str]] = {
    "laws": ((), (), "model-mismatch", REMEDIES["model-mismatch"]),
    "no hysteresis": (
        (),
        ('x.hysteresis.model = "triangle"',),
        "uncompensated-hysteresis",
        REMEDIES["uncompensated-hysteresis"],
    ),
    "few harmonics": (("x.band_limit.harmonics = 2", *FREE), (), "scaling-error", CAUSE_REMEDIES["band limit"]),
    "coarse converter": (("dac.bits = 12", *FREE), (), "scaling-error", CAUSE_REMEDIES["converter"]),
    "coarse table": (("x.table.bits = 8", *FREE), (), "scaling-error", CAUSE_REMEDIES["table"]),
}


@pytest.mark.parametrize("name", CASES)
def test_every_command_says_the_same_remedy(name: str, tmp_path: Path) -> None:
    scan_edits, scanner_edits, code, remedy = CASES[name]
    write_pair(tmp_path, edited(SCAN, *scan_edits), edited(SCANNER, *scanner_edits))
    scan, page = tmp_path / "scan.toml", tmp_path / "report.html"
    said = {}
    for command in (
        ["show", scan, "--no-plot"],
        ["check", scan],
        ["build", scan, "-o", tmp_path / "b"],
        ["report", scan, "-o", page],
        ["simulate", scan, "--no-calibration"],
    ):
        outcome = run(*command)
        assert outcome.status == 0, outcome.err
        said[command[0]] = re.findall("; next: (.*)", outcome.out.splitlines()[0])
        lines = outcome.out.splitlines() + outcome.err.splitlines()
        said[f"notes of {command[0]}"] = [one for line in lines for one in noted(code, line)] or [remedy]
    assert {one for every in said.values() for one in every} == {remedy}, said
    assert said["show"] == said["simulate"] == [remedy]
    x = json.loads(run("simulate", scan, "--no-calibration", "--json").out)["answers"]["x"]
    assert (x["code"], x["next"]) == (code, remedy)
    for one in tablegen.report(scan).findings:
        assert one.remedy == REMEDIES[one.code]
        assert one.full_text.endswith(f"; next: {one.remedy}") == bool(one.remedy and one.code not in IN_TEXT)


def noted(code: str, line: str) -> list[str]:
    """Return the remedy of a note on x whose code has one that is appended."""
    about = code in ("model-mismatch", "uncompensated-hysteresis") and re.search("of x", line)
    return re.findall("^note: .*(?:model leaves|not compensated).*; next: (.*)", line) if about else []


def test_a_remedy_with_values_is_not_said_twice() -> None:
    told = Finding("note", 0.0, "give --delay-s 0.001", code="sensor-delay")
    assert (told.line, told.record()["remedy"]) == ("note: give --delay-s 0.001", "`--delay-s`")
    plain = Finding("note", 0.0, "a period has 3 pixels", code="few-pixels")
    assert plain.line == f"note: a period has 3 pixels; next: {REMEDIES['few-pixels']}"
    assert Finding("note", 0.0, "without a code").line == "note: without a code"
