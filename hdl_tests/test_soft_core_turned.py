"""``examples/firmware/soft_core`` of a scan at an angle: uploads of other such scans, from bytes on its line.

The scan of the build decides that the sequencer and the link have slow parts. Every line that plays is the model's.
"""

import struct
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from boards import make
from building import REMOVED, Variant, build
from editing import run
from limits import PATIENCE_S
from line_log import LineCheck, PlayedLine, WrongLine
from link_talk import is_answer
from loader_bridge import Simulation
from replacing import replace
from soft_core_device import BAUD, EXAMPLE, UPDATE_RATE_HZ, Device, Host, compiled_device, refusal
from turned_scans import write_turned

from tablegen.device.commit_mode import CommitMode
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.frame_words import FrameMove
from tablegen.link.acceptance import first_objection
from tablegen.link.messages import AxisWords, DeviceState, More, Move, Reason, Request
from tablegen.link.prepare import PreparedScan
from tablegen.link.program_image import PROGRAM_BYTES, ProgramImage, make_image, take_apart
from tablegen.link.refusal_reasons import explain

pytestmark = pytest.mark.rest

CLOCKS_PER_TICK = 93
LINE = 120  # ticks
LINES = 6
FAR_WORD, FAR_LINE = 55, 4  # of the slow table of y: the largest word there leads too far, on this line
BAD_SLOW_PART = 9  # DAC_BAD_SLOW_PART of dac_sequencer.h
EDITS = (
    f"dac.update_rate_hz = {float(UPDATE_RATE_HZ)}", f"timing.ticks_per_line = {LINE}", "timing.pixels = 40",
    f"timing.line_rate_hz = {UPDATE_RATE_HZ / LINE}", "timing.settle_lines = 1", "x.band_limit.harmonics = 12",
    "y.band_limit.harmonics = 8",
)  # fmt: skip
FORMATS = "+ [emit]\nformats = ['c', 'verilog']"
STRAIGHT: dict[str, object] = {
    "limits": REMOVED,
    "timing": {"pixels": 40, "lines": LINES, "line_rate_hz": 100.0, "ticks_per_line": LINE, "settle_lines": 1},
    "dac.update_rate_hz": float(UPDATE_RATE_HZ),
    **{f"{axis}.band_limit.harmonics": 12 for axis in "xy"},
    **{f"{axis}.table.{key}": value for axis in "xy" for key, value in {"mode": "cubic", "length": 64}.items()},
}


@dataclass(frozen=True)
class Scans:
    """What the device begins with; two of its frame; one of more lines; one at 0 degrees, without a slow part."""

    boot: PreparedScan
    first: PreparedScan
    second: PreparedScan
    more: PreparedScan
    straight: PreparedScan
    folder: Path

    @property
    def moves(self) -> tuple[FrameMove, FrameMove]:
        """Words that make ``first`` smaller and shift it."""
        x, y = self.first.program.x, self.first.program.y
        assert isinstance(x, FrameProgram)
        assert isinstance(y, FrameProgram)
        codes = 1 << x.output.gain_q
        return (
            FrameMove.of(x, 0.8, 0.8, x.slow.offset_word / codes + 1500.25),
            FrameMove.of(y, 0.7, 0.8, y.slow.offset_word / codes - 800.5),
        )

    def check(self, simulation: Simulation) -> LineCheck:
        """Hold the log against the model. Raises ``WrongLine``."""
        check = LineCheck(self.boot.program, keeps=True)
        first = self.first.program
        x, y = (move.program(axis) for move, axis in zip(self.moves, (first.x, first.y), strict=True))  # type: ignore[arg-type]
        check.offer("moved", replace(first, x=x, y=y))
        for name in ("first", "second", "more"):
            check.offer(name, getattr(self, name).program)
        check.follow(PlayedLine.parse(line) for line in simulation.lines())
        return check


def turned_build(folder: Path, angle_deg: float, size_nm: float, lines: int = LINES) -> PreparedScan:
    """Build a scan at an angle for C and Verilog; its file is beside the build."""
    folder.mkdir()
    scan = write_turned(folder, angle_deg, *EDITS, f"timing.lines = {lines}", FORMATS, size_nm=size_nm)
    assert run("build", scan, "-o", folder / "build", "-q").status == 0
    return PreparedScan.of_build(folder / "build")


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> Scans:
    folder = tmp_path_factory.mktemp("scans")
    return Scans(
        turned_build(folder / "boot", 30.0, 100.0),
        turned_build(folder / "first", -20.0, 80.0),
        turned_build(folder / "second", 75.0, 60.0),
        turned_build(folder / "more", 30.0, 80.0, lines=8),
        PreparedScan.of_build(build(folder / "straight", Variant(STRAIGHT)).folder),
        folder,
    )


@pytest.fixture(scope="module")
def device(scans: Scans, tmp_path_factory: pytest.TempPathFactory) -> Device:
    """The device with its firmware in a bench."""
    scan = scans.folder / "boot" / "scan.toml"
    return compiled_device(tmp_path_factory.mktemp("device"), scan, CLOCKS_PER_TICK, LINE)


@pytest.fixture
def simulation(device: Device) -> Iterator[Simulation]:
    with Simulation(device.compiled) as running:
        yield running


@pytest.fixture
def host(device: Device, simulation: Simulation) -> Host:
    return device.host(simulation)


def upload(host: Host, scan: PreparedScan, mode: CommitMode, generation: int) -> None:
    """Upload a scan into the scan that plays, and see that it has taken its place."""
    image = scan.image("table")
    assert is_answer(host.send(image), Request.DATA)
    answer = host.commit_at(image, mode)
    assert is_answer(answer, Request.COMMIT)
    assert struct.unpack("<II", answer.payload)[0] == generation
    host.play(3)
    now = host.status()
    assert (now.state, now.generation, now.hash) == (DeviceState.PLAYING, generation, image.info.hash)
    assert (now.faults, now.bad_frames) == (0, 0)
    assert host.read_back(len(image.data)) == image.data


def test_a_frame_goes_on_with_another_scan_and_a_move(host: Host, scans: Scans) -> None:
    info = host.start()
    assert info.more == More.SLOW_PARTS | More.MOVE | More.SLOW_MOVE
    assert (info.slow_knots, info.slow_index_bits) == (17, 6)
    upload(host, scans.first, CommitMode.KEEP, 2)
    words = [AxisWords(move.gain_word, move.offset_word, move.factor_word) for move in scans.moves]
    assert is_answer(host.ask(host.talk.acting(Request.MOVE, Move(2, *words).pack())), Request.MOVE)
    host.play(LINES)
    assert is_answer(host.ask(host.talk.acting(Request.PARK)), Request.PARK)
    host.play(10)
    assert host.status().state is DeviceState.PARKED
    check = scans.check(host.simulation)
    assert check.taken == {1: "boot", 2: "first", 3: "moved"}
    assert check.kept == {2, 3}, "a frame that goes on, and does not begin"
    assert check.lines > 3 * LINES

    # Negative control: one line, as if a tick of it had been another.
    log = [PlayedLine.parse(line) for line in host.simulation.lines()]
    log[5] = replace(log[5], crc=log[5].crc ^ 1)
    with pytest.raises(WrongLine):
        LineCheck(scans.boot.program, keeps=True).follow(log)


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_uploads_of_each_mode(host: Host, scans: Scans) -> None:
    """At the next line, within the frame, and behind it; another frame cannot go on with this one."""
    host.start()
    more = scans.more.image("table")
    assert is_answer(host.send(more), Request.DATA)
    assert refusal(host.commit_at(more, CommitMode.KEEP)) == (Reason.KEEP, 0)
    upload(host, scans.first, CommitMode.LINE, 2)
    upload(host, scans.second, CommitMode.KEEP, 3)
    upload(host, scans.more, CommitMode.FRAME, 4)
    host.play(LINES)
    check = scans.check(host.simulation)
    assert check.taken == {1: "boot", 2: "first", 3: "second", 4: "more"}
    assert check.kept <= {3}


def slow_word_at(scan: PreparedScan, axis: str, number: int) -> int:
    """The byte of an image where a word of the slow table of an axis begins."""
    before = (scan.program.x,) if axis == "y" else ()
    parts = sum(
        3 * len(each.fast.words) + 2 * len(each.slow.words) + 5 * len(each.gains.words)
        for each in before
        if isinstance(each, FrameProgram)
    )
    program = getattr(scan.program, axis)
    return PROGRAM_BYTES + parts + 3 * len(program.fast.words) + 2 * number


def with_slow_word(scan: PreparedScan, axis: str, number: int) -> ProgramImage:
    """The image with the largest word somewhere in the slow table of an axis, and too small a limit; and its CRC."""
    program = getattr(scan.program, axis)
    words = np.array(program.slow.words)
    words[number] = 32_767
    least, most, _ = program.extremes
    output = replace(program.output, code_min=least, code_max=most, park_code=most)
    changed = replace(program, fast=replace(program.fast, output=output), slow=replace(program.slow, words=words))
    return make_image(replace(scan.program, **{axis: changed}), scan.digest)


def test_a_slow_table_that_leads_too_far_is_refused(host: Host, scans: Scans) -> None:
    """A damaged word of it, and the CRC of that: the scan that plays is left alone."""
    info = host.start()
    far = with_slow_word(scans.first, "y", FAR_WORD)
    assert is_answer(host.send(far), Request.DATA)
    objection = first_objection(take_apart(far.data, far.info.x, far.info.y), info.x_limits, info.y_limits, None)
    assert refusal(host.ask(host.talk.commit(far))) == objection == (Reason.RANGE, 1 + 2 * FAR_LINE)
    host.play(2)
    now = host.status()
    assert (now.state, now.generation, now.faults) == (DeviceState.PLAYING, 1, 0)
    assert scans.check(host.simulation).taken == {1: "boot"}


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_what_is_refused_leaves_the_scan_alone(host: Host, scans: Scans) -> None:
    """A slow table that was damaged on its way, and a scan without a slow part."""
    host.start()
    whole = scans.first.image("table")
    data = bytearray(whole.data)
    data[slow_word_at(scans.first, "y", FAR_WORD)] ^= 1
    damaged = replace(whole, data=bytes(data))
    assert is_answer(host.send(damaged), Request.DATA)
    assert refusal(host.ask(host.talk.commit(damaged))) == (Reason.IMAGE, 0)

    straight = scans.straight.image("table")
    assert is_answer(host.send(straight), Request.DATA)
    assert refusal(host.ask(host.talk.commit(straight))) == (Reason.REFUSED, BAD_SLOW_PART)
    assert "scans at an angle" in explain(Reason.REFUSED, BAD_SLOW_PART)
    host.play(2)
    now = host.status()
    assert (now.state, now.generation, now.faults) == (DeviceState.PLAYING, 1, 0)
    assert scans.check(host.simulation).taken == {1: "boot"}


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_an_open_interlock(host: Host, scans: Scans) -> None:
    host.start()
    host.simulation.set(permit=0)
    whole = scans.first.image("table")
    assert is_answer(host.send(whole), Request.DATA)
    assert refusal(host.ask(host.talk.commit(whole))) == (Reason.INTERLOCK, 0)
    host.simulation.set(permit=1)
    host.play(1)
    assert is_answer(host.ask(host.talk.commit(whole)), Request.COMMIT)  # the upload has stayed
    host.play(2)
    assert scans.check(host.simulation).taken == {1: "boot", 2: "first"}


FAULTS = {
    "the slow table of y is one word further": (
        "SEQUENCER(offset + SLOW_PART + 4 * i) = (uint32_t)slow->table[i];",
        "SEQUENCER(offset + SLOW_PART + 4 * i) = (uint32_t)slow->table[i + (offset == DAC_Y_SLOW_ADDRESS)];",
    ),
    "the ratios have no sign": ("(uint32_t)slow->ratios[i]", "(uint32_t)(slow->ratios[i] & 0x7FFF)"),
    "gains are at twice as many lines": ("= slow->gain_spacing;", "= 2 * slow->gain_spacing;"),
    "the offset is 16 codes higher": (
        "slow->gain_word, slow->offset_word)",
        "slow->gain_word, slow->offset_word + (1 << 24))",
    ),
}
OF_THE_REST = 1  # faults; the others are long


@pytest.mark.parametrize(
    "fault",
    [name if at < OF_THE_REST else pytest.param(name, marks=pytest.mark.long) for at, name in enumerate(FAULTS)],
)
def test_faults_of_the_firmware_are_found(device: Device, scans: Scans, tmp_path: Path, fault: str) -> None:
    with device.edited(tmp_path, "sequencer_registers.c", *FAULTS[fault]) as host:
        host.start()
        host.play(LINES)
        with pytest.raises(WrongLine):
            scans.check(host.simulation)


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_the_bitstream_is_made(tmp_path: Path) -> None:
    """Of a scan of another name and update rate: it is placed in time for the clock of the board."""
    scan = write_turned(tmp_path, 30.0, "dac.update_rate_hz = 250e3", FORMATS, size_nm=200.0)
    scan.write_text(scan.read_text("utf-8").replace('name = "annexin_200nm"', 'name = "lattice"', 1), "utf-8")
    make(EXAMPLE, "bitstream", f"BUILD={tmp_path / 'bits'}", f"PYTHON={sys.executable}", f"SCAN={scan}")
    assert (tmp_path / "bits" / "ulx3s.bit").stat().st_size > 100_000
    assert "CLOCKS_PER_TICK(100)" in (tmp_path / "bits" / "ulx3s.v").read_text("utf-8")


def command(*arguments: str | Path | int) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "tablegen", *map(str, arguments)],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=PATIENCE_S,
    )


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_the_command_line(device: Device, simulation: Simulation, scans: Scans) -> None:
    device.host(simulation)
    with simulation.bridged() as port:
        where = ("--port", port, "--baud", BAUD)
        steps: list[tuple[str | Path | int, ...]] = [
            ("trigger", *where),
            ("upload", scans.folder / "first" / "build", *where),
            ("readback", scans.folder / "first" / "build", *where),
            ("upload", scans.folder / "second" / "build", "--swap", "keep", *where),
            ("park", *where),
        ]
        for step in steps:
            done = command(*step)
            assert done.returncode == 0, (step, done.stdout, done.stderr)
        straight = command("upload", scans.folder / "straight" / "out", *where)
    assert straight.returncode == 9
    assert "scans at an angle" in straight.stderr
    assert scans.check(simulation).taken == {1: "boot", 2: "first", 3: "second"}
