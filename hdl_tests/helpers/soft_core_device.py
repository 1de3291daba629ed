"""``examples/firmware/soft_core`` simulated whole, and a host that talks to it over its line."""

import shutil
import struct
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pythondata_cpu_vexriscv
from building import BENCHES, REPOSITORY, run_warned
from link_talk import Talk, is_answer
from loader_bridge import LINE_LOG, LINES, Simulation

from tablegen.base.resources import resource_folder, verilog_runtime
from tablegen.device.commit_mode import CommitMode
from tablegen.link.frames import Frame
from tablegen.link.messages import REFUSAL, DeviceInfo, DeviceStatus, Refusal, Request
from tablegen.link.program_image import ProgramImage
from tablegen.verification.verilog.simulate import CompiledDesign, Design, compile_design

EXAMPLE = REPOSITORY / "examples" / "firmware" / "soft_core"
CORE = Path(pythondata_cpu_vexriscv.data_location) / "VexRiscv_Lite.v"
UPDATE_RATE_HZ = 50_000
FIRMWARE = "firmware.mem"
Z_LINES, APART = "z_lines.log", "apart.log"  # what the bench writes of z
CLOCKS_PER_BIT = 8
BAUD = 300  # the least, by which a client reckons its time-outs; a simulation has no rate of its own
STEP = 5_000  # clocks between two looks at what has come
MOST_STEPS = 2_000
START_LINES = 12  # lines in which the firmware starts, and the guard reaches the park codes


def refusal(answer: Frame) -> tuple[int, int]:
    """Return the reason and the detail of a refusal."""
    assert answer.type == REFUSAL
    unpacked = Refusal.unpack(answer.payload)
    return unpacked.reason, unpacked.detail


@dataclass
class Host:
    """Requests, one after the other, each until it is answered."""

    simulation: Simulation
    talk: Talk
    line_clocks: int

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
        """Return the state of the device."""
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

    def commit_at(self, image: ProgramImage, mode: CommitMode) -> Frame:
        """Commit what was sent with a mode; the answer."""
        payload = struct.pack("<IB", image.info.image_crc, mode)
        return self.ask(self.talk.acting(Request.COMMIT, payload))

    def read_back(self, length: int) -> bytes:
        """Return the first bytes of the image that plays."""
        data = b""
        while len(data) < length:
            wire = self.talk.request(Request.READBACK, struct.pack("<IB", len(data), min(length - len(data), 240)))
            data += self.ask(wire).payload[4:]
        return data

    def play(self, lines: int) -> None:
        """Let so many lines go by."""
        self.simulation.run(self.line_clocks * lines)


@dataclass(frozen=True)
class Device:
    """The device with the firmware of a scan in a bench: a tick takes ``clocks``, a line of the scan ``ticks``."""

    compiled: CompiledDesign
    scan: Path
    clocks: int
    ticks: int
    z: bool = False

    def host(self, simulation: Simulation) -> Host:
        """Return a host once the firmware has started."""
        simulation.run(START_LINES * self.line_clocks)
        return Host(simulation, Talk(), self.line_clocks)

    @property
    def line_clocks(self) -> int:
        """The clocks of a line."""
        return self.clocks * self.ticks

    @contextmanager
    def edited(self, folder: Path, name: str, right: str, wrong: str) -> Iterator[Host]:
        """Run the device with an edited file of its firmware."""
        copy = folder / "firmware"
        shutil.copytree(EXAMPLE.parent, copy, ignore=shutil.ignore_patterns("build"))
        source = copy / "soft_core" / name
        text = source.read_text("utf-8")
        assert text.count(right) == 1
        source.write_text(text.replace(right, wrong), "utf-8")
        firmware = compiled_firmware(folder / "build", copy / "soft_core", self.scan, self.clocks, self.z)
        usual = (self.compiled.folder / FIRMWARE).read_bytes()
        shutil.copy(firmware, self.compiled.folder)
        try:
            with Simulation(self.compiled) as simulation:
                yield self.host(simulation)
        finally:
            (self.compiled.folder / FIRMWARE).write_bytes(usual)


def compiled_firmware(folder: Path, example: Path, scan: Path, clocks: int, z: bool = False) -> Path:
    """Compile the firmware of a scan with the Makefile of the example, and return the content of its RAM."""
    command = ["make", "-C", example, f"SCAN={scan}", f"BUILD={folder}", f"TABLEGEN={sys.executable} -m tablegen"]
    clock = [f"CLOCK_HZ={UPDATE_RATE_HZ * clocks}", f"CLOCKS_PER_TICK={clocks}"]
    run_warned([*command, *clock, *([] if z else ["MOVE=1"])])
    return folder / FIRMWARE


def compiled_device(folder: Path, scan: Path, clocks: int, ticks: int, of_z: Sequence[Path] = ()) -> Device:
    """Compile the device with the firmware of a scan in its bench; ``of_z`` are the sources of z, if it has that."""
    firmware = compiled_firmware(folder / "firmware", EXAMPLE, scan, clocks, bool(of_z))
    runtime = resource_folder("firmware_templates") / "verilog"
    parts = [path for name in ("bus", "slow") for path in sorted((runtime / name).glob("dac_*.v"))]
    sources = [BENCHES / "soft_core_bench.v", LINE_LOG, EXAMPLE / "soft_core.v", CORE, *of_z, *parts]
    sources += [path for path in verilog_runtime() if path.name != "program_loader.v"]
    values: dict[str, int | str] = {"FIRMWARE": FIRMWARE, "LINES": LINES, "Z_LINES": Z_LINES, "APART": APART}
    values |= {"CLOCKS_PER_TICK": clocks, "CLOCKS_PER_BIT": CLOCKS_PER_BIT}
    design = Design(sources, "soft_core_bench", values, includes=[firmware.parent])
    compiled = compile_design("verilator", design, folder / "model")
    shutil.copy(firmware, compiled.folder)
    return Device(compiled, scan, clocks, ticks, bool(of_z))
