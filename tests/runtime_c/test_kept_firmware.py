"""Kept programs in the reference firmware, in QEMU: the command line saves, chooses and tries scans over resets."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest
from building import REMOVED, REPOSITORY, VARIANTS, Variant, run_warned, write_variant
from limits import PATIENCE_S
from link_qemu import LinkMachine

from tablegen.config.load import load
from tablegen.link.prepare import PreparedScan
from tablegen.planning.line_plan import make_plan

pytestmark = pytest.mark.rest

SCAN = {
    **VARIANTS["short_frame"].scan,
    "limits": REMOVED,
    "dac.update_rate_hz": 20e3,  # that of the firmware's timer
    "timing": {"pixels": 50, "lines": 8, "line_rate_hz": 60.0, "ticks_per_line": 331},
    "x.table.length": 256,
    "y.table.length": 128,
}
SIZES_NM = (40.0, 30.0)
_PATIENT = ("--timeout", str(PATIENCE_S))


def _tablegen(machine: LinkMachine, *arguments: str | Path) -> str:
    """The output of a command that works."""
    done = subprocess.run(
        [sys.executable, "-m", "tablegen", *map(str, arguments), "--port", machine.url],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=PATIENCE_S,
    )
    assert done.returncode == 0, done.stdout
    return done.stdout


def _status(machine: LinkMachine) -> tuple[int, str]:
    """Boot count and hash of what plays, of a device that has a program."""
    until = time.monotonic() + PATIENCE_S
    while True:
        status = json.loads(_tablegen(machine, "status", "--json"))["status"]
        if status["hash"] is not None:
            return status["boot"], status["hash"]
        assert time.monotonic() < until, "the device has no program"


def _after_reset(machine: LinkMachine) -> str:
    """The hash of what plays after a reset."""
    before, _ = _status(machine)
    machine.reset()
    until = time.monotonic() + PATIENCE_S
    while (now := _status(machine))[0] == before:
        assert time.monotonic() < until, "the device was not reset"
    return now[1]


def _plays(machine: LinkMachine, digest: str) -> None:
    """Wait until a program plays."""
    until = time.monotonic() + PATIENCE_S
    while _status(machine)[1] != digest:
        assert time.monotonic() < until, "the program does not play"


def test_a_button_and_a_host_play_compiled_and_kept_programs(tmp_path: Path) -> None:
    """Of three compiled ones one is too large: its first line would jump, which the checks of an upload find."""
    boot = write_variant(tmp_path / "boot", Variant(SCAN))
    sizes = ("--set", "x.size_nm=30,40,1000")
    run_warned([sys.executable, "-m", "tablegen", "sweep", boot, *sizes, "-o", tmp_path / "library"])
    entries = json.loads((tmp_path / "library" / "library.json").read_text())["programs"]
    small, middle = (entry["hash"] for entry in entries[:2])
    kept_file = write_variant(tmp_path / "kept", Variant({**SCAN, "x.size_nm": 20.0}))
    kept = PreparedScan.of_plan(make_plan(load(kept_file))).digest
    target = tmp_path / "firmware"
    run_warned(
        ["make", "-C", REPOSITORY / "examples" / "firmware" / "cortex_m", "BOARD=lm3s6965evb", f"SCAN={boot}",
         f"BUILD={target}", f"TABLEGEN={sys.executable} -m tablegen", "CONTROL=link", "DAC=lines", "STORE=1",
         f"LIBRARY={tmp_path / 'library'}", "CFLAGS=-O2 -DLINK_MAX_JUMP=20000"]
    )  # fmt: skip
    with LinkMachine("lm3s6965evb", target / "firmware.elf") as machine:
        _status(machine)
        _tablegen(machine, "upload", kept_file, "--store", "1", *_PATIENT)
        machine.press_up()  # QEMU reads it as pressed until it was released
        _plays(machine, kept)
        machine.press_up()
        _plays(machine, small)
        _tablegen(machine, "trigger")
        machine.press_up()
        _plays(machine, middle)
        machine.press_up()
        _plays(machine, middle)
        machine.press_up()
        _plays(machine, kept)
        _tablegen(machine, "readback", kept_file, *_PATIENT)
        programs = json.loads(_tablegen(machine, "slots", "--json"))["programs"]
        assert [(each["number"], each["name"], each["hash"]) for each in programs] == [
            *((entry["number"], entry["name"], entry["hash"]) for entry in entries),
            (len(entries) + 1, None, kept),
        ]
        assert small[:12] in _tablegen(machine, "play", entries[0]["name"], *_PATIENT)
        assert kept[:12] in _tablegen(machine, "play", str(len(entries) + 1), *_PATIENT)


@pytest.mark.parametrize(("board", "name"), [("lm3s6965evb", "lm3s6965evb"), ("mps2_an386", "mps2-an386")])
def test_scans_are_kept_over_resets(board: str, name: str, tmp_path: Path) -> None:
    files = [write_variant(tmp_path / "boot", Variant(SCAN))]
    files += [write_variant(tmp_path / f"{size}", Variant({**SCAN, "x.size_nm": size})) for size in SIZES_NM]
    boot, first, second = (PreparedScan.of_plan(make_plan(load(file))).digest for file in files)
    target = tmp_path / "firmware"
    run_warned(
        ["make", "-C", REPOSITORY / "examples" / "firmware" / "cortex_m", f"BOARD={board}", f"SCAN={files[0]}",
         f"BUILD={target}", f"TABLEGEN={sys.executable} -m tablegen", "CONTROL=link", "DAC=lines", "STORE=1"]
    )  # fmt: skip
    with LinkMachine(name, target / "firmware.elf") as machine:
        assert _after_reset(machine) == boot
        _tablegen(machine, "trigger")
        kept = _tablegen(machine, "upload", files[1], "--as", "fourier", "--store", "1", *_PATIENT)
        assert f"slot 1 keeps {first[:12]}" in kept
        _tablegen(machine, "select", "1")
        assert _after_reset(machine) == first
        _tablegen(machine, "readback", files[1], *_PATIENT)
        _tablegen(machine, "trigger")
        _tablegen(machine, "upload", files[2], "--store", "0", *_PATIENT)
        _tablegen(machine, "select", "0", "--trial")
        assert [_after_reset(machine) for _ in range(2)] == [second, first]
        _tablegen(machine, "select", "0", "--trial")
        assert _after_reset(machine) == second
        assert _tablegen(machine, "confirm") == "slot 0 plays after a start\n"
        assert _after_reset(machine) == second
        _tablegen(machine, "delete", "0")
        assert _after_reset(machine) == boot
