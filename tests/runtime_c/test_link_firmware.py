"""Uploads into the reference firmware: by the command line into QEMU, and in process under unicorn.

The firmware logs the CRC of every line that it played; each of them has to be one of the model.
"""

import json
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from random import Random

import numpy as np
import pytest
from building import REMOVED, REPOSITORY, VARIANTS, Variant, run_warned, write_variant
from editing import run
from emulation import CmsdkBoard, Firmware, Pl011Board
from limits import PATIENCE_S
from line_log import LineCheck, PlayedLine
from link_faults import MIXED, Chances
from link_line import Line
from link_proxy import FaultProxy
from link_qemu import LinkMachine
from replacing import replace
from sets import LONG_TEST

from tablegen.config.load import load
from tablegen.config.variants import variants
from tablegen.link.device import Device
from tablegen.link.errors import LinkError, NotPlaying, Refused
from tablegen.link.prepare import PreparedScan
from tablegen.planning.line_plan import make_plan
from tablegen.verification.play.stream import FLAGS

pytestmark = pytest.mark.rest

SCAN = {
    **VARIANTS["short_frame"].scan,
    "limits": REMOVED,
    "dac.update_rate_hz": 20e3,  # that of the firmware's timer
    "timing": {"pixels": 50, "lines": 8, "line_rate_hz": 60.0, "ticks_per_line": 331},
    "x.table.length": 256,
    "y.table.length": 128,
}
SIZES_NM = (40.0, 30.0)  # of the scans that are uploaded into one of 50 nm
_INSTRUCTIONS = 700  # between two samples, beside interrupts
_PATIENT = ("--timeout", str(PATIENCE_S))
Board = type[Pl011Board | CmsdkBoard]


@dataclass(frozen=True)
class Built:
    """Firmware with a scan of 50 nm, and smaller ones to be uploaded: their files, and what they play."""

    executable: Path
    boot: PreparedScan
    files: list[Path]
    scans: list[PreparedScan]

    def check(self) -> LineCheck:
        """Of what a device with this firmware plays."""
        check = LineCheck(self.boot.program)
        for scan in self.scans:
            check.offer(scan.digest, scan.program)
        return check


def _built(folder: Path, board: Board) -> Built:
    files = [write_variant(folder / "boot", Variant(SCAN))]
    files += [write_variant(folder / f"{size}", Variant({**SCAN, "x.size_nm": size})) for size in SIZES_NM]
    target = folder / "firmware"
    run_warned(
        ["make", "-C", REPOSITORY / "examples" / "firmware" / "cortex_m", f"BOARD={board.name}", f"SCAN={files[0]}",
         f"BUILD={target}", f"TABLEGEN={sys.executable} -m tablegen", "CONTROL=link", "DAC=lines"]
    )  # fmt: skip
    boot, *scans = [PreparedScan.of_plan(make_plan(load(file))) for file in files]
    return Built(target / "firmware.elf", boot, files[1:], scans)


@pytest.fixture(scope="module")
def build_for(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Board], Built]:
    """Firmware for a board, made once."""
    made: dict[Board, Built] = {}

    def build(board: Board) -> Built:
        if board not in made:
            made[board] = _built(tmp_path_factory.mktemp(board.name), board)
        return made[board]

    return build


def _tablegen(*arguments: str | Path) -> tuple[int, str]:
    """A command in this process; its status, and all that it said."""
    outcome = run(*arguments)
    return outcome.status, outcome.out + outcome.err


def _works(*arguments: str | Path) -> str:
    status, said = _tablegen(*arguments)
    assert status == 0, said
    return said


def _play(machine: LinkMachine, check: LineCheck, digest: str) -> None:
    """Until a line of it was played."""
    machine.wait_for(lambda line: check.taken.get(line.generation) == digest, check.follow)


@pytest.mark.parametrize(
    ("board", "pty"),
    [
        (Pl011Board, True),
        (CmsdkBoard, False),
        pytest.param(Pl011Board, False, marks=LONG_TEST),
        pytest.param(CmsdkBoard, True, marks=LONG_TEST),
    ],
)
def test_the_command_line_and_firmware_in_qemu(build_for: Callable[[Board], Built], board: Board, pty: bool) -> None:
    built = build_for(board)
    check = built.check()
    with LinkMachine(board.machine, built.executable, pty) as machine:
        port = ("--port", machine.url)
        assert built.boot.digest[:8] in _works("status", *port)
        _works("trigger", *port)
        for form, file, scan in zip(("table", "fourier"), built.files, built.scans, strict=True):
            assert "is active" in _works("upload", file, *port, "--as", form, *_PATIENT)
            _play(machine, check, scan.digest)
        _works("readback", built.files[1], *port, *_PATIENT)
        _works("park", *port, "--wait", *_PATIENT)
        check.follow(machine.lines())
    assert sorted(check.taken.values()) == sorted([LineCheck.BOOT, *(scan.digest for scan in built.scans)])


def test_a_swap_in_qemu_keeps_the_frame_or_waits_for_the_next(build_for: Callable[[Board], Built]) -> None:
    """No line is left out or played twice, and the new scan is that of the model from its settled lines on."""
    built = build_for(CmsdkBoard)
    lines = built.boot.program.schedule.lines
    played: list[PlayedLine] = []
    with LinkMachine(CmsdkBoard.machine, built.executable) as machine:
        port = ("--port", machine.url)
        _works("trigger", *port)
        for number, (swap, file) in enumerate(zip(("keep", "frame"), built.files, strict=True), start=2):
            _works("upload", file, *port, "--swap", swap, *_PATIENT)
            machine.wait_for(_line_of(number, lines - 1), played.extend)
    for before, after in pairwise(played):
        assert after.line == (before.line + 1) % lines
    first = {line.generation: line.line for line in reversed(played)}
    assert (set(first), first[3]) == ({1, 2, 3}, 0)
    for number, scan in enumerate(built.scans, start=2):
        last = [line for line in played if (line.generation, line.line) == (number, lines - 1)][-1]
        ways = [built.check().steady(scan.program, lines - 1, settled) for settled in (True, False)]
        assert (last.crc, last.markers) in [ticks.sum(last.ticks) for ticks in ways]


def test_a_program_moves_the_scan_in_qemu_by_lines_of_json(build_for: Callable[[Board], Built]) -> None:
    """The frame goes on at each move, and what plays then is the scan of the file at that place."""
    built = build_for(CmsdkBoard)
    lines = built.boot.program.schedule.lines
    played: list[PlayedLine] = []
    with LinkMachine(CmsdkBoard.machine, built.executable) as machine:
        command = [sys.executable, "-m", "tablegen", "live", built.files[0], "--port", machine.url]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as session:
            assert session.stdin is not None
            assert session.stdout is not None
            answers = [json.loads(session.stdout.readline())]
            for distance_nm in (3.0, 3.0, -4.0):
                session.stdin.write(json.dumps({"do": "move", "x_nm": distance_nm}) + "\n")
                session.stdin.flush()
                answers.append(json.loads(session.stdout.readline()))
                assert answers[-1]["ok"], answers[-1]
                machine.wait_for(_line_of(answers[-1]["scan"]["generation"], lines - 1), played.extend)
            session.stdin.close()
            assert session.wait(PATIENCE_S) == 0
    assert [one["scan"]["swap"] for one in answers] == ["frame", "keep", "keep", "keep"]
    first, last = answers[0]["scan"], answers[-1]["scan"]
    assert last["x"]["position_nm"] - first["x"]["position_nm"] == pytest.approx(2.0, abs=1e-6)
    for before, after in pairwise(played):
        assert after.line == (before.line + 1) % lines
    _, (scan,) = variants(built.files[0], {"x.offset_nm": [last["x"]["position_nm"]]})
    plan = make_plan(scan.setup)
    end = [line for line in played if _line_of(last["generation"], lines - 1)(line)][-1]
    ways = [built.check().steady(plan.program, lines - 1, settled) for settled in (True, False)]
    assert (end.crc, end.markers) in [ticks.sum(end.ticks) for ticks in ways]


def _line_of(generation: int, number: int) -> Callable[[PlayedLine], bool]:
    """Return a test for a line of a generation, other than its first one: that begins where the one before was."""
    swapped = 1 << FLAGS.index("swapped")
    return lambda line: (line.generation, line.line) == (generation, number) and not line.markers & swapped


@pytest.mark.parametrize("board", [CmsdkBoard, pytest.param(Pl011Board, marks=LONG_TEST)])
def test_the_command_line_and_qemu_with_faults_in_between(build_for: Callable[[Board], Built], board: Board) -> None:
    """Each command ends well, or says why not; what plays is always a whole scan."""
    built = build_for(board)
    check = built.check()
    chances = replace(MIXED.times(0.7), reset=0.0, vanish=0.01)
    with LinkMachine(board.machine, built.executable) as machine:
        with FaultProxy(machine.port, chances, seed=len(board.name)) as proxy:
            port = ("--port", proxy.url)
            trials: list[tuple[str, ...]] = [("trigger", *port)]
            for form, file in zip(("table", "fourier"), built.files, strict=True):
                trials.append(("upload", str(file), *port, "--as", form, "--timeout", "20"))
            for trial in trials:
                status, said = _tablegen(*trial)
                assert status in (0, 8, 10), said
                assert said.strip()
                check.follow(machine.lines())
            assert proxy.done.total()
        port = ("--port", machine.url)
        _works("trigger", *port)
        _works("upload", built.files[0], *port, "--force", *_PATIENT)
        _play(machine, check, built.scans[0].digest)


def test_a_reset_of_qemu_in_mid_upload(build_for: Callable[[Board], Built]) -> None:
    """The device forgets what it had, the client begins again, and the boot count tells."""
    board = Pl011Board
    built = build_for(board)
    check = built.check()
    image = built.scans[0].image("table")
    with LinkMachine(board.machine, built.executable) as machine, Device(machine.url, timeout_s=PATIENCE_S) as client:
        boot = client.hello.boot
        client.arm()
        client.trigger()
        resets: list[int] = []

        def progress(received: int, size: int) -> None:
            if 2 * received > size and not resets:
                resets.append(received)
                machine.reset()

        with suppress(NotPlaying):  # the reset may come when all was in force
            client.upload(image, progress, timeout_s=PATIENCE_S)
        assert resets
        assert client.upload(image, timeout_s=PATIENCE_S).generation == 2
        check.follow(machine.lines())  # nothing plays after a reset
        check.reboot()
        assert client.status().boot == boot + 1
        client.arm()
        client.trigger()
        _play(machine, check, built.scans[0].digest)


def test_what_was_received_before_a_reset_does_not_deafen_it(build_for: Callable[[Board], Built]) -> None:
    """QEMU's UART keeps its FIFO over a reset, as one does behind a boot loader, and asks only when it begins to fill.

    So a reset of the processor between its acknowledging an interrupt and its reading of what came would be the end.
    """
    board = Pl011Board
    built = build_for(board)
    with LinkMachine(board.machine, built.executable) as machine:
        with Device(machine.url, timeout_s=PATIENCE_S) as client:
            boot = client.hello.boot
        # UARTFR without RXFE, and neither receive interrupt in UARTRIS.
        machine.reset_while_receiving(
            bytes(range(1, 256)), 0x4000C018, 0x4000C03C, lambda flags, raised: not flags & 0x10 and not raised & 0x50
        )
        with Device(machine.url, timeout_s=PATIENCE_S) as client:
            assert client.status().boot == boot + 1


class InProcess:
    """The same firmware under unicorn, as the far end of a line in virtual time; its lines are checked."""

    def __init__(self, board: Pl011Board | CmsdkBoard, built: Built, seed: int) -> None:
        self.check = built.check()
        self._uarts = board.uarts
        self._firmware = Firmware(board, built.executable, np.random.default_rng(seed))
        self._firmware.boot()

    def receive(self, data: bytes) -> None:
        """Into the receiver, a byte for each interrupt."""
        self._uarts.to_console += data

    def transmit(self) -> bytes:
        """What the transmitter has put out."""
        sent = bytes(self._uarts.console)
        self._uarts.console.clear()
        return sent

    def tick(self, ticks: int) -> None:
        """Samples, and the main loop between them."""
        for _ in range(ticks):
            self._firmware.tick(_INSTRUCTIONS)
        whole, end, rest = bytes(self._uarts.log).rpartition(b"\n")
        if end:
            self._uarts.log[:] = rest
            self.check.follow(PlayedLine.parse(line) for line in whole.decode("ascii").splitlines())

    def reboot(self) -> None:
        """There is no reset in this emulation."""
        raise NotImplementedError


_SPOILT = replace(MIXED, reset=0.0)


@pytest.mark.parametrize(
    ("board", "chances"),
    [
        (CmsdkBoard, Chances()),
        (Pl011Board, _SPOILT),
        pytest.param(Pl011Board, Chances(), marks=LONG_TEST),
        pytest.param(CmsdkBoard, _SPOILT, marks=LONG_TEST),
    ],
    ids=["clean", "faults", "clean", "faults"],
)
def test_the_client_and_firmware_in_process(
    build_for: Callable[[Board], Built], board: Board, chances: Chances
) -> None:
    built = build_for(board)
    device = InProcess(board(), built, seed=4)
    line = Line(device, chances=chances, seed=6)
    random = Random(8)
    failed = []
    for number, scan in enumerate(built.scans):
        image = scan.image("fourier" if number % 2 else "table")
        try:
            with Device(line.open, random=random, sleep=line.sleep) as client:
                client.arm()
                client.trigger()
                result = client.upload(image, timeout_s=8.0)
                line.sleep(0.06)
                assert device.check.taken[result.generation] == scan.digest
        except LinkError as error:
            failed.append(error)
            line.sleep(0.5)
    assert not any(isinstance(error, Refused) for error in failed)
    assert not failed or chances.lose, failed
    line.heal()
    line.sleep(0.2)
    with Device(line.open, random=random, sleep=line.sleep) as client:
        assert client.upload(built.scans[0].image("fourier"), timeout_s=8.0, force=True).generation > 1
        assert client.readback()[192:] == built.scans[0].image("table").data[192:]
        assert client.status().faults == 0
