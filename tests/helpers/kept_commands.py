"""Commands about kept programs to firmware in QEMU, and scans for it."""

import json
import time
from pathlib import Path

from building import REMOVED, VARIANTS
from editing import run
from limits import PATIENCE_S
from link_qemu import LinkMachine

SCAN = {
    **VARIANTS["short_frame"].scan,
    "limits": REMOVED,
    "dac.update_rate_hz": 20e3,  # that of the firmware's timer
    "timing": {"pixels": 50, "lines": 8, "line_rate_hz": 60.0, "ticks_per_line": 331},
    "x.table.length": 256,
    "y.table.length": 128,
}
SIZES_NM = (40.0, 30.0)
PATIENT = ("--timeout", str(PATIENCE_S))


def command(machine: LinkMachine, *arguments: str | Path) -> str:
    """All that a command says that works; it runs in this process, since to start one takes longer than most do."""
    outcome = run(*arguments, "--port", machine.url)
    assert outcome.status == 0, outcome.err
    return outcome.out + outcome.err


def status(machine: LinkMachine) -> tuple[int, str]:
    """Boot count and hash of what plays, of a device that has a program."""
    until = time.monotonic() + PATIENCE_S
    while True:
        now = json.loads(command(machine, "status", "--json"))["status"]
        if now["hash"] is not None:
            return now["boot"], now["hash"]
        assert time.monotonic() < until, "the device has no program"


def after_reset(machine: LinkMachine) -> str:
    """The hash of what plays after a reset."""
    before, _ = status(machine)
    machine.reset()
    until = time.monotonic() + PATIENCE_S
    while (now := status(machine))[0] == before:
        assert time.monotonic() < until, "the device was not reset"
    return now[1]


def plays(machine: LinkMachine, digest: str) -> None:
    """Wait until a program plays."""
    until = time.monotonic() + PATIENCE_S
    while status(machine)[1] != digest:
        assert time.monotonic() < until, "the program does not play"
