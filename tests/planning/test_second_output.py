"""The second output beside x and y: the plane that its codes are on, by formulas of the tests, and what is refused."""

import re
from pathlib import Path

import numpy as np
import pytest
from editing import edited
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from replacing import replace
from tilted_scans import (
    AUX_NM_PER_V,
    AUX_OF_SCANNER,
    AUX_OFFSET_V,
    AUX_X,
    AUX_Y,
    SIZE_NM,
    UP_DOWN,
    fitted_plane,
    triangle,
    volts_of,
    wanted_places,
    wanted_y,
    with_aux,
    write_sine,
    write_stepped,
    write_straight,
    write_tilted,
)

from tablegen.base.input_errors import Problems, Rejected
from tablegen.certificate.certified_scan import certify_scan
from tablegen.compensation.line import SineLine
from tablegen.config.load import Setup, load
from tablegen.device.beside import rests
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.numerics.arrays import Floats, Ints
from tablegen.planning.line_plan import Plan, make_plan
from tablegen.planning.tilt import TiltedOutput
from tablegen.planning.turned_plan import FrameGeometry, make_turned_plan, plan_tilts

LSB_NM = abs(AUX_NM_PER_V) * 100.0 / 65536.0


@pytest.fixture(scope="module")
def operators(tmp_path_factory: pytest.TempPathFactory) -> tuple[Setup, Plan]:
    """A scan on axes with operators, and its plan at 0 degrees without outputs beside x and y."""
    setup = load(with_aux(write_tilted(tmp_path_factory.mktemp("operators"), 0.0)))
    without = {"z": None, "aux": None}
    return setup, make_plan(replace(setup, scan=replace(setup.scan, **without)))


def outputs(setup: Setup, straight: Plan) -> dict[str, TiltedOutput]:
    """Both outputs of a scan alone, without what is learnt on x and y."""
    problems = Problems()
    sizes = straight.x.drive.size_nm, straight.y.drive.size_nm
    geometry = FrameGeometry.of(setup, straight.schedule, sizes)
    planned = plan_tilts(setup, straight.schedule, straight.x.series.harmonics, geometry, problems)
    problems.stop_if_any()
    return {str(name): tilt for name, tilt in planned.items()}


def imaged(tilt: TiltedOutput) -> tuple[Ints, Ints, Floats]:
    """The imaged lines, shape (lines, 1); the ticks in the window, and the phases of their middles."""
    ticks = tilt.program.fast.phase.ticks
    t = (np.arange(ticks) + 0.5) / ticks
    inside = np.flatnonzero(tilt.motion.inside(t))
    return np.flatnonzero(tilt.motion.imaged)[:, None], inside, t[inside]


def distances(program: FrameProgram, x_nm: Floats, y_nm: Floats, slopes: tuple[float, float], at: object) -> Floats:
    """The distances in LSB of codes at indices of a frame from a plane over places."""
    nm = AUX_NM_PER_V * (volts_of(program.frame()[at]) - AUX_OFFSET_V)  # type: ignore[index]
    return np.asarray(np.abs(nm - slopes[0] * x_nm - slopes[1] * y_nm) / LSB_NM)


SLOPES = st.builds(lambda size, sign: sign * size, st.floats(0.01, 0.05), st.sampled_from([-1.0, 1.0]))


@pytest.mark.common
@settings(max_examples=12, phases=[Phase.generate])
@given(slope_x=SLOPES, slope_y=SLOPES, angle_deg=st.floats(-180.0, 180.0))
def test_the_codes_are_on_the_plane_at_any_angle(
    operators: tuple[Setup, Plan], slope_x: float, slope_y: float, angle_deg: float
) -> None:
    """Within the bounds of z, at every imaged tick; and the plane through them has the slopes.

    Slopes are of a size at which codes change often: the rounding of a level has a mean of its own.
    """
    setup, straight = operators
    aux = replace(setup.scan.aux, slope_x=slope_x, slope_y=slope_y)
    both = outputs(replace(setup, scan=replace(setup.scan, angle_deg=angle_deg, aux=aux)), straight)
    tilt = both["aux"]
    lines, ticks, t = imaged(tilt)
    x_nm, y_nm = wanted_places(angle_deg, lines, t)
    error = distances(tilt.program, x_nm, y_nm, (slope_x, slope_y), (lines, ticks))
    assert np.max(error) < 1.5
    assert np.max(error) == pytest.approx(tilt.errors.error_lsb, rel=1e-5, abs=1e-7)
    nm = AUX_NM_PER_V * volts_of(tilt.program.frame()[lines, ticks])
    found = fitted_plane(x_nm, y_nm, nm)
    assert max(abs(found[0] - slope_x), abs(found[1] - slope_y)) * SIZE_NM < 0.2 * LSB_NM
    assert abs(found[2] - AUX_NM_PER_V * AUX_OFFSET_V) < 0.2 * LSB_NM


def test_codes_of_z_and_exchanged_slopes_are_not_on_the_plane(operators: tuple[Setup, Plan]) -> None:
    """The check of the property finds the program of z, the slopes of z, and slopes in the other order."""
    both = outputs(*operators)
    lines, ticks, t = imaged(both["aux"])
    at, places = (lines, ticks), wanted_places(0.0, lines, t)
    own = (AUX_X, AUX_Y)
    of_z = (both["z"].slope_x, both["z"].slope_y)
    assert np.max(distances(both["aux"].program, *places, own, at)) < 1.5
    for program, slopes in ((both["z"].program, own), (both["aux"].program, of_z), (both["aux"].program, own[::-1])):
        assert np.max(distances(program, *places, slopes, at)) > 300.0


@pytest.mark.common
@pytest.mark.parametrize("what", ["straight", "stepped", "up and down", "sine", "line scan"])
def test_the_second_output_follows_each_motion(what: str, tmp_path: Path) -> None:
    """Steps of y are levels of lines, a sine is followed where the operator predicts it, a resting y is the place 0."""
    resting = ("- y.size_nm", "- y.turn", "- [y.band_limit]", "- [y.table]", "y.motion = 'off'")
    writers = {
        "straight": lambda: write_straight(tmp_path),
        "stepped": lambda: write_stepped(tmp_path),
        "up and down": lambda: write_stepped(tmp_path, *UP_DOWN),
        "sine": lambda: write_sine(tmp_path),
        "line scan": lambda: write_straight(tmp_path, *resting),
    }
    plan = make_plan(load(with_aux(writers[what]())), sines=True)
    assert [tilt.name for tilt in plan.tilts] == ["z", "aux"]
    assert plan.program_of_z is not None
    assert plan.program_of_z.y is plan.tilts[1].program
    assert not rests(plan.program_of_z)
    tilt, schedule = plan.tilts[1], plan.schedule
    lines, ticks, t = imaged(tilt)
    x_nm = SIZE_NM * (triangle(t, 0.5) - 0.5) + 0.0 * lines
    if what == "sine":
        assert isinstance(plan.x.drive.shape, SineLine)
        place = plan.x.drive.shape.place.value(t)  # which tests of the sine compare with the piezo
        assert np.ptp(place) > 0.75
        x_nm = plan.x.drive.size_nm * (place - 0.5) + 0.0 * lines
    within = 0.5 if what in ("stepped", "up and down") else t
    y_nm = wanted_y((lines + within) / schedule.lines, 0.5 if schedule.down.count else 0.95)
    if what == "line scan":
        y_nm = 0.0 * x_nm
    error = distances(tilt.program, x_nm, y_nm + 0.0 * x_nm, (AUX_X, AUX_Y), (lines, ticks))
    assert np.max(error) < 1.5
    swapped = distances(tilt.program, x_nm, y_nm + 0.0 * x_nm, (AUX_Y, AUX_X), (lines, ticks))
    assert np.max(swapped) > 100.0


def test_both_outputs_of_a_scan_at_an_angle_are_planned(tmp_path: Path) -> None:
    """The second sequencer has both, and x and y are those without aux."""
    path = write_tilted(tmp_path, 30.0)
    without = make_turned_plan(load(path))
    plan = make_turned_plan(load(with_aux(path)))
    assert plan.program_of_z is not None
    assert without.program_of_z is not None
    assert rests(without.program_of_z)
    assert not rests(plan.program_of_z)
    for ours, theirs in ((plan.x, without.x), (plan.y, without.y), (plan.tilts[0], without.tilts[0])):
        assert np.array_equal(ours.program.frame(), theirs.program.frame())


def refused(path: Path) -> str:
    """The one message of a scan that is refused, without its folder."""
    with pytest.raises(Rejected) as rejected:
        make_plan(load(path))
    (problem,) = rejected.value.problems
    return str(problem).removeprefix(f"{path.parent}/")


OF_AUX = "+ [aux]\nnm_per_v = 5\nv_max = 100"


@pytest.mark.parametrize(
    ("edits", "scanner", "says"),
    [
        ((), (), r"scan\.toml:\d+: aux: .*scanner\.toml has no \[aux\]; give it nm_per_v and v_max of the piezo of"),
        (("aux.offset_v = 130",), None, r"scan\.toml:\d+: aux\.offset_v: 130 V is outside the 0\.\.99\.9985 V of aux"),
        (("aux.park_v = -1",), None, r"scan\.toml:\d+: aux\.park_v: -1 V is outside"),
        (("aux.slope_z = 0.1",), None, r"scan\.toml:\d+: aux\.slope_z: unknown key; slope_"),
        (("- aux.offset_v",), None, r"scan\.toml:\d+: aux\.offset_v: missing; this key is required"),
        ((), ("+ [aux]\nnm_per_v = 0\nv_max = 100",), r"scanner\.toml:\d+: aux\.nm_per_v: 0 moves nothing"),
        ((), ("+ [aux]\nv_max = 100",), r"scanner\.toml:\d+: aux\.nm_per_v: missing; this key is required"),
        ((), (f"{OF_AUX}\n[aux.dac]\nshaping = 'first'",),
         r"scanner\.toml:\d+: aux\.dac\.shaping: the output aux is not shaped"),
        ((), (f"{OF_AUX}\n[aux.dac]\nupdate_rate_hz = 1e6",),
         r"scanner\.toml:\d+: aux\.dac\.update_rate_hz: 1000000 of aux, and .* is 500000 of x; aux moves on"),
        ((), (f"{OF_AUX}\n[aux.dac]\nbits = 18",),
         r"scanner\.toml:\d+: aux\.dac\.bits: 18 of aux, and .* is 16 of z; the device computes codes of as many bits "
         r"for both axes: give bits = 16 to both, and to the one of 18 bits word_bits = 18 with align = 'left'"),
        ((), (f"{OF_AUX}\n[aux.amplifier]\ngain = 1.0\nbias_v = 500",),
         r"scanner\.toml:\d+: aux\.v_max: the driver of aux has 0\.\.100 V, and its converter reaches none of it"),
    ],
)  # fmt: skip
def test_a_wrong_key_is_named(
    edits: tuple[str, ...], scanner: tuple[str, ...] | None, says: str, tmp_path: Path
) -> None:
    path = with_aux(write_straight(tmp_path), *edits, **({} if scanner is None else {"scanner": scanner}))
    assert re.match(says, message := refused(path)), message


def test_aux_without_z_says_what_to_do(tmp_path: Path) -> None:
    """Also where the scanner has both; the scan without both is planned."""
    path = with_aux(write_straight(tmp_path), "- [z]")
    says = r"scan\.toml:\d+: aux: is the y of the sequencer whose x is z, and there is no \[z\]; rename this table to"
    assert re.match(says, message := refused(path)), message
    path.write_text(edited(path.read_text("utf-8"), "- [aux]"), "utf-8")
    assert make_plan(load(path)).tilts == ()


@pytest.mark.common
def test_an_output_that_leaves_its_range_says_what_fits(tmp_path: Path) -> None:
    """The slopes of the message fit, and some more do not."""
    path = with_aux(write_straight(tmp_path), "aux.slope_x = 0.8", "aux.slope_y = -0.9")
    says = r"scan\.toml:\d+: aux\.slope_y: the tilt leaves the 0\.\.99\.9985 V of aux; the largest that fits here is "
    fits = re.match(says + r"slope_x = (\S+) and slope_y = (\S+)$", message := refused(path))
    assert fits, message
    text = path.read_text("utf-8")
    for factor in (1.0, 1.01):
        slopes = (f"aux.slope_{axis} = {factor * float(fits[at])}" for at, axis in ((1, "x"), (2, "y")))
        path.write_text(edited(text, *slopes), "utf-8")
        if factor == 1.0:
            assert len(make_plan(load(path)).tilts) == 2
        else:
            assert re.match(says, refused(path))


@pytest.mark.common
def test_a_slew_rate_of_the_second_output_says_what_fits(tmp_path: Path) -> None:
    own = f"{AUX_OF_SCANNER}\n[aux.amplifier]\nmax_slew_v_per_s = 20000"
    path = with_aux(write_straight(tmp_path), "aux.slope_x = 0.5", "aux.slope_y = 0", scanner=(own,))
    message = refused(path)
    fits = re.search(r"aux\.slope_x: aux steps by up to \d+ codes a tick, 20000 V/s allow 26; slope_x = (\S+)", message)
    assert fits, message
    path.write_text(edited(path.read_text("utf-8"), f"aux.slope_x = {fits[1]}"), "utf-8")
    assert len(make_plan(load(path)).tilts) == 2


def test_room_for_steps_is_asked_for_by_name(tmp_path: Path) -> None:
    """Where z does not move along y, the message is that of aux."""
    path = with_aux(write_stepped(tmp_path, "x.band_limit.window = [0.0, 1.0]", "z.slope_y = 0.0"))
    assert "aux takes 0.0157 of a line on either side of a step of y" in refused(path)


def test_a_limit_of_the_scan_file_holds_for_each_output(tmp_path: Path) -> None:
    level = ("z.slope_x = 0", "z.slope_y = 0", "+ [limits]\nmax_error_lsb = 0.9")
    path = with_aux(write_straight(tmp_path, *level), "aux.slope_x = 0.3")
    (problem,) = certify_scan(load(path), remedies=False).broken
    assert re.match(r"aux errs by up to \d\.\d+ LSB, above 0\.9", problem.why), problem
