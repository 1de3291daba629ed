"""Plans at an angle: the linear map, the integers against the drive that was learnt, and what is refused."""

import re
from math import cos, radians, sin
from pathlib import Path

import numpy as np
import pytest
from editing import SCANNER, edited
from hypothesis import given
from hypothesis import strategies as st
from turned_scans import OPERATORS, turned_setup, write_turned

from tablegen.base.input_errors import Rejected
from tablegen.certificate.turned_errors import certify_turned
from tablegen.config.load import load
from tablegen.fixedpoint.frame_program import RATIO_FRACTION_BITS, played_extremes
from tablegen.numerics.arrays import Floats, Ints
from tablegen.planning.line_plan import make_plan
from tablegen.planning.turned_plan import FrameGeometry, TurnedPlan, make_turned_plan

SHORT = ("timing.lines = 24", "x.band_limit.harmonics = 16")


def planned(folder: Path, angle_deg: float, *edits: str, size_nm: float = 300.0) -> TurnedPlan:
    """A short frame at an angle."""
    return make_turned_plan(turned_setup(folder, angle_deg, *SHORT, *edits, size_nm=size_nm))


def refused(folder: Path, angle_deg: float, *edits: str, size_nm: float = 300.0) -> list[str]:
    """The messages of a plan that is refused, without their folder."""
    with pytest.raises(Rejected) as rejected:
        planned(folder, angle_deg, *edits, size_nm=size_nm)
    return [str(problem).removeprefix(f"{folder}/") for problem in rejected.value.problems]


numbers = st.floats(-400.0, 400.0)
couplings = st.floats(-0.5, 0.5)


@given(st.floats(-360.0, 360.0), numbers, numbers, couplings, couplings, numbers, numbers)
def test_the_shares_are_the_inverse_of_the_coupling(
    angle_deg: float, fast_nm: float, slow_nm: float, x_per_y: float, y_per_x: float, drift_x: float, drift_y: float
) -> None:
    """The positions of axes that move by their shares are the two motions along and across the lines."""
    geometry = FrameGeometry(angle_deg, (fast_nm, slow_nm), x_per_y, y_per_x, (drift_x, drift_y), 0.5)
    shares = geometry.shares
    for fast, slow in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.3, -0.4)):
        x, y = (np.array(shares[axis][0] * fast + shares[axis][1] * slow) for axis in "xy")
        along, across = geometry.on_the_sample(x, y, np.array(0.5 * slow))
        assert abs(float(along) - fast_nm * fast) < 1e-6
        assert abs(float(across) - slow_nm * slow) < 1e-6


def test_the_angle_is_counterclockwise() -> None:
    geometry = FrameGeometry(30.0, (100.0, 50.0), 0.0, 0.0, (0.0, 0.0), 1.0)
    c, s = cos(radians(30.0)), sin(radians(30.0))
    assert np.allclose(geometry.shares["x"], (100.0 * c, -50.0 * s))
    assert np.allclose(geometry.shares["y"], (100.0 * s, 50.0 * c))


@pytest.mark.parametrize("angle_deg", [30.0, 90.0, 200.0])
def test_the_words_are_the_drive(angle_deg: float, tmp_path: Path) -> None:
    """At every 50th tick the sum of words is within 2 LSB of the drive in volts; the hold leads by half a tick."""
    plan = planned(tmp_path, angle_deg)
    for axis in plan.axes:
        ticks = np.arange(0, plan.schedule.ticks, 50)
        volts = axis.known.driver.volts(axis.drive.at(plan.schedule.lines, (ticks + 0.5) / plan.schedule.ticks))
        exact = (volts - axis.converter.v_zero) / axis.converter.v_per_code
        for line in range(plan.schedule.lines):
            sums = axis.program.sums(line)[ticks] / float(1 << axis.program.output.gain_q)
            assert np.max(np.abs(sums - exact[line])) < 2.0


def test_a_second_part_is_mixed_in(tmp_path: Path) -> None:
    """Words of the second table, times their ratios, are in LSB of the first one."""
    plan = planned(tmp_path, 30.0)
    program = plan.x.program
    assert np.max(np.abs(program.second)) == 127
    mixed = np.max(np.abs(program.ratios.words)) * 127 >> RATIO_FRACTION_BITS
    assert 5 < mixed < 1100


def test_the_certificate_is_straight(tmp_path: Path) -> None:
    certificate = certify_turned(planned(tmp_path, 30.0, "timing.lines = 40"))
    errors = certificate.errors
    assert errors.rms < 0.05
    assert max(abs(errors.fast_size), abs(errors.slow_size), abs(errors.shear)) < 0.1
    assert max(errors.code_lsb) < 2.0


def test_coupling_and_drift_are_undone(tmp_path: Path) -> None:
    """Positions on the sample are straight with 5 % of coupling and 100 nm/s; the axes themselves move otherwise."""
    path = write_turned(tmp_path, 0.0, *SHORT, "timing.lines = 40")
    scanner = tmp_path / "scanner.toml"
    scanner.write_text(scanner.read_text("utf-8") + "\n[coupling]\nx_per_y = 0.05\ny_per_x = -0.03\n", "utf-8")
    path.write_text("drift_nm_per_s = [100.0, -50.0]\n" + path.read_text("utf-8"), "utf-8")
    plan = make_turned_plan(load(path))
    (fast_x, slow_x), (fast_y, _) = plan.geometry.shares["x"], plan.geometry.shares["y"]
    assert fast_y == pytest.approx(0.03 * fast_x)
    assert slow_x == pytest.approx(-0.05 * plan.geometry.shares["y"][1] + 100.0 * plan.geometry.rise_s)
    errors = certify_turned(plan).errors
    assert max(errors.rms, abs(errors.fast_size), abs(errors.slow_size), abs(errors.shear)) < 0.1


def test_an_axis_without_an_operator_is_refused(tmp_path: Path) -> None:
    write_turned(tmp_path, 30.0)
    without = [edit for edit in OPERATORS if not edit.startswith("y.hysteresis")]
    (tmp_path / "scanner.toml").write_text(edited(SCANNER, *without), "utf-8")
    with pytest.raises(Rejected, match=r"y\.hysteresis: is no operator; `calibrate operator --axis y` makes one"):
        make_turned_plan(load(tmp_path / "scan.toml"))


@pytest.mark.parametrize(
    ("edits", "says"),
    [
        (("y.motion = 'step'",), "y.motion: a scan at an angle moves y on every tick; leave this out"),
        (("timing.frame = 'up-down'", "- y.turn", "- y.band_limit.directions", "drift_nm_per_s = [1.0, 0.0]"),
         "drift_nm_per_s: is followed in frames that go up alone; take timing.frame = 'flyback'"),
    ],
)  # fmt: skip
def test_what_a_turned_scan_has_not_is_refused(edits: tuple[str, ...], says: str, tmp_path: Path) -> None:
    (message,) = refused(tmp_path, 30.0, *edits)
    assert re.sub(r"^scan\.toml:\d+: ", "", message) == says


def test_shaped_codes_leave_less_of_the_rounding_where_the_piezo_follows(tmp_path: Path) -> None:
    """A twentieth of what rounded codes leave below 1/50 of the update rate, by the second order, of 12 bits."""
    plan = planned(tmp_path, 30.0, "dac.bits = 12", "dac.shaping = 'second'")
    for axis in plan.axes:
        program, output = axis.program, axis.program.output
        assert output.shaping.order == 2
        exact = np.concatenate([program.sums(line) for line in range(program.lines)]) / 2.0**output.gain_q
        shaped = program.played(0, program.lines, output.begin())
        rounded = program.frame().ravel()

        def in_band(codes: Ints, exact: Floats = exact) -> float:
            spectrum = np.fft.rfft((codes - exact) * np.hanning(len(exact)))
            return float(np.linalg.norm(spectrum[: len(exact) // 50]))

        assert in_band(shaped) < 0.05 * in_band(rounded)
        least, most, steepest = played_extremes(program)
        assert least <= int(np.min(shaped))
        assert most >= int(np.max(shaped))
        assert steepest >= int(np.max(np.abs(np.diff(shaped))))
        assert output.max_step >= steepest


def test_what_leaves_the_range_says_what_fits(tmp_path: Path) -> None:
    """A smaller scan at this angle, and another angle for this size: both are tried, and fit."""
    low = ("x.offset_v = 22.0",)
    messages = refused(tmp_path, 45.0, *low, size_nm=400.0)
    pattern = r"scan\.toml:\d+: angle_deg: x leaves the range of the driver or the converter; a scan of about (\S+) nm"
    fits = re.match(pattern + r" would fit, or an angle of about (\S+) degrees", messages[0])
    assert fits, messages
    assert 200.0 < float(fits[1]) < 400.0
    planned(tmp_path, 45.0, *low, size_nm=0.97 * float(fits[1]))
    planned(tmp_path, float(fits[2]), *low, size_nm=0.95 * 400.0)


def test_a_slew_rate_that_is_too_low_says_which_rate_fits(tmp_path: Path) -> None:
    """That of y, which is slow at 0 degrees."""
    path = write_turned(tmp_path, 45.0, *SHORT, "- amplifier.max_slew_v_per_s")
    scanner = tmp_path / "scanner.toml"
    scanner.write_text(scanner.read_text("utf-8") + "\n[y.amplifier]\nmax_slew_v_per_s = 4600\n", "utf-8")
    with pytest.raises(Rejected) as rejected:
        make_turned_plan(load(path))
    message = str(rejected.value.problems[0])
    fits = re.search(r"timing\.line_rate_hz: at 45 degrees y steps by up to .* about (\S+) Hz would fit", message)
    assert fits, message
    path.write_text(edited(path.read_text("utf-8"), f"timing.line_rate_hz = {0.95 * float(fits[1])}"), "utf-8")
    make_turned_plan(load(path))


def test_the_slew_guard_does_not_act(tmp_path: Path) -> None:
    plan = planned(tmp_path, 30.0, "- amplifier.max_slew_v_per_s")
    for axis in plan.axes:
        least, most, steepest = axis.program.extremes
        output = axis.program.output
        assert output.code_min <= least < most <= output.code_max
        assert steepest * 2 == output.max_step
        codes = axis.program.unclamped(0, axis.program.lines).ravel()
        steps = np.abs(codes - np.roll(codes, 1))
        assert (least, most, steepest) == (np.min(codes), np.max(codes), np.max(steps))
        low, high, step = axis.program.bounds  # narrow enough to decide without the codes
        assert least - low + high - most < 0.02 * (most - least)
        assert steepest <= step < 1.05 * steepest + 3


def test_other_plans_refuse_what_mixes_motions(tmp_path: Path) -> None:
    with pytest.raises(Rejected, match=r"angle_deg: a scan at an angle, on coupled axes or with drift is for"):
        make_plan(turned_setup(tmp_path, 30.0))
    with pytest.raises(Rejected, match="drift_nm_per_s: a scan at an angle"):
        make_plan(turned_setup(tmp_path, 360.0, "drift_nm_per_s = [0.0, 1.0]"))
    setup = turned_setup(tmp_path, 0.0)
    assert not setup.mixes_motions
    assert make_plan(setup).name == setup.scan.name
