"""Errors of a frame at an angle from positions whose errors are known."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from turned_scans import turned_setup

from tablegen.certificate.turned_errors import frame_errors
from tablegen.numerics.arrays import Floats
from tablegen.planning.turned_plan import TurnedPlan, make_turned_plan

T = (np.arange(200) + 0.5) / 200


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> TurnedPlan:
    folder = tmp_path_factory.mktemp("turned")
    return make_turned_plan(turned_setup(Path(folder), 30.0, "timing.lines = 24", "x.band_limit.harmonics = 12"))


def positions(plan: TurnedPlan, along: float, across: float, shear: float, turned_deg: float) -> tuple[Floats, Floats]:
    """Positions of both axes, whose sizes are so much too large, with a shear and an error of the angle."""
    motion = plan.x.motion
    fast = np.broadcast_to(motion.fast(T) - 0.5, (motion.lines, len(T))) * 300.0 * (1.0 + along)
    slow = (motion.slow((np.arange(motion.lines)[:, None] + T) / motion.lines) - 0.5) * 300.0 * (1.0 + across)
    at = np.radians(30.0 + turned_deg)
    u, v = fast + shear * slow, slow
    return np.cos(at) * u - np.sin(at) * v + 17.0, np.sin(at) * u + np.cos(at) * v - 5.0


small = st.floats(-0.02, 0.02)


@settings(max_examples=30, deadline=None)
@given(small, small, small, st.floats(-1.0, 1.0))
def test_sizes_shear_and_angle_are_found(
    plan: TurnedPlan, along: float, across: float, shear: float, turned_deg: float
) -> None:
    errors = frame_errors(plan, *positions(plan, along, across, shear, turned_deg), T)
    assert errors["fast_size"] == pytest.approx(100.0 * along, abs=1e-6)
    assert errors["slow_size"] == pytest.approx(100.0 * ((1.0 + across) * np.hypot(1.0, shear) - 1.0), abs=1e-6)
    assert errors["shear"] == pytest.approx(100.0 * shear, abs=0.06)
    assert errors["rotation_deg"] == pytest.approx(turned_deg, abs=1e-6)
    assert errors["rms"] < 1e-6


def test_a_bow_along_the_line_is_residual_scaling_and_no_mismatch(plan: TurnedPlan) -> None:
    """A parabola of 1 % of the line: its rms about a straight line is 0.01 / sqrt(180) of (0.8)^2; slopes 2 x 0.8."""
    motion = plan.x.motion
    x = motion.fast(T)
    bow = 3.0 * (2.0 * x - 1.0) ** 2
    x_nm, y_nm = positions(plan, 0.0, 0.0, 0.0, 0.0)
    c, s = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    errors = frame_errors(plan, x_nm + c * bow, y_nm + s * bow, T)
    assert errors["rms"] == pytest.approx(100.0 * 4.0 * 0.01 * 0.64 / np.sqrt(180.0), rel=0.02)
    assert errors["scaling"] == pytest.approx(100.0 * 0.08 * (0.8 - 0.05), rel=0.03)
    assert errors["mismatch"] < 0.02


def test_a_lag_is_mismatch(plan: TurnedPlan) -> None:
    """0.3 nm too far on the way back."""
    x_nm, y_nm = positions(plan, 0.0, 0.0, 0.0, 0.0)
    back = 0.3 * (T > 0.5)
    c, s = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    errors = frame_errors(plan, x_nm + c * back, y_nm + s * back, T)
    assert errors["mismatch"] == pytest.approx(0.1, rel=0.02)


def test_one_bad_line_is_the_worst_line(plan: TurnedPlan) -> None:
    x_nm, y_nm = positions(plan, 0.0, 0.0, 0.0, 0.0)
    line = int(np.flatnonzero(plan.x.motion.imaged)[5])
    x_nm[line] += 3.0 * np.sin(40.0 * T)
    errors = frame_errors(plan, x_nm, y_nm, T)
    assert errors["worst_line"] > 0.5
    assert errors["rms"] < 0.3
