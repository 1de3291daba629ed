"""What docs/shaping.md says of three scanners, measured again, and held to what shaped output was made for."""

import importlib
import re
import sys
from types import ModuleType

import pytest
from building import REPOSITORY

PAGE = (REPOSITORY / "docs" / "shaping.md").read_text("utf-8")
ROWS = [
    row.strip("| ").split(" | ")
    for row in PAGE.split("scanners -->")[1].splitlines()
    if row.startswith("| ") and "scanner" not in row
]
# By scanner, of a trial in floats whose table had no error: rms error of the position in LSB, scaling error in percent.
TRIAL = ((0.067, 0.8), (0.004, 0.05), (0.0001, 0.1))


@pytest.fixture(scope="module")
def benchmark() -> ModuleType:
    """The benchmark, which is no package."""
    sys.path.insert(0, str(REPOSITORY / "benchmarks"))
    try:
        return importlib.import_module("shaping")
    finally:
        sys.path.remove(str(REPOSITORY / "benchmarks"))


def test_the_page_has_every_row(benchmark: ModuleType) -> None:
    tables = [f"{mode}, {length} x {bits}" for mode, length, bits in benchmark.TABLES]
    assert [row[:2] for row in ROWS] == [[name, table] for name, *_ in benchmark.SCANNERS for table in tables]


@pytest.mark.rest
@pytest.mark.parametrize("number", range(3))
@pytest.mark.parametrize("table", range(3))
def test_a_row_is_measured(benchmark: ModuleType, number: int, table: int) -> None:
    """Without shaping, and with that of the scanner."""
    row = ROWS[len(benchmark.TABLES) * number + table]
    for column in (0, 3):
        line = benchmark.planned(benchmark.SHAPINGS[column], benchmark.TABLES[table], number)
        assert benchmark.cell(line) == row[2 + column]


@pytest.mark.parametrize("table", [0, 2], ids=["lines", "cubic"])
def test_fine_tables_leave_what_the_trial_in_floats_leaves(benchmark: ModuleType, table: int) -> None:
    for (rms, scaling), row in zip(TRIAL, ROWS[table :: len(benchmark.TABLES)], strict=True):
        found = re.fullmatch(r"(\S+) LSB, (\S+) % \(.*\)", row[-1])
        assert found is not None
        assert float(found[1]) <= 1.5 * rms
        assert float(found[2]) <= 1.5 * scaling
