"""The reference firmware on processors that it is for, emulated: unicorn in process, QEMU over its serial lines.

It boots, takes commands, and every sample that it puts out is the model's. The ports to other boards are compiled (they
run in ``test_port_firmware.py``), and the runtime plays on a simulated AVR.
"""

import re
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from building import EXAMPLE, REMOVED, REPOSITORY, VARIANTS, Variant, build, run, run_clean, run_warned, write_variant
from emulation import BOARDS, CmsdkBoard, Firmware, Pl011Board
from following import Differs, Follower, follow
from qemu import Machine
from sets import long

from tablegen.base.resources import c_runtime
from tablegen.config.load import load
from tablegen.planning.line_plan import Plan, make_plan
from tablegen.verification.play.stream import FLAGS

pytestmark = pytest.mark.rest

FIRMWARE = REPOSITORY / "examples" / "firmware"
SHORT = {**VARIANTS["short_frame"].scan, "limits": REMOVED}  # which coarse converters break
PLAYED: dict[str, Variant] = {
    "bits_16": Variant(SHORT),
    "bits_8": Variant({**SHORT, "x.table.bits": 8, "y.table.bits": 8, "dac.bits": 8}),
    "bits_18": Variant({**SHORT, "x.table.bits": 18, "y.table.bits": 18, "dac.bits": 18}),
    "bits_24": Variant({**SHORT, "x.table.bits": 24, "y.table.bits": 24, "dac.bits": 24, "x.table.length": 512}),
    "header_only": Variant({**SHORT, "emit.header_only": True}),
    "direct": Variant({**SHORT, "x.table": {"mode": "direct", "bits": 16}, "y.table": {"mode": "direct", "bits": 12}}),
    "steps": Variant(
        {
            **SHORT,
            "timing": {"pixels": 40, "lines": 8, "line_rate_hz": 100.0, "ticks_per_line": 331},
            "dac.update_rate_hz": 50e3,
            "y.motion": "step",
            "y.band_limit.harmonics": 3,
        }
    ),
    "twos_complement": Variant({**SHORT, "dac.coding": "twos-complement"}),
    "left_aligned": Variant(
        {**SHORT, "dac.bits": 18, "dac.word_bits": 24, "dac.align": "left", "dac.coding": "twos-complement"}
    ),
}


def make_firmware(folder: Path, scan: Path, board: str, player: str, *more: str) -> Path:
    """The firmware as its Makefile makes it."""
    target = folder / f"{board}-{player}"
    run_warned(
        ["make", "-C", FIRMWARE / "cortex_m", f"BOARD={board}", f"SCAN={scan}", f"PLAYER={player}", f"BUILD={target}",
         f"TABLEGEN={sys.executable} -m tablegen", "CONTROL=console", "DAC=log", *more]
    )  # fmt: skip
    return target / "firmware.elf"


def firmware(folder: Path, name: str, board: str, player: str) -> tuple[Path, Plan]:
    scan = write_variant(folder, PLAYED[name])
    return make_firmware(folder, scan, board, player), make_plan(load(scan))


def after_status(lines: Sequence[str]) -> dict[str, int]:
    """The counts of the last status."""
    words = next(line for line in reversed(lines) if " swaps " in line).split()[1:]
    return dict(zip(words[::2], map(int, words[1::2]), strict=True))


@pytest.mark.parametrize("player", ["step", "fill"])
@pytest.mark.parametrize("name", long(["bits_16", "bits_24", "direct", "left_aligned"], PLAYED))
def test_firmware_in_process_plays_two_frames_and_swaps_in_the_middle(name: str, player: str, tmp_path: Path) -> None:
    board = BOARDS[list(PLAYED).index(name) % 2]()
    executable, plan = firmware(tmp_path, name, board.name, player)
    machine = Firmware(board, executable, np.random.default_rng(3))
    machine.boot()
    for line in ("status", "arm 1", "trigger"):
        machine.send(line)
    frame, settled = plan.schedule.frame_ticks, 300
    for _ in range(settled + frame):
        machine.tick(700)
    machine.send("arm 2")
    machine.send("trigger")
    for _ in range(frame // 2):
        machine.tick(700)
    machine.send("swap")
    for _ in range(2 * frame + settled):
        machine.tick(700)
    machine.send("status")
    for _ in range(3000):
        machine.tick(700)
        if machine.console[-1].startswith("parked") and len(machine.samples) > 3 * frame:
            break
    follower = follow_two_scans(machine.samples, plan)
    assert machine.console[0] == "ready"
    assert [line for line in machine.console if line.startswith("error")] == []
    counts = after_status(machine.console)
    assert counts["swaps"] == follower.swaps == 2
    assert counts["faults"] == counts["slew"] == counts["clamp"] == counts["underrun"] == 0


def follow_two_scans(samples: Sequence[str], plan: Plan) -> Follower:
    """One frame, then another scan without a count that the model would know: the swap begins its frame again."""
    follower = follow(samples, plan, 0)
    playing = [int(sample.split()[2], 16) >> 6 & 1 for sample in samples]
    assert sum(playing) > 2 * plan.schedule.frame_ticks
    first = playing.index(1)
    assert playing[first : first + plan.schedule.frame_ticks + 1] == [1] * plan.schedule.frame_ticks + [0]
    return follower


DAC_SWAPPED, DAC_PLAYING, DAC_PARKED = (1 << FLAGS.index(name) for name in ("swapped", "playing", "parked"))


def markers(sample: str) -> int:
    """Those of a line of the log."""
    return int(sample.split()[2], 16)


def listen(machine: Machine, until: int, times: int = 1) -> list[str]:
    """The log until a marker was high so many times; what is read is behind what is played."""
    samples: list[str] = []
    while times:
        assert len(samples) < 200_000, f"{until} was not heard: {samples[-1]}"
        samples.append(machine.sample())
        times -= bool(markers(samples[-1]) & until)
    return samples


@pytest.mark.parametrize("player", ["step", "fill"])
@pytest.mark.parametrize("board", BOARDS, ids=lambda board: board.name)
@pytest.mark.parametrize("name", long(["left_aligned"], ["bits_16", "left_aligned", "direct"]))
def test_firmware_in_qemu_plays_two_frames_and_swaps_in_the_middle(
    name: str, board: type[Pl011Board | CmsdkBoard], player: str, tmp_path: Path
) -> None:
    executable, plan = firmware(tmp_path, name, board.name, player)
    frame = plan.schedule.frame_ticks
    with Machine(board.machine, executable) as machine:
        assert machine.console() == "ready"
        assert machine.ask("arm 1") == "ok"
        assert machine.ask("trigger") == "ok"
        samples = listen(machine, until=DAC_PLAYING, times=frame)
        samples += listen(machine, until=DAC_PARKED)
        assert machine.ask("arm 0") == "ok"
        assert machine.ask("trigger") == "ok"
        samples += listen(machine, until=DAC_PLAYING, times=frame // 2)
        assert machine.ask("swap") == "ok"
        samples += listen(machine, until=DAC_SWAPPED)
        samples += listen(machine, until=DAC_PLAYING, times=frame + frame // 3)
        assert machine.ask("park") == "ok"
        samples += listen(machine, until=DAC_PARKED)
        counts = after_status([machine.ask("status")])
    assert int(samples[[bool(markers(s) & DAC_SWAPPED) for s in samples].index(True, 10)].split()[2], 16) & DAC_PLAYING
    follower = follow_two_scans(samples, plan)
    assert counts["swaps"] == follower.swaps == 2
    assert counts["faults"] == counts["slew"] == counts["clamp"] == counts["underrun"] == 0


def test_a_line_that_is_too_long_keeps_its_end(tmp_path: Path) -> None:
    """Whatever the main loop is slow: its queue drops characters, and the end of the line is none of them."""
    source = tmp_path / "queue.c"
    source.write_text(
        """#include <stdio.h>
#include "receive.h"
int main(void)
{
    static receive_queue queue;
    for (int i = 0; i < 300; i++)
        received(&queue, 'x');
    received(&queue, '\\n');
    received(&queue, 'y');
    int c, last = 0, count = 0;
    for (; (c = receive(&queue)) >= 0; count++)
        last = c;
    printf("%d %d\\n", count, last);
    return 0;
}
""",
        "ascii",
    )
    program = tmp_path / "queue"
    run_clean(["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", f"-I{FIRMWARE / 'cortex_m'}", source, "-o", program])
    assert run_clean([program]).split() == ["256", str(ord("\n"))]


def test_the_console_says_what_is_wrong(tmp_path: Path) -> None:
    executable, _ = firmware(tmp_path, "bits_16", "lm3s6965evb", "step")
    with Machine("lm3s6965evb", executable) as machine:
        assert machine.console() == "ready"
        for line in ("arm", "arm x", "arm 1x", "arm 1234567890", "armed 1", "nonsense", "swapp"):
            assert machine.ask(line).startswith("error: "), line
        for line in ("arm 0", "park", "reset", "clear", "withdraw", "trigger"):
            assert machine.ask(line) == "ok"
        assert machine.ask("x" * 300).startswith("error: ")
        assert " swaps 1 " in machine.ask("status")


@pytest.mark.parametrize("player", ["step", "fill"])
def test_a_trigger_as_early_as_can_be_is_heard(player: str, tmp_path: Path) -> None:
    """Commands that wait already when the firmware says that it is ready, on a machine that had no tick until then."""
    executable, _ = firmware(tmp_path, "bits_16", "lm3s6965evb", player)
    machine = Firmware(Pl011Board(), executable, np.random.default_rng(5))
    machine.boot()
    for line in ("arm 1", "trigger"):
        machine.send(line)
    while machine.board.uarts.to_console:
        machine.interrupt(machine.board.uart)
    machine.run(20_000)
    for _ in range(200):
        machine.tick(700)
    assert machine.console == ["ready", "ok", "ok"]
    assert any(markers(sample) & DAC_PLAYING for sample in machine.samples)


def test_a_log_with_one_wrong_code_is_found(tmp_path: Path) -> None:
    """A negative control of ``follow``."""
    board = Pl011Board()
    executable, plan = firmware(tmp_path, "bits_16", board.name, "step")
    machine = Firmware(board, executable, np.random.default_rng(3))
    machine.boot()
    for line in ("arm 1", "trigger"):
        machine.send(line)
    for _ in range(600):
        machine.tick(700)
    samples = machine.samples
    follow(samples, plan, 0)
    x, rest = samples[400].split(" ", 1)
    for wrong in (f"{int(x, 16) ^ 1:06x} {rest}", samples[400][:-2] + "f0"):
        with pytest.raises(Differs, match="tick 400"):
            follow([*samples[:400], wrong, *samples[401:]], plan, 0)


@pytest.mark.parametrize("level", ["-Os", "-O3"])
def test_the_firmware_compiles_at_other_levels(level: str, tmp_path: Path) -> None:
    make_firmware(tmp_path, EXAMPLE, "mps2_an386", "fill", f"CFLAGS={level}")


def test_the_firmware_of_a_microbit_compiles_with_its_own_scan(tmp_path: Path) -> None:
    run_warned(
        ["make", "-C", FIRMWARE / "cortex_m", "BOARD=microbit", f"BUILD={tmp_path}", "CFLAGS=-Os",
         f"TABLEGEN={sys.executable} -m tablegen"]
    )  # fmt: skip
    assert (tmp_path / "firmware.elf").is_file()


# Ports: compiled as far as there are compilers, and the AVR simulated.

WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Werror")
SLOW_12_BITS = Variant(
    {
        "limits": REMOVED,
        "dac.bits": 12,
        "dac.update_rate_hz": 2000.0,
        "timing": {"pixels": 40, "lines": 8, "line_rate_hz": 2.0, "ticks_per_line": 1000},
        "x.table.length": 256,
        "y.table.length": 128,
        "y.band_limit.harmonics": 16,
    }
)
AVR_HZ, AVR_UPDATE_HZ = 16_000_000, 2000


@pytest.mark.parametrize("level", ["-O2", "-Os"])
@pytest.mark.parametrize("port", ["stm32", "stm32h7", "teensy41", "rp2040"])
def test_a_port_compiles(port: str, level: str, tmp_path: Path) -> None:
    run_clean(
        ["make", "-C", FIRMWARE / port, f"BUILD={tmp_path / port}", f"CFLAGS={level}",
         f"TABLEGEN={sys.executable} -m tablegen"]
    )  # fmt: skip
    assert (tmp_path / port / "firmware.elf").is_file()


def test_the_scan_of_a_port_has_its_converter_checked(tmp_path: Path) -> None:
    """A negative control: 16 bits for the 12 of an STM32F4."""
    done = run(
        ["make", "-C", FIRMWARE / "stm32", f"BUILD={tmp_path / 'stm32'}", f"SCAN={EXAMPLE}",
         f"TABLEGEN={sys.executable} -m tablegen"]
    )  # fmt: skip
    assert done.returncode != 0
    assert "twelve_bits_right_aligned" in done.stderr


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ((f"SCAN={EXAMPLE}",), "the_scan_has_words_of_the_converter"),  # 16 bits
        (("CONVERTER=ad5764",), "the_scan_has_words_of_the_converter"),
        (("CONVERTER=ad5541a",), "a_frame_is_no_half_word"),
        (("UPDATE_RATE_HZ=800000",), "a_tick_has_room"),
    ],
)
@pytest.mark.parametrize("port", ["stm32h7", "teensy41"])
def test_the_converter_of_a_port_is_checked(options: tuple[str, ...], reason: str, port: str, tmp_path: Path) -> None:
    """Negative controls: a scan of other words, a converter with shorter frames, a rate without time for them."""
    done = run(
        ["make", "-C", FIRMWARE / port, f"BUILD={tmp_path / 'port'}", f"TABLEGEN={sys.executable} -m tablegen",
         *options]
    )  # fmt: skip
    assert done.returncode != 0
    assert reason in done.stderr


@pytest.mark.parametrize("in_flash", [0, 1])
def test_avr_plays_the_scan_in_time(tmp_path: Path, in_flash: int) -> None:
    """Every tick is the model's, and takes fewer cycles than there are between two interrupts; RAM has no table."""
    ticks, executable = 2600, tmp_path / "avr.elf"
    built = build(tmp_path, SLOW_12_BITS)
    source, sources = REPOSITORY / "tests" / "helpers" / "avr_step.c", sorted(built.folder.glob("*.c"))
    run_clean(
        ["avr-gcc", "-std=c99", "-mmcu=atmega2560", "-O2", *WARNINGS, f"-DTICKS={ticks}", f"-DDAC_PROGMEM={in_flash}",
         f"-I{built.folder}", source, *sources, "-o", executable]
    )  # fmt: skip
    done = run(["simavr", "-m", "atmega2560", "-f", str(AVR_HZ), executable])
    shown = re.sub(r"\x1b\[[0-9;]*m", "", done.stdout + done.stderr)  # simavr colours, and cuts, what a UART sends
    lines = re.findall(r"[0-9a-f]{6} [0-9a-f]{6} [0-9a-f]{2} [0-9a-f]{4}", shown)
    assert len(lines) == ticks
    follow([line[:-5] for line in lines], built.plan, 1)
    assert max(int(line[-4:], 16) for line in lines) < AVR_HZ / AVR_UPDATE_HZ / 2
    symbols = re.findall(r"^[0-9a-f]+ (\w) \w+_(?:table|fourier|sine)$", run_clean(["avr-nm", executable]), re.M)
    assert symbols == ["T" if in_flash else "D"] * 5
    page = " ".join((REPOSITORY / "docs" / "c.md").read_text("utf-8").split())
    initialised = run_clean(["avr-size", executable]).splitlines()[1].split()[1]
    clocks = round(float(np.mean([int(line[-4:], 16) for line in lines])))
    told = (f"then has {initialised} bytes", f"takes {clocks} clocks")
    before = (f"initialised data in place of {initialised},", f"clocks in place of {clocks} in the mean")
    assert all(figure in page for figure in (told if in_flash else before)), (initialised, clocks)


def test_a_link_does_not_start_where_tables_are_read_from_flash(tmp_path: Path) -> None:
    """Its tables are in RAM. What it and the renderer answer is constant, so that the compiler drops the rest."""
    source = tmp_path / "unit.c"
    source.write_text(
        '#include "dac_link.c"\n#include "dac_fourier.c"\n'
        "int starts(void) { return judge_config(0) == DAC_LINK_STARTED; }\n"
        "int renders(void) { return dac_synthesize(0, 9, 3, 16, 0, 1, 0, 3); }\n",
        "ascii",
    )
    command = ["avr-gcc", "-std=c99", "-mmcu=atmega2560", "-O2", f"-I{c_runtime()[0].parent}", "-S", source, "-o", "-"]
    for flag, is_constant in (("-DDAC_PROGMEM=1", True), ("-DDAC_PROGMEM=0", False)):
        shown = run_clean([*command, flag], tmp_path)
        for name in ("starts", "renders"):
            body = shown.partition(f"\n{name}:\n")[2].partition("\t.size")[0]
            instructions = re.findall(r"^\t([a-z]\w*.*)$", body, re.M)
            assert instructions[-1] == "ret"
            assert (instructions[:-1] == ["ldi r24,0", "ldi r25,0"]) == is_constant
    refused = run([*command, "-DDAC_PROGMEM=1", "-DDAC_SLOW_PART=1"], tmp_path)
    assert "DAC_PROGMEM has no slow parts and no tables of pixels" in refused.stderr
