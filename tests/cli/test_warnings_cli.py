"""Warnings on the command line: where they go, what they leave as it is, and ``--strict``."""

import json
from pathlib import Path

import pytest
from editing import SCAN, SCANNER, edited, run, write_pair

import tablegen

SMALL = ("- [limits]", "timing.lines = 40", "x.size_nm = 20.0", "y.size_nm = 20.0")


@pytest.fixture
def small(tmp_path: Path) -> Path:
    return write_pair(tmp_path, edited(SCAN, *SMALL))


def test_a_good_scan_has_no_warning(tmp_path: Path) -> None:
    scan = write_pair(tmp_path)
    for command in (("check", scan), ("check", scan, "--strict")):
        found = run(*command)
        assert (found.status, found.err) == (0, "")
        assert found.out.endswith(f"\n{scan}: correct\n")
    built = run("build", scan, "-o", tmp_path / "build", "--strict")
    assert (built.status, built.err) == (0, "")


@pytest.mark.common
def test_build_check_and_show_warn_and_succeed(small: Path, tmp_path: Path) -> None:
    build = run("build", small, "-o", tmp_path / "build")
    assert build.status == 0
    assert (tmp_path / "build" / "manifest.json").is_file()
    x, y = build.messages
    line = small.read_text(encoding="utf-8").splitlines().index("size_nm = 20.0") + 1
    assert x.startswith(f"warning: {small}:{line}: x.size_nm: the x axis has a scaling error of 2.")
    assert y.startswith(f"warning: {small}:")
    assert ": y.size_nm: " in y
    check = run("check", small)
    assert (check.status, check.err) == (0, build.err)
    assert check.out.startswith("x: ")
    assert check.out.endswith(f"\n{small}: correct, with 2 warnings\n")
    show = run("show", small, "--json")
    assert (show.status, show.err) == (0, build.err)
    assert json.loads(show.out)["hash"] == json.loads((tmp_path / "build" / "manifest.json").read_bytes())["hash"]
    up_to_date = run("build", small, "-o", tmp_path / "build", "--check")
    assert (up_to_date.status, up_to_date.out, up_to_date.err) == (0, "", build.err)


def test_the_block_in_the_emitted_files_says_it(small: Path, tmp_path: Path) -> None:
    assert run("build", small, "-o", tmp_path / "build", "-q").status == 0
    header = (tmp_path / "build" / "annexin_200nm.h").read_text("ascii")
    assert header.count(" axis has a scaling error of 2.") == 2
    assert header.count("the cause is quantisation (quantisation 2.") == 2
    good = tablegen.build(write_pair(tmp_path, SCAN, SCANNER)).files["annexin_200nm.h"].decode("ascii")
    assert "warning" not in good


@pytest.mark.common
def test_strict_makes_them_errors(small: Path, tmp_path: Path) -> None:
    warnings = run("check", small).err
    for command in (("check", small), ("build", small, "-o", tmp_path / "build")):
        found = run(*command, "--strict")
        assert (found.status, found.out, found.err) == (3, "", warnings)
    assert not (tmp_path / "build").exists()


def test_a_limit_that_is_exceeded_is_an_error_before_any_warning(tmp_path: Path) -> None:
    """With remedies that were tried against that limit: each, written into the file, is accepted."""
    edits = ("x.size_nm = 20.0", "y.size_nm = 20.0", "timing.lines = 40")
    found = run("check", write_pair(tmp_path, edited(SCAN, *edits)))
    assert found.status == 3
    assert "warning" not in found.err
    for axis, message in zip("xy", found.messages, strict=True):
        assert f"the {axis} axis has a scaling error of " in message
        for advice in message.split("; tried: ")[1].split("; or "):
            changes = advice.rpartition(" leaves ")[0].split(" with ")
            again = run("check", write_pair(tmp_path, edited(SCAN, *edits, *changes)))
            assert f"the {axis} axis" not in again.err, advice


def test_a_remedy_that_breaks_another_limit_says_so(tmp_path: Path) -> None:
    """More bits of the converter make its LSB small beside the words of y's table, and y's drive takes the range."""
    found = run("check", write_pair(tmp_path, edited(SCAN, "x.size_nm = 20.0")))
    assert found.status == 3
    said = "no remedy that was tried is enough; the best: dac.bits = 19 leaves 0."
    assert said in found.err
    assert found.err.endswith(" %, with an error above limits.max_error_lsb\n")


@pytest.mark.common
def test_a_build_in_python_has_them(small: Path) -> None:
    scan = tablegen.build(small)
    assert [f"warning: {text}" for text in scan.warnings] == run("check", small).messages
    assert repr(scan).count("\n  warning: the ") == 2
    assert scan._repr_html_().count("<b>warning</b>: the ") == 2
    good = tablegen.build(write_pair(small.parent, SCAN, SCANNER))
    assert good.warnings == []
    assert "warning" not in repr(good) + good._repr_html_()
