"""A driver of v_min..v_max: the laws in voltages from v_min on, and everything else in volts as they are.

The law that holds it all: a scanner whose driver, offsets and biases are moved by the same volts plays the same codes.
"""

import re
from math import sqrt
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from building import REMOVED, changed, to_toml
from editing import EXAMPLES, run
from hypothesis import given, settings
from hypothesis import strategies as st

from tablegen.base.input_errors import Rejected, Unphysical
from tablegen.compensation.offset import OffsetLaw
from tablegen.config.load import Setup, from_values, load
from tablegen.correction.settled_scan import AxisScan, ScannerModel, triangle
from tablegen.html_report.subject import PlannedScan
from tablegen.html_report.usable import largest_sizes
from tablegen.numerics.driver import Driver
from tablegen.planning.line_plan import make_plan
from tablegen.virtual.parameters import load_truth
from tablegen.virtual.scaling import scaled_to
from tablegen.virtual.scanner import VirtualScanner
from tablegen.virtual.simulation import AxisRun, run_line

SCAN, SCANNER = EXAMPLES / "annexin_200nm.toml", EXAMPLES / "scanner.toml"
TUBE = EXAMPLES / "tube_5um.toml"
SMALL = {"timing.lines": 20, "y.band_limit.harmonics": 16, "limits": REMOVED}
POINTS = [(0.0, 200.0), (30.0, 205.0), (60.0, 222.0), (95.0, 240.0)]
BY_OFFSET = [
    {"size_v": size, "beta": beta * (1.0 + 0.002 * at), "u_peak": 0.4, "offset_v": at}
    for at in (20.0, 50.0, 80.0)
    for size, beta in ((10.0, 0.01), (60.0, 0.05))
]


def moved(by: float, points: bool, offset_v: float = 62.0) -> Setup:
    """The example on a driver of -by..100 - by, all that is measured in volts from 0 moved with it."""
    scanner: dict[str, Any] = {"v_max": 100.0 - by, "v_min": -by}
    if points:
        scanner["x.offset"] = {"points": [{"offset_v": v - by, "apparent_nm": nm} for v, nm in POINTS]}
        branch = {"points": [{**one, "offset_v": one["offset_v"] - by} for one in BY_OFFSET]}
        scanner["x.hysteresis.branches"] = [{"turn": 0.5, "forward": branch, "backward": branch}]
    scan = {"amplifier.bias_v": 50.0 - by, "x.offset_v": offset_v - by, "y.offset_v": 45.0 - by, "x.park_v": 7.0 - by}
    return from_values(changed(SCAN, {**SMALL, **scan}), changed(SCANNER, scanner))


@settings(derandomize=True, deadline=None, max_examples=6)
@given(st.sampled_from((12.5, 50.0, 64.0, 99.0)), st.booleans())
def test_moving_all_voltages_moves_no_code(by: float, points: bool) -> None:
    one, other = make_plan(moved(0.0, points)), make_plan(moved(by, points))
    for before, after in zip(one.lines, other.lines, strict=True):
        assert after.drive.m == pytest.approx(before.drive.m, rel=1e-12)
        assert after.drive.forward.beta == pytest.approx(before.drive.forward.beta, rel=1e-12)
        assert after.drive.v_offset == pytest.approx(before.drive.v_offset - by, abs=1e-9)
        assert after.converter.v_zero == pytest.approx(before.converter.v_zero - by, abs=1e-9)
        assert after.program.output.gain_word == before.program.output.gain_word
        assert abs(after.program.output.offset_word - before.program.output.offset_word) <= 4
        for key in ("code_min", "code_max", "max_step", "park_code"):
            assert getattr(after.program.output, key) == getattr(before.program.output, key)
        assert np.max(np.abs(after.program.words - before.program.words)) <= 1


def test_a_tube_by_hand() -> None:
    """+-220 V at 0 V: the middle, where m is 1; everything from the equations, with 440 V for V_max."""
    plan = make_plan(load(TUBE))
    drive, y = plan.x.drive, plan.y
    alpha = 24.0 * 440.0 / (1.0 + 0.35 * 1000.0 / (24.0 * 440.0))  # (8)
    v = (sqrt(1.0 + 4.0 * 0.35 * 5000.0 / alpha) - 1.0) / (2.0 * 0.35)  # (9)
    assert (drive.p_offset, drive.m, drive.position_nm) == (0.0, 1.0, 0.0)
    assert drive.v_scan == pytest.approx(440.0 * v, rel=1e-12)
    x = plan.x.program.output
    volts = 22.0 * (-10.0 + 20.0 / 65536 * np.array([x.code_min, x.offset_code, x.code_max]))
    assert volts.tolist() == pytest.approx([-220.0, 0.0, 220.0 - 440.0 / 65536])
    codes = y.program.output
    volts = -22.5 * (-10.0 + 20.0 / 65536 * np.array([codes.code_max, codes.offset_code, codes.code_min])) + 1.5
    assert volts.tolist() == pytest.approx([-220.0, 0.0, 220.0], abs=450.0 / 65536)
    assert volts[0] >= -220.0
    assert volts[2] <= 220.0
    played = plan.x.codes(0, plan.x.program.ticks)
    assert abs(int(played.min()) + int(played.max()) - 65536) <= 200, "about 0 V"


@settings(derandomize=True, deadline=None, max_examples=20)
@given(st.floats(-0.3, 0.3), st.floats(-0.2, 0.3), st.floats(-220.0, 180.0))
def test_the_position_is_the_integral_from_0_v(alpha: float, beta: float, volts: float) -> None:
    law, driver = OffsetLaw(alpha, beta), Driver(180.0, -220.0)

    def slope(v: Any) -> Any:
        p = 2 * (v + 220) / mpmath.mpf(400) - 1
        return 24 / (1 + alpha * p + beta * p * p)

    position = law.position_nm(volts, driver, 24.0)
    assert position == pytest.approx(float(mpmath.quad(slope, [0, volts])), rel=1e-9, abs=1e-9)
    assert law.voltage_at(position, driver, 24.0) == pytest.approx(volts, abs=1e-9)


CASES = {
    "x.offset_v = -230": "x.offset_v: -230 V is outside the driver's -220..220 V, by 10 V",
    "x.offset_v = -150": "x.size_nm: the drive spans ",
    "x.park_v = 221": "x.park_v: 221 V is outside the driver's -220..220 V, by 1 V",
    "x.offset_nm = -6000": "x.offset_nm: -6000 nm is outside the -5198.82..5173.8 nm that -220..220 V reach",
    "x.size_v = 441": "x.size_v: 441 V is above v_max - v_min = 440 V",
}


@pytest.mark.parametrize("edit", CASES)
def test_what_leaves_the_driver_is_refused_in_its_volts(edit: str) -> None:
    key, value = edit.split(" = ")
    other = {"x.offset_nm": {"x.offset_v": REMOVED}, "x.size_v": {"x.size_nm": REMOVED}}.get(key, {})
    scan = changed(TUBE, {"timing.lines": 20, "y.band_limit.harmonics": 16, key: float(value), **other})
    with pytest.raises(Rejected) as refused:
        make_plan(from_values(scan, changed(EXAMPLES / "tube_scanner.toml", {})))
    (problem,) = refused.value.problems
    assert f"{problem.key}: {problem.why}".startswith(CASES[edit])


def test_the_offsets_and_sizes_that_a_refusal_names_fit() -> None:
    """-150 V does not carry 5 um: the nearest offset that is named does, and so does the size."""

    def outcome(**scan: float) -> str:
        values = changed(TUBE, {"timing.lines": 20, "y.band_limit.harmonics": 16, "limits": REMOVED})
        values["x"].update(scan)
        try:
            make_plan(from_values(values, changed(EXAMPLES / "tube_scanner.toml", {})))
        except Rejected as refused:
            return str(refused.problems[0].why)
        return ""

    said = outcome(offset_v=-150.0)
    found = re.search(
        r"an offset of (-[\d.]+) to ([\d.]+) V fits, or at this offset a line of about ([\d.e+]+) nm", said
    )
    assert found is not None, said
    low, high, size = map(float, found.groups())
    assert outcome(offset_v=low) == outcome(offset_v=high) == outcome(offset_v=-150.0, size_nm=size) == ""
    assert outcome(offset_v=low - 2.0) != ""
    assert outcome(offset_v=high + 2.0) != ""


def test_a_minimum_above_0_is_refused() -> None:
    with pytest.raises(Rejected, match="v_min: 10 is above 0"):
        from_values(changed(SCAN, {}), changed(SCANNER, {"v_min": 10.0}))
    with pytest.raises(Unphysical, match=r"outside the -\d+\.?\d*\.\.\d+\.?\d* nm that -20\.\.80 V reach"):
        OffsetLaw().voltage_at(-500.0, Driver(80.0, -20.0), 10.0)


def test_the_page_marks_the_same_usable_area() -> None:
    one, other = (PlannedScan(setup, make_plan(setup), {}) for setup in (moved(0.0, False), moved(50.0, False)))
    offsets, largest, _ = largest_sizes(one, one.plan.x)
    there, same, said = largest_sizes(other, other.plan.x)
    assert there == pytest.approx(offsets - 50.0, abs=1e-9)
    assert same == pytest.approx(largest, rel=0.02, abs=20.0)  # on a grid of sizes
    assert "-50..50 V" in said


def test_the_virtual_scanner_follows_from_v_min_on() -> None:
    """The built-in one in the range of the file: what moved volts move it by is the same."""

    def found(by: float) -> AxisRun:
        setup = moved(by, False)
        scanner, done = scaled_to(VirtualScanner.of(load_truth("default")), setup.scanner)
        assert f"scaled to {-by:g}..{100.0 - by:g} V" in done
        return run_line(make_plan(setup).x, scanner.x)

    one, other = found(25.0), found(50.0)
    assert np.max(np.abs(one.displacement_nm - other.displacement_nm)) < 0.02


def test_an_image_is_put_straight_alike() -> None:
    """What `tablegen correct` takes the axis to have done, by the laws, does not depend on where 0 V is."""

    def position(by: float) -> Any:
        setup = moved(by, points=True)
        model = ScannerModel(setup.scanner, setup.scanner_file, Path())
        return model.position("x", AxisScan(triangle(60.0, 55.0 - by, 0.5), 100.0, 0.5, (0.1, 0.9)))

    one, other = position(0.0), position(50.0)
    assert np.ptp(one) > 400.0
    assert np.max(np.abs((one - one.mean()) - (other - other.mean()))) < 1e-6 * np.ptp(one)
    setup, beyond = moved(50.0, points=False), AxisScan(triangle(60.0, -35.0, 0.5), 100.0, 0.5, (0.1, 0.9))
    with pytest.raises(Unphysical, match=r"x: -65 V is outside the driver's -50\.\.50 V, by 15 V"):
        ScannerModel(setup.scanner, setup.scanner_file, Path()).position("x", beyond)


@pytest.mark.common
def test_the_tubes_page_and_terminal_speak_of_its_range(tmp_path: Path) -> None:
    scan = changed(TUBE, {"timing.lines": 20, "y.band_limit.harmonics": 16, "limits": REMOVED})
    (tmp_path / "scan.toml").write_text(to_toml(scan), "utf-8")
    (tmp_path / "tube_scanner.toml").write_bytes((EXAMPLES / "tube_scanner.toml").read_bytes())
    shown = run("show", tmp_path / "scan.toml", "--all")
    assert shown.status == 0, shown.err
    assert "187.325 V   0.425739 of v_max - v_min, (9) (12)" in shown.out
    assert run("report", tmp_path / "scan.toml", "-o", tmp_path / "page.html").status == 0
    page = (tmp_path / "page.html").read_text("utf-8")
    assert "The driver&#39;s -220..220 V bound it." in page or "The driver's -220..220 V bound it." in page
    for key, value in (("v_min", "-220 V"), ("dac.coding", "twos-complement"), ("y.amplifier.gain", "-22.5")):
        assert f">{key}<" in page, key
        assert value in page
