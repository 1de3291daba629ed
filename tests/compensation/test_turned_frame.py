"""The drive of a frame at an angle: in closed form without hysteresis, on the operator; separate corrections."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from operator_files import operator_file

from tablegen.base.input_errors import Unphysical
from tablegen.compensation.dynamics import SecondOrder
from tablegen.compensation.operator.file import operator_text, read_operator
from tablegen.compensation.operator.in_time import OperatorInTime
from tablegen.compensation.operator.operator import Operator
from tablegen.compensation.operator.turned_frame import FrameDrive, FrameMotion, learn_frame
from tablegen.numerics.arrays import Floats
from tablegen.waveform.series import FourierSeries

KNOTS = 16
COUNT = 256  # samples of a line


@cache
def operator(*weights: float) -> Operator:
    """Plays of these weights over a bent line."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "operator.toml"
        path.write_text(operator_text(operator_file(weights=weights or (12.0, 3.0, 5.0)), []), "utf-8")
        return read_operator(path, "operator.toml")[0]


def motion(
    fast_nm: float = 200.0, slow_nm: float = -120.0, lines: int = 40, turn: float = 0.5, centre: float = 0.5
) -> FrameMotion:
    """A frame of which the lines between 10 and 90 % of the way up are imaged."""
    x = (np.arange(lines) + 0.5) / lines / 0.9
    return FrameMotion(
        fast_nm=fast_nm,
        slow_nm=slow_nm,
        fast_turn=turn,
        fast_window=(0.1, 0.9),
        both=True,
        slow_turn=0.9,
        imaged=(x > 0.1) & (x < 0.9),
        line_rate_hz=100.0,
        harmonics=24,
        slow_harmonics=12,
        centre=centre,
    )


def unchanged(series: FourierSeries) -> FourierSeries:
    """No dynamics."""
    return series


def position(axis: OperatorInTime, of: FrameMotion, drive: FrameDrive) -> Floats:
    """What the axis does with a drive that repeats, shape (lines, COUNT)."""
    u = drive.on_grid(of.lines, COUNT).ravel()
    time_s = np.arange(len(u) + 1) / (COUNT * of.line_rate_hz)
    return axis.position(time_s, np.append(u, u[0]))[:-1].reshape(of.lines, COUNT)


def affine(of: FrameMotion, nm: Floats) -> tuple[float, float, float]:
    """The nm along the line and along the frame, and the rms about them, of the imaged samples."""
    t = np.arange(COUNT) / COUNT
    at = np.ix_(np.flatnonzero(of.imaged), np.flatnonzero(of.inside(t)))
    phase = (np.arange(of.lines)[:, None] + t) / of.lines
    fast, slow = np.broadcast_to(of.fast(t), nm.shape)[at].ravel(), of.slow(phase)[at].ravel()
    design = np.stack([np.ones(fast.size), fast, slow], axis=1)
    found, *_ = np.linalg.lstsq(design, nm[at].ravel(), rcond=None)
    return float(found[1]), float(found[2]), float(np.std(nm[at].ravel() - design @ found))


@settings(max_examples=5, deadline=None)
@given(
    st.floats(-300.0, 300.0).filter(lambda nm: abs(nm) > 20.0),
    st.floats(-300.0, 300.0),
    st.sampled_from([0.4, 0.5, 0.6]),
)
def test_the_operator_follows_both_motions(fast_nm: float, slow_nm: float, turn: float) -> None:
    of, axis = motion(fast_nm, slow_nm, turn=turn), OperatorInTime(operator())
    drive = learn_frame(axis, of, unchanged, KNOTS)
    along, across, rms = affine(of, position(axis, of, drive))
    assert abs(along - fast_nm) < 2e-3 * of.longest_nm
    assert abs(across - slow_nm) < 2e-3 * of.longest_nm
    assert rms < 1e-3 * of.longest_nm
    assert drive.distance_percent < 0.1


def test_without_hysteresis_the_drive_is_the_inverse_of_the_curve() -> None:
    """In closed form: 700 u + 60 u^2 of the drive, times the sensitivity at its mean, are both motions."""
    of, axis = motion(), OperatorInTime(operator(0.0, 0.0, 0.0))
    drive = learn_frame(axis, of, unchanged, KNOTS)
    u = drive.on_grid(of.lines, COUNT)
    nm = (700.0 * u + 60.0 * u * u) * axis.operator.sensitivity(float(np.mean(u)), 1.0)
    along, across, rms = affine(of, nm)
    assert abs(along - 200.0) < 0.1
    assert abs(across + 120.0) < 0.1
    assert rms < 0.05


def test_a_frame_without_a_fast_motion_is_its_slow_part() -> None:
    of, axis = motion(fast_nm=0.0), OperatorInTime(operator())
    drive = learn_frame(axis, of, unchanged, KNOTS)
    assert not np.any(drive.fast.a)
    assert not np.any(drive.second.b)
    assert set(drive.gains.tolist()) == {1.0}
    _, across, rms = affine(of, position(axis, of, drive))
    assert abs(across + 120.0) < 0.3
    assert rms < 0.2


def test_separate_corrections_leave_the_slow_motion_too_large() -> None:
    """The negative control: the slow part of a frame without a fast motion, and the fast part without a slow one."""
    axis = OperatorInTime(operator())
    both, slow, fast = motion(), motion(fast_nm=0.0), motion(slow_nm=0.0)
    one, other = (learn_frame(axis, each, unchanged, KNOTS) for each in (slow, fast))
    summed = replace(other, slow=one.slow)
    _, across, _ = affine(both, position(axis, both, summed))
    assert across / -120.0 > 1.05


@pytest.mark.common
def test_a_long_frame_begins_with_fewer_lines() -> None:
    """Its start is learnt on every fourth line; the result is as straight as that of a short frame."""
    of, axis = motion(lines=120), OperatorInTime(operator())
    drive = learn_frame(axis, of, unchanged, KNOTS)
    along, across, rms = affine(of, position(axis, of, drive))
    assert max(abs(along - 200.0), abs(across + 120.0), rms) < 0.2


def test_the_parts_are_multiples_of_2_to_the_minus_30() -> None:
    """So that the last bits of a processor do not reach the words."""
    drive = learn_frame(OperatorInTime(operator()), motion(lines=24), unchanged, KNOTS)
    for values in (drive.slow.a, drive.fast.a, drive.fast.b, drive.second.b, drive.gains, drive.ratios):
        scaled = values * 2.0**30
        assert np.array_equal(scaled, np.rint(scaled))


def test_knots_are_periodic() -> None:
    drive = learn_frame(OperatorInTime(operator()), motion(lines=24), unchanged, 7)
    assert drive.spacing == 4
    assert len(drive.gains) == 7
    assert drive.gains[0] == drive.gains[-1]
    assert drive.ratios[0] == drive.ratios[-1]


def test_a_frame_beyond_the_driver_is_refused() -> None:
    with pytest.raises(Unphysical, match=r"the frame takes -?\d+\.?\d* to \d+\.?\d* % of the driver's range"):
        learn_frame(OperatorInTime(operator()), motion(900.0, 600.0), unchanged, KNOTS)


@pytest.mark.parametrize(
    ("frequency_hz", "quality", "says"),
    [
        (900.0, 8.0, "grows from round to round on the operator; a lower line rate may help"),
        (2500.0, 2.0, r"did not settle on the operator: .* % are left after \d+ rounds"),
    ],
)
def test_a_drive_that_does_not_settle_is_refused(frequency_hz: float, quality: float, says: str) -> None:
    """Beside a resonance that nobody undoes the position lags."""
    axis, of = OperatorInTime(operator(), response=SecondOrder(frequency_hz, quality)), motion()
    with pytest.raises(Unphysical, match=says):
        learn_frame(axis, of, unchanged, KNOTS)


def test_a_resonance_is_undone_by_its_inverse() -> None:
    response, of = SecondOrder(40e3, 20.0, 2e-6), motion()

    def inverse(series: FourierSeries) -> FourierSeries:
        real, imaginary = response.inverse(np.arange(1.0, series.harmonics + 1.0) * of.line_rate_hz)
        return series.times(real, imaginary)

    axis = OperatorInTime(operator(), response=response)
    drive = learn_frame(axis, of, inverse, KNOTS)
    along, across, rms = affine(of, position(axis, of, drive))
    assert abs(along - 200.0) < 0.1
    assert abs(across + 120.0) < 0.1
    assert rms < 0.05


def test_a_frame_of_two_lines_is_learnt() -> None:
    of = replace(motion(lines=2), imaged=np.array([True, False]), slow_harmonics=1)
    drive = learn_frame(OperatorInTime(operator()), of, unchanged, KNOTS)
    assert drive.distance_percent < 1.0
    assert len(drive.gains) == 3
