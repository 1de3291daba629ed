"""Frames of the virtual scanner: of a running build, and of triangles; each pixel where the axes truly were."""

import msgspec
import numpy as np
import pytest
from refining import scanner, setup_of
from replacing import replace

from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import Plan, make_plan
from tablegen.virtual.imaging import (
    Conditions,
    FrameImages,
    grating,
    hexagonal,
    image_pair,
    running_frame,
    triangle_frame,
)
from tablegen.virtual.simulation import run_line

CLEAN = Conditions(noise=0.0)
LINES = 100


class Linear:
    """An axis that follows its drive, 10 nm a volt."""

    def settled(self, volts: Floats, tick_s: float) -> Floats:
        assert tick_s > 0.0
        return 10.0 * volts


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(setup_of(f"timing.lines = {LINES}", "timing.pixels = 64"))


def plane(x: Floats, y: Floats) -> Floats:
    return x + 0.0 * y


def frame(plan: Plan, conditions: Conditions = CLEAN) -> FrameImages:
    return running_frame(plan, scanner().x, scanner().y, plane, conditions)


@pytest.mark.common
def test_pixels_are_where_the_played_line_has_the_scanner(plan: Plan) -> None:
    """Columns evenly in time in the window of each sweep, rows the imaged lines of y's way up, by another way."""
    found = frame(plan)
    up = plan.schedule.up
    assert found.trace.heights.shape == (up.count, 64)
    assert up.count == pytest.approx(0.9 * 0.95 * LINES, abs=1.0)
    run = run_line(plan.x, scanner().x)
    place = 0.1 + 0.8 * (np.arange(64) + 0.5) / 64
    moved = np.append(run.displacement_nm, run.displacement_nm[0])
    turns = np.append(run.drive.turns, 1.0 + run.drive.turns[0])
    for sweep, times in ((found.trace, 0.5 * place), (found.retrace, 1.0 - 0.5 * place)):
        assert sweep.x_nm[0] == pytest.approx(np.interp(times, turns, moved), rel=1e-9)
        assert np.array_equal(sweep.heights, sweep.x_nm)
        assert np.all(sweep.x_nm[:, -1] > sweep.x_nm[:, 0] + 100.0)  # left on the left
    slow = run_line(plan.y, scanner().y)
    middle = (up.first + np.arange(up.count) + 0.5 * place[0]) / LINES
    expected = np.interp(middle, slow.drive.turns, slow.displacement_nm)
    assert found.trace.y_nm[:, 0] == pytest.approx(expected, abs=2e-4 * float(np.ptp(expected)))


def test_late_pixels_show_earlier_places(plan: Plan) -> None:
    """One pixel late, each sweep is one column behind on its way."""
    now, late = frame(plan), frame(plan, Conditions(noise=0.0, late=1.0))
    assert late.trace.heights[:, 1:] == pytest.approx(now.trace.heights[:, :-1], rel=1e-9)
    assert late.retrace.heights[:, :-1] == pytest.approx(now.retrace.heights[:, 1:], rel=1e-9)


def test_noise_drift_and_tilt_are_as_asked(plan: Plan) -> None:
    drifted = frame(plan, Conditions(noise=0.0, drift=(0.02, 0.03))).trace
    assert np.array_equal(drifted.heights, drifted.x_nm + drifted.drift_nm[0])
    assert drifted.drift_nm[0][-1, -1] == pytest.approx(0.02 * np.ptp(drifted.x_nm), rel=0.03)
    assert drifted.drift_nm[1][-1, -1] == pytest.approx(0.03 * np.ptp(drifted.y_nm), rel=0.03)
    assert drifted.drift_nm[0][0, 0] == pytest.approx(0.0, abs=1e-4 * float(np.ptp(drifted.x_nm)))
    following = frame(plan, Conditions(noise=0.0, drift=(0.02, 0.03), frame=1)).trace
    frames = LINES / plan.schedule.up.count  # a frame in units of what it shows
    expected = (
        0.03 * np.ptp(following.y_nm) * (np.sqrt(drifted.drift_nm[1] / (0.03 * np.ptp(drifted.y_nm))) + frames) ** 2
    )
    assert following.drift_nm[1] == pytest.approx(expected, rel=1e-9)
    clean = frame(plan).trace.heights
    noise = frame(plan, Conditions(noise=0.05, seed=4)).trace.heights - clean
    assert np.std(noise) == pytest.approx(0.05 * np.ptp(clean), rel=0.03)
    tilted = frame(plan, Conditions(noise=0.0, tilt=(0.5, -2.0))).trace.heights - clean
    assert tilted[0, -1] - tilted[0, 0] == pytest.approx(0.5 * np.ptp(clean), rel=0.03)
    assert tilted[-1, 0] - tilted[0, 0] == pytest.approx(-2.0 * np.ptp(clean), rel=0.03)
    again = frame(plan, Conditions(noise=0.05, seed=4)).trace.heights - clean
    assert np.array_equal(again, noise)


def test_a_frame_downwards_has_the_lines_of_the_way_down() -> None:
    setup = setup_of(f"timing.lines = {LINES}", "y.turn = 0.5", 'y.band_limit.directions = "both"')
    y = msgspec.structs.replace(setup.scanner.y, hysteresis=setup.scanner.x.hysteresis)  # calibrated at this turn
    both = make_plan(replace(setup, scanner=msgspec.structs.replace(setup.scanner, y=y)))
    up, down = (running_frame(both, Linear(), Linear(), plane, CLEAN, 48, down=way) for way in (False, True))
    assert down.trace.heights.shape == (both.schedule.down.count, 48)
    assert np.all(np.diff(up.trace.y_nm[:, 0]) > 0.0)
    assert np.all(np.diff(down.trace.y_nm[:, 0]) < 0.0)
    with pytest.raises(ValueError, match="way down"):
        running_frame(make_plan(setup_of(f"timing.lines = {LINES}")), Linear(), Linear(), plane, CLEAN, down=True)


@pytest.mark.parametrize("plant", ["default", "duhem"])
def test_a_triangle_frame_is_the_image_pair_of_its_axis(plant: str) -> None:
    """Along x the same as ``image_pair``; y is another axis, with hysteresis of its own."""
    x, y = scanner(plant).x, scanner(plant).y
    stripes = grating(50.0, angle_deg=0.0)  # does not see y
    trace, retrace = image_pair(x, stripes, 60.0, 50.0, 1.0, pixels=64, lines=40, noise=0.0)
    found = triangle_frame(x, y, stripes, (60.0, 40.0), (50.0, 45.0), 1.0, CLEAN, pixels=64, lines=40)
    assert found.trace.heights == pytest.approx(trace, abs=1e-9)
    assert found.retrace.heights == pytest.approx(retrace, abs=1e-9)
    rows = found.trace.y_nm[:, 0]
    straight = np.polyval(np.polyfit(np.arange(40), rows, 1), np.arange(40))
    bent = float(np.max(np.abs(rows - straight)) / np.ptp(rows))
    assert 0.005 < bent < 0.06  # the bend of uncompensated hysteresis


def test_the_lattice_is_seen_where_the_scanner_was(plan: Plan) -> None:
    lattice = hexagonal(20.0)
    found = running_frame(plan, scanner().x, scanner().y, lattice, Conditions(noise=0.0, drift=(0.01, 0.01))).retrace
    assert np.array_equal(found.heights, lattice(found.x_nm + found.drift_nm[0], found.y_nm + found.drift_nm[1]))


def test_the_example_at_its_own_rate_can_be_imaged() -> None:
    """The example as it is shipped, 400 lines a second and 200 lines."""
    found = running_frame(
        make_plan(setup_of("timing.line_rate_hz = 400.0", "timing.lines = 200")), scanner().x, scanner().y, plane
    )
    assert found.trace.heights.shape == (170, 200)  # whole lines in 9.5..180.5
