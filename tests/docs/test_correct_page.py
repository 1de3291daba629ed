"""docs/correct.md says what `tablegen correct` does: its example, its options, its numbers."""

import re
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest
from building import REPOSITORY
from correcting import Off, axes
from correcting import off as off_the_truth
from editing import run

from tablegen.cli.images.correct import correct
from tablegen.correction.by_fit import by_fit
from tablegen.correction.by_scanner import by_scanner
from tablegen.correction.old_scan import OldAxis, OldScan
from tablegen.correction.scan_images import Choice, read_scan
from tablegen.images.files import read_channels
from tablegen.virtual.imaging import Conditions, FrameImages, hexagonal, triangle_frame

PAGE = (REPOSITORY / "docs" / "correct.md").read_text("utf-8")
ROW = re.compile(
    r"^\| (.*?) \| (as taken|operator|fit) \| ([\d.]+), ([\d.]+) \| ([\d.]+), ([\d.]+) \| (.*?) \| ([\d.]+) \|"
)


def section(title: str) -> str:
    """The text under a heading."""
    return PAGE.partition(f"\n## {title}\n")[2].partition("\n## ")[0]


def test_every_option_of_the_page_is_one_and_those_of_the_drive_are_told() -> None:
    options = {name for one in correct.params for name in one.opts if name.startswith("--")}
    told = set(re.findall(r"--[a-z][a-z-]*", PAGE))
    assert told - options == {"--axis", "--write"}  # of calibrate
    drive = set(re.findall(r"`(--[a-z-]+)`", section("How an image was taken").partition("\n\n`--scan ")[0]))
    assert drive == {name for name in options if name.startswith("--slow")} | {
        *("--size-v", "--size-nm", "--offset-v", "--rate-hz", "--turn", "--window", "--lines", "--delay-pixels")
    }


def test_the_measured_numbers_are_within_reach() -> None:
    """0.3 % of the width is the aim, half a pixel of 512; the tests of corrections make such numbers again."""
    rows = [row.groups() for row in map(ROW.match, PAGE.splitlines()) if row]
    assert len(rows) == 12
    told = " ".join((REPOSITORY / "docs" / "accuracy.md").read_text("utf-8").split())
    assert "falls from 4 to 7 % of the width to 0.2 % or less" in told
    for _, how, *numbers, _, apart in rows:
        errors = [float(number) for number in numbers]
        if how == "as taken":
            assert 3.5 < max(errors[:2]) < 7.5
            assert min(errors) > 2.0
            assert float(apart) > 50.0
        else:
            assert max(errors) <= 0.2
            assert float(apart) <= 0.5


@pytest.mark.rest
def test_rows_of_the_measured_table(tmp_path: Path) -> None:
    sys.path.insert(0, str(REPOSITORY / "docs" / "figures"))
    try:
        import make_correct
    finally:
        sys.path.pop(0)
    made = make_correct.rows_of("default", tmp_path)
    shown = [line for line in PAGE.splitlines() if line.startswith("| virtual scanner |")]
    number = re.compile(r"[-+]?\d+(?:\.\d+)?")
    assert [number.sub("#", row) for row in made] == [number.sub("#", row) for row in shown]
    for one, other in zip(made, shown, strict=True):
        for value, told in zip(number.findall(one), number.findall(other), strict=True):
            assert float(value) == pytest.approx(float(told), rel=0.1, abs=0.05)  # LAPACK differs between machines


def old_frame() -> FrameImages:
    """That of the example's lattice, whose axes both samples share."""
    conditions = Conditions(noise=0.02, seed=1)
    sizes, offsets = (90, 90), (50, 50)
    return triangle_frame(*axes("default"), hexagonal(60.0), sizes, offsets, 100.0, conditions, 256, 256)


@pytest.mark.rest
def test_the_example_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every command, in order, on images made by the virtual scanner, whose truth is known."""
    monkeypatch.chdir(tmp_path)
    part = section("An example to run")
    code, in_python = re.findall(r"```python\n(.*?)```", part, re.DOTALL)
    exec(compile(code, "docs/correct.md", "exec"), {})
    (old,) = re.findall(r"<!-- file: old.toml -->\n```toml\n(.*?)```", part, re.DOTALL)
    (tmp_path / "old.toml").write_text(old, "utf-8")
    commands = re.findall(r"^\$ tablegen (.*)$", part, re.MULTILINE)
    assert len(commands) == 4
    for command in commands:
        outcome = run(*shlex.split(command))
        assert (outcome.status, outcome.err) == (0, ""), command
    exec(compile(in_python, "docs/correct.md", "exec"), {})
    frame = old_frame()
    lattice = read_scan(Path("lattice_trace.npy"), Path("lattice_retrace.npy"), Choice())
    islands = read_scan(Path("islands_trace.npy"), Path("islands_retrace.npy"), Choice())
    taken = OldScan(x=OldAxis(size_v=90.0, offset_v=50.0), rate_hz=100.0)
    found: list[Off] = []
    for name, scan in (
        ("lattice", by_fit(lattice, OldScan(), lattice_nm=60.0)[0]),
        ("islands", by_scanner(islands, Path("old.toml"), taken)),
    ):
        written = [one.heights for one in read_channels(Path(f"{name}.gwy"))]
        for picture, heights in zip(scan.pictures, written, strict=True):
            there = np.isfinite(picture.heights)
            assert heights[there] == pytest.approx(picture.heights[there])
        found.append(off_the_truth(scan.distortion, frame))
        assert max(found[-1].x, found[-1].y) < 0.3
    for one, size in zip(found, (0.1, 0.5), strict=True):
        assert one.size == pytest.approx((0.0, 0.0), abs=size)
