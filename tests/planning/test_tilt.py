"""The output z: the plane that its codes are on, by formulas of the tests, and what is refused."""

import re
from pathlib import Path

import numpy as np
import pytest
from building import REPOSITORY
from editing import edited
from replacing import replace
from tilted_scans import (
    LINES,
    NM_PER_V,
    OFFSET_V,
    SIZE_NM,
    SLOPE_X,
    SLOPE_Y,
    fitted_plane,
    volts_of,
    wanted_places,
    write_straight,
    write_tilted,
)

from tablegen.base.input_errors import Problems, Rejected
from tablegen.certificate.certified_scan import certify_scan
from tablegen.config.load import load
from tablegen.config.schema import TiltName
from tablegen.numerics.arrays import Floats, Ints
from tablegen.planning.line_plan import make_plan
from tablegen.planning.tilt import TiltedOutput
from tablegen.planning.turned_plan import FrameGeometry, make_turned_plan, plan_tilts

LSB_NM = NM_PER_V * 100.0 / 65536.0


def imaged(z: TiltedOutput) -> tuple[Ints, Ints, Floats]:
    """The imaged lines, shape (lines, 1); the ticks in the window, and the phases of their middles."""
    ticks = z.program.fast.phase.ticks
    t = (np.arange(ticks) + 0.5) / ticks
    inside = np.flatnonzero(z.motion.inside(t))
    return np.flatnonzero(z.motion.imaged)[:, None], inside, t[inside]


def heights(z: TiltedOutput, lines: Ints, ticks: Ints) -> Floats:
    """The heights in nm over that at 0 V by the codes of imaged ticks."""
    return NM_PER_V * volts_of(z.program.frame()[lines, ticks])


def planned(path: Path, name: TiltName = "z") -> TiltedOutput:
    """An output beside x and y of a scan alone, without what is learnt on x and y."""
    setup, problems = load(path), Problems()
    without = {"angle_deg": 0.0, "z": None, "aux": None}
    straight = make_plan(replace(setup, scan=replace(setup.scan, **without)))
    geometry = FrameGeometry.of(setup, straight.schedule, (straight.x.drive.size_nm, straight.y.drive.size_nm))
    tilts = plan_tilts(setup, straight.schedule, straight.x.series.harmonics, geometry, problems)
    problems.stop_if_any()
    return tilts[name]


def straight(path: Path, name: TiltName = "z") -> TiltedOutput:
    """An output beside x and y of a scan without an operator."""
    return {tilt.name: tilt for tilt in make_plan(load(path)).tilts}[name]


@pytest.mark.parametrize(("angle_deg", "operators"), [(0.0, True), (30.0, True), (0.0, False)])
def test_the_codes_are_on_the_plane(angle_deg: float, operators: bool, tmp_path: Path) -> None:
    """At every imaged tick within an LSB; the plane through them has the slopes, and swapped ones are far off."""
    z = planned(write_tilted(tmp_path, angle_deg)) if operators else straight(write_straight(tmp_path))
    assert z.program.lines == LINES
    lines, ticks, t = imaged(z)
    x_nm, y_nm = wanted_places(angle_deg, lines, t)
    z_nm = heights(z, lines, ticks)
    error = np.abs(z_nm - NM_PER_V * OFFSET_V - SLOPE_X * x_nm - SLOPE_Y * y_nm)
    assert np.max(error) < 1.5 * LSB_NM
    assert np.max(error) == pytest.approx(z.errors.error_nm, rel=1e-6)
    slope_x, slope_y, centre = fitted_plane(x_nm, y_nm, z_nm)
    assert max(abs(slope_x - SLOPE_X), abs(slope_y - SLOPE_Y)) * SIZE_NM < 0.2 * LSB_NM
    assert abs(centre - NM_PER_V * OFFSET_V) < 0.2 * LSB_NM
    swapped = np.abs(z_nm - NM_PER_V * OFFSET_V - SLOPE_Y * x_nm - SLOPE_X * y_nm)
    assert np.max(swapped) > 300.0 * LSB_NM


def test_z_follows_the_sample_and_not_the_axes() -> None:
    """Coupling and drift change what the axes do, and not the plane."""
    plain = FrameGeometry(30.0, (300.0, 200.0), 0.0, 0.0, (0.0, 0.0), 0.5)
    mixed = FrameGeometry(30.0, (300.0, 200.0), 0.05, -0.03, (10.0, -20.0), 0.5)
    assert plain.shares != mixed.shares
    assert plain.on_a_plane(0.02, -0.05) == mixed.on_a_plane(0.02, -0.05)


@pytest.mark.common
def test_a_window_off_the_middle_a_falling_piezo_and_a_level(tmp_path: Path) -> None:
    """Lines whose window has a mean of its own; a gain below 0, by another converter; slopes of 0 play the offset."""
    own = "+ [z]\nnm_per_v = -5.0\nv_max = 100.0\n[z.dac]\nbits = 18\ninverted = true"
    edits = ("x.band_limit.window = [0.1, 0.7]", "x.turn = 0.6", "timing.pixels = 40")
    z = planned(write_tilted(tmp_path, 0.0, *edits, scanner=(own,)))
    assert z.program.output.dac_bits == 18
    assert z.errors.error_nm < 2.0 * LSB_NM
    level = planned(write_tilted(tmp_path, 0.0, "z.slope_x = 0", "z.slope_y = 0"))
    assert np.max(np.abs(volts_of(level.program.frame()) - OFFSET_V)) < 1e-3


def refused(path: Path) -> str:
    """The one message of a scan that is refused, without its folder."""
    with pytest.raises(Rejected) as rejected:
        planned(path)
    (problem,) = rejected.value.problems
    return str(problem).removeprefix(f"{path.parent}/")


@pytest.mark.parametrize(
    ("edits", "scanner", "says"),
    [
        ((), (), r"scan\.toml:\d+: z: .*scanner\.toml has no \[z\]; give it nm_per_v and v_max"),
        (("z.offset_v = 130",), None, r"scan\.toml:\d+: z\.offset_v: 130 V is outside the 0\.\.99\.9985 V of z"),
        (("z.park_v = -1",), None, r"scan\.toml:\d+: z\.park_v: -1 V is outside"),
        (("z.slope_z = 0.1",), None, r"scan\.toml:\d+: z\.slope_z: unknown key; slope_"),
        (("z.offset = 1", "- z.offset_v"), None, r"scan\.toml:\d+: z\.offset: unknown key; did you mean offset_v"),
        (("- z.offset_v",), None, r"scan\.toml:\d+: z\.offset_v: missing; this key is required"),
        ((), ("+ [z]\nnm_per_v = 0\nv_max = 100",), r"scanner\.toml:\d+: z\.nm_per_v: 0 moves nothing"),
        ((), ("+ [z]\nnm_per_v = 5\nv_max = 100\n[z.dac]\nshaping = 'first'",),
         r"scanner\.toml:\d+: z\.dac\.shaping: the output z is not shaped"),
        ((), ("+ [z]\nnm_per_v = 5\nv_max = 100\n[z.dac]\nupdate_rate_hz = 1e6",),
         r"scanner\.toml:\d+: z\.dac\.update_rate_hz: 1000000 of z, and .* is 500000 of x"),
        ((), ("+ [z]\nnm_per_v = 5\nv_max = 100\n[z.amplifier]\ngain = 1.0\nbias_v = 500",),
         r"scanner\.toml:\d+: z\.v_max: the driver of z has 0\.\.100 V, and its converter reaches none of it"),
        ((), ("+ [z]\nnm_per_volt = 5\nv_max = 100",), r"scanner\.toml:\d+: z\.nm_per_volt: unknown key; did you mean"),
    ],
)  # fmt: skip
def test_a_wrong_key_is_named(
    edits: tuple[str, ...], scanner: tuple[str, ...] | None, says: str, tmp_path: Path
) -> None:
    path = write_tilted(tmp_path, 0.0, *edits, **({} if scanner is None else {"scanner": scanner}))
    assert re.match(says, refused(path))


@pytest.mark.common
def test_a_tilt_that_leaves_the_range_says_what_fits(tmp_path: Path) -> None:
    """The slopes of the message fit, and some more do not; the page shows this message."""
    path = write_tilted(tmp_path, 0.0, "z.slope_x = 0.5", "z.slope_y = -0.6")
    message = refused(path)
    assert message in (REPOSITORY / "docs" / "tilt.md").read_text("utf-8").replace("\n", " ")
    says = r"scan\.toml:\d+: z\.slope_y: the tilt leaves the 0\.\.99\.9985 V of z; the largest that fits here is "
    fits = re.match(says + r"slope_x = (\S+) and slope_y = (\S+)$", message)
    assert fits, message
    text = path.read_text("utf-8")
    for factor in (1.0, 1.01):
        slopes = (f"z.slope_{axis} = {factor * float(fits[at])}" for at, axis in ((1, "x"), (2, "y")))
        path.write_text(edited(text, *slopes), "utf-8")
        if factor == 1.0:
            assert planned(path).offset > 0.0
        else:
            assert re.match(says, refused(path))


@pytest.mark.common
def test_a_slew_rate_of_z_says_what_fits(tmp_path: Path) -> None:
    own = "+ [z]\nnm_per_v = 5.0\nv_max = 100.0\n[z.amplifier]\nmax_slew_v_per_s = 20000"
    path = write_tilted(tmp_path, 0.0, "z.slope_x = 0.5", "z.slope_y = 0", scanner=(own,))
    message = refused(path)
    fits = re.search(
        r"z\.slope_x: z steps by up to \d+ codes a tick, 20000 V/s allow 26; slope_x = (\S+) would", message
    )
    assert fits, message
    path.write_text(edited(path.read_text("utf-8"), f"z.slope_x = {fits[1]}"), "utf-8")
    assert planned(path).offset > 0.0


@pytest.mark.common
def test_z_of_a_line_scan_follows_x_alone(tmp_path: Path) -> None:
    """y rests in the wanted place 0, whatever its slope is."""
    tables = ("- y.size_nm", "- y.turn", "- [y.band_limit]", "- [y.table]", "y.motion = 'off'")
    z = straight(write_straight(tmp_path, *tables))
    lines, ticks, t = imaged(z)
    x_nm, _ = wanted_places(0.0, lines, t)
    assert np.max(np.abs(heights(z, lines, ticks) - NM_PER_V * OFFSET_V - SLOPE_X * x_nm)) < 1.5 * LSB_NM


@pytest.mark.parametrize(
    ("edits", "says"),
    [
        (("z.slope_y = -0.9",), "z.slope_y: the tilt leaves the 0..99.9985 V of z; the largest that fits here is"),
        (("angle_deg = 30.0",), "x.hysteresis: is no operator"),
    ],
)
def test_a_scan_without_an_operator_that_z_cannot_follow(edits: tuple[str, ...], says: str, tmp_path: Path) -> None:
    path = write_straight(tmp_path, *edits)
    setup = load(path)
    with pytest.raises(Rejected, match=re.escape(says)):
        make_turned_plan(setup) if setup.mixes_motions else make_plan(setup)


def test_a_limit_of_the_scan_file_holds_for_z(tmp_path: Path) -> None:
    """A steep tilt takes z further off than x and y are."""
    path = write_straight(tmp_path, "z.slope_x = 0.2", "+ [limits]\nmax_error_lsb = 0.9")
    (problem,) = certify_scan(load(path), remedies=False).broken
    assert re.match(r"z errs by up to \d\.\d+ LSB, above 0\.9", problem.why), problem


def test_a_plan_of_one_table_refuses_z(tmp_path: Path) -> None:
    with pytest.raises(Rejected, match=r"z: a scan with the output z whose axes have operators is for `check`"):
        make_plan(load(write_tilted(tmp_path, 0.0)))
