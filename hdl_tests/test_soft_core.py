"""``examples/firmware/soft_core`` whole: firmware on VexRiscv, its bus and the sequencer, from bytes on the serial line.

Every line that is played is the model's, before and after an upload.
"""

import json
import shutil
import struct
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import pythondata_cpu_vexriscv
from building import BENCHES, REMOVED, REPOSITORY, Build, Variant, build, run_warned
from limits import PATIENCE_S
from line_log import LineCheck, PlayedLine, WrongLine
from link_talk import Talk, is_answer
from loader_bridge import LINE_LOG, LINES, Simulation
from replacing import replace

from tablegen.base.resources import resource_folder, verilog_runtime
from tablegen.link.frames import Frame
from tablegen.link.messages import ANSWER, REFUSAL, DeviceInfo, DeviceState, DeviceStatus, Reason, Refusal, Request
from tablegen.link.program_image import ProgramImage, make_image
from tablegen.verification.verilog.simulate import CompiledDesign, Design, compile_design

pytestmark = pytest.mark.rest

EXAMPLE = REPOSITORY / "examples" / "firmware" / "soft_core"
CORE = Path(pythondata_cpu_vexriscv.data_location) / "VexRiscv_Lite.v"
UPDATE_RATE_HZ = 50_000
CLOCKS_PER_TICK = 50
CLOCKS_PER_BIT = 16
LINE = 331  # ticks
BAUD = 2400  # by which a client reckons its time-outs; a simulation has no rate of its own
STEP = 20_000  # clocks between two looks at what has come
MOST_STEPS = 400
SCAN: dict[str, object] = {
    "limits": REMOVED,
    "timing": {"pixels": 40, "lines": 8, "line_rate_hz": 100.0, "ticks_per_line": LINE, "settle_lines": 1},
    "dac.update_rate_hz": float(UPDATE_RATE_HZ),
    "x.band_limit.harmonics": 16,
    "y.band_limit.harmonics": 8,
    "x.table.length": 256,
    "y.table.length": 128,
}


@dataclass(frozen=True, eq=False)
class Scans:
    """What the device begins with, two others, and one with longer tables."""

    boot: Build
    first: Build
    second: Build
    longer: Build

    def check(self, simulation: Simulation) -> LineCheck:
        """Hold the log against the model. Raises ``WrongLine``."""
        check = LineCheck(self.boot.plan.program)
        check.offer("first", self.first.plan.program)
        check.offer("second", self.second.plan.program)
        check.follow(PlayedLine.parse(line) for line in simulation.lines())
        return check


def scan_of(size_nm: float, **more: object) -> Variant:
    return Variant({**SCAN, "x.size_nm": size_nm, "y.size_nm": size_nm, **more})


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> Scans:
    folder = tmp_path_factory.mktemp("scans")
    variants = scan_of(200.0), scan_of(150.0), scan_of(90.0), scan_of(90.0, **{"x.table.length": 128})
    return Scans(*(build(folder / str(at), variant) for at, variant in enumerate(variants)))


def compiled_firmware(folder: Path, example: Path, scan: Path) -> Path:
    command = ["make", "-C", example, f"SCAN={scan}", f"BUILD={folder}", f"TABLEGEN={sys.executable} -m tablegen"]
    clock = f"CLOCK_HZ={UPDATE_RATE_HZ * CLOCKS_PER_TICK}", f"CLOCKS_PER_TICK={CLOCKS_PER_TICK}"
    run_warned([*command, *clock])
    return folder / "firmware.mem"


def compiled_device(folder: Path, example: Path, scan: Path) -> CompiledDesign:
    """The device with its firmware in a bench."""
    firmware = compiled_firmware(folder / "firmware", example, scan)
    bus = sorted((resource_folder("firmware_templates") / "verilog" / "bus").glob("dac_*.v"))
    sources = [BENCHES / "soft_core_bench.v", LINE_LOG, example / "soft_core.v", CORE, *bus]
    runtime = [path for path in verilog_runtime() if path.name != "program_loader.v"]
    values: dict[str, int | str] = {"FIRMWARE": str(firmware), "LINES": LINES}
    values |= {"CLOCKS_PER_TICK": CLOCKS_PER_TICK, "CLOCKS_PER_BIT": CLOCKS_PER_BIT}
    design = Design([*sources, *runtime], "soft_core_bench", values, includes=[firmware.parent / "scan"])
    return compile_design("verilator", design, folder / "model")


@pytest.fixture(scope="module")
def device(scans: Scans, tmp_path_factory: pytest.TempPathFactory) -> CompiledDesign:
    return compiled_device(tmp_path_factory.mktemp("device"), EXAMPLE, scans.boot.folder.parent / "annexin_200nm.toml")


@pytest.fixture
def simulation(device: CompiledDesign) -> Iterator[Simulation]:
    with Simulation(device) as running:
        yield running


@dataclass
class Host:
    """Requests, one after the other, each until it is answered."""

    simulation: Simulation
    talk: Talk

    def ask(self, wire: bytes) -> Frame:
        """Send a request and wait for its answer."""
        received = self.simulation.run(len(wire) * 10 * CLOCKS_PER_BIT + STEP, wire)
        for _ in range(MOST_STEPS):
            answers = self.talk.answers(received)
            if answers:
                (answer,) = answers
                return answer
            received = self.simulation.run(STEP)
        raise AssertionError("no answer")

    def status(self) -> DeviceStatus:
        return DeviceStatus.unpack(self.ask(self.talk.request(Request.STATUS)).payload)

    def send(self, image: ProgramImage) -> Frame:
        """Send BEGIN and all DATA; the last answer, or the first refusal."""
        for wire in self.talk.upload(image):
            answer = self.ask(wire)
            if answer.type == REFUSAL:
                break
        return answer

    def start(self) -> DeviceInfo:
        """HELLO, ARM and TRIGGER, and the lines in which the guard leaves the power-up codes."""
        hello = self.ask(self.talk.hello())
        assert is_answer(hello, Request.HELLO)
        assert is_answer(self.ask(self.talk.acting(Request.ARM, bytes(4))), Request.ARM)
        assert is_answer(self.ask(self.talk.acting(Request.TRIGGER)), Request.TRIGGER)
        self.play(3)
        return DeviceInfo.unpack(hello.payload)

    def play(self, lines: int) -> None:
        self.simulation.run(CLOCKS_PER_TICK * LINE * lines)


@pytest.fixture
def host(simulation: Simulation) -> Host:
    simulation.run(CLOCKS_PER_TICK * LINE * 12)  # the firmware starts, and the guard reaches the park codes
    return Host(simulation, Talk())


def image_of(built: Build, fourier: bool = False) -> ProgramImage:
    digest = str(built.manifest["hash"])
    words = [line.fourier.in_order for line in built.plan.lines] if fourier else []
    return make_image(built.plan.program, digest, *words)


def refusal(answer: Frame) -> tuple[int, int]:
    assert answer.type == REFUSAL
    unpacked = Refusal.unpack(answer.payload)
    return unpacked.reason, unpacked.detail


def test_it_says_what_it_is(host: Host, scans: Scans) -> None:
    info, boot = host.start(), scans.boot.plan
    assert info.update_rate_hz == UPDATE_RATE_HZ
    for told, limits, line in ((info.x, info.x_limits, boot.x), (info.y, info.y_limits, boot.y)):
        output = line.program.output
        assert (told.index_bits, told.word_bits) == (line.program.index_bits, line.program.bits)
        assert (told.dac_bits, told.converter) == (output.dac_bits, output.word_bits)
        assert (limits.code_min, limits.code_max, limits.max_step) == (
            output.code_min, output.code_max, output.max_step,
        )  # fmt: skip
    now = host.status()
    assert (now.state, now.generation, now.faults) == (DeviceState.PLAYING, 1, 0)
    assert now.hash.hex() == scans.boot.manifest["hash"]
    assert 0 < now.line < 8


def test_uploads_while_a_scan_plays(host: Host, scans: Scans) -> None:
    host.start()
    uploads = [(scans.first, False), (scans.second, True), (scans.first, True)]
    for generation, (built, fourier) in enumerate(uploads, 2):
        image = image_of(built, fourier)
        assert is_answer(host.send(image), Request.DATA)
        answer = host.ask(host.talk.commit(image))
        assert is_answer(answer, Request.COMMIT)
        taken, line = struct.unpack("<II", answer.payload)
        assert taken == generation
        assert 0 <= line < 8
        host.play(3)
        now = host.status()
        assert (now.state, now.generation, now.hash) == (DeviceState.PLAYING, generation, image.info.hash)
        assert (now.faults, now.bad_frames) == (0, 0)
    assert is_answer(host.ask(host.talk.acting(Request.PARK)), Request.PARK)
    host.play(10)
    assert host.status().state is DeviceState.PARKED
    check = scans.check(host.simulation)
    assert check.taken == {1: "boot", 2: "first", 3: "second", 4: "first"}
    assert check.lines > 12

    # Negative control: one line, as if a tick of it had been another.
    log = [PlayedLine.parse(line) for line in host.simulation.lines()]
    log[5] = replace(log[5], crc=log[5].crc ^ 1)
    with pytest.raises(WrongLine):
        LineCheck(scans.boot.plan.program).follow(log)
