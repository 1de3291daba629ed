"""``examples/firmware/soft_core`` of a scan with z: uploads of x, y and z as one program, from bytes on its line.

The scan of the build decides that there is a second sequencer. Every line that x, y and z play is the model's, and z
has the markers of x and y on every tick.
"""

import struct
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from boards import make
from editing import run
from limits import PATIENCE_S
from line_log import LineCheck, PlayedLine, WrongLine
from link_talk import is_answer
from loader_bridge import Simulation
from replacing import replace
from soft_core_device import (
    APART,
    BAUD,
    EXAMPLE,
    UPDATE_RATE_HZ,
    Z_LINES,
    Device,
    Host,
    compiled_device,
    refusal,
)  # fmt: skip
from tilted_scans import write_straight, write_tilted

from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import ScanProgram
from tablegen.link.messages import OF_Z, DeviceState, DeviceStatus, More, Reason, Request, ZStatus
from tablegen.link.prepare import PreparedScan
from tablegen.link.program_image import join, make_image

pytestmark = pytest.mark.rest

CLOCKS_PER_TICK = 93
LINE = 60  # ticks
LINES = 3
EDITS = (
    f"dac.update_rate_hz = {float(UPDATE_RATE_HZ)}", f"timing.ticks_per_line = {LINE}", "timing.pixels = 20",
    f"timing.line_rate_hz = {UPDATE_RATE_HZ / LINE}", "timing.settle_lines = 1", "x.band_limit.harmonics = 8",
    "y.band_limit.harmonics = 4", f"timing.lines = {LINES}", "+ [emit]\nformats = ['c', 'verilog']",
)  # fmt: skip
CUBIC = tuple(f"{axis}.table.{key}" for axis in "xy" for key in ("mode = 'cubic'", "length = 64"))
WITHOUT_Z = ("- [z]",)
UNDERRUN = 8  # a bit of the faults


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


def scans_of(folder: Path, angle_deg: float | None) -> Scans:
    """Build what a device of one kind takes."""
    edits: tuple[tuple[str, ...], ...] = ((), (), (), WITHOUT_Z)
    sizes, slopes = (100.0, 80.0, 60.0, 70.0), (0.02, -0.2, 0.3, 0.02)
    boot, first, second, plain = (
        built(folder / f"{at}", angle_deg, slope, size, *more)
        for at, (slope, size, more) in enumerate(zip(slopes, sizes, edits, strict=True))
    )
    return Scans(boot, first, second, plain, folder)


def device_of(folder: Path, scans: Scans) -> Device:
    """Compile the device of these scans."""
    of_z = EXAMPLE / "soft_core_z.v", EXAMPLE / "soft_core_both.v"
    return compiled_device(folder, scans.folder / "0" / "scan.toml", CLOCKS_PER_TICK, LINE, of_z)


def apart(simulation: Simulation) -> list[tuple[int, int, int]]:
    """Return the ticks on which z has other markers than x and y, with both."""
    number, x_y, z = range(3)
    split = [line.split() for line in log_of(simulation, APART)]
    return [(int(each[number], 16), int(each[x_y], 16), int(each[z], 16)) for each in split]


def command(*arguments: str | Path | int) -> subprocess.CompletedProcess[str]:
    """Run a command of tablegen."""
    return subprocess.run(
        [sys.executable, "-m", "tablegen", *map(str, arguments)],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=PATIENCE_S,
    )


def both_states(host: Host) -> tuple[DeviceStatus, ZStatus]:
    """Return the status of both."""
    payload = host.ask(host.talk.request(Request.STATUS)).payload
    return DeviceStatus.unpack(payload), ZStatus.unpack(payload[DeviceStatus.LAYOUT.size :])


def upload(host: Host, scan: PreparedScan, mode: CommitMode, generation: int, reads_back: bool = True) -> None:
    """Upload a scan into the scan that plays, and see that it has taken its place."""
    image = scan.image("table")
    assert is_answer(host.send(image), Request.DATA)
    answer = host.commit_at(image, mode)
    assert is_answer(answer, Request.COMMIT)
    assert struct.unpack("<II", answer.payload)[0] == generation
    host.play(3)
    now, z = both_states(host)
    assert (now.state, now.generation, now.hash) == (DeviceState.PLAYING, generation, image.info.hash)
    assert (z.state, z.generation, z.plays) == (DeviceState.PLAYING, generation, True)
    assert (now.faults, now.bad_frames, z.faults) == (0, 0, 0)
    read = len(image.data) if reads_back else 240
    assert host.read_back(read) == image.data[:read]


def park(host: Host) -> None:
    """Park the device, and see that x, y and z rest."""
    assert is_answer(host.ask(host.talk.acting(Request.PARK)), Request.PARK)
    host.play(10)
    now, z = both_states(host)
    assert (now.state, z.state) == (DeviceState.PARKED, DeviceState.PARKED)


def trigger(host: Host) -> None:
    """Start frames without end."""
    for request in (host.talk.acting(Request.ARM, bytes(4)), host.talk.acting(Request.TRIGGER)):
        assert host.ask(request).payload == b""
    host.play(3)


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> Scans:
    return scans_of(tmp_path_factory.mktemp("scans"), None)


@pytest.fixture(scope="module")
def device(scans: Scans, tmp_path_factory: pytest.TempPathFactory) -> Device:
    """The device with its firmware in a bench."""
    return device_of(tmp_path_factory.mktemp("device"), scans)


@pytest.fixture
def simulation(device: Device) -> Iterator[Simulation]:
    with Simulation(device.compiled) as running:
        yield running


@pytest.fixture
def host(device: Device, simulation: Simulation) -> Host:
    return device.host(simulation)


def test_a_frame_goes_on_with_another_scan_of_x_y_and_z(host: Host, scans: Scans) -> None:
    """x, y and z begin the same line on one tick, and park together."""
    info = host.start()
    assert info.more & More.Z
    upload(host, scans.first, CommitMode.KEEP, 2, reads_back=False)
    park(host)
    assert apart(host.simulation) == []
    x_y, z = scans.check(host.simulation)
    assert x_y.taken == z.taken == {1: "boot", 2: "first"}
    assert x_y.kept == z.kept
    assert x_y.lines == z.lines > 2 * LINES

    # Negative control: a line of z, as if a tick of it had been another.
    log = [PlayedLine.parse(line) for line in log_of(host.simulation, Z_LINES)]
    log[5] = replace(log[5], crc=log[5].crc ^ 1)
    with pytest.raises(WrongLine):
        LineCheck(of_z(scans.boot), keeps=True).follow(log)


def uploads_in_each_mode(host: Host, scans: Scans) -> None:
    """Upload one scan after the other, each while the last one plays."""
    host.start()
    upload(host, scans.first, CommitMode.LINE, 2)
    upload(host, scans.second, CommitMode.KEEP, 3)
    upload(host, scans.first, CommitMode.FRAME, 4)
    park(host)
    assert apart(host.simulation) == []
    x_y, z = scans.check(host.simulation)
    assert x_y.taken == z.taken == {1: "boot", 2: "first", 3: "second", 4: "first"}
    assert x_y.kept == z.kept <= {3}


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_uploads_of_each_mode(host: Host, scans: Scans) -> None:
    """At the next line, within the frame, and behind it."""
    uploads_in_each_mode(host, scans)


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_a_scan_at_an_angle(tmp_path: Path) -> None:
    """The same of a device whose x and y have a slow part too."""
    scans = scans_of(tmp_path, 30.0)
    device = device_of(tmp_path / "device", scans)
    with Simulation(device.compiled) as simulation:
        uploads_in_each_mode(device.host(simulation), scans)


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_a_scan_without_z_plays_where_none_with_z_does(host: Host, scans: Scans) -> None:
    host.start()
    plain, first = scans.plain.image("table"), scans.first.image("table")
    assert is_answer(host.send(plain), Request.DATA)
    assert refusal(host.commit_at(plain, CommitMode.LINE)) == (Reason.PLAYING, 0)
    park(host)
    together = len(log_of(host.simulation, Z_LINES))
    assert is_answer(host.commit_at(plain, CommitMode.LINE), Request.COMMIT)  # the upload has stayed
    trigger(host)
    now, z = both_states(host)
    assert (now.state, now.generation, z.state, z.plays) == (DeviceState.PLAYING, 2, DeviceState.PARKED, False)
    assert is_answer(host.send(first), Request.DATA)
    assert refusal(host.commit_at(first, CommitMode.LINE)) == (Reason.PLAYING, 0)
    assert is_answer(host.ask(host.talk.acting(Request.PARK)), Request.PARK)
    host.play(10)
    alone = apart(host.simulation)
    assert alone
    assert {z_markers for _, _, z_markers in alone} == {0}, "z rests"
    assert len(log_of(host.simulation, Z_LINES)) == together
    assert is_answer(host.commit_at(first, CommitMode.LINE), Request.COMMIT)
    trigger(host)
    now, z = both_states(host)
    assert (now.generation, now.faults, z.generation, z.faults, z.plays) == (3, 0, 2, 0, True)
    x_y, of_z = scans.check(host.simulation)
    assert (x_y.taken, of_z.taken) == ({1: "boot", 2: "plain", 3: "first"}, {1: "boot", 2: "first"})
    assert apart(host.simulation) == alone


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_what_is_refused_leaves_x_y_and_z_alone(host: Host, scans: Scans) -> None:
    """A damaged image of z, z of another frame, and an open interlock."""
    host.start()
    whole = scans.first.image("table")
    data = bytearray(whole.data)
    data[-1] ^= 1
    damaged = replace(whole, data=bytes(data))
    assert is_answer(host.send(damaged), Request.DATA)
    assert refusal(host.ask(host.talk.commit(damaged))) == (Reason.IMAGE, 0)
    other = replace(of_z(scans.first), schedule=replace(of_z(scans.first).schedule, settle_lines=0))
    divided = join(make_image(scans.first.program, scans.first.digest), make_image(other, scans.first.digest))
    assert is_answer(host.send(divided), Request.DATA)
    assert refusal(host.ask(host.talk.commit(divided))) == (Reason.SCHEDULE, OF_Z)
    host.simulation.set(permit=0)
    assert is_answer(host.send(whole), Request.DATA)
    assert refusal(host.ask(host.talk.commit(whole))) == (Reason.INTERLOCK, 0)
    host.simulation.set(permit=1)
    host.play(2)
    now, z = both_states(host)
    assert (now.state, now.generation, now.faults) == (DeviceState.PLAYING, 1, 0)
    assert (z.state, z.generation, z.faults) == (DeviceState.PLAYING, 1, 0)
    assert is_answer(host.ask(host.talk.commit(whole)), Request.COMMIT)  # the upload has stayed
    host.play(2)
    assert apart(host.simulation) == []
    assert [check.taken for check in scans.check(host.simulation)] == 2 * [{1: "boot", 2: "first"}]


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_the_interlock_stops_what_the_firmware_would_commit(device: Device, scans: Scans, tmp_path: Path) -> None:
    with device.edited(tmp_path, "main.c", "(SYSTEM_STATE & STATE_PERMIT) != 0", "true") as host:
        host.start()
        host.simulation.set(permit=0)
        image = scans.first.image("table")
        host.send(image)
        assert refusal(host.ask(host.talk.commit(image))) == (Reason.WITHDRAWN, 0)
        host.simulation.set(permit=1)
        host.play(2)
        now, z = both_states(host)
        assert (now.generation, now.faults, z.generation, z.faults) == (1, 0, 1, 0)
        upload(host, scans.first, CommitMode.LINE, 2)
        assert apart(host.simulation) == []
        assert [check.taken for check in scans.check(host.simulation)] == 2 * [{1: "boot", 2: "first"}]


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_the_command_line(device: Device, simulation: Simulation, scans: Scans) -> None:
    device.host(simulation)
    with simulation.bridged() as port:
        where = ("--port", port, "--baud", BAUD)
        steps: list[tuple[str | Path | int, ...]] = [
            ("trigger", *where),
            ("upload", scans.folder / "1" / "build", *where),
            ("readback", scans.folder / "1" / "build", *where),
            ("upload", scans.folder / "2" / "build", "--swap", "keep", *where),
            ("status", *where),
            ("park", *where),
        ]
        done = [command(*step) for step in steps]
        for step, each in zip(steps, done, strict=True):
            assert each.returncode == 0, (step, each.stdout, each.stderr)
        assert "output z    follows the scan; faults: none" in done[4].stdout
    assert apart(simulation) == []
    assert [check.taken for check in scans.check(simulation)] == 2 * [{1: "boot", 2: "first", 3: "second"}]


# Controls


def test_a_tick_between_two_requests_is_found(device: Device, scans: Scans, tmp_path: Path) -> None:
    """Firmware that gives x and y what is requested of both, lets ticks pass, and then gives it z."""
    right = "    command_at(OF_BOTH, of_both);"
    wrong = "    command_at(0, of_both);\n    let_samples_pass();\n    command_at(OF_Z, of_both);"
    with device.edited(tmp_path, "sequencer_registers.c", right, wrong) as host:
        host.start()
        host.play(LINES)
        assert apart(host.simulation)
        scans.check(host.simulation)  # each by itself plays its lines


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_words_of_z_in_the_table_of_x_are_found(device: Device, scans: Scans, tmp_path: Path) -> None:
    right = "    write_table(of + DAC_X_TABLE_ADDRESS, &program->x);"
    wrong = right + "\n    if (of != 0)\n        write_table(DAC_X_TABLE_ADDRESS, &program->x);"
    with device.edited(tmp_path, "sequencer_registers.c", right, wrong) as host:
        host.start()
        host.play(LINES)
        with pytest.raises(WrongLine):
            scans.check(host.simulation)


@pytest.mark.long
@pytest.mark.timeout(86_400)
@pytest.mark.parametrize("lacks", ["x and y", "z"])
def test_a_park_of_one_parks_both(device: Device, tmp_path: Path, lacks: str) -> None:
    """A request that reaches one sequencer alone: the hardware parks the other one, and counts a fault."""
    right = "        requests[IS_Z(s)].command |= mask;"
    this = "IS_Z(s)" if lacks == "z" else "!IS_Z(s)"
    wrong = f"        requests[IS_Z(s)].command |= {this} ? mask & ~DAC_COMMAND_PARK_MASK : mask;"
    with device.edited(tmp_path, "sequencer_registers.c", right, wrong) as host:
        host.start()
        park(host)
        assert both_states(host)[1].faults == UNDERRUN


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_a_commit_of_each_parks_both(device: Device, scans: Scans, tmp_path: Path) -> None:
    """x and y begin the new scan, and z does not."""
    right = "const uint32_t of_both = x_y->command & z->command;"
    wrong = right.replace(";", " & ~(DAC_COMMAND_COMMIT_MASK | DAC_COMMAND_COMMIT_MODE_MASK);")
    with device.edited(tmp_path, "sequencer_registers.c", right, wrong) as host:
        host.start()
        image = scans.first.image("table")
        host.send(image)
        host.ask(host.talk.commit(image))
        host.play(10)
        now, z = both_states(host)
        assert (now.state, z.state, z.faults) == (DeviceState.PARKED, DeviceState.PARKED, UNDERRUN)
        assert apart(host.simulation)


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_the_bitstream_is_made(tmp_path: Path) -> None:
    """It is placed in time for the clock of the board, or nextpnr ends with an error."""
    scan = write_tilted(tmp_path, 30.0, "dac.update_rate_hz = 250e3", "+ [emit]\nformats = ['c', 'verilog']")
    make(EXAMPLE, "bitstream", "DEVICE=45k", f"BUILD={tmp_path / 'bits'}", f"PYTHON={sys.executable}", f"SCAN={scan}")
    assert (tmp_path / "bits" / "ulx3s.bit").stat().st_size > 100_000
