"""A calibration into a scanner file: values, comments, order, provenance, and layouts that people write."""

import re
import tomllib
from typing import Any

import pytest
from calibrating import OFFSETS, V_MAX, apparent
from editing import SCANNER
from hypothesis import given, settings
from hypothesis import strategies as st

from tablegen.base.data_files import Source
from tablegen.base.input_errors import Rejected
from tablegen.base.toml import parse_toml
from tablegen.calibration import summary
from tablegen.calibration.laws.offset import fit_offset
from tablegen.calibration.scanner_file import Change, new_file, updated, with_own_hysteresis
from tablegen.config.like import inherited

HASH = "0123456789abcdef"
BRANCH = {"beta_max": 0.04, "rho": 3.0, "u_peak": 0.4}


def offset(m_minus: float = 0.93, m_plus: float = 1.2, points: int = 5) -> Change:
    lines = [f"{points} points, residual 0.1 % rms", f"from a.csv, sha256 {HASH}"]
    return Change("offset", {"m_minus": m_minus, "m_plus": m_plus}, ("alpha", "beta", "points"), (), [lines])


def hysteresis(*turns: float, note: str = "3 traces") -> Change:
    entries = [{"turn": turn, "forward": BRANCH, "backward": BRANCH} for turn in turns]
    return Change(
        "hysteresis", {"model": "harmonic"}, (), entries, [[note, f"from t.csv, sha256 {HASH}"] for _ in turns]
    )


def put(text: str, change: Change, axis: str = "x") -> dict[str, Any]:
    """The values of a text after a calibration; and that doing it again changes nothing."""
    new = updated(text, "scanner.toml", axis, change)
    assert updated(new, "scanner.toml", axis, change) == new
    return tomllib.loads(new)


def test_only_what_was_calibrated_changes() -> None:
    new = updated(SCANNER, "scanner.toml", "x", offset())
    lines, before = new.splitlines(), SCANNER.splitlines()
    at = before.index(next(line for line in before if line.startswith("[x.offset]")))
    assert lines[:at] == before[:at]
    assert lines[at : at + 2] == ["# calibrate offset: 5 points, residual 0.1 % rms", f"# from a.csv, sha256 {HASH}"]
    assert lines[at + 2] == before[at]
    assert lines[at + 3] == before[at + 1].replace("0.92", "0.93")
    assert lines[at + 4].split() == before[at + 2].replace("1.25", "1.2").split()
    assert lines[at + 4].index("#") == before[at + 2].index("#"), "the comment stays in its column"
    assert lines[at + 5 :] == before[at + 3 :]


def test_a_second_calibration_replaces_the_comment_of_the_first() -> None:
    first = updated(SCANNER, "scanner.toml", "x", offset())
    second = updated(first, "scanner.toml", "x", offset(0.95, 1.3, 7))
    assert len(second.splitlines()) == len(first.splitlines())
    assert "7 points" in second
    assert "5 points" not in second


OPERATOR = Change("hysteresis", {"model": "operator", "file": "x.toml"})
LIKE = """name = "s"
v_max = 100.0

[x.size]
k_nm_per_v = 10.0
{x}
[y]
like = "x"
{y}"""
TABLE = """
[x.hysteresis]
model = "sinusoidal"

[[x.hysteresis.branches]]
turn = 0.5
forward = { beta_max = 0.04, rho = 3.0 }
backward = { beta_max = 0.05, rho = 2.0 }
"""
OF_Y = """
[[y.hysteresis.branches]]        # of frames that fly back
turn = 0.95
forward = { beta_max = 0.04, rho = 3.0 }
backward = { beta_max = 0.04, rho = 3.0 }
"""


@pytest.mark.parametrize(
    ("x", "y"), [(TABLE, ""), (TABLE, OF_Y), ("", ""), (TABLE, '\n[y.hysteresis]\nmodel = "triangle"\n')]
)
def test_y_keeps_the_hysteresis_that_it_shares_when_x_gets_an_operator(x: str, y: str) -> None:
    text = LIKE.format(x=x, y=y)
    before = inherited(*parse_toml(text, "s.toml"))[0]["y"].get("hysteresis", {"model": "triangle"})
    new = updated(with_own_hysteresis(text, "s.toml"), "s.toml", "x", OPERATOR)
    assert with_own_hysteresis(new, "s.toml") == new
    values = inherited(*parse_toml(new, "s.toml"))[0]
    assert values["y"]["hysteresis"] == before
    assert values["x"]["hysteresis"]["model"] == "operator"
    assert new.count("# of frames that fly back") == y.count("#"), "a comment stays where it was, and once"
    shared = inherited(*parse_toml(updated(text, "s.toml", "x", OPERATOR), "s.toml"))[0]["y"]["hysteresis"]
    assert (shared["model"] == "operator") == ("model" not in y), "negative control: y takes the operator of x"


@pytest.mark.parametrize("text", [SCANNER, "y = 3\n", '[y]\nlike = "x"\nhysteresis = 3\n[x]\n'])
def test_a_file_without_a_shared_hysteresis_stays_as_it_is(text: str) -> None:
    assert with_own_hysteresis(text, "s.toml") == text


def test_every_comment_survives_every_calibration() -> None:
    text = SCANNER
    for axis in "xy":
        for change in (offset(), hysteresis(0.5, 0.9), Change("resonance", {"frequency_hz": 3e4, "quality": 9.0})):
            text = updated(text, "scanner.toml", axis, change)
    comments = re.findall(r"#.*", SCANNER)
    assert len(comments) > 10
    assert [line for line in re.findall(r"#.*", text) if line in comments] == comments


def test_turns_are_told_apart() -> None:
    values = put(SCANNER, hysteresis(0.503, 0.9))
    branches = values["x"]["hysteresis"]["branches"]
    assert [entry["turn"] for entry in branches] == [0.503, 0.9]
    assert all(entry["forward"] == BRANCH for entry in branches)
    text = updated(SCANNER, "scanner.toml", "x", hysteresis(0.5, 0.9))
    again = updated(text, "scanner.toml", "x", hysteresis(0.9, note="9 traces"))
    assert "# calibrate hysteresis, turn 0.5: 3 traces" in again
    assert "# calibrate hysteresis, turn 0.9: 9 traces" in again
    assert again.count("# calibrate hysteresis") == 2


def test_other_ways_to_give_an_offset_go() -> None:
    ways = (
        "alpha = 0.1 # old\nbeta = 0.0\n",
        "[[x.offset.points]]\noffset_v = 7.0\napparent_nm = 16.0\n[[x.offset.points]]\noffset_v = 9.0\n",
    )
    for way in ways:
        text = f'name = "a"\nv_max = 100.0\n[x.offset]\n{way}[y.size]\nk_nm_per_v = 1.0\n'
        assert put(text, offset())["x"]["offset"] == {"m_minus": 0.93, "m_plus": 1.2}


def test_a_new_file_grows() -> None:
    text = new_file("mine", 150.0)
    assert tomllib.loads(text) == {"name": "mine", "v_max": 150.0}
    for axis in "yx":
        for change in (hysteresis(0.5), offset(), Change("size", {"k_nm_per_v": 9.0}, (), (), [["a"]])):
            text = updated(text, "scanner.toml", axis, change)
    values = tomllib.loads(text)
    assert values["x"] == values["y"]
    assert values["x"]["size"] == {"k_nm_per_v": 9.0}
    for before, line in zip(text.splitlines(), text.splitlines()[1:], strict=False):
        assert not line.startswith("[") or before == "" or before.startswith("#"), "tables are set apart"


TOP = 'name = "a"\nv_max = 100.0\n'
SIZE = "k_nm_per_v = 10.0"
LAYOUTS = {
    "inline": f"{TOP}x = {{ size = {{ {SIZE} }} }} # all\ny = {{ size = {{ {SIZE} }} }}\n",
    "inline tables": f"{TOP}[x]\nsize = {{ {SIZE} }}\noffset = {{ alpha = 0.1, beta = 0.0 }} # old\n"
    f"[y]\nsize = {{ {SIZE} }}\n",
    "inline branches": f"{TOP}[x]\nsize = {{ {SIZE} }}\n"
    'hysteresis = { model = "harmonic", branches = [{ turn = 0.5, forward = { beta_max = 0.1 } }] }\n'
    f"[y.size]\n{SIZE}\n",
    "out of order": f"{TOP}[x.size]\n{SIZE}\n[y.size]\n{SIZE}\n[x.offset]\nalpha = 0.1\nbeta = 0.0\n",
    "indented": f"{TOP}  [x]\n    [x.size]\n    {SIZE}\n    [x.offset]\n    alpha = 0.1 # old\n"
    f"    beta = 0.0\n  [y]\n    [y.size]\n    {SIZE}\n",
    "no end": f"{TOP}[y.size]\n{SIZE}\n[x.size]\n{SIZE}",
    "dotted": f"{TOP}x.size.{SIZE}\n[y.size]\n{SIZE}\n",
    "windows": SCANNER.replace("\n", "\r\n"),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_layouts_that_people_write(layout: str) -> None:
    text = LAYOUTS[layout]
    before = tomllib.loads(text)
    values = put(text, offset())
    assert values["x"]["offset"] == {"m_minus": 0.93, "m_plus": 1.2}
    turned = put(text, hysteresis(0.5, 0.9))
    assert [entry["turn"] for entry in turned["x"]["hysteresis"]["branches"]] == [0.5, 0.9]
    for changed, kind in ((values, "offset"), (turned, "hysteresis")):
        for one in (before, changed):
            one["x"].pop(kind, None)
        assert changed == before
        before = tomllib.loads(text)
    new = updated(text, "scanner.toml", "x", offset())
    assert ("\r\n" in new) == ("\r\n" in text)
    assert "\r\r" not in new
    assert new.count("# calibrate offset") == 1


def test_a_layout_that_cannot_be_edited_is_left_alone() -> None:
    text = f"{TOP}x.size.{SIZE}\ny = {{ size = {{ {SIZE} }} }}\n"
    with pytest.raises(Rejected, match=r"scanner.toml: x: its layout is too unusual"):
        updated(text, "scanner.toml", "x", offset())


@pytest.mark.parametrize(
    ("text", "change", "why"),
    [
        (SCANNER, offset(m_minus=0.01), "scanner.toml: x.offset.m_minus: 0.01 is below 0.1; nothing was written"),
        (SCANNER, Change("frequency", {"alpha": 0.9}), "scanner.toml: x.frequency.alpha: 0.9 is above 0.5"),
        ("name = [", offset(), "scanner.toml:1: not TOML"),
        ("x = 3\n", offset(), "scanner.toml: x: is not a table"),
        ("[x]\noffset = 3\n", offset(), "scanner.toml: x.offset: is not a table"),
    ],
)
def test_what_is_refused(text: str, change: Change, why: str) -> None:
    with pytest.raises(Rejected) as caught:
        updated(text, "scanner.toml", "x", change)
    assert str(caught.value).startswith(why)


def test_faults_that_were_there_before_do_not_matter() -> None:
    text = SCANNER.replace("base_nm = 200.0", "base_nm = 200.0\ncolour = 3", 1)
    assert put(text, offset())["x"]["size"]["colour"] == 3


@pytest.mark.common
@given(name=st.text(st.characters(exclude_categories=["Cs"]), min_size=1, max_size=30))
@settings(max_examples=20)
def test_no_file_name_can_spoil_the_file(name: str) -> None:
    sizes = apparent(OFFSETS, 0.93, 1.2, 17.7)
    put_in = summary.change(fit_offset(OFFSETS, sizes, V_MAX), [Source(name, HASH)])
    assert put(SCANNER, put_in)["x"]["offset"] == pytest.approx({"m_minus": 0.93, "m_plus": 1.2})
