"""CSV files as Python's reader has them, against what the manifest plays."""

import csv
from pathlib import Path

import pytest
from building import NAME
from formatted import BUILDS, FEW, Formatted, check_finds_a_flip, formatted
from manifest_integers import markers, played_codes, seconds
from sets import quick


@pytest.fixture(scope="module", params=quick(FEW, BUILDS))
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Formatted:
    return formatted(tmp_path_factory.mktemp("csv"), request.param, "csv")


@pytest.mark.parametrize("axis", ["x", "y"])
def test_the_rows_are_a_period_of_the_manifest(built: Formatted, axis: str) -> None:
    with (built.folder / f"{NAME}_{axis}.csv").open(newline="", encoding="ascii") as file:
        rows = list(csv.DictReader(file))
    content = built.manifest["axes"][axis]
    codes, output = played_codes(content), content["output"]
    assert [int(row["code"]) for row in rows] == codes
    assert [float(row["time_s"]) for row in rows] == seconds(built.manifest, len(codes))
    assert [float(row["volts"]) for row in rows] == [output["v_zero"] + output["v_per_code"] * code for code in codes]
    wanted = markers(built.manifest, axis)
    assert [{name: row[name] for name in wanted[0]} for row in rows] == [
        {name: str(int(set_)) for name, set_ in tick.items()} for tick in wanted
    ]
    assert set(rows[0]) == {"time_s", "volts", "code", *wanted[0]}


def test_spreadsheets_get_nothing_but_numbers(built: Formatted) -> None:
    for axis in "xy":
        text = built.file(f"_{axis}.csv")
        assert text.isascii()
        assert text.endswith(b"\n")
        assert b" " not in text
        assert b"\r" not in text


def test_a_changed_value_is_found(tmp_path: Path) -> None:
    names = [f"{NAME}_{axis}.csv" for axis in "xy"]
    check_finds_a_flip(formatted(tmp_path, "short", "csv"), "csv", names)
