"""docs/operator.md says what the operator is: its keys, its columns, its limits, and what its example prints."""

import re
import sys
from pathlib import Path
from typing import Any

import msgspec.inspect as types
import pytest
from building import EXAMPLE, REPOSITORY
from page_script import run_page
from paper.printed_numbers import default_x

from tablegen.base.reading import CONFIGURATION
from tablegen.calibration.operator import branches, fit, periodic_line, plays_fit
from tablegen.compensation.operator import operator as operators
from tablegen.compensation.operator.file import OperatorFile, read_operator
from tablegen.compensation.operator.operator import CENTRE_REACH, STROKE_REACH
from tablegen.config.load import load
from tablegen.planning.line_plan import make_plan
from tablegen.virtual.simulation import run_line

PAGE = (REPOSITORY / "docs" / "operator.md").read_text("utf-8")
WORDS = " ".join(PAGE.split())
DIRECTIONS = ("forward", "backward")
CELL = re.compile(r"([\d.]+) / ([\d.]+)")


def section(title: str) -> str:
    """The text under a heading."""
    return PAGE.partition(f"\n## {title}\n")[2].partition("\n## ")[0]


def first_cells(title: str) -> list[str]:
    """The code words in the first column of a section's table."""
    rows = re.findall(r"^\| (`.*?) \|", section(title), re.MULTILINE)
    return [word for row in rows for word in re.findall(r"`([^`]+)`", row)]


def keys(described: Any, before: str = "") -> list[str]:
    """Dotted names of all values of a table."""
    if isinstance(described, types.ListType) and isinstance(described.item_type, types.StructType):
        described = described.item_type
    if isinstance(described, types.UnionType):  # a table that may be missing
        described = next((one for one in described.types if isinstance(one, types.StructType)), described)
    if not isinstance(described, types.StructType):
        return [before[:-1]]
    return [key for field in described.fields for key in keys(field.type, f"{before}{field.encode_name}.")]


def test_every_key_of_the_file_is_told() -> None:
    assert first_cells("What the file holds") == keys(types.type_info(OperatorFile))


def test_the_limits_are_those_of_the_code() -> None:
    assert f"more than {STROKE_REACH:g} v_max above the largest trace" in WORDS
    assert f"{CENTRE_REACH:g} v_max away from every trace" in WORDS
    assert f"at most {CONFIGURATION.most_bytes >> 20} MiB" in WORDS
    assert f"{plays_fit.THRESHOLDS} thresholds up to {plays_fit._HIGHEST}" in WORDS
    assert f"linear between {plays_fit.NODES} nodes" in WORDS
    assert f"Chebyshev series of degree {branches.DEGREE}" in WORDS
    assert f"These {2 * branches.DEGREE + 2} numbers" in WORDS
    assert f"s0 is {operators.SMALL_STROKE}" in WORDS
    assert f"more than {fit._MAX_NOISE_PERCENT:g} % of the line differs" in WORDS
    assert f"up to {periodic_line._RESONANCE_SHARE:g} of the resonance" in WORDS
    assert f"more than {100 * periodic_line._BACKWARDS:g} % in the middle of a sweep" in WORDS


def test_the_summary_has_the_numbers_of_the_page() -> None:
    shown = " ".join((REPOSITORY / "docs" / "accuracy.md").read_text("utf-8").split())
    for plant in ("many plays", "Bouc-Wen"):
        for line in ("laws", "operator, six traces"):
            (row,) = re.findall(rf"^\| {plant} \| 50 V \| {line} \| (.*) \|$", PAGE, re.MULTILINE)
            _, (mean, worst), (mean_apart, worst_apart), _ = CELL.findall(row)
            told = f"{float(mean):.1f} ({float(worst):.1f})", f"{float(mean_apart):.2f} ({float(worst_apart):.2f})"
            assert f"{told[0]} | {told[1]}" in shown, (plant, line, told)


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_the_example_of_the_page(tmp_path: Path) -> None:
    """All commands of the page, on what `tablegen init` writes; then what the scan leaves on the same scanner."""
    assert run_page(REPOSITORY / "docs" / "operator.md", tmp_path, before="tablegen init .") == []

    shown = section("An example to run")
    (header,) = [line for line in shown.splitlines() if line.startswith("size [V]")]
    columns = re.findall(r"[a-z]+(?: \[\S+\])?", header)
    assert list(dict.fromkeys(columns)) == first_cells("What it prints")

    _, file = read_operator(tmp_path / "scanner_x_operator.toml", "")
    places = {50: (10, 25, 45, 65, 82, 97), 25: (12, 46), 75: (12, 46)}
    names = [f"{volts}v_at_{offset_v}v.csv" for offset_v, sizes_v in places.items() for volts in sizes_v]
    assert [line.name for line in file.lines] == sorted(names)

    setup = load(tmp_path / EXAMPLE.name)
    played = run_line(make_plan(setup).x, default_x())
    residual = max(abs(end) for side in DIRECTIONS for end in getattr(played.imaged, side).residual_range)
    scaling = [getattr(played.imaged, side).scaling_peak_to_peak for side in DIRECTIONS]
    (numbers,) = re.findall(
        r"straight within (\S+) % .*? of (\S+) % forward and (\S+) % backward.*? is (\S+) % off", WORDS
    )
    measured = [residual, *scaling, abs(played.size_error_percent)]
    assert [float(number) for number in numbers] == pytest.approx(measured, rel=0.1, abs=0.06)


@pytest.mark.rest
def test_a_row_of_the_measured_table(tmp_path: Path) -> None:
    """The first one with an operator: five sizes at two rates, from traces through commands to integers."""
    sys.path.insert(0, str(REPOSITORY / "docs" / "figures"))
    try:
        import make_operator
        from calibrated_plant import calibrated, scanned
        from foreign_plants import SIX, ForeignPlant, ManyPlays
    finally:
        sys.path.pop(0)
    plant = ForeignPlant(ManyPlays())
    calibrated(plant, tmp_path, SIX)
    lines = [
        scanned(plant, tmp_path, "operator.toml", size_nm, offset_v, rate_hz)
        for offset_v, size_nm in make_operator.SCANS["50 V"]
        for rate_hz in make_operator.RATES_HZ
    ]
    made = make_operator.row("many plays", "50 V", "operator, six traces", lines)
    (shown,) = [row for row in PAGE.splitlines() if row.startswith(made[: made.index("traces |")])]
    for one, other in zip(CELL.findall(made), CELL.findall(shown), strict=True):
        assert [float(v) for v in one] == pytest.approx([float(v) for v in other], rel=0.1, abs=0.02)
