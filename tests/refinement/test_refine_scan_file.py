"""A layer put into a scan file in place: values, order, comments and line ends; what cannot be edited is left alone."""

import tomllib
from itertools import pairwise
from typing import Any

import pytest
from editing import SCAN
from hypothesis import given
from hypothesis import strategies as st

from tablegen.base.input_errors import Rejected
from tablegen.refinement.scan_file import with_layer

VALUES: dict[str, Any] = {
    "a": [0.001 * n for n in range(8)],
    "b": [-0.0005 * n for n in range(8)],
    "v_amplitude": 20.0,
    "v_offset": 50.0,
    "rate_hz": 400.0,
    "turn": 0.5,
    "window": [0.1, 0.9],
    "directions": "both",
    "model": "0123456789abcdef",
    "before_percent": 0.3,
}


def put(text: str, axis: str = "x", values: dict[str, Any] | None = None, where: str = "t.csv") -> str:
    return with_layer(text, "scan.toml", axis, values or VALUES, where)


def without(text: str, axis: str) -> list[str]:
    """The lines that are not of the layer."""
    rows, kept, inside = text.split("\n"), [], False
    for row in rows:
        if row.startswith("["):
            inside = row == f"[{axis}.refinement]"
        if not inside and not row.startswith("# refine "):
            kept.append(row)
    return [row for row in kept if row]


@pytest.mark.common
@given(
    st.lists(st.floats(-0.5, 0.5), min_size=1, max_size=40),
    st.sampled_from("xy"),
    st.sampled_from(["\n", "\r\n"]),
    st.integers(1, 3),
)
def test_nothing_else_changes(a: list[float], axis: str, end: str, rounds: int) -> None:
    before = SCAN.replace("\n", end)
    values = {**VALUES, "a": a, "b": a[::-1]}
    text = before
    for _ in range(rounds):
        text = put(text, axis, values)
    expected = tomllib.loads(SCAN)
    expected[axis]["refinement"] = values
    assert tomllib.loads(text) == expected
    assert text.count(end) == text.count("\n")
    plain = text.replace("\r\n", "\n")
    assert without(plain, axis) == [row for row in SCAN.split("\n") if row]
    assert [row for row in plain.split("\n") if row.startswith("# refine ")] == [
        f"# refine {n}: t.csv" for n in range(1, rounds + 1)
    ]
    assert put(text, axis, values).count("# refine") == rounds + 1


def test_it_reads_well() -> None:
    text = put(put(put(SCAN), where="second.csv"), "y")
    at = text.index("# refine 1: t.csv\n# refine 2: second.csv\n[x.refinement]\na = [\n    0.0, 0.001,")
    assert text[:at].endswith("bits = 16\n\n")
    assert "before_percent = 0.3\n\n[y]\n" in text[at:]
    assert "before_percent = 0.3\n\n[limits]" in text[at:]
    rows = text.split("\n")
    assert max(map(len, rows)) < 121
    assert not any(one == two == "" for one, two in pairwise(rows))


def test_a_comment_on_what_follows_stays_with_it() -> None:
    text = put(SCAN.replace("[y]\n", "# the slow one\n[y]\n"))
    assert "before_percent = 0.3\n\n# the slow one\n[y]\n" in text


def test_keys_that_are_gone_go_and_comments_on_keys_stay() -> None:
    once = put(SCAN).replace("rate_hz = 400.0\n", "rate_hz = 400.0  # mine\n")
    values = {key: value for key, value in VALUES.items() if key != "model"}
    again = put(once, values={**values, "rate_hz": 399.0})
    assert "rate_hz = 399.0  # mine\n" in again
    assert "model" not in tomllib.loads(again)["x"]["refinement"]


def test_an_inline_axis() -> None:
    text = put('name = "a"\nx = { size_v = 20.0 } # mine\n')
    assert tomllib.loads(text)["x"] == {"size_v": 20.0, "refinement": VALUES}
    assert text.startswith('name = "a"\n# refine 1: t.csv\nx = {')


@pytest.mark.parametrize("text", ["x.size_v = 20.0\nname = 1\n", "[x]\nsize_v = 1\n[y]\n[x.table]\nbits = 8\n"])
def test_an_unusual_layout_is_edited_or_refused(text: str) -> None:
    """Never anything but what was asked for."""
    try:
        changed = put(text)
    except Rejected:
        return
    expected = tomllib.loads(text)
    expected["x"]["refinement"] = VALUES
    assert tomllib.loads(changed) == expected


def test_what_is_no_toml() -> None:
    with pytest.raises(Rejected):
        put("[x\n")
