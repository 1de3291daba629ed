"""``examples/firmware/soft_core`` whole: firmware on VexRiscv, its bus, the sequencer; from bytes on its line.

Every line that is played is the model's, before and after an upload.
"""

import json
import struct
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import pytest
from boards import TICKS, Board, ecp5_library, expected_words, make
from building import NAME, REMOVED, Build, Variant, build, write_variant
from limits import PATIENCE_S
from line_log import LineCheck, PlayedLine, WrongLine
from link_talk import is_answer
from loader_bridge import Simulation
from replacing import replace
from soft_core_device import (
    BAUD,
    CLOCKS_PER_BIT,
    EXAMPLE,
    START_LINES,
    STEP,
    UPDATE_RATE_HZ,
    Device,
    Host,
    compiled_device,
    refusal,
)  # fmt: skip
from tilted_scans import write_straight
from turned_scans import write_turned

from tablegen.config.load import load
from tablegen.device.commit_mode import CommitMode
from tablegen.link.errors import Unsuitable
from tablegen.link.messages import (
    AxisWords,
    DeviceState,
    Feature,
    More,
    Move,
    Reason,
    Request,
    Upload,
)
from tablegen.link.prepare import PreparedScan, check
from tablegen.link.program_image import ProgramImage, make_image
from tablegen.planning.line_plan import make_plan
from tablegen.planning.turned_plan import make_turned_plan

pytestmark = pytest.mark.rest

CLOCKS_PER_TICK = 50
LINE = 331  # ticks
SCAN: dict[str, object] = {
    "limits": REMOVED,
    "timing": {"pixels": 40, "lines": 8, "line_rate_hz": 100.0, "ticks_per_line": LINE, "settle_lines": 1},
    "dac.update_rate_hz": float(UPDATE_RATE_HZ),
    "x.band_limit.harmonics": 16,
    "y.band_limit.harmonics": 8,
    "x.table.length": 64,
    "y.table.length": 32,
}
UNDERRUN = 8  # a bit of the faults
BAD_TABLE = 4  # DAC_BAD_TABLE of dac_sequencer.h
MOST_FRAMES = 65_535  # of the register
ULX3S = Board("ulx3s", clocks_per_tick=50, clocks_per_bit=217, limit=3_000_000)
ON_A_BOARD: dict[str, object] = {
    "limits": REMOVED,
    "x.band_limit.harmonics": 5,
    "y.band_limit.harmonics": 5,
    "x.table.length": 64,
    "y.table.length": 32,
}
SLOW_LINE = 40_000  # ticks: a program waits long for the next one
SLOW = {"timing.ticks_per_line": SLOW_LINE, "timing.line_rate_hz": UPDATE_RATE_HZ / SLOW_LINE}
SHORT_TABLE = {"x.table.length": 32, "x.band_limit.harmonics": 8}


@dataclass(frozen=True, eq=False)
class Scans:
    """What the device begins with, and others: with slow lines, and with a shorter table."""

    boot: Build
    first: Build
    second: Build
    slow: Build
    shorter: Build

    @property
    def scan(self) -> Path:
        """The file that the firmware is built from."""
        return self.boot.folder.parent / f"{NAME}.toml"

    def check(self, simulation: Simulation) -> LineCheck:
        """Hold the log against the model. Raises ``WrongLine``."""
        check = LineCheck(self.boot.plan.program)
        for name in ("first", "second", "slow"):
            check.offer(name, getattr(self, name).plan.program)
        check.follow(PlayedLine.parse(line) for line in simulation.lines())
        return check


def scan_of(size_nm: float, **more: object) -> Variant:
    return Variant({**SCAN, "x.size_nm": size_nm, "y.size_nm": size_nm, **more})


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> Scans:
    folder = tmp_path_factory.mktemp("scans")
    variants = scan_of(200.0), scan_of(150.0), scan_of(90.0), scan_of(150.0, **SLOW), scan_of(90.0, **SHORT_TABLE)
    return Scans(*(build(folder / str(at), variant) for at, variant in enumerate(variants)))


@pytest.fixture(scope="module")
def device(scans: Scans, tmp_path_factory: pytest.TempPathFactory) -> Device:
    """The device with its firmware in a bench."""
    return compiled_device(tmp_path_factory.mktemp("device"), scans.scan, CLOCKS_PER_TICK, LINE)


@pytest.fixture
def simulation(device: Device) -> Iterator[Simulation]:
    with Simulation(device.compiled) as running:
        yield running


@pytest.fixture
def host(device: Device, simulation: Simulation) -> Host:
    return device.host(simulation)


def image_of(built: Build, fourier: bool = False) -> ProgramImage:
    digest = str(built.manifest["hash"])
    words = [line.fourier.in_order for line in built.plan.lines] if fourier else []
    return make_image(built.plan.program, digest, *words)


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


def test_faults_are_those_of_the_sequencer(host: Host) -> None:
    host.start()
    host.simulation.set(underrun=1)
    host.play(1)
    host.simulation.set(underrun=0)
    now = host.status()
    assert now.faults == UNDERRUN
    assert now.fault_counts[:3] == (0, 0, 0)
    assert now.fault_counts[3] >= LINE
    assert is_answer(host.ask(host.talk.acting(Request.CLEAR)), Request.CLEAR)
    host.play(1)
    now = host.status()
    assert (now.faults, now.fault_counts) == (0, (0, 0, 0, 0))


def test_uploads_while_a_scan_plays(host: Host, scans: Scans) -> None:
    host.start()
    for generation, (built, fourier) in enumerate([(scans.first, False), (scans.second, True)], 2):
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
    assert check.taken == {1: "boot", 2: "first", 3: "second"}
    assert check.lines > 12

    # Negative control: one line, as if a tick of it had been another.
    log = [PlayedLine.parse(line) for line in host.simulation.lines()]
    log[5] = replace(log[5], crc=log[5].crc ^ 1)
    with pytest.raises(WrongLine):
        LineCheck(scans.boot.plan.program).follow(log)


def test_a_frame_goes_on(host: Host, scans: Scans) -> None:
    """With a program of the same lines, and with a move of the one that plays; with another one it is refused."""
    info = host.start()
    assert info.features & Feature.COMMIT_MODES
    assert info.more & More.MOVE
    slow, image, plan = image_of(scans.slow), image_of(scans.first), scans.first.plan
    host.send(slow)
    assert refusal(host.commit_at(slow, CommitMode.KEEP)) == (Reason.KEEP, 0)
    host.send(image)
    taken = [struct.unpack("<II", host.commit_at(image, CommitMode.KEEP).payload)]
    host.play(2)
    moved = replace(
        plan.x.program.output, offset_word=plan.x.program.output.offset_word + (300 << plan.x.program.output.gain_q)
    )
    outputs = moved, plan.y.program.output
    words = [AxisWords(output.gain_word, output.offset_word) for output in outputs]
    answer = host.ask(host.talk.acting(Request.MOVE, Move(taken[0][0], *words).pack()))
    assert is_answer(answer, Request.MOVE)
    taken.append(struct.unpack("<II", answer.payload[:8]))
    host.play(3)
    assert [generation for generation, _ in taken] == [2, 3]
    log = [PlayedLine.parse(line) for line in host.simulation.lines()]
    swaps = [(before, after) for before, after in pairwise(log) if after.generation != before.generation]
    assert [(after.generation, after.line) for _, after in swaps] == [
        (generation, (before.line + 1) % 8) for generation, (before, _) in zip((2, 3), swaps, strict=True)
    ]
    assert any(after.line for _, after in swaps), "a frame that goes on, and does not begin"
    # The last whole line is one of the moved program.
    program = replace(plan.program, x=replace(plan.program.x, output=moved))
    last = next(played for played in reversed(log) if played.ticks == LINE)
    assert last.generation == 3
    line = LineCheck(program).steady(program, last.line, settled=True)
    assert line.sum(LINE) == (last.crc, last.markers)


def test_a_core_without_z_refuses_it(host: Host, tmp_path: Path) -> None:
    """The client before it sends anything, and the device."""
    info = host.start()
    tilted = PreparedScan.of_plan(make_plan(load(write_straight(tmp_path))))
    image = tilted.image("table")
    with pytest.raises(Unsuitable, match="the scan has the output z, and the device has none"):
        check(tilted, image, info, (info.x_limits, info.y_limits), any_rate=True)
    assert refusal(host.send(image)) == (Reason.PAYLOAD, 0)


def damaged(image: ProgramImage) -> ProgramImage:
    """The image with a bit of its last word changed, and the CRC of what it was."""
    data = bytearray(image.data)
    data[-1] ^= 1
    return replace(image, data=bytes(data))


def test_what_is_refused_leaves_the_scan_alone(host: Host, scans: Scans, tmp_path: Path) -> None:
    """Scans at an angle; a damaged image; one for other tables, which the hardware does not have; an open interlock."""
    info = host.start()
    turned = PreparedScan.of_turned(make_turned_plan(load(write_turned(tmp_path, 30.0, "timing.lines = 16"))))
    with pytest.raises(Unsuitable, match="one table for each axis alone"):
        check(turned, turned.image("table"), info, (info.x_limits, info.y_limits), any_rate=True)
    assert refusal(host.send(turned.image("table"))) == (Reason.SHAPE, 0)
    whole = image_of(scans.first)
    image = damaged(whole)
    assert is_answer(host.send(image), Request.DATA)
    assert refusal(host.ask(host.talk.commit(image))) == (Reason.IMAGE, 0)
    shorter = image_of(scans.shorter)
    assert is_answer(host.send(shorter), Request.DATA)
    assert refusal(host.ask(host.talk.commit(shorter))) == (Reason.REFUSED, BAD_TABLE)
    host.simulation.set(permit=0)
    assert is_answer(host.send(whole), Request.DATA)
    assert refusal(host.ask(host.talk.commit(whole))) == (Reason.INTERLOCK, 0)
    assert refusal(host.ask(host.talk.acting(Request.ARM, struct.pack("<I", MOST_FRAMES + 1)))) == (Reason.TICKS, 0)
    host.play(2)
    now = host.status()
    assert (now.state, now.generation, now.faults, now.permits) == (DeviceState.PLAYING, 1, 0, False)
    assert scans.check(host.simulation).taken == {1: "boot"}

    host.simulation.set(permit=1)
    host.play(1)
    assert is_answer(host.ask(host.talk.commit(whole)), Request.COMMIT)  # the upload has stayed
    host.play(2)
    assert scans.check(host.simulation).taken == {1: "boot", 2: "first"}


def test_a_program_that_waits_is_withdrawn(host: Host, scans: Scans) -> None:
    host.start()
    slow, second = image_of(scans.slow), image_of(scans.second)
    host.send(slow)
    assert is_answer(host.ask(host.talk.commit(slow)), Request.COMMIT)
    host.send(second)
    wire = host.talk.commit(second)
    host.simulation.run(len(wire) * 10 * CLOCKS_PER_BIT + STEP, wire)
    while (upload := host.status().upload) is Upload.CHECKING:
        pass
    assert upload is Upload.WAITING
    wire = host.talk.acting(Request.ABORT)
    received = host.simulation.run(len(wire) * 10 * CLOCKS_PER_BIT + 50 * STEP, wire)
    first, then = host.talk.answers(received)
    assert refusal(first) == (Reason.WITHDRAWN, 0)
    assert is_answer(then, Request.ABORT)
    assert struct.unpack("<I", then.payload) == (2,)
    now = host.status()
    assert (now.upload, now.generation, now.faults) == (Upload.NONE, 2, 0)
    assert is_answer(host.ask(host.talk.acting(Request.PARK)), Request.PARK)
    host.play(10)

    # The bank is free again.
    host.send(second)
    assert is_answer(host.ask(host.talk.commit(second)), Request.COMMIT)
    assert is_answer(host.ask(host.talk.acting(Request.ARM, struct.pack("<I", 1))), Request.ARM)
    assert is_answer(host.ask(host.talk.acting(Request.TRIGGER)), Request.TRIGGER)
    host.play(20)
    now = host.status()
    assert (now.state, now.generation, now.faults) == (DeviceState.PARKED, 3, 0)
    assert scans.check(host.simulation).taken == {1: "boot", 2: "slow", 3: "second"}


def command(*arguments: str | Path | int) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "tablegen", *map(str, arguments)],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        timeout=PATIENCE_S,
    )


def test_the_command_line(simulation: Simulation, scans: Scans) -> None:
    simulation.run(START_LINES * CLOCKS_PER_TICK * LINE)
    with simulation.bridged() as port:
        where = ("--port", port, "--baud", BAUD)
        steps: list[tuple[str | Path | int, ...]] = [
            ("trigger", *where),
            ("upload", scans.first.folder, *where),
            ("readback", scans.first.folder, *where),
            ("status", *where, "--json"),
            ("park", *where),
        ]
        done = [command(*step) for step in steps]
        for step, each in zip(steps, done, strict=True):
            assert each.returncode == 0, (step, each.stdout, each.stderr)
        assert json.loads(done[3].stdout)
    assert scans.check(simulation).taken == {1: "boot", 2: "first"}


def test_the_interlock_stops_what_the_firmware_would_commit(device: Device, scans: Scans, tmp_path: Path) -> None:
    right = "(SYSTEM_STATE & STATE_PERMIT) != 0"
    with device.edited(tmp_path, "main.c", right, "true") as host:
        host.start()
        host.simulation.set(permit=0)
        image = image_of(scans.first)
        host.send(image)
        assert refusal(host.ask(host.talk.commit(image))) == (Reason.TICKS, 0)
        host.play(2)
        now = host.status()
        assert (now.state, now.generation, now.faults) == (DeviceState.PLAYING, 1, 0)
        host.simulation.set(permit=1)
        host.play(2)
        assert is_answer(host.ask(host.talk.commit(image)), Request.COMMIT)
        host.play(2)
        assert scans.check(host.simulation).taken == {1: "boot", 2: "first"}


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_the_cells_play_the_model_once_they_are_triggered(tmp_path: Path) -> None:
    """The cells that yosys makes of the device on a ULX3S, from bytes on the line to the pins of the converters."""
    scan = write_variant(tmp_path / "scan", Variant(ON_A_BOARD))
    target, folder = tmp_path / "build", tmp_path / "cells"
    folder.mkdir()
    make(EXAMPLE, f"{target}/ulx3s.json", f"BUILD={target}", f"PYTHON={sys.executable}", f"SCAN={scan}")
    cells = ULX3S.simulator(target / "ulx3s.json", folder, *ecp5_library(folder))
    fault, answers, words = ULX3S.played(cells)
    assert all(is_answer(*pair) for pair in zip(answers, (Request.HELLO, Request.ARM, Request.TRIGGER), strict=False))
    assert not fault
    assert len(answers) >= 2
    assert all(len(each) >= TICKS - 2 for each in words)
    whole = expected_words(make_plan(load(scan)).program)
    assert words == [each[: len(words[0])] for each in whole]


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_the_bitstream_is_made(tmp_path: Path) -> None:
    """It is placed in time for the clock of the board, or nextpnr ends with an error."""
    make(EXAMPLE, "bitstream", f"BUILD={tmp_path}", f"PYTHON={sys.executable}")
    assert (tmp_path / "ulx3s.bit").stat().st_size > 100_000


def test_words_in_another_order_are_heard(device: Device, scans: Scans, tmp_path: Path) -> None:
    """A control: firmware that writes each second word of a table in front of the first."""
    right = "SEQUENCER(offset + 4 * i) = (uint32_t)p->table[i];"
    wrong = right.replace("[i]", "[i ^ 1]")
    with device.edited(tmp_path, "sequencer_registers.c", right, wrong) as host:
        host.start()
        with pytest.raises(WrongLine):
            scans.check(host.simulation)
