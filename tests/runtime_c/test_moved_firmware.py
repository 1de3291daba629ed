"""MOVE in the reference firmware in QEMU: random moves of a scan, and every line that it plays meanwhile."""

import sys
from pathlib import Path

import numpy as np
import pytest
from building import REPOSITORY, Variant, run_warned, write_variant
from emulation import Pl011Board
from limits import PATIENCE_S
from link_qemu import LinkMachine
from moved_scans import MovedLines, moved, random_words
from sets import LONG_TEST
from test_link_firmware import SCAN
from turned_scans import write_turned

from tablegen.config.load import load
from tablegen.link.device import Device
from tablegen.link.errors import Refused
from tablegen.link.messages import DeviceState, More
from tablegen.link.prepare import PreparedScan
from tablegen.planning.line_plan import make_plan
from tablegen.planning.turned_plan import make_turned_plan

pytestmark = pytest.mark.rest


TURNED = (
    "dac.update_rate_hz = 20e3", "timing.ticks_per_line = 331", "timing.line_rate_hz = 60", "timing.pixels = 50",
    "timing.lines = 12", "x.band_limit.harmonics = 12", "y.band_limit.harmonics = 8",
)  # fmt: skip


def _scans(folder: Path, turned: bool) -> tuple[Path, PreparedScan]:
    """A scan that the firmware is built from, and one to upload, straight or at an angle."""
    boot, other = folder / "boot", folder / "other"
    if not turned:
        file = write_variant(boot, Variant(SCAN))
        plan = make_plan(load(write_variant(other, Variant({**SCAN, "x.size_nm": 40.0}))))
        return file, PreparedScan.of_plan(plan)
    boot.mkdir()
    other.mkdir()
    file = write_turned(boot, 30.0, *TURNED, size_nm=100.0)
    return file, PreparedScan.of_turned(make_turned_plan(load(write_turned(other, 60.0, *TURNED, size_nm=100.0))))


@pytest.mark.parametrize("turned", [False, True], ids=["straight", "at an angle"])
@pytest.mark.parametrize("moves", [30, pytest.param(2000, marks=LONG_TEST)])
def test_random_moves_in_qemu(moves: int, turned: bool, tmp_path: Path) -> None:
    file, scan = _scans(tmp_path, turned)
    target = tmp_path / "firmware"
    run_warned(
        ["make", "-C", REPOSITORY / "examples" / "firmware" / "cortex_m", f"BOARD={Pl011Board.name}", f"SCAN={file}",
         f"BUILD={target}", f"TABLEGEN={sys.executable} -m tablegen", "CONTROL=link", "DAC=lines", "MOVE=1"]
    )  # fmt: skip
    rng, taken = np.random.default_rng(1), 0
    with (
        LinkMachine(Pl011Board.machine, target / "firmware.elf") as machine,
        Device(machine.url, timeout_s=PATIENCE_S) as device,
    ):
        device.wait_for(DeviceState.PARKED, PATIENCE_S)
        assert (More.SLOW_MOVE in device.info.more) == turned
        generation = device.upload(scan.image("auto", device.info), timeout_s=PATIENCE_S).generation
        device.wait_for(DeviceState.PARKED, PATIENCE_S)
        machine.lines()
        check = MovedLines(scan.program, generation)
        device.arm()
        device.trigger()
        for _ in range(moves):
            words = [random_words(rng, axis) for axis in (scan.program.x, scan.program.y)]
            check.offer(generation + 1, moved(scan.program, *words))
            try:
                generation = device.move(words[0], words[1], generation, PATIENCE_S).generation
                taken += 1
            except Refused:
                pass
            check.follow(machine.lines())
        machine.wait_for(lambda line: line.generation == generation, check.follow)
        status = device.status()
    assert taken > moves // 4
    assert (status.generation, status.faults, status.moved) == (generation, 0, True)
    assert check.generation == generation
    assert check.lines >= taken  # one a move where moves come as fast as lines
