"""The option --plot: into a file or into the terminal, in colours or without, as wide as the terminal."""

import os
import re
import sys
from pathlib import Path

import pytest
from editing import run, write_pair
from pseudo_terminal import on_pseudo_terminal

FORWARD, BACKWARD = "\x1b[38;5;32m", "\x1b[38;5;172m"


@pytest.fixture
def scan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv("COLUMNS", raising=False)
    return write_pair(tmp_path)


def on_a_terminal(*arguments: str | Path, columns: int = 80, **environment: str) -> str:
    """What a terminal of a width gets of stdout."""
    without = {key: value for key, value in os.environ.items() if key not in ("COLUMNS", "NO_COLOR", "TERM")}
    status, shown = on_pseudo_terminal(arguments, {**without, **environment}, columns, stderr_too=False)
    assert status == 0, shown
    return shown


def plotted(text: str) -> list[str]:
    """The lines of plots, from the first title on, without colours."""
    plain = re.sub(r"\x1b\[[0-9;]*m", "", text).splitlines()
    first = plain.index("x drive, one line")
    return [line for line in plain[first:] if not line.startswith("note: ")]


@pytest.mark.common
def test_directions_have_two_colours_and_two_marks(scan: Path) -> None:
    shown = on_a_terminal("show", scan)
    assert f"{FORWARD}> forward" in shown
    assert f"{BACKWARD}< backward" in shown
    rows = [line for line in shown.splitlines() if "\u2502" in line or "\u2524" in line]
    for colour, mark in ((FORWARD, ">"), (BACKWARD, "<")):
        runs = re.findall(rf"{re.escape(colour)}([^\x1b]*)\x1b\[0m", "\n".join(rows))
        assert any(mark in one for one in runs)
        assert not any({">": "<", "<": ">"}[mark] in one for one in runs)


@pytest.mark.common
@pytest.mark.parametrize("variable", [{"NO_COLOR": "1"}, {"TERM": "dumb"}])
def test_no_colour_where_none_is_wanted(scan: Path, variable: dict[str, str]) -> None:
    plain, coloured = (on_a_terminal("show", scan, **given) for given in (variable, {}))
    assert "\x1b[38" not in plain
    assert "\x1b[38" in coloured
    assert plotted(plain) == plotted(coloured)
    assert "> forward" in plain
    assert "\x1b" not in run("show", scan).out


@pytest.mark.common
def test_the_width_is_that_of_the_terminal(scan: Path) -> None:
    widths = {}
    for columns in (60, 100, 150):
        lines = plotted(on_a_terminal("show", scan, columns=columns))
        widths[columns] = max(map(len, lines))
        assert columns - 3 <= widths[columns] <= columns
    narrow = plotted(on_a_terminal("show", scan, columns=150, COLUMNS="70"))
    assert 67 <= max(map(len, narrow)) <= 70
    assert 77 <= max(map(len, plotted(run("show", scan).out))) <= 80  # no terminal


def test_a_file_takes_the_place_of_the_terminal(scan: Path, tmp_path: Path) -> None:
    for ending, begins in (("svg", b"<?xml"), ("png", b"\x89PNG"), ("pdf", b"%PDF")):
        done = run("show", scan, "--plot", tmp_path / f"a.{ending}")
        assert (done.status, done.err) == (0, "")
        assert "> forward" not in done.out
        assert (tmp_path / f"a.{ending}").read_bytes().startswith(begins)


@pytest.mark.common
def test_the_terminal_by_default_or_when_asked(scan: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert "> forward" in run("show", scan).out
    assert "> forward" not in run("show", scan, "--no-plot").out
    assert "> forward" not in run("build", scan, "-o", out).out
    for words in (("build", scan, "-o", out, "-q", "--plot"), ("build", scan, "-o", out, "-q", "--plot", "-")):
        assert "> forward" in run(*words).out


def test_a_file_that_is_there_is_no_picture(scan: Path) -> None:
    """``--plot`` before an argument: the argument stays one."""
    assert run("show", "--plot", scan).out == run("show", scan, "--plot").out
    wrong = run("show", scan, "--plot", "a.gif")
    assert wrong.status == 2
    assert "'a.gif': the name has to end in .png, .svg or .pdf" in wrong.err


def test_json_and_a_plot_go_into_two_places(scan: Path, tmp_path: Path) -> None:
    done = run("show", scan, "--json", "--plot", tmp_path / "a.svg")
    assert done.status == 0
    assert done.out == run("show", scan, "--json").out
    assert (tmp_path / "a.svg").is_file()
    both = run("show", scan, "--json", "--plot")
    assert both.status == 2
    assert "give --plot FILE" in both.err


def test_a_check_draws_nothing(scan: Path, tmp_path: Path) -> None:
    done = run("build", scan, "--check", "--plot", tmp_path / "a.svg")
    assert done.status == 2
    assert "--check cannot be used with --plot" in done.err


@pytest.mark.parametrize("name", ["show", "build", "simulate", "refine"])
def test_svg_needs_no_library(scan: Path, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """PNG without matplotlib ends before anything is worked out, with advice."""
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    words = {"refine": ("refine", scan, tmp_path / "none.csv", "--axis", "x")}.get(name, (name, scan))
    done = run(*words, "--plot", tmp_path / "a.png")
    assert done.status == 6
    assert "matplotlib is missing; install it with: pip install 'piezo-tablegen[plot]'; or give a FILE.svg" in done.err
    assert not (tmp_path / "a.png").exists()
    if name == "show":
        assert run("show", scan, "--plot", tmp_path / "a.svg").status == 0
