"""The output z beside steps of y and a sine of x: the plane at places that the scan alone states, and refusals."""

import re
from pathlib import Path

import numpy as np
import pytest
from replacing import replace
from tilted_scans import (
    NM_PER_V,
    OFFSET_V,
    SIZE_NM,
    SLOPE_X,
    SLOPE_Y,
    STEPS,
    UP_DOWN,
    fitted_plane,
    triangle,
    volts_of,
    wanted_y,
    write_sine,
    write_stepped,
    write_tilted,
)

from tablegen.base.input_errors import Rejected
from tablegen.certificate.tilt_text import tilt_rows
from tablegen.config.load import load
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import Plan, make_plan
from tablegen.planning.tilt import TiltedOutput
from tablegen.planning.turned_plan import make_turned_plan

LSB_NM = NM_PER_V * 100.0 / 65536.0
LOW, HIGH = 0.1, 0.9  # window of x in the example
FLAT, LONG = "z.slope_x = 0.0", "timing.lines = 200"


def planned(path: Path) -> tuple[Plan, TiltedOutput]:
    plan = make_plan(load(path), sines=True)
    assert plan.z is not None
    return plan, plan.z


def heights(z: TiltedOutput) -> Floats:
    """The heights in nm from the centre of the scan by the codes of a frame, shape (lines, ticks)."""
    return NM_PER_V * (volts_of(z.program.frame()) - OFFSET_V)


def imaged_lines(plan: Plan) -> list[int]:
    schedule = plan.schedule
    return [line for line in range(schedule.lines) if line in schedule.up or line in schedule.down]


@pytest.mark.common
@pytest.mark.parametrize(
    ("edits", "turn", "slope_x"),
    [
        ((), 0.95, SLOPE_X),
        ((FLAT,), 0.95, 0.0),
        (UP_DOWN, 0.5, SLOPE_X),
        ((*UP_DOWN, LONG), 0.5, SLOPE_X),
        ((*UP_DOWN, LONG, FLAT), 0.5, 0.0),
    ],
)
def test_z_has_the_level_of_each_line(edits: tuple[str, ...], turn: float, slope_x: float, tmp_path: Path) -> None:
    """At every imaged tick, upward and downward; beside the places of a ramp it is far off."""
    plan, z = planned(write_stepped(tmp_path, *edits))
    schedule, line = plan.schedule, np.array(imaged_lines(plan))[:, None]
    t = (np.arange(schedule.ticks) + 0.5) / schedule.ticks
    place = triangle(t, 0.5)
    inside = np.flatnonzero((place >= LOW) & (place <= HIGH))
    x_nm = SIZE_NM * (place[inside] - 0.5) + 0.0 * line
    y_nm = wanted_y((line + 0.5) / schedule.lines, turn) + 0.0 * x_nm
    z_nm = heights(z)[line, inside]
    error = np.abs(z_nm - slope_x * x_nm - SLOPE_Y * y_nm)
    assert np.max(error) < 1.5 * LSB_NM
    assert np.max(error) == pytest.approx(z.errors.error_nm, rel=1e-6)
    slopes = fitted_plane(x_nm, y_nm, z_nm)
    assert max(abs(slopes[0] - slope_x), abs(slopes[1] - SLOPE_Y)) * SIZE_NM < 0.2 * LSB_NM
    assert abs(slopes[2]) < 0.2 * LSB_NM
    step = abs(SLOPE_Y) * SIZE_NM / (turn * schedule.lines)
    ramp = wanted_y((line + t[inside]) / schedule.lines, turn)
    assert np.max(np.abs(z_nm - slope_x * x_nm - SLOPE_Y * ramp)) > 0.35 * step > 2.0 * LSB_NM


def test_z_steps_smoothly_while_nothing_is_imaged(tmp_path: Path) -> None:
    """A step takes what is not imaged around the start of a line, and no tick takes more than a 30th of it."""
    plan, z = planned(write_stepped(tmp_path, FLAT))
    first, step = plan.schedule.forward.first, abs(SLOPE_Y) * SIZE_NM / (0.95 * plan.schedule.lines)
    rows = heights(z)[imaged_lines(plan)]
    assert np.max(np.ptp(rows[:, first:-first], axis=1)) < 1.5 * LSB_NM
    assert np.ptp(rows[0]) > 0.4 * step > 30.0 * LSB_NM
    assert z.errors.codes.steepest <= np.ceil(step / 30.0 / LSB_NM)
    assert ("y", "the level of each line; between lines it moves within 9.92 % of a line") in tilt_rows(z)


def pixel_heights(plan: Plan, z: TiltedOutput) -> tuple[Floats, Floats, Floats]:
    """The lines and ticks of pixels, and the mean height over each, shape (lines, pixels of both sides)."""
    schedule, middles, means = plan.schedule, [], []
    rows = heights(z)[imaged_lines(plan)]
    for window, starts in zip((schedule.forward, schedule.backward), schedule.pixel_starts, strict=True):
        edges = np.append(starts, window.stop)
        middles += [0.5 * (edges[:-1] + edges[1:])]
        means += [np.add.reduceat(rows[:, : window.stop], starts, axis=1) / np.diff(edges)]
    return np.array(imaged_lines(plan)), np.concatenate(middles), np.concatenate(means, axis=1)


@pytest.mark.common
@pytest.mark.parametrize("steps", [False, True])
def test_z_is_on_the_plane_at_the_pixels_of_a_sine(steps: bool, tmp_path: Path) -> None:
    """Pixels are at equal steps of x, there and back; those of a straight line are far off."""
    edits = ("y.motion = 'step'", "- amplifier.max_slew_v_per_s") if steps else ()
    plan, z = planned(write_sine(tmp_path, *edits))
    schedule, pixels = plan.schedule, plan.schedule.pixels
    assert schedule.pixel_table is not None
    assert plan.program_of_z is not None
    assert plan.program_of_z.schedule == replace(schedule, pixel_table=None)
    line, middle, z_nm = pixel_heights(plan, z)
    grid = LOW + (HIGH - LOW) * (np.arange(pixels) + 0.5) / pixels
    x_nm = SIZE_NM * (np.concatenate([grid, grid[::-1]]) - 0.5) + 0.0 * line[:, None]
    within = 0.5 + 0.0 * middle if steps else middle / schedule.ticks
    y_nm = wanted_y((line[:, None] + within) / schedule.lines, 0.95) + 0.0 * x_nm
    assert plan.pixel_errors is not None
    rounded = 0.01 * max(plan.pixel_errors.worst.values()) * SIZE_NM * SLOPE_X  # to whole ticks, as the pixels of x are
    assert np.max(np.abs(z_nm - SLOPE_X * x_nm - SLOPE_Y * y_nm)) < LSB_NM + rounded
    slopes = fitted_plane(x_nm, y_nm, z_nm)
    assert max(abs(slopes[0] - SLOPE_X), abs(slopes[1] - SLOPE_Y)) * SIZE_NM < 0.5 * LSB_NM
    assert z.errors.error_nm < 1.5 * LSB_NM
    straight = SIZE_NM * (triangle(middle / schedule.ticks, 0.5) - 0.5)
    assert np.max(np.abs(z_nm - SLOPE_X * straight - SLOPE_Y * y_nm)) > 50.0 * LSB_NM
    assert tilt_rows(z)[1] == ("x", "the position that the operator predicts for the sine")


def test_axes_with_operators_keep_their_plan(tmp_path: Path) -> None:
    """Beside steps they play the tables that they have without z; an angle is refused as without z."""
    path = write_stepped(tmp_path)
    setup = load(path)
    assert not setup.mixes_motions
    assert load(write_tilted(tmp_path, 0.0)).mixes_motions
    assert load(write_tilted(tmp_path, 30.0, *STEPS)).mixes_motions
    assert not load(write_tilted(tmp_path, 0.0, "x.motion = 'sine'")).mixes_motions
    with_z, without = make_plan(setup), make_plan(replace(setup, scan=replace(setup.scan, z=None)))
    assert without.z is None
    assert with_z.z is not None
    for ours, others in zip(with_z.lines, without.lines, strict=True):
        assert np.array_equal(ours.program.words, others.program.words)
        assert ours.program.output == others.program.output


def test_a_build_does_not_choose_the_motion_of_axes_with_operators(tmp_path: Path) -> None:
    with pytest.raises(Rejected, match=r"x\.motion: a line with z is planned as one at an angle, and a sine is not"):
        make_turned_plan(load(write_tilted(tmp_path, 0.0, "x.motion = 'auto'")))


@pytest.mark.parametrize(
    ("edits", "says"),
    [
        (
            ("x.band_limit.window = [0.01, 0.9]",),
            "y.motion: z takes 0.0157 of a line on either side of a step of y, and the imaged parts leave 0.0048; "
            "narrow x.band_limit.window",
        ),
        (
            (LONG, *UP_DOWN[:2], "y.band_limit.window = [0.0, 1.0]"),
            "y.motion: z turns its steps round in 6 lines of a frame of 200, and y has 0 between its images",
        ),
        (("z.slope_y = -0.9",), "z.slope_y: the tilt leaves the 0..99.9985 V of z; the largest that fits here is"),
    ],
)
def test_steps_that_z_cannot_follow(edits: tuple[str, ...], says: str, tmp_path: Path) -> None:
    with pytest.raises(Rejected, match=re.escape(says)):
        planned(write_stepped(tmp_path, *edits))


def test_a_slew_rate_that_the_steps_exceed_says_what_fits(tmp_path: Path) -> None:
    """Slopes and a line rate; the slope of the message fits."""
    path = write_stepped(tmp_path, FLAT, "z.slope_y = -0.2")
    scanner = tmp_path / "scanner.toml"
    scanner.write_text(scanner.read_text("utf-8") + "[z.amplifier]\nmax_slew_v_per_s = 2000\n", "utf-8")
    with pytest.raises(Rejected) as rejected:
        planned(path)
    (problem,) = rejected.value.problems
    says = r"z steps by up to \d+ codes a tick, 2000 V/s allow 2; slope_y = (\S+) would fit, or lines at \S+ Hz"
    fits = re.fullmatch(says, problem.why)
    assert fits, problem
    path.write_text(path.read_text("utf-8").replace("slope_y = -0.2", f"slope_y = {fits[1]}"), "utf-8")
    assert planned(path)[1].errors.codes.steepest <= 2
