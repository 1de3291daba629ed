"""A build whose slow axis turns back within the drive of its window: few lines, a flyback of less than one of them."""

import json
from pathlib import Path

import pytest
from editing import SCAN, SCANNER, edited, run, write_pair
from turned_scans import EDITS, OPERATORS, SIMPLE, operator_bytes
from verifying import edit_manifest


@pytest.mark.common
def test_an_error_of_a_triangle_that_nobody_can_know_is_not_stated(tmp_path: Path) -> None:
    """Where the line does not rise, a drive has more than one place; the build is right, and is verified."""
    for axis in "xy":
        (tmp_path / f"operator_{axis}.toml").write_bytes(operator_bytes(SIMPLE, axis))
    scan = write_pair(tmp_path, edited(SCAN, *EDITS, "timing.lines = 16"), edited(SCANNER, *OPERATORS))
    folder = tmp_path / "build"
    assert "forward                -  " in run("build", scan, "-o", folder, "-f", "c").out
    verified = run("verify", folder)
    assert (verified.status, "its certificate" in verified.out) == (0, True), verified.out
    assert run("show", scan).status == 0

    sides = json.loads((folder / "manifest.json").read_bytes())["axes"]["y"]["certificate"]["scaling_error_percent"]
    assert "uncompensated" not in sides["forward"]
    path = ("axes", "y", "certificate", "scaling_error_percent", "forward", "uncompensated")
    edit_manifest(folder, *path, value=182.403)
    tampered = run("verify", folder)
    assert tampered.status == 5
    assert "axes.y.certificate.scaling_error_percent.forward has uncompensated" in tampered.out + tampered.err
