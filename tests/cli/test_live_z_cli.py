"""``tablegen live`` of scans with the output z, against the model of a device: answers, range, modes, and previews."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from building import REPOSITORY
from client_line import VirtualLine
from client_rig import Bench, Watched, client, info_for, z_info_for
from editing import edited, run
from replacing import replace
from test_live_cli import pressed, said
from tilted_scans import (
    AUX_NM_PER_V,
    AUX_OFFSET_V,
    AUX_X,
    AUX_Y,
    NM_PER_V,
    OFFSET_V,
    SLOPE_X,
    SLOPE_Y,
    volts_of,
    with_aux,
    write_sine,
    write_stepped,
    write_straight,
    write_tilted,
)

from tablegen.api.live import Live
from tablegen.api.live_tilt import followed_offset_v
from tablegen.base.input_errors import Problem, Rejected
from tablegen.config.load import load
from tablegen.config.variants import variants
from tablegen.device.dual_program import ScanProgram
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.link.device import Device
from tablegen.link.errors import Refused, Unsuitable
from tablegen.link.messages import DeviceInfo, DeviceState, Feature, More, Reason, Request
from tablegen.link.model_device import ModelDevice
from tablegen.link.players import LinePlayer
from tablegen.link.prepare import PreparedScan
from tablegen.numerics.arrays import Ints
from tablegen.planning.line_plan import make_plan

pytestmark = pytest.mark.common

LSB_NM = NM_PER_V * 100.0 / 65536.0
SMOOTH = "y.band_limit.harmonics = 32"  # else the command warns


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_straight(tmp_path_factory.mktemp("straight"), SMOOTH)


def prepared(path: Path, **settings: float) -> PreparedScan:
    """A scan of the file with other values of its keys, without the class under test."""
    _, (scan,) = variants(path, {key.replace("__", "."): [value] for key, value in settings.items()})
    return PreparedScan.of_plan(make_plan(scan.setup, sines=True))


def wide(info: DeviceInfo) -> DeviceInfo:
    """The same device with modes of a COMMIT and the widest limits of steps, in z too."""
    limits = {f"{axis}_limits": replace(getattr(info, f"{axis}_limits"), max_step=1 << 16) for axis in "xy"}
    assert info.z is not None
    steps = {f"{axis}_limits": replace(getattr(info.z, f"{axis}_limits"), max_step=1 << 16) for axis in "xy"}
    z = replace(info.z, **steps)
    more, table = info.more | More.PIXEL_TABLES, {"table_pixels": 64}
    return replace(info, features=info.features | Feature.COMMIT_MODES, more=more, z=z, **limits, **table)


@pytest.fixture(scope="module")
def info(file: Path) -> DeviceInfo:
    """Of a device that takes every scan of these converters."""
    return wide(z_info_for(prepared(file)))


def device_for(info: DeviceInfo) -> ModelDevice:
    """A device with z that has no program yet."""
    device = ModelDevice(info, LinePlayer(None), z_player=LinePlayer(None))
    device.tick(1)
    return device


@contextmanager
def session(info: DeviceInfo, path: Path, **how: Any) -> Iterator[tuple[ModelDevice, Device, Live]]:
    """A session on a new device, not yet started."""
    machine = device_for(info)
    with client(VirtualLine(machine, baud=3_000_000, tick_hz=500_000)) as device:
        yield machine, device, Live(device, path, **how)


def of_z(machine: ModelDevice) -> ScanProgram:
    """What the second sequencer has."""
    assert machine.z_player is not None
    assert machine.z_player.playing is not None
    return machine.z_player.playing


def same_z(first: ScanProgram, second: ScanProgram) -> bool:
    """Return True if z is the same in both, integer by integer."""
    assert isinstance(first.x, FrameProgram)
    assert isinstance(second.x, FrameProgram)
    first_park, second_park = first.x.output.park_code, second.x.output.park_code
    return first_park == second_park and bool((first.x.frame() == second.x.frame()).all())


# Answers


def test_answers_and_status_have_z(info: DeviceInfo, file: Path) -> None:
    """Voltages are those of the plane; heights and room are those of the codes that are played."""
    bench = Bench(device_for(info))
    start, moved, zoomed, slower, status = said(
        bench,
        file,
        {"do": "move", "x_nm": 40, "y_nm": -30.5},
        {"do": "zoom", "factor": 0.8},
        {"do": "set", "values": {"timing.line_rate_hz": 500.0}},
        {"do": "status"},
    )
    scans = [one["scan"] for one in (start, moved, zoomed, slower)]
    there = OFFSET_V + (40.0 * SLOPE_X - 30.5 * SLOPE_Y) / NM_PER_V
    offsets = [scan["z"]["offset_v"] for scan in scans]
    assert offsets == pytest.approx([OFFSET_V, there, there, there], abs=1e-9)
    assert offsets[0] == OFFSET_V
    assert offsets[1] == offsets[2] == offsets[3]
    assert [scan["swap"] for scan in scans] == ["frame", "keep", "keep", "frame"]
    heights_nm = NM_PER_V * volts_of(of_z(bench.device).x.frame())  # type: ignore[union-attr]
    z = scans[3]["z"]
    assert (z["slope_x"], z["slope_y"]) == (SLOPE_X, SLOPE_Y)
    assert (z["lowest_nm"], z["highest_nm"]) == pytest.approx((heights_nm.min(), heights_nm.max()), abs=1e-9)
    assert z["room_below_nm"] == pytest.approx(heights_nm.min(), abs=1e-9)
    assert z["room_above_nm"] == pytest.approx(NM_PER_V * 100.0 - LSB_NM - heights_nm.max(), abs=1e-9)
    assert zoomed["scan"]["z"]["highest_nm"] - z["lowest_nm"] < 0.85 * (
        moved["scan"]["z"]["highest_nm"] - moved["scan"]["z"]["lowest_nm"]
    )
    assert status["status"]["z"] == {**z, "faults": 0}
    assert status["status"]["digest"] == slower["scan"]["digest"]


def test_a_change_is_the_scan_that_a_build_makes(info: DeviceInfo, file: Path) -> None:
    with session(info, file) as (machine, device, live):
        x, y = (line.drive.position_nm for line in live.place)
        live.start()
        scan = live.move(40.0, -30.5)
        assert scan.z is not None
        same = prepared(file, x__offset_nm=x + 40.0, y__offset_nm=y - 30.5, z__offset_v=scan.z.offset_v)
        assert same.program_of_z is not None
        assert same_z(of_z(machine), same.program_of_z)
        assert device.readback()[-200:] == same.image("auto", device.info).data[-200:]


def test_z_is_null_without_z_and_in_a_scan_of_somebody_else(info: DeviceInfo, file: Path, tmp_path: Path) -> None:
    plain = write_straight(tmp_path, SMOOTH, "- [z]")
    start, status = said(Bench(device_for(info)), plain, {"do": "status"})
    assert (start["scan"]["z"], status["status"]["z"]) == (None, None)
    from tablegen.cli.device.live import _REQUESTS

    with session(info, file) as (_, device, live):
        live.start()
        assert _REQUESTS["status"][1](live, device, {})["status"]["z"]["offset_v"] == OFFSET_V
        device.upload(prepared(file, z__offset_v=30.0).image("auto", device.info))
        assert _REQUESTS["status"][1](live, device, {})["status"]["z"] is None


def test_keys_show_the_room_of_z(info: DeviceInfo, file: Path) -> None:
    _, start, right = pressed(Bench(device_for(info)), file, "\x1b[C", "q")
    row = next(row for row in start.splitlines() if row.startswith("z "))
    bar = r"z 0 nm \[\.{7}==\.{31}\] 500 nm  17\.7 nm about 20 V, room 90\.96 nm below, 391\.3 nm above"
    assert re.fullmatch(bar, row), row
    assert " nm about 20.12 V, " in right  # 30 nm by 0.02 over 5 nm/V
    assert right.splitlines()[-1].endswith("the frame goes on")


# The plane


def test_slopes_turn_the_plane_about_the_centre_and_an_offset_is_taken_as_it_is(info: DeviceInfo, file: Path) -> None:
    """Then moves follow the new slopes; the way back ends where it began."""

    def offset_v(scan: Any) -> float:
        return float(scan.z.offset_v)

    with session(info, file) as (_, _, live):
        first = live.start()
        assert offset_v(live.move(50.0)) == pytest.approx(OFFSET_V + 0.2)
        assert offset_v(live.set({"z": {"slope_x": -0.03}})) == pytest.approx(OFFSET_V + 0.2)
        assert offset_v(live.move(50.0)) == pytest.approx(OFFSET_V + 0.2 - 0.3)
        assert offset_v(live.set({"z.offset_v": 40.0, "x.offset_nm": 400.0})) == 40.0
        x, y = (line.drive.position_nm for line in live.place)
        assert offset_v(live.move(y_nm=20.0)) == pytest.approx(40.0 - 0.2)
        back = live.set({
            "x.offset_nm": first.x.position_nm, "y.offset_nm": y, "z.slope_x": SLOPE_X,
        })  # fmt: skip
        assert offset_v(back) == pytest.approx(40.0 + SLOPE_X * (first.x.position_nm - x) / NM_PER_V)


def test_coupled_axes_move_the_tip_along_each_other(tmp_path: Path) -> None:
    """By (x + x_per_y y, y + y_per_x x), the map that the scanner file states; turned by any angle."""
    coupling = "+ [coupling]\nx_per_y = 0.04\ny_per_x = -0.02"
    for angle_deg, name in ((0.0, "straight"), (70.0, "turned")):
        (tmp_path / name).mkdir()
        path = write_tilted(tmp_path / name, angle_deg)
        file = tmp_path / name / "scanner.toml"
        file.write_text(edited(file.read_text("utf-8"), coupling), "utf-8")
        before = load(path)
        _, (after,) = variants(path, {"x.offset_v": [60.0], "y.offset_v": [30.0]})
        k_nm_per_v = [before.scanner.x.size.k_nm_per_v, before.scanner.y.size.k_nm_per_v]
        by_x, by_y = (k * (volts - 50.0) for k, volts in zip(k_nm_per_v, (60.0, 30.0), strict=True))
        rise_nm = SLOPE_X * (by_x + 0.04 * by_y) + SLOPE_Y * (by_y - 0.02 * by_x)
        assert abs(rise_nm) > 5.0
        centres = before.scan.x.offset_v, before.scan.y.offset_v
        assert centres in ((None, None), (50.0, 50.0)), centres
        assert followed_offset_v(before, after.setup) == pytest.approx(OFFSET_V + rise_nm / NM_PER_V, abs=1e-9)


@pytest.mark.parametrize("write", [write_stepped, write_sine])
def test_steps_of_y_and_a_sine_of_x_move_too(write: Any, tmp_path: Path) -> None:
    path = write(tmp_path)
    with session(wide(z_info_for(prepared(path))), path) as (machine, _, live):
        live.start()
        scan = live.move(40.0, -30.0)
        assert scan.z is not None
        assert scan.z.offset_v == pytest.approx(OFFSET_V + (40.0 * SLOPE_X - 30.0 * SLOPE_Y) / NM_PER_V)
        assert scan.swap == "keep"
        assert machine.z_player is not None
        assert machine.z_player.swaps == machine.player.swaps == 2


# The second output


def test_aux_stays_on_its_own_plane(tmp_path: Path) -> None:
    """Its voltage in the centre is that of its slopes, whatever z does; a move beyond its range names it."""
    path = with_aux(write_straight(tmp_path, SMOOTH))
    with session(wide(z_info_for(prepared(path))), path) as (machine, device, live):
        started = live.start()
        assert started.aux is not None
        assert (started.aux.offset_v, started.aux.slope_x, started.aux.slope_y) == (AUX_OFFSET_V, AUX_X, AUX_Y)
        moved = live.move(40.0, -30.5)
        assert moved.z is not None
        assert moved.aux is not None
        assert moved.z.offset_v == pytest.approx(OFFSET_V + (40.0 * SLOPE_X - 30.5 * SLOPE_Y) / NM_PER_V)
        assert moved.aux.offset_v == pytest.approx(AUX_OFFSET_V + (40.0 * AUX_X - 30.5 * AUX_Y) / AUX_NM_PER_V)
        same = prepared(
            path,
            x__offset_nm=moved.x.position_nm,
            y__offset_nm=moved.y.position_nm,
            z__offset_v=moved.z.offset_v,
            aux__offset_v=moved.aux.offset_v,
        )
        assert same.program_of_z is not None
        frames = [_aux_frame(one) for one in (of_z(machine), same.program_of_z, prepared(path).program_of_z)]
        assert (frames[0] == frames[1]).all()
        assert not (frames[0] == frames[2]).all()
        live.set({"aux": {"offset_v": 97.5}, "z.slope_x": 0.0, "z.slope_y": 0.0})
        sent = device._session.exchange.bytes_sent
        with pytest.raises(Rejected, match=r"aux: a move by x_nm = -?[\d.]+ and y_nm = 0 takes aux to .* fit$"):
            live.move(120.0, 0.0)
        assert device._session.exchange.bytes_sent == sent


def _aux_frame(program: ScanProgram | None) -> Ints:
    assert program is not None
    assert isinstance(program.y, FrameProgram)
    return program.y.frame()


# Range


@pytest.mark.parametrize(
    ("offset_v", "nm_per_v", "move"),
    [
        (97.9, NM_PER_V, (120.0, 0.0)),
        (97.9, NM_PER_V, (40.0, -90.0)),
        (2.1, NM_PER_V, (0.0, 90.0)),
        (2.1, -NM_PER_V, (0.0, -90.0)),
        (97.9, -NM_PER_V, (-120.0, 0.0)),
    ],
)
def test_a_move_beyond_the_range_of_z_is_refused_and_what_fits_is_taken(
    offset_v: float, nm_per_v: float, move: tuple[float, float], info: DeviceInfo, tmp_path: Path
) -> None:
    """What fits by the message does fit, and a little more is refused; of what is refused nothing is sent."""
    path = write_straight(tmp_path, f"z.offset_v = {offset_v}")
    scanner = tmp_path / "scanner.toml"
    scanner.write_text(edited(scanner.read_text("utf-8"), f"z.nm_per_v = {nm_per_v}"), "utf-8")
    with session(info, path) as (machine, device, live):
        live.start()
        sent, before = device._session.exchange.bytes_sent, live.z
        with pytest.raises(Rejected) as caught:
            live.move(*move)
        why = str(caught.value.problems[0])
        assert "z: a move by x_nm = " in why
        number = r"(-?[\d.]+)"
        found = re.search(rf"takes z to {number}\.\.{number} V, beyond its 0\.\.99\.9985 V; x_nm = {number} and "
                          rf"y_nm = {number} of it fit$", why)  # fmt: skip
        assert found is not None, why
        if (offset_v, move) == (97.9, (120.0, 0.0)):
            page = (REPOSITORY / "docs" / "live.md").read_text("utf-8")
            assert f'"{why[why.index("z: a move") :]}"' in " ".join(page.split())
        low, high, *part = map(float, found.groups())
        assert low < 0.0 or high > 100.0
        assert all(
            0.0 <= by * whole < whole * whole or by == whole == 0.0 for by, whole in zip(part, move, strict=True)
        )
        with pytest.raises(Rejected):
            live.move(*(by + 0.02 * whole for by, whole in zip(part, move, strict=True)))
        assert device._session.exchange.bytes_sent == sent
        assert live.z == before
        after = live.move(*part)
        assert after.z is not None
        assert 0.0 <= min(after.z.room_below_nm, after.z.room_above_nm) < 0.5
        with pytest.raises(Rejected, match=r"z: a move .* fit"):
            live.move(*move)
        back = live.move(*(-by for by in part)).z
        assert before is not None
        assert back is not None
        assert replace(back, offset_v=before.offset_v) == before
        assert back.offset_v == pytest.approx(before.offset_v, abs=1e-9)
        assert machine.player.swaps == 3


def test_a_tilt_that_leaves_the_range_by_another_change_is_refused_as_by_a_build(
    info: DeviceInfo, tmp_path: Path
) -> None:
    path = write_straight(tmp_path, SMOOTH, "z.offset_v = 97.9")
    start, larger, steeper, place, status = said(
        Bench(device_for(info)),
        path,
        {"do": "zoom", "factor": 1.3},
        {"do": "set", "values": {"z.slope_x": 0.05}},
        {"do": "set", "values": {"z.offset_v": 101.0}},
        {"do": "status"},
    )
    for refused in (larger, steeper):
        assert "the tilt leaves the 0..99.9985 V of z; the largest that fits here is slope_x = " in refused["error"]
    assert "z.offset_v: 101 V is outside the 0..99.9985 V of z" in place["error"]
    assert status["status"]["digest"] == start["scan"]["digest"]


# Modes, and where z begins and ends


@pytest.mark.parametrize("modes", [True, False])
def test_x_y_and_z_change_together_in_every_mode(modes: bool, info: DeviceInfo, file: Path) -> None:
    features = info.features if modes else info.features & ~Feature.COMMIT_MODES
    with session(replace(info, features=features), file) as (machine, device, live):
        assert machine.z_player is not None
        swaps = [live.start().swap]
        for settings in ({"x.offset_nm": 500.0}, {"timing.line_rate_hz": 500.0}, {"timing.lines": 32}):
            swaps.append(live.set(settings).swap)
            status = device.status()
            assert status.z is not None
            assert (status.z.generation, status.z.plays) == (status.generation, True)
            assert live.plan.program_of_z is not None
            assert same_z(of_z(machine), live.plan.program_of_z)
            machine.tick(live.plan.schedule.frame_ticks)
            assert machine.player.line == machine.z_player.line
    assert swaps == (["frame", "keep", "frame", "frame"] if modes else ["line"] * 4)


def test_z_begins_and_ends_where_no_scan_plays(info: DeviceInfo, file: Path, tmp_path: Path) -> None:
    """At the start, with the remedy; of what is refused no image is sent."""
    plain = write_straight(tmp_path, SMOOTH, "- [z]")
    machine = device_for(info)
    for first, second in ((plain, file), (file, plain)):
        line = Watched(machine, baud=3_000_000, tick_hz=500_000)
        with client(line) as device:
            Live(device, first).start()
            begun = line.count(Request.BEGIN)
            with pytest.raises(Unsuitable, match="park first, with `tablegen park --wait`"):
                Live(device, second).start()
            assert line.count(Request.BEGIN) == begun
            device.park()
            device.wait_for(DeviceState.PARKED, 5.0)
            scan = Live(device, second).start()
            assert (scan.z is not None) == (second == file)
            status = device.status()
            assert status.z is not None
            assert (status.state, status.z.plays) == (DeviceState.PLAYING, second == file)
            device.park()
            device.wait_for(DeviceState.PARKED, 5.0)


def test_the_command_says_how_z_begins(info: DeviceInfo, file: Path, tmp_path: Path) -> None:
    plain, bench = write_straight(tmp_path, SMOOTH, "- [z]"), Bench(device_for(info))
    said(bench, plain)
    outcome = bench.run("live", file)
    assert outcome.status == 9
    assert "has the output z, which begins and ends to play only where no scan plays: park first" in outcome.err


def test_z_begins_in_a_session_that_is_parked(info: DeviceInfo, tmp_path: Path) -> None:
    plain = write_straight(tmp_path, SMOOTH, "- [z]")
    tilt = {"z": {"slope_x": SLOPE_X, "offset_v": OFFSET_V}}
    with session(info, plain) as (machine, device, live):
        before = live.start()
        with pytest.raises(Unsuitable, match="begins and ends"):
            live.set(tilt)
        assert (live.z, live.plan.z) == (None, None)
        live.move(10.0)
        device.park()
        device.wait_for(DeviceState.PARKED, 5.0)
        begun = live.set(tilt)
        assert begun.z is not None
        assert begun.z.offset_v == OFFSET_V
        device.arm()
        device.trigger()
        device.wait_for(DeviceState.PLAYING, 5.0)
        moved = live.move(25.0)
        assert moved.z is not None
        assert moved.z.offset_v == pytest.approx(OFFSET_V + 25.0 * SLOPE_X / NM_PER_V)
        assert moved.x.position_nm == pytest.approx(before.x.position_nm + 35.0)
        assert machine.z_player is not None
        assert (machine.player.swaps, machine.z_player.swaps) == (4, 2)


def test_a_device_that_refuses_z_leaves_the_scan_that_plays(info: DeviceInfo, file: Path) -> None:
    """Its z may not jump so far, and the next move begins where the scan is."""
    assert info.z is not None
    narrow = replace(info, z=replace(info.z, x_limits=replace(info.z.x_limits, max_jump=1900)))
    with session(narrow, file) as (_, device, live):
        before = live.start()
        with pytest.raises(Refused, match="z: it begins further than 1900 codes") as caught:
            live.move(100.0, -100.0)
        assert caught.value.reason == Reason.JUMP
        status = device.status()
        assert status.z is not None
        assert (status.generation, status.z.generation, status.hash.hex()) == (1, 1, before.digest)
        after = live.move(5.0)
        assert after.z is not None
        assert after.z.offset_v == pytest.approx(OFFSET_V + 5.0 * SLOPE_X / NM_PER_V)


def test_a_device_without_z_gets_nothing(file: Path) -> None:
    scan = prepared(file)
    machine = ModelDevice(info_for(scan), LinePlayer(None))
    machine.tick(1)
    outcome = Bench(machine).run("live", file)
    assert outcome.status == 9
    assert "the scan has the output z, and the device has none: build its firmware with DAC_LINK_Z=1" in outcome.err
    assert machine.player.swaps == 0


def test_libraries_with_z_stay_refused(tmp_path: Path) -> None:
    path = write_straight(tmp_path)
    path.write_text(path.read_text("utf-8") + '\n[[scans]]\nname = "a"\n\n[[scans]]\nname = "b"\n', "utf-8")
    outcome = run("sweep", path, "-o", tmp_path / "out")
    assert outcome.status == 2
    assert "z: a library plays no output z; build this scan alone, or leave [z] out" in outcome.err


# Previews


@pytest.mark.rest
def test_a_preview_at_an_angle_has_the_exact_z(tmp_path: Path) -> None:
    """z is that of the plan behind it; a plan that is refused gives way to the scan before, with its z."""
    path = write_tilted(tmp_path, 30.0, "timing.lines = 16")
    boot = tmp_path / "boot"
    boot.mkdir()
    info = wide(z_info_for(prepared(write_straight(boot, "timing.lines = 16"))))
    slow = {"more": info.more | More.SLOW_PARTS, "slow_knots": 17, "slow_index_bits": 6}
    previews: list[ScanProgram] = []
    machine = device_for(replace(info, **slow))  # type: ignore[arg-type]
    with client(VirtualLine(machine, baud=3_000_000, tick_hz=500_000)) as device:
        live = Live(device, path, on_preview=lambda _: previews.append(of_z(machine)))
        start = live.start()
        before = of_z(machine)
        problem = Rejected([Problem("scan.toml", 1, "limits", "is exceeded")])
        with patch("tablegen.api.live.build_turned", side_effect=problem), pytest.raises(Rejected):
            live.move(60.0, -40.0)
        assert not same_z(previews[0], before)
        assert same_z(of_z(machine), before)
        assert device.status().hash.hex() == start.digest
        with patch("tablegen.api.live.build_turned", side_effect=problem), pytest.raises(Rejected):
            live.set({"z.slope_x": 0.03})  # x and y of this preview are those that play
        assert not same_z(previews[1], before)
        moved = live.move(60.0, -40.0)
        assert same_z(previews[2], previews[0])
        assert same_z(of_z(machine), previews[2])
        assert moved.preview is not None
        assert moved.z is not None
        assert moved.z.offset_v == pytest.approx(OFFSET_V + (60.0 * SLOPE_X - 40.0 * SLOPE_Y) / NM_PER_V)
        status = device.status()
        assert status.z is not None
        assert status.generation == status.z.generation == 7
