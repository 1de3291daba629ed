"""``examples/firmware/soft_core`` of a scan with z: uploads of x, y and z as one program, from bytes on its line.

The scan of the build decides that there is a second sequencer. Every line that x, y and z play is the model's, and z
has the markers of x and y on every tick.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from editing import run
from line_log import LineCheck, PlayedLine, WrongLine
from link_talk import is_answer
from loader_bridge import Simulation
from soft_core_device import APART, UPDATE_RATE_HZ, Z_LINES, Device, Host, compiled_device, refusal
from tilted_scans import write_straight, write_tilted

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import ScanProgram
from tablegen.link.messages import DeviceState, DeviceStatus, Reason, Request, ZStatus
from tablegen.link.prepare import PreparedScan

pytestmark = pytest.mark.rest

CLOCKS_PER_TICK = 93
LINE = 60  # ticks
LINES = 4
EDITS = (
    f"dac.update_rate_hz = {float(UPDATE_RATE_HZ)}", f"timing.ticks_per_line = {LINE}", "timing.pixels = 20",
    f"timing.line_rate_hz = {UPDATE_RATE_HZ / LINE}", "timing.settle_lines = 1", "x.band_limit.harmonics = 8",
    "y.band_limit.harmonics = 4", f"timing.lines = {LINES}", "+ [emit]\nformats = ['c', 'verilog']",
)  # fmt: skip
CUBIC = tuple(
    f"{axis}.table.{key}" for axis in "xy" for key in ("mode = 'cubic'", "length = 32")
)
WITHOUT_Z = ("- [z]",)


@dataclass(frozen=True)
class Scans:
    """What the device begins with, and others of its frame; ``plain`` has no z."""

    boot: PreparedScan
    first: PreparedScan
    second: PreparedScan
    plain: PreparedScan
    folder: Path

    def check(self, simulation: Simulation) -> tuple[LineCheck, LineCheck]:
        """Hold the logs of x and y and of z against the model. Raises ``WrongLine``."""
        checks = LineCheck(self.boot.program, keeps=True), LineCheck(of_z(self.boot), keeps=True)
        for name in ("first", "second", "plain"):
            scan = getattr(self, name)
            checks[0].offer(name, scan.program)
            if scan.program_of_z is not None:
                checks[1].offer(name, scan.program_of_z)
        for check, log in zip(checks, (simulation.lines(), log_of(simulation, Z_LINES)), strict=True):
            check.follow(PlayedLine.parse(line) for line in log)
        return checks


def of_z(scan: PreparedScan) -> ScanProgram:
    """Return the program of z."""
    assert scan.program_of_z is not None
    return scan.program_of_z


def log_of(simulation: Simulation, name: str) -> list[str]:
    """Return the lines of a log of the bench."""
    return (simulation.folder / name).read_text("ascii").splitlines()


def built(folder: Path, angle_deg: float | None, slope: float, size_nm: float, *edits: str) -> PreparedScan:
    """Build a scan at an angle, or one at 0 degrees without operators; its file is beside the build."""
    folder.mkdir(parents=True)
    more = (*EDITS, f"x.size_nm = {size_nm}", f"y.size_nm = {size_nm}", f"z.slope_x = {slope}", *edits)
    scan = write_straight(folder, *more, *CUBIC) if angle_deg is None else write_tilted(folder, angle_deg, *more)
    assert run("build", scan, "-o", folder / "build", "-q").status == 0
    return PreparedScan.of_build(folder / "build")


def scans_of(folder: Path, *angles_deg: float | None) -> Scans:
    """Build what a device of one kind takes."""
    edits: tuple[tuple[str, ...], ...] = ((), (), (), WITHOUT_Z)
    sizes, slopes = (100.0, 80.0, 60.0, 80.0), (0.02, -0.2, 0.3, 0.02)
    made = (
        built(folder / f"{at}", angle, slope, size, *more)
        for at, (angle, slope, size, more) in enumerate(zip(angles_deg, slopes, sizes, edits, strict=True))
    )
    return Scans(*made, folder)  # type: ignore[call-arg]


def two_states(host: Host) -> tuple[DeviceStatus, ZStatus]:
    """Return the status of both."""
    payload = host.ask(host.talk.request(Request.STATUS)).payload
    return DeviceStatus.unpack(payload), ZStatus.unpack(payload[DeviceStatus.LAYOUT.size :])


def upload(host: Host, scan: PreparedScan, mode: CommitMode, generation: int) -> None:
    """Upload a scan into the scan that plays, and see that it has taken its place."""
    image = scan.image("table")
    assert is_answer(host.send(image), Request.DATA)
    answer = host.commit_at(image, mode)
    assert is_answer(answer, Request.COMMIT), answer
    assert struct.unpack("<II", answer.payload)[0] == generation
    host.play(3)
    now, z = two_states(host)
    assert (now.state, now.generation, now.hash) == (DeviceState.PLAYING, generation, image.info.hash)
    assert (z.state, z.generation, z.plays) == (DeviceState.PLAYING, generation, True)
    assert (now.faults, now.bad_frames, z.faults) == (0, 0, 0)
    assert host.read_back(len(image.data)) == image.data


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> Scans:
    return scans_of(tmp_path_factory.mktemp("scans"), None, None, None, None)


@pytest.fixture(scope="module")
def device(scans: Scans, tmp_path_factory: pytest.TempPathFactory) -> Device:
    """The device with its firmware in a bench."""
    return compiled_device(tmp_path_factory.mktemp("device"), scans.folder / "0" / "scan.toml", CLOCKS_PER_TICK, LINE, True)


@pytest.fixture
def simulation(device: Device) -> Iterator[Simulation]:
    with Simulation(device.compiled) as running:
        yield running


@pytest.fixture
def host(device: Device, simulation: Simulation) -> Host:
    return device.host(simulation)


def test_x_y_and_z_begin_on_one_tick_in_each_mode(host: Host, scans: Scans) -> None:
    host.start()
    try:
        upload(host, scans.first, CommitMode.LINE, 2)
        upload(host, scans.second, CommitMode.KEEP, 3)
        upload(host, scans.first, CommitMode.FRAME, 4)
    finally:
        print(*host.simulation.lines()[:30], "--", *log_of(host.simulation, Z_LINES)[:30], "--", *log_of(host.simulation, APART)[:20], sep="\n")
    assert is_answer(host.ask(host.talk.acting(Request.PARK)), Request.PARK)
    host.play(10)
    now, z = two_states(host)
    assert (now.state, z.state) == (DeviceState.PARKED, DeviceState.PARKED)
    checks = scans.check(host.simulation)
    assert log_of(host.simulation, APART) == []
    assert checks[0].taken == checks[1].taken == {1: "boot", 2: "first", 3: "second", 4: "first"}
    assert checks[0].kept == checks[1].kept
    assert checks[0].lines == checks[1].lines > 3 * LINES
