"""``Live`` with the output z on a compiled device: what it plays before and after changes is one plane."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import cos, radians, sin
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
import pytest
from client_line import VirtualLine, intact
from client_rig import client
from link_device import HostDevice
from replacing import replace
from sets import common
from tilted_scans import (
    LINES,
    NM_PER_V,
    OF_SCANNER,
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

from tablegen.api.live import Live
from tablegen.api.live_tilt import followed_offset_v
from tablegen.config.load import Setup, load
from tablegen.config.schema import TiltName
from tablegen.link.errors import LinkLost
from tablegen.link.frames import FrameReader
from tablegen.link.messages import Request
from tablegen.link.prepare import PreparedScan
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import make_plan
from tablegen.planning.turned_plan import make_turned_plan
from tablegen.verification.play.stream import FLAGS

pytestmark = pytest.mark.common

BIT = {name: 1 << bit for bit, name in enumerate(FLAGS)}
LSB_NM = NM_PER_V * 100.0 / 65536.0
ANGLE, COUPLING = 30.0, (0.05, -0.03)


class Frame(NamedTuple):
    """A frame that was played: its centre on the sample from that of the first one, its angle and zoom, and volts."""

    centre_nm: tuple[float, float]
    angle_deg: float
    zoom: float
    valid: Floats
    volts: Floats

    def points(self) -> tuple[Floats, Floats, Floats]:
        """The wanted places on the sample, and the heights that were played there, at the valid ticks."""
        lines, ticks = self.valid.shape
        line, tick = np.nonzero(self.valid)
        x_nm, y_nm = wanted_places(self.angle_deg, line, (tick + 0.5) / ticks, lines)
        x_nm, y_nm = (at + self.zoom * by for at, by in zip(self.centre_nm, (x_nm, y_nm), strict=True))
        return x_nm, y_nm, NM_PER_V * self.volts[self.valid]


def check_plane(frames: list[Frame]) -> None:
    """Check that all frames are on one plane of the sample, within the bounds of docs/tilt.md."""
    x_nm, y_nm, z_nm = (np.concatenate(one) for one in zip(*(frame.points() for frame in frames), strict=True))
    plane = NM_PER_V * OFFSET_V + SLOPE_X * x_nm + SLOPE_Y * y_nm
    assert np.max(np.abs(z_nm - plane)) < 1.5 * LSB_NM
    slope_x, slope_y, centre = fitted_plane(x_nm, y_nm, z_nm)
    assert max(abs(slope_x - SLOPE_X), abs(slope_y - SLOPE_Y)) * SIZE_NM < 0.2 * LSB_NM
    assert abs(centre - NM_PER_V * OFFSET_V) < 0.2 * LSB_NM


class Session:
    """``Live`` on a compiled device that plays a scan file, and the frames that it has played so far."""

    def __init__(self, live: Live, line: VirtualLine, device: HostDevice) -> None:
        self.live, self.line, self.device = live, line, device
        self.frames: list[Frame] = []

    def play(self, centre_nm: tuple[float, float], angle_deg: float = 0.0, zoom: float = 1.0) -> None:
        """Note a whole frame of what plays now."""
        schedule = self.live.plan.schedule
        ticks = self.device.played(4 * schedule.frame_ticks)
        starts = np.flatnonzero(ticks["markers"] & BIT["frame"])
        first = int(starts[starts >= 2 * schedule.frame_ticks][0])  # settled
        shape = schedule.lines, schedule.ticks
        x_y, of_z, z = (
            ticks[name][first : first + schedule.frame_ticks].reshape(shape) for name in ("markers", "z_markers", "z")
        )
        valid = (x_y & of_z & BIT["valid"]) != 0
        assert np.count_nonzero(valid) > 0.5 * valid.size
        self.frames.append(Frame(centre_nm, angle_deg, zoom, valid, volts_of(z.astype(np.int64))))


@contextmanager
def session(path: Path) -> Iterator[Session]:
    """A session that has started."""
    setup = load(path)
    plan = make_turned_plan(setup) if setup.mixes_motions else make_plan(setup)
    scan = PreparedScan.of_turned(plan) if setup.mixes_motions else PreparedScan.of_plan(plan)  # type: ignore[arg-type]
    rate_hz = round(scan.program.schedule.update_rate_hz)
    device = HostDevice(scan.program, update_rate_hz=rate_hz, slow=True, modes=True, z=scan.program_of_z)
    device.tick(1)
    line = VirtualLine(device, baud=3_000_000, tick_hz=500_000)  # type: ignore[arg-type]
    with client(line) as host:
        live = Live(host, path)
        assert live.start().z is not None
        yield Session(live, line, device)
    assert device.apart == 0


def play_moves(path: Path) -> list[Frame]:
    """Frames of a scan at 0 degrees that is moved, zoomed and moved on; its line rate changes, too."""
    with session(path) as it:
        it.play((0.0, 0.0))
        swaps = [it.live.move(70.0, -40.0).swap]
        it.play((70.0, -40.0))
        swaps.append(it.live.zoom(0.7).swap)
        it.play((70.0, -40.0), zoom=0.7)
        swaps.append(it.live.move(y_nm=-55.0).swap)
        it.play((70.0, -95.0), zoom=0.7)
        swaps.append(it.live.set({"timing.line_rate_hz": 500.0}).swap)
        it.play((70.0, -95.0), zoom=0.7)
        swaps.append(it.live.move(-120.0, 95.0).swap)
        it.play((-50.0, 0.0), zoom=0.7)
        assert swaps == ["keep", "keep", "keep", "frame", "keep"]
        return it.frames


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_straight(tmp_path_factory.mktemp("straight"))


def test_what_is_played_about_moves_is_one_plane(straight: Path) -> None:
    check_plane(play_moves(straight))


def _fixed(before: Setup, after: Setup, _: TiltName = "z") -> float:
    """A plane that does not follow a move."""
    assert after.scan.z is not None
    assert before.scan.z is not None
    return before.scan.z.offset_v


def _mirrored(before: Setup, after: Setup, _: TiltName = "z") -> float:
    """A plane of the wrong sign."""
    return 2.0 * _fixed(before, after) - followed_offset_v(before, after)


def _exchanged(before: Setup, after: Setup, _: TiltName = "z") -> float:
    """A plane whose slopes are exchanged."""
    assert after.scan.z is not None
    z = replace(after.scan.z, slope_x=after.scan.z.slope_y, slope_y=after.scan.z.slope_x)
    return followed_offset_v(before, replace(after, scan=replace(after.scan, z=z)))


def _in_nm(before: Setup, after: Setup, _: TiltName = "z") -> float:
    """A plane in nm in place of volts."""
    return _fixed(before, after) + NM_PER_V * (followed_offset_v(before, after) - _fixed(before, after))


@pytest.mark.parametrize("wrong", common([_fixed], [_fixed, _mirrored, _exchanged, _in_nm]))
def test_a_plane_that_does_not_follow_is_found(wrong: Callable[[Setup, Setup], float], straight: Path) -> None:
    """The control of the test above: of ``Live`` itself."""
    with patch("tablegen.api.live.followed_offset_v", wrong):
        frames = play_moves(straight)
    check_plane(frames[:1])
    with pytest.raises(AssertionError):
        check_plane(frames)


@pytest.mark.rest
def test_what_is_played_about_turns_is_one_plane(tmp_path: Path) -> None:
    """On coupled axes, which move the tip along each other: moves are those of the axes, and z those of the tip."""
    (by_x, by_y), (x_per_y, y_per_x), zoom = (60.0, -80.0), COUPLING, 0.8
    coupled = f"+ [coupling]\nx_per_y = {x_per_y}\ny_per_x = {y_per_x}"
    with session(write_tilted(tmp_path, ANGLE, scanner=(OF_SCANNER, coupled))) as it:
        it.play((0.0, 0.0), ANGLE)
        turned = it.live.rotate(-75.0)
        it.play((0.0, 0.0), ANGLE - 75.0)
        x, y = it.live.place
        moved = it.live.set({
            "x.offset_nm": x.drive.position_nm + by_x, "y.offset_nm": y.drive.position_nm + by_y,
            "x.size_nm": zoom * SIZE_NM, "y.size_nm": zoom * SIZE_NM,
        })  # fmt: skip
        centre = by_x + x_per_y * by_y, by_y + y_per_x * by_x
        it.play(centre, ANGLE - 75.0, zoom)
    assert all(scan.swap == "keep" and scan.preview is not None for scan in (turned, moved))
    check_plane(it.frames)
    c, s = cos(radians(ANGLE - 75.0)), sin(radians(ANGLE - 75.0))
    along_lines = c * by_x - s * by_y, s * by_x + c * by_y
    for wrong in ((0.0, 0.0), (-centre[0], -centre[1]), (by_x, by_y), along_lines):
        with pytest.raises(AssertionError):
            check_plane([*it.frames[:2], it.frames[2]._replace(centre_nm=wrong)])
    for other in (it.frames[1]._replace(angle_deg=ANGLE), it.frames[2]._replace(zoom=1.0)):
        with pytest.raises(AssertionError):
            check_plane([it.frames[0], other])


def test_a_link_that_is_lost_between_both_images_leaves_the_scan_that_plays(straight: Path) -> None:
    """The port vanishes with the first bytes of z; another move begins where the scan is."""
    with session(straight) as it:
        first = it.live._scan.prepared.image("auto", it.live._device.info).info.first.image_bytes

        def cut(piece: bytes) -> list[bytes]:
            for frame in FrameReader().feed(piece):
                if frame.type == Request.DATA and int.from_bytes(frame.payload[:4], "little") >= first:
                    it.line.there = False
            return [piece] if it.line.there else []

        it.line.spoil_out = cut
        with pytest.raises(LinkLost):
            it.live.move(70.0, -40.0)
        it.play((0.0, 0.0))
        assert it.live.generation == 1
        it.line.spoil_out, it.line.there = intact, True
        assert it.live._device.status().generation == 1
        moved = it.live.move(30.0, 20.0)
        it.play((30.0, 20.0))
    assert (moved.generation, moved.swap) == (2, "keep")
    check_plane(it.frames)
    assert len(it.frames[0].valid) == LINES
