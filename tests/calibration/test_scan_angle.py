"""Scan angles: which axis was fast, and what each command is told of it."""

import numpy as np
import pytest

from tablegen.base.data_files import Source
from tablegen.base.input_errors import Rejected
from tablegen.images.files import ScanImage
from tablegen.images.scan_angle import (
    angle_remarks,
    fast_axis,
    is_turned,
    require_fast_axis,
    running_scan_remarks,
)


def image(angle_deg: float | None) -> ScanImage:
    return ScanImage("folder/a.ibw", Source("a.ibw", "0"), np.eye(4), angle_deg=angle_deg)


@pytest.mark.parametrize(
    ("angle", "axis"),
    [
        *((0.0, "x"), (90.0, "y"), (-90.0, "y"), (270.0, "y"), (180.0, "x"), (-180.0, "x"), (360.0, "x")),
        *((0.9, "x"), (-0.9, "x"), (89.1, "y"), (-90.9, "y"), (1.5, None), (45.0, None), (88.0, None)),
    ],
)
def test_the_fast_axis_of_an_angle(angle: float, axis: str | None) -> None:
    assert fast_axis(angle) == axis


def test_an_angle_that_is_not_stated_is_none_and_a_whole_turn_is_0() -> None:
    assert [is_turned(image(angle)) for angle in (None, 0.0, 360.0, -0.01, 0.1, 90.0)] == [False] * 4 + [True] * 2


@pytest.mark.parametrize(
    ("angle", "axis", "accepted"),
    [
        *((None, "x", True), (None, "y", True), (0.0, "x", True), (0.0, "y", True)),
        *((90.0, "y", True), (-90.0, "y", True), (90.0, "x", False), (180.0, "x", False), (30.0, "x", False)),
    ],
)
def test_which_angles_are_refused(angle: float | None, axis: str, accepted: bool) -> None:
    if accepted:
        require_fast_axis([image(angle)], axis)
        return
    with pytest.raises(Rejected, match="scan angle"):
        require_fast_axis([image(0.0), image(angle)], axis)


@pytest.mark.parametrize(
    ("angle", "axis", "weights"),
    [
        *((None, "x", []), (None, "y", []), (0.0, "x", []), (0.0, "y", ["spoils"])),
        *((90.0, "y", ["note"]), (90.0, "x", ["spoils"]), (180.0, "x", ["spoils"]), (30.0, "y", ["spoils"])),
    ],
)
def test_what_a_calibration_is_told(angle: float | None, axis: str, weights: list[str]) -> None:
    """Once a file, and nothing of what is no image."""
    assert [text.weight for text in angle_remarks([object(), image(angle), image(angle)], axis)] == weights


def test_a_running_scan_has_its_lines_along_x() -> None:
    assert not running_scan_remarks([image(None), image(0.0)])
    (remark,) = running_scan_remarks([image(90.0), image(90.0)])
    assert remark.startswith("a.ibw: scan angle 90 degrees: the fast axis was y; the lines of a scan file are along x")
