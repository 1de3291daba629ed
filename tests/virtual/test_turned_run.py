"""Frames at an angle on scanners: what is wrong with the scanner or the integers has to show in the errors."""

from math import cos, radians, sin
from pathlib import Path

import msgspec
import numpy as np
import pytest
from turned_scans import turned_setup

import tablegen
from tablegen.certificate.turned_errors import certify_turned
from tablegen.config.load import Setup
from tablegen.config.scanner import Coupling
from tablegen.planning.turned_plan import TurnedPlan, make_turned_plan
from tablegen.virtual.imaging import Conditions, Surface
from tablegen.virtual.turned_run import (
    MEASURES,
    OwnFrameAxis,
    TurnedPlant,
    emitted_volts,
    frame_rows,
    own_plants,
    own_samples,
    play_frame,
)

SHORT = ("timing.lines = 16", "x.band_limit.harmonics = 12", "timing.line_rate_hz = 400")
ANGLE_DEG = 30.0


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    """A short frame at 30 degrees."""
    return turned_setup(tmp_path_factory.mktemp("turned"), ANGLE_DEG, *SHORT)


@pytest.fixture(scope="module")
def plan(setup: Setup) -> TurnedPlan:
    """Its plan."""
    return make_turned_plan(setup)


def on_itself(
    plan: TurnedPlan, coupling: Coupling | None = None, drift_nm_per_s: tuple[float, float] = (0.0, 0.0)
) -> dict[str, float]:
    """Errors on the operators of the plan, with a coupling and a drift of which the plan knows nothing."""
    x, y = (OwnFrameAxis(axis.piezo, axis.known.driver) for axis in plan.axes)
    plant = TurnedPlant(x, y, coupling or Coupling(), drift_nm_per_s)
    return dict(zip(MEASURES, play_frame(plan, emitted_volts(plan, own_samples(plan)), plant).errors, strict=True))


def test_the_operators_themselves_give_the_certificate(plan: TurnedPlan) -> None:
    """At other samples, and by another way from codes to drives."""
    errors, certified = on_itself(plan), certify_turned(plan).errors
    for name, bound in (("rms", 0.01), ("worst_line", 0.02), ("fast_size", 0.01), ("slow_size", 0.01), ("shear", 0.01)):
        assert abs(errors[name] - getattr(certified, name)) < bound
    assert abs(errors["rotation_deg"]) < 0.005


@pytest.mark.parametrize(("x_per_y", "y_per_x"), [(0.02, 0.02), (0.02, -0.02), (0.0, 0.03)])
def test_a_coupling_that_the_plan_does_not_know_shows(plan: TurnedPlan, x_per_y: float, y_per_x: float) -> None:
    """By the rotated matrix of the coupling: shear, sizes and angle of both motions."""
    before, after = on_itself(plan), on_itself(plan, Coupling(x_per_y=x_per_y, y_per_x=y_per_x))
    s, c = sin(radians(ANGLE_DEG)), cos(radians(ANGLE_DEG))
    turn = np.array([[c, s], [-s, c]])
    (ff, fs), (sf, ss) = turn @ np.array([[1.0, x_per_y], [y_per_x, 1.0]]) @ turn.T
    expected = {
        "shear": 100.0 * (sf / ff + fs / ss),
        "fast_size": 100.0 * (np.hypot(ff, sf) - 1.0),
        "slow_size": 100.0 * (np.hypot(fs, ss) - 1.0),
    }
    for name, value in expected.items():
        assert after[name] - before[name] == pytest.approx(value, abs=0.02)
    assert after["rotation_deg"] - before["rotation_deg"] == pytest.approx(np.degrees(np.arctan2(sf, ff)), abs=0.005)
    assert after["rms"] == pytest.approx(before["rms"], rel=0.1)


def test_a_drift_that_the_plan_does_not_follow_shows_as_shear_and_size(plan: TurnedPlan) -> None:
    s, c = sin(radians(ANGLE_DEG)), cos(radians(ANGLE_DEG))
    rise_s, size_nm = plan.geometry.rise_s, plan.geometry.size_nm[1]
    v = 0.02 * size_nm / rise_s  # along the lines
    sheared = on_itself(plan, drift_nm_per_s=(c * v, s * v))
    assert sheared["shear"] == pytest.approx(-2.0, abs=0.05)
    shorter = on_itself(plan, drift_nm_per_s=(-s * v, c * v))
    assert shorter["slow_size"] == pytest.approx(-2.0, abs=0.05)


def test_a_slow_table_that_was_changed_shows(plan: TurnedPlan) -> None:
    """5 % more of the slow part of x alone, which has half of the slow motion: size and shear."""
    slow = plan.x.program.slow
    more = msgspec.structs.replace(slow, gain_word=round(1.05 * slow.gain_word))
    changed = msgspec.structs.replace(plan.x, program=msgspec.structs.replace(plan.x.program, slow=more))
    errors, before = on_itself(msgspec.structs.replace(plan, x=changed)), on_itself(plan)
    s, c = sin(radians(ANGLE_DEG)), cos(radians(ANGLE_DEG))
    assert errors["slow_size"] - before["slow_size"] == pytest.approx(5.0 * s * s, rel=0.25)
    assert errors["shear"] - before["shear"] == pytest.approx(-5.0 * s * c, rel=0.25)


def test_own_scanners_are_as_wrong_as_the_operators_say(setup: Setup, plan: TurnedPlan) -> None:
    plants = own_plants(setup, plan, 0)[:3]
    straight, built = frame_rows(setup, plan, plants, own_samples(plan))
    assert (straight.correction, built.correction) == ("uncompensated", "operator")
    assert len(built.errors) == 3
    assert len(set(built.errors)) == 3
    mean, worst = built.summary()["rms"]
    assert certify_turned(plan).errors.rms < mean <= worst < 0.3
    assert straight.summary()["rms"][0] > 10.0 * mean
    assert straight.summary()["slow_size"][0] > 10.0  # what straight lines leave of the slow part


def test_straight_lines_beyond_the_driver_have_a_reason(tmp_path: Path, plan: TurnedPlan) -> None:
    far = turned_setup(tmp_path, ANGLE_DEG, *SHORT)
    for k_nm_per_v, why in ((2.0, "x: 259.808 nm needs 1.27"), (3.0, "x: straight lines take -")):
        size = msgspec.structs.replace(far.scanner.x.size, k_nm_per_v=k_nm_per_v)
        scanner = msgspec.structs.replace(far.scanner, x=msgspec.structs.replace(far.scanner.x, size=size))
        weak = msgspec.structs.replace(far, scanner=scanner)
        straight, built = frame_rows(weak, plan, own_plants(weak, plan, 0)[:1], own_samples(plan))
        assert not straight.errors
        assert straight.rejected.startswith(why)
        assert built.errors


def test_the_laboratory_images_a_frame(setup: Setup, plan: TurnedPlan) -> None:
    """Pixels are where the axes are; the lines go in the direction of the angle."""

    def ramp(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.asarray(2.0 * x - y)

    surface: Surface = ramp
    laboratory = tablegen.Laboratory("default", setup.scanner)
    quiet = Conditions(noise=0.0)
    frame = laboratory.frame(plan, surface, 32, quiet)
    trace = frame.trace
    assert trace.heights.shape == (plan.schedule.up.count, 32)
    assert np.allclose(trace.heights, 2.0 * trace.x_nm - trace.y_nm)
    dx, dy = (float(np.mean(one[:, -1] - one[:, 0])) for one in (trace.x_nm, trace.y_nm))
    assert np.degrees(np.arctan2(dy, dx)) == pytest.approx(ANGLE_DEG, abs=2.0)
    late = laboratory.frame(plan, surface, 32, Conditions(noise=0.0, late=1.0)).trace
    assert np.allclose(late.x_nm[:, 1:], trace.x_nm[:, :-1], atol=0.05)
    assert np.max(np.abs(frame.retrace.x_nm - trace.x_nm)) < 0.1 * abs(dx)


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_operators_of_the_virtual_scanner_itself_are_far_better(setup: Setup, monkeypatch: pytest.MonkeyPatch) -> None:
    """The scanner file has those of another piezo; three traces instead of five, for time, leave more of the sizes."""
    monkeypatch.setattr("tablegen.virtual.operator_day.STROKES", (0.2, 0.45, 0.9))
    simulated = tablegen.simulate_turned(setup, "default", noise_percent=0.1)
    given, calibrated = (stage.rows[1].summary() for stage in simulated.stages)
    assert calibrated["rms"][1] < 0.3 * given["rms"][1]
    assert abs(calibrated["slow_size"][1]) < 0.5 * abs(given["slow_size"][1])
    assert abs(calibrated["shear"][1]) < 0.5 < abs(given["shear"][1])
    assert simulated.record["calibrated"]["corrections"]["operator"]["errors"]["rms"]["mean"] == calibrated["rms"][0]
    assert "lines and slow direction are" not in simulated.summary()
