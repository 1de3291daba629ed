"""CSV of measurements: what is read, and what is said of what cannot be."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tablegen.base.input_errors import Rejected
from tablegen.calibration.tables.columns import APPARENT, FREQUENCY, GAIN, OFFSET, PHASE, TIME, Column
from tablegen.calibration.tables.table import MeasuredTable, read_table


def read(folder: Path, content: str | bytes, *needed: Column, optional: tuple[Column, ...] = ()) -> MeasuredTable:
    path = folder / "data.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    return read_table(path, needed or (OFFSET, APPARENT), optional)


def refused(folder: Path, content: str | bytes, *needed: Column) -> list[str]:
    with pytest.raises(Rejected) as caught:
        read(folder, content, *needed)
    return [str(problem).replace(f"{folder}/", "") for problem in caught.value.problems]


@pytest.mark.parametrize(
    "content",
    [
        "offset_v,apparent_nm\n7,16.5\n50,17.7\n",
        "offset_v;apparent_nm\n7;16,5\n50;17,7\n",
        "offset_v\tapparent_nm\r\n7\t16.5\r\n50\t17.7\r\n",
        "\ufeffoffset_v,apparent_nm\n7,16.5\n50,17.7",
        "# of Monday\n\noffset_v, apparent_nm\n7, 16.5\n# a pause\n ,\n50, 17.7\n\n",
        '"Offset_V","Apparent_nm"\n"7","16.5"\n"50","17.7"\n',
        "apparent_um,comment,offset_mv\n0.0165,good,7000\n0.0177,,5e4\n",
        "offset_v,apparent_nm\r7,16.5\r50,17.7\r",
    ],
    ids=["commas", "semicolons", "tabs", "mark", "comments", "quotes", "units", "old ends"],
)
def test_what_is_read(content: str, tmp_path: Path) -> None:
    table = read(tmp_path, content)
    assert table[OFFSET] == pytest.approx([7.0, 50.0], rel=1e-15)
    assert table[APPARENT] == pytest.approx([16.5, 17.7], rel=1e-15)
    assert len(table) == 2
    assert table.source.name == "data.csv"
    assert table.source.sha256 == hashlib.sha256(content.encode()).hexdigest()[:16]


def test_units_of_every_kind_are_converted(tmp_path: Path) -> None:
    table = read(
        tmp_path, "frequency_khz,gain_db,phase_rad,time_us\n1.5,20,3.141592653589793,2\n", FREQUENCY, GAIN, PHASE, TIME
    )
    assert [float(table[c][0]) for c in (FREQUENCY, GAIN, PHASE, TIME)] == pytest.approx([1500.0, 10.0, 180.0, 2e-6])


def test_an_optional_column_may_be_missing(tmp_path: Path) -> None:
    table = read(tmp_path, "offset_v\n1\n", OFFSET, optional=(APPARENT,))
    assert OFFSET in table
    assert APPARENT not in table


def test_rows_know_their_lines(tmp_path: Path) -> None:
    table = read(tmp_path, "# a\noffset_v,apparent_nm\n\n7,16.5\n# b\n50,17.7\n")
    assert table.lines.tolist() == [4, 6]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", ["data.csv: is empty; a header with offset_v, apparent_nm is needed"]),
        ("# nothing\n", ["data.csv: is empty; a header with offset_v, apparent_nm is needed"]),
        (
            "7,16.5\n",
            [
                "data.csv:1: the first line has numbers; a header with offset_v, apparent_nm has to stand above them, "
                "or say which column is which: --columns offset=1,..."
            ],
        ),
        ("offset_v,apparent_nm\n", ["data.csv:1: no numbers follow the header"]),
        (
            "Shift [V],apparent_nm\n1,2\n",
            [
                "data.csv:1: offset_v: missing (or offset_mv, offset_kv); the header has shift [v], apparent_nm, "
                "or choose it: --columns offset=NAME"
            ],
        ),
        (
            "offset_v,offset_mv,apparent_nm\n1,2,3\n",
            [
                "data.csv:1: offset_mv: the header has both offset_v and offset_mv; keep one of them, "
                "or choose it: --columns offset=NAME"
            ],
        ),
        (
            "offset_v,apparent_nm\n1,2\n1\n1,2,3\n",
            ["data.csv:3: 1 fields where the header has 2", "data.csv:4: 3 fields where the header has 2"],
        ),
        (
            "offset_v,apparent_nm\n1,two\n,3\n",
            ["data.csv:2: apparent_nm: 'two' is not a number", "data.csv:3: offset_v: is empty"],
        ),
        ("offset_v,apparent_nm\n1_0,3\n", ["data.csv:2: offset_v: '1_0' is not a number"]),
        (
            "offset_v,apparent_nm\n1,inf\nnan,1\n",
            ["data.csv:2: apparent_nm: inf is not finite", "data.csv:3: offset_v: nan is not finite"],
        ),
        ("offset_v,apparent_nm\n1,0\n", ["data.csv:2: apparent_nm: 0 is not above 0 (apparent_nm)"]),
        ("offset_v,apparent_um\n1,-1\n", ["data.csv:2: apparent_um: -1 is not above 0 (apparent_nm)"]),
        ("offset_v;apparent_nm\n1;1,234,5\n", ["data.csv:2: apparent_nm: '1,234,5' is not a number"]),
        ("offset_v,apparent_nm\n1,2\n\xff".encode("latin-1"), ["data.csv:3: byte 0xff is not UTF-8"]),
        ("offset_v,apparent_nm\n1,2\n".encode("utf-16"), ["data.csv:1: is UTF-16; save it as UTF-8"]),
    ],
)
def test_what_is_refused(content: str | bytes, said: list[str], tmp_path: Path) -> None:
    assert refused(tmp_path, content) == said


def test_a_gain_beyond_all_bounds_is_refused(tmp_path: Path) -> None:
    assert refused(tmp_path, "gain_db\n1e9\n", GAIN) == ["data.csv:2: gain_db: 1e9 is not below 1e+12 (gain)"]


def test_many_faults_are_cut_off(tmp_path: Path) -> None:
    said = refused(tmp_path, "offset_v,apparent_nm\n" + "1,x\n" * 50)
    assert len(said) == 21
    assert said[-1] == "data.csv:21: more faults follow; stopped"


def test_what_is_no_file_is_named(tmp_path: Path) -> None:
    for name in ("absent.csv", "."):
        with pytest.raises(Rejected, match="is not a file"):
            read_table(tmp_path / name, (OFFSET,))


@pytest.mark.common
@given(
    values=st.lists(
        st.tuples(st.floats(-1e5, 1e5), st.floats(1e-6, 1e9)).map(lambda pair: (pair[0] + 0.0, pair[1])),
        min_size=1,
        max_size=9,
    ),
    style=st.sampled_from([(",", "."), (";", "."), (";", ","), ("\t", ","), ("\t", ".")]),
    noise=st.lists(st.sampled_from(["", "# a, comment; here", "   "]), min_size=9, max_size=9),
    end=st.sampled_from(["\n", "\r\n"]),
    mark=st.sampled_from(["", "\ufeff"]),
    swapped=st.booleans(),
)
def test_numbers_come_back_as_they_were_written(
    tmp_path_factory: pytest.TempPathFactory,
    values: list[tuple[float, float]],
    style: tuple[str, str],
    noise: list[str],
    end: str,
    mark: str,
    swapped: bool,
) -> None:
    separator, point = style
    rows = [("offset_v", "apparent_nm"), *(tuple(repr(v).replace(".", point) for v in pair) for pair in values)]
    lines = []
    for between, row in zip([*noise, "", ""], rows, strict=False):
        lines += [between, separator.join(reversed(row) if swapped else row)]
    table = read(tmp_path_factory.mktemp("csv"), mark + end.join(lines))
    assert np.array_equal(table[OFFSET], [pair[0] for pair in values])
    assert np.array_equal(table[APPARENT], [pair[1] for pair in values])


@pytest.mark.common
@given(
    content=st.one_of(
        st.binary(max_size=80), st.text(max_size=80).map(lambda text: ("offset_v,apparent_nm\n" + text).encode())
    )
)
def test_whatever_it_is_is_read_or_refused(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    try:
        table = read(tmp_path_factory.mktemp("csv"), content)
    except Rejected:
        return
    assert np.all(np.isfinite(table[OFFSET]))
    assert np.all(table[APPARENT] > 0.0)
