"""Images of builds put straight by their scan file: the drive that was played, on the scanner as it is known now."""

from pathlib import Path

import numpy as np
import pytest
from correcting import LATTICE, LAWS, Off, axes, off, save_pair
from editing import SCAN, edited, run

from tablegen.base.input_errors import Unphysical
from tablegen.config.load import load
from tablegen.correction.by_scanner import by_scan_file
from tablegen.correction.old_scan import OldScan
from tablegen.correction.scan_images import Choice, read_scan
from tablegen.planning.line_plan import make_plan
from tablegen.virtual.imaging import Conditions, FrameImages, running_frame

EDITS = ("x.size_nm = 700", "y.size_nm = 700", "timing.pixels = 96", "timing.lines = 100", "timing.line_rate_hz = 100")
STRAIGHT = """name = "old"
v_max = 100.0
[x.size]
k_nm_per_v = 12.0
[y.size]
k_nm_per_v = 12.0
"""
X_AT_HALF, Y_AT_END = LAWS.split("[y.size]")
LATER = X_AT_HALF + "[y.size]" + Y_AT_END.replace("turn = 0.5", "turn = 0.95")


@pytest.fixture
def build(tmp_path: Path) -> Path:
    """A scan for a scanner that was taken for straight, and what is known of it since: ``later.toml``."""
    text = edited(SCAN, *EDITS, "y.band_limit.harmonics = 16", 'scanner = "scanner.toml"')
    (tmp_path / "scan.toml").write_text(text, "utf-8")
    (tmp_path / "scanner.toml").write_text(STRAIGHT, "utf-8")
    (tmp_path / "later.toml").write_text(
        LAWS.replace("turn = 0.5", "turn = 0.95", 2).replace("0.95", "0.5", 1), "utf-8"
    )
    return tmp_path


def frame_of(build: Path, down: bool = False) -> FrameImages:
    plan = make_plan(load(build / "scan.toml"))
    return running_frame(plan, *axes("paper"), LATTICE, Conditions(noise=0.0), down=down)


def corrected(build: Path, frame: FrameImages, scanner: str | None) -> Off:
    images = read_scan(*save_pair(frame, build), Choice())
    path = None if scanner is None else build / scanner
    return off(by_scan_file(images, build / "scan.toml", path, OldScan()).distortion, frame)


@pytest.mark.common
def test_a_build_for_a_straight_scanner_on_one_that_bends(build: Path) -> None:
    """Its own scanner file changes nothing that counts; what is known since puts it straight, rounded turns and all."""
    frame = frame_of(build)
    before, after = corrected(build, frame, None), corrected(build, frame, "later.toml")
    assert before.x > 3.0
    assert before.y > 2.0
    assert after.x < 0.05
    assert after.y < 0.05
    assert after.size == pytest.approx((0.0, 0.0), abs=0.1)


@pytest.mark.common
def test_the_command_takes_both_files_and_keeps_them(build: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    save_pair(frame_of(build), build)
    monkeypatch.chdir(build)
    images = ("trace.npy", "retrace.npy")
    outcome = run("correct", *images, "--scan", "scan.toml", "--scanner", "later.toml", "-o", "o.npy")
    assert (outcome.status, outcome.err) == (0, "")
    record = (build / "o.json").read_text("utf-8")
    assert '"file": "later.toml"' in record
    assert '"file": "scan.toml"' in record


@pytest.mark.common
def test_a_part_of_a_frame_is_refused(build: Path) -> None:
    frame = frame_of(build)
    paths = save_pair(frame, build)
    for path in paths:
        np.save(path, np.load(path)[:-3])
    with pytest.raises(Unphysical, match="give the frame"):
        by_scan_file(read_scan(*paths, Choice()), build / "scan.toml", None, OldScan())
