"""Kept programs in the reference firmware, in QEMU: the command line saves, chooses and tries scans over resets.

Their flash is RAM here; ``test_flash_nrf51.py`` has that of a chip.
"""

import json
import sys
from pathlib import Path

import pytest
from building import REPOSITORY, Variant, run_warned, write_variant
from kept_commands import PATIENT, SCAN, SIZES_NM, after_reset, command, plays, status
from link_qemu import LinkMachine

from tablegen.config.load import load
from tablegen.link.prepare import PreparedScan
from tablegen.planning.line_plan import make_plan

pytestmark = pytest.mark.rest


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
        status(machine)
        command(machine, "upload", kept_file, "--store", "1", *PATIENT)
        machine.press_up()  # QEMU reads it as pressed until it was released
        plays(machine, kept)
        machine.press_up()
        plays(machine, small)
        command(machine, "trigger")
        machine.press_up()
        plays(machine, middle)
        machine.press_up()
        plays(machine, middle)
        machine.press_up()
        plays(machine, kept)
        command(machine, "readback", kept_file, *PATIENT)
        programs = json.loads(command(machine, "slots", "--json"))["programs"]
        assert [(each["number"], each["name"], each["hash"]) for each in programs] == [
            *((entry["number"], entry["name"], entry["hash"]) for entry in entries),
            (len(entries) + 1, None, kept),
        ]
        assert small[:12] in command(machine, "play", entries[0]["name"], *PATIENT)
        assert kept[:12] in command(machine, "play", str(len(entries) + 1), *PATIENT)


def test_scans_are_kept_over_resets(tmp_path: Path) -> None:
    files = [write_variant(tmp_path / "boot", Variant(SCAN))]
    files += [write_variant(tmp_path / f"{size}", Variant({**SCAN, "x.size_nm": size})) for size in SIZES_NM]
    boot, first, second = (PreparedScan.of_plan(make_plan(load(file))).digest for file in files)
    target = tmp_path / "firmware"
    run_warned(
        ["make", "-C", REPOSITORY / "examples" / "firmware" / "cortex_m", "BOARD=lm3s6965evb", f"SCAN={files[0]}",
         f"BUILD={target}", f"TABLEGEN={sys.executable} -m tablegen", "CONTROL=link", "DAC=lines", "STORE=1"]
    )  # fmt: skip
    with LinkMachine("lm3s6965evb", target / "firmware.elf") as machine:
        assert after_reset(machine) == boot
        command(machine, "trigger")
        kept = command(machine, "upload", files[1], "--as", "fourier", "--store", "1", *PATIENT)
        assert f"slot 1 keeps {first[:12]}" in kept
        command(machine, "select", "1")
        assert after_reset(machine) == first
        command(machine, "readback", files[1], *PATIENT)
        command(machine, "trigger")
        command(machine, "upload", files[2], "--store", "0", *PATIENT)
        command(machine, "select", "0", "--trial")
        assert [after_reset(machine) for _ in range(2)] == [second, first]
        command(machine, "select", "0", "--trial")
        assert after_reset(machine) == second
        assert command(machine, "confirm") == "slot 0 plays after a start\n"
        assert after_reset(machine) == second
        command(machine, "delete", "0")
        assert after_reset(machine) == boot
