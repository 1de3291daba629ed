"""CSV files that are read in blocks, most of them by numpy: the same numbers and faults as line by line."""

from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablegen.base.input_errors import Rejected
from tablegen.calibration.tables import table
from tablegen.calibration.tables.columns import DRIVE, FREQUENCY, GAIN, TIME, Column
from tablegen.calibration.tables.csv_blocks import plain_rows

ROWS = 60_000  # some blocks
HEADER = "time_ms,comment,drive_v\n"


def long_csv(path: Path, changes: dict[int, str], end: str = "\n", point: str = ".") -> Path:
    """Rows k, 0 and k / 7, and other lines at some numbers; the header is line 1."""
    rows = [changes.get(k + 2, f"{k},0,{k / 7!r}") for k in range(ROWS)]
    text = HEADER.replace("\n", end) + end.join(rows)
    path.write_text(text if point == "." else text.replace(",", ";").replace(".", point), "utf-8", newline="")
    return path


def line_by_line(path: Path, *needed: Column) -> table.MeasuredTable:
    with patch.object(table, "plain_rows", lambda *_: None):
        return table.read_table(path, needed)


@pytest.mark.common
@pytest.mark.parametrize(("end", "point"), [("\n", "."), ("\r\n", "."), ("\n", ","), ("\r", ".")])
def test_blocks_have_the_numbers_and_lines_of_the_file(end: str, point: str, tmp_path: Path) -> None:
    path = long_csv(tmp_path / "long.csv", {40_000: "# a pause", 40_001: ""}, end, point)
    found = table.read_table(path, [TIME, DRIVE])
    kept = np.array([k for k in range(ROWS) if k + 2 not in (40_000, 40_001)])
    assert np.array_equal(found[TIME], kept * 1e-3)
    assert np.array_equal(found[DRIVE], kept / 7)
    assert np.array_equal(found.lines, kept + 2)
    assert found.source == line_by_line(path, TIME, DRIVE).source


@pytest.mark.common
@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("1,0", "2 fields where the header has 3"),
        ("1,0,1,1", "4 fields where the header has 3"),
        ("1,0,", "drive_v: is empty"),
        ("1,0,1e999", "drive_v: 1e999 is not finite"),
        ("1,0,-1e6", "drive_v: -1e6 is not above -1e+06 (drive_v)"),
        ("1,0,1_0", "drive_v: '1_0' is not a number"),
        ("1,0,1e", "drive_v: '1e' is not a number"),
        ("1,0,1 1", "drive_v: '1 1' is not a number"),
    ],
)
def test_a_fault_far_down_has_its_line(line: str, said: str, tmp_path: Path) -> None:
    path = long_csv(tmp_path / "long.csv", {51_234: line})
    with pytest.raises(Rejected) as caught:
        table.read_table(path, [TIME, DRIVE])
    assert [str(one) for one in caught.value.problems] == [f"{path}:51234: {said}"]


def test_a_byte_that_is_no_text_far_down_has_its_line(tmp_path: Path) -> None:
    path = long_csv(tmp_path / "long.csv", {})
    path.write_bytes(path.read_bytes() + b"\n\xff\n")
    with pytest.raises(Rejected) as caught:
        table.read_table(path, [TIME, DRIVE])
    assert [str(one) for one in caught.value.problems] == [f"{path}:{ROWS + 2}: byte 0xff is not UTF-8"]


@pytest.mark.common
def test_units_that_are_no_factor_are_converted_too(tmp_path: Path) -> None:
    path = tmp_path / "gains.csv"
    gains = np.linspace(-40.0, 20.0, ROWS)
    rows = (f"{k + 1}.25,{gain!r}" for k, gain in enumerate(gains.tolist()))
    path.write_text("frequency_khz,gain_db\n" + "\n".join(rows), "utf-8")
    found = table.read_table(path, [FREQUENCY, GAIN])
    assert np.array_equal(found[FREQUENCY], (np.arange(ROWS) + 1.25) * 1e3)
    assert np.array_equal(found[GAIN], [10.0 ** (gain / 20.0) for gain in gains.tolist()])


cells = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False).map(repr), st.text("0123456789+-.eE ,;_x", max_size=6)
)


@given(
    rows=st.lists(st.lists(cells, min_size=2, max_size=2), min_size=1, max_size=4), separator=st.sampled_from(",;\t")
)
def test_rows_are_plain_only_where_each_number_is_one_to_python(rows: list[list[str]], separator: str) -> None:
    text = "\n".join(separator.join(row) for row in rows)
    found = plain_rows(text.encode(), separator, 2)
    if found is None:
        return
    lines = [line.split(separator) for line in text.split("\n")]
    expected = [[float(cell.replace(",", ".") if separator != "," else cell) for cell in cells] for cells in lines]
    assert np.array_equal(found, expected)


def test_plain_rows_are_those_of_plain_numbers() -> None:
    """What the property above must not pass by refusing everything."""
    assert np.array_equal(plain_rows(b"1,-2.5e3\r\n .5, +4\r\n", ",", 2), [[1.0, -2500.0], [0.5, 4.0]])  # type: ignore[arg-type]
    assert np.array_equal(plain_rows(b"1,5;2\n", ";", 2), [[1.5, 2.0]])  # type: ignore[arg-type]
