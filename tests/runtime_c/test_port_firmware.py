"""The firmware of every port, from an upload by the client to the words at its converters, each of them the model's.

RP2040 in rp2040js, STM32F4 under unicorn with a model of the peripherals that it touches, Arduino Mega in simavr. Time
is virtual, and so is the serial line.
"""

import os
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from random import Random

import pytest
from building import EXAMPLE, REMOVED, REPOSITORY, VARIANTS, Variant, run_clean, run_warned, tool, write_variant
from converter_chips import CHIPS, Codes
from converter_chips import Board as Converters
from converter_words import commit, follow_words, park, start
from following import Differs
from limits import PATIENCE_S
from link_line import FarEnd, Line
from link_qemu import LinkMachine
from pipe_board import PipeBoard
from sets import LONG_TEST, long, one_of
from sketches import own_warnings, run_builder
from stm32_board import Stm32Board
from stm32h7_board import ITCM, OFF, Stm32h7Board
from teensy41_board import Teensy41Board
from unicorn import UcError

from tablegen.config.load import load
from tablegen.link.device import Device
from tablegen.link.errors import LinkError
from tablegen.link.prepare import PreparedScan
from tablegen.planning.line_plan import make_plan
from tablegen.verification.c.elf import read_executable

pytestmark = pytest.mark.rest

DAC_FAULT_UNDERRUN = 8
AVR_HZ = 16_000_000
FIRMWARE = REPOSITORY / "examples" / "firmware"
HELPERS = REPOSITORY / "tests" / "helpers"
TIMING = {"pixels": 50, "lines": 4, "ticks_per_line": 331}
SMALL = {
    **VARIANTS["short_frame"].scan,
    "limits": REMOVED,
    "x.table.length": 64,  # the words of an upload take most of the time of a board
    "y.table.length": 64,
}


def _scan(folder: Path, name: str, changes: dict[str, object]) -> tuple[Path, PreparedScan]:
    file = write_variant(folder / name, Variant(changes))
    return file, PreparedScan.of_plan(make_plan(load(file)))


def _firmware(port: str, folder: Path, scan: Path, *more: str, ports: Path = FIRMWARE) -> Path:
    target = folder / port
    run_warned(
        ["make", "-C", ports / port, f"SCAN={scan}", f"BUILD={target}", f"TABLEGEN={sys.executable} -m tablegen",
         *more]
    )  # fmt: skip
    return target / "firmware.elf"


def _play(
    board: FarEnd,
    tick_hz: int,
    baud: int,
    scan: PreparedScan,
    form: str,
    begin_s: float = 0.02,
    raise_trigger: Callable[[], None] | None = None,
) -> None:
    """The boot scan plays, another one is uploaded meanwhile, plays for more than a frame, and parks.

    The pin of a trigger starts it where there is one. What comes in the first ``begin_s``, before the UART is on, is
    lost.
    """
    line = Line(board, baud=baud, tick_hz=tick_hz)
    frame = scan.program.schedule.frame_ticks / tick_hz
    line.sleep(begin_s)
    with Device(line.open, random=Random(8), sleep=line.sleep) as client:
        if raise_trigger is not None:
            raise_trigger()  # ignored: not armed
            line.sleep(0.1 * frame)
        client.arm()
        (raise_trigger or client.trigger)()
        line.sleep(frame / 3)
        client.upload(scan.image(form), timeout_s=20.0)
        line.sleep(1.3 * frame)
        status = client.status()
        client.park()
        line.sleep(0.1 * frame)
    assert status.faults == 0
    assert status.bad_frames == 0


def _follow(
    words: Sequence[tuple[int, ...]],
    boot: PreparedScan,
    scan: PreparedScan,
    power_up: int = 0,
    *,
    codes: bool = False,
    pixels: bool = False,
) -> None:
    """Hold the words of a boot scan, and of one that was uploaded and parked, against the model.

    As negative controls, each word of a tick is another one; a frame before the end, that of the uploaded scan.
    """
    requests = [commit(boot.program), start(), commit(scan.program), park]
    frame = scan.program.schedule.frame_ticks
    at = len(words) - frame
    wrong = [tuple(word ^ (other == place) for other, word in enumerate(words[at])) for place in range(len(words[at]))]
    heard = follow_words(words, requests, power_up, codes=codes, pixels=pixels, wrong={at: wrong})
    assert heard[2] < at < heard[3]
    assert heard[3] - heard[2] > frame


@pytest.fixture(scope="module")
def rp2040js(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which node finds the emulator."""
    folder = tmp_path_factory.mktemp("node")
    (folder / "package.json").write_bytes((HELPERS / "rp2040" / "package.json").read_bytes())
    subprocess.run(
        [tool("npm"), "install", "--silent", "--no-audit", "--no-fund", "--no-package-lock", "--ignore-scripts"],
        cwd=folder, check=True, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    return folder


def _rp2040(rp2040js: Path, folder: Path, divider: int) -> tuple[PipeBoard, int, PreparedScan, PreparedScan]:
    """A board at 460800 baud, its update rate, the scan that it has, and another one."""
    rate = 125_000_000 // 34 // divider
    changes = {**SMALL, "dac.update_rate_hz": float(rate), "timing": {**TIMING, "line_rate_hz": rate / 331}}
    file, boot = _scan(folder, "boot", changes)
    _, scan = _scan(folder, "scan", {**changes, "x.size_nm": 40.0})
    image = folder / "image.bin"
    (segment,) = read_executable(_firmware("rp2040", folder, file, "BAUD=460800", f"DIVIDER={divider}")).segments
    image.write_bytes(segment.data)
    command = ["node", HELPERS / "rp2040" / "board.mjs", image, "460800"]
    return PipeBoard(command, 34 * divider, rp2040js), rate, boot, scan


def test_rp2040(rp2040js: Path, tmp_path: Path) -> None:
    """One core plays, the other one serves the link; words are what shifted out of the pins."""
    board, rate, boot, scan = _rp2040(rp2040js, tmp_path, divider=36)
    with board:
        _play(board, rate, 460800, scan, "fourier")
    lost, apart = board.counts
    assert (lost, apart) == (0, 0)
    _follow(board.words, boot, scan)


def test_rp2040_tells_underruns(rp2040js: Path, tmp_path: Path) -> None:
    """A negative control: at five times the rate it holds words, says so, and no word is lost or wrong."""
    board, rate, boot, _ = _rp2040(rp2040js, tmp_path, divider=7)
    with board:
        line = Line(board, baud=460800, tick_hz=rate)
        line.sleep(0.002)
        with Device(line.open, random=Random(8), sleep=line.sleep) as client:
            client.arm()
            client.trigger()
            line.sleep(0.02)
            assert client.status().faults == DAC_FAULT_UNDERRUN
            client.park()
            line.sleep(0.002)
    follow_words(board.words, [commit(boot.program), start(), park])


def test_stm32(tmp_path: Path) -> None:
    """The DAC and the receiver by DMA; words are what DMA gave to the DAC."""
    rate, baud = 200_000, 460800
    timing = {**TIMING, "line_rate_hz": rate / 331}
    changes = {**SMALL, "dac.bits": 12, "dac.update_rate_hz": float(rate), "timing": timing}
    file, boot = _scan(tmp_path, "boot", changes)
    _, scan = _scan(tmp_path, "scan", {**changes, "x.size_nm": 40.0})
    board = Stm32Board(_firmware("stm32", tmp_path, file, f"BAUD={baud}"))
    board.tick(1)
    _play(board, rate, baud, scan, "table")
    _follow(board.words, boot, scan)


# Ports to a Cortex-M7: two AD5791 at 500 kHz.

M7_RATE, M7_BAUD = 500_000, 921_600
M7_CHANGES: dict[str, object] = {
    **SMALL,
    "dac.bits": 20,
    "dac.v_min": -10.0,
    "dac.v_max": 10.0,
    "dac.update_rate_hz": float(M7_RATE),
    "timing": {**TIMING, "line_rate_hz": M7_RATE / 331},
}
M7_POWER_UP = 1 << 19  # 0 V


def _m7_play(
    board: Stm32h7Board | Teensy41Board, scan: PreparedScan, raise_trigger: Callable[[], None] | None = None
) -> None:
    """Play the boot scan and an uploaded one: see ``_play``."""
    board.tick(1)
    _play(board, M7_RATE, M7_BAUD, scan, "table", 0.002, raise_trigger)


def _m7_play_boot(board: Stm32h7Board | Teensy41Board, raise_trigger: Callable[[], None] | None = None) -> None:
    """Play the first lines of the boot scan."""
    board.tick(1)
    line = Line(board, baud=M7_BAUD, tick_hz=M7_RATE)
    line.sleep(0.002)
    with Device(line.open, random=Random(8), sleep=line.sleep, timeout_s=0.02) as client:
        client.arm()
        (raise_trigger or client.trigger)()
        line.sleep(2 * 331 / M7_RATE)
        assert client.status().faults == 0


def _after_setup(board: Stm32h7Board | Teensy41Board, setups: int = 1) -> list[tuple[int, int]]:
    """Return the codes at the converters from the end of the set-up, before which they are off.

    The first tick was there before the set-up, and is there again.
    """
    assert board.words[:setups] == [(OFF, OFF)] * setups
    if setups == 1:  # no reset: the output is switched on at the first tick's code
        assert board.words[1] == board.words[2]
    return board.words[1 + setups :]


def _with_pixels(board: Stm32h7Board, codes: list[tuple[int, int]]) -> list[tuple[int, int, int]]:
    """Add to each of the last codes whether it began a pixel."""
    pixels = board.pixels[len(board.words) - len(codes) :]
    return [(x, y, pixel) for (x, y), pixel in zip(codes, pixels, strict=False)]


def _h7_play_boot(firmware: Path, converter: str = "ad5791", setups: int = 1) -> list[tuple[int, int, int]]:
    board = Stm32h7Board(firmware, converter)
    _m7_play_boot(board, board.raise_trigger)
    return _with_pixels(board, _after_setup(board, setups))


def test_stm32h7(tmp_path: Path) -> None:
    """Two AD5791 by DMA behind a data cache; codes and pixel clock are those at the converters and at the pin."""
    file, boot = _scan(tmp_path, "boot", M7_CHANGES)
    _, scan = _scan(tmp_path, "scan", {**M7_CHANGES, "x.size_nm": 40.0})
    firmware = _firmware("stm32h7", tmp_path, file, f"BAUD={M7_BAUD}")
    symbols = read_executable(firmware).symbols
    assert {symbols["dac_sequencer_fill"], symbols["dac_axis_run"]} <= set(ITCM)
    assert symbols["dac_link_work"] not in ITCM
    size = symbols["itcm_end"] - symbols["itcm_start"]
    assert f": {size / 1000:.1f} kB." in (FIRMWARE / "stm32h7" / "README.md").read_text("utf-8")
    board = Stm32h7Board(firmware, "ad5791")
    _m7_play(board, scan, board.raise_trigger)
    played = _with_pixels(board, _after_setup(board))
    _follow(played, boot, scan, M7_POWER_UP, codes=True, pixels=True)
    assert sum(pixel for _, _, pixel in played) > 2 * 50 * 4


H7_FAULTS = {
    "the other half is cleaned": ("fill(0, HALF);\n        clean_half(0);", "fill(0, HALF);\n        clean_half(1);"),
    "the half that plays is filled": (
        "fill(0, HALF);\n        clean_half(0);",
        "fill(HALF, HALF);\n        clean_half(1);",
    ),
    "half of y is cleaned": ("clean(play.y + half * HALF, HALF * 4)", "clean(play.y + half * HALF, HALF * 2)"),
    "the pixel clock is not cleaned": ("    clean(play.pixels + half * HALF, HALF * 4);\n", ""),
    "the pixel clock is that of lines": ("& DAC_PIXEL", "& DAC_LINE"),
    "y comes a tick early": ("TIM1_CNT = PERIOD - 1;", "TIM1_CNT = 0;"),
    "SYNC rises early": ("SETTLE = 88", "SETTLE = 0"),
    "the pin starts nothing": ("    edge = true;", "    edge = false;"),
    "a line that rests does not wake the link": ("USART3_CR1 = 1u << 4 |", "USART3_CR1 ="),
    "no code is copied into the ITCM": ("    copy(itcm_start, itcm_end, itcm_load);\n", ""),
    "the outputs stay off": ("play.x[at] = play.y[at] = SPI_CONVERTER.setup[i];", "play.x[at] = play.y[at] = 0;"),
}


def _faulty(folder: Path, old: str, new: str, *among: str) -> Path:
    """Copy the ports, with a fault in what stands once in one of these files of theirs."""
    ports = folder / "firmware"
    shutil.copytree(FIRMWARE, ports, ignore=shutil.ignore_patterns("build"))
    files = [ports / name for name in among]
    texts = [file.read_text("ascii") for file in files]
    assert sum(text.count(old) for text in texts) == 1
    for file, text in zip(files, texts, strict=True):
        if old in text:
            file.write_text(text.replace(old, new), "ascii")
    return ports


@pytest.mark.parametrize("fault", long(["the pixel clock is not cleaned"], H7_FAULTS))
def test_a_fault_of_the_stm32h7_port_is_found(fault: str, tmp_path: Path) -> None:
    ports = _faulty(tmp_path, *H7_FAULTS[fault], "stm32h7/main.c", "stm32h7/startup.c")
    file, boot = _scan(tmp_path, "boot", M7_CHANGES)
    firmware = _firmware("stm32h7", tmp_path, file, f"BAUD={M7_BAUD}", ports=ports)
    with pytest.raises((Differs, LinkError, AssertionError, UcError)):
        follow_words(_h7_play_boot(firmware), [commit(boot.program), start()], M7_POWER_UP, codes=True, pixels=True)


@pytest.mark.parametrize(
    ("converter", "table", "setups"),
    [
        pytest.param("ad5791", {}, 1, marks=LONG_TEST),  # the test of the port has it
        pytest.param("ad5781", {"dac.bits": 18, "dac.word_bits": 20, "dac.align": "left"}, 1, marks=LONG_TEST),
        ("ad5761", {"dac.bits": 16}, 2),
    ],
)
def test_a_converter_of_the_stm32h7_port(converter: str, table: dict[str, object], setups: int, tmp_path: Path) -> None:
    changes = {**M7_CHANGES, **table}
    file, boot = _scan(tmp_path, "boot", changes)
    firmware = _firmware("stm32h7", tmp_path, file, f"BAUD={M7_BAUD}", f"CONVERTER={converter}")
    played = _h7_play_boot(firmware, converter, setups)
    power_up = 1 << int(str(changes["dac.bits"])) - 1
    heard = follow_words(played, [commit(boot.program), start()], power_up, codes=True, pixels=True)
    assert len(played) - heard[1] > 331


def test_teensy41(tmp_path: Path) -> None:
    """Two AD5791 by DMA behind a data cache; codes are those at the converters."""
    file, boot = _scan(tmp_path, "boot", M7_CHANGES)
    _, scan = _scan(tmp_path, "scan", {**M7_CHANGES, "x.size_nm": 40.0})
    board = Teensy41Board(_firmware("teensy41", tmp_path, file, f"BAUD={M7_BAUD}"), "ad5791")
    _m7_play(board, scan)
    _follow(_after_setup(board), boot, scan, M7_POWER_UP, codes=True)


def _teensy_play_boot(firmware: Path) -> list[tuple[int, int]]:
    board = Teensy41Board(firmware, "ad5791")
    _m7_play_boot(board)
    return _after_setup(board)


TEENSY_FAULTS = {  # the first four are in what ports to a Cortex-M7 share
    "no half is cleaned": ("        SCB_DCCMVAC = at;", "        (void)at;"),
    "no barrier after a half is cleaned": (
        "        SCB_DCCMVAC = at;\n    barrier();",
        "        SCB_DCCMVAC = at;",
    ),
    "received bytes are not invalidated": ("        SCB_DCIMVAC = at;", "        (void)at;"),
    "the cache is on before it is invalidated": (
        "            SCB_DCISW = way << 30 | set << 5;",
        "            (void)way;",
    ),
    "the other half is cleaned": ("    clean_half(half);", "    clean_half(1 - half);"),
    "the half that plays is filled": (
        "TCD_CITER(FRAME_CHANNEL) > HALF ? 1 : 0",
        "TCD_CITER(FRAME_CHANNEL) > HALF ? 0 : 1",
    ),
    "half of a half is cleaned": ("clean(frames + half * HALF, HALF * 8)", "clean(frames + half * HALF, HALF * 4)"),
    "a request moves a frame of x alone": ("<< 10 | 8u;", "<< 10 | 4u;"),
    "a request moves two frames of each axis": ("<< 10 | 8u;", "<< 10 | 16u;"),
    "minor loops have no offset": ("DMA_CR = 1u << 10 | 1u << 7;", "DMA_CR = 1u << 10;"),
    "the destination does not go back at the end": (
        "TCD_DLAST(FRAME_CHANNEL) = 2 * LPSPI_STEP;",
        "TCD_DLAST(FRAME_CHANNEL) = 0;",
    ),
    "the source goes on at the end": (
        "TCD_SLAST(FRAME_CHANNEL) = -(uint32_t)sizeof frames;",
        "TCD_SLAST(FRAME_CHANNEL) = 0;",
    ),
    "too few requests before the start": (
        "TCD_CITER(FRAME_CHANNEL) = 2 * HALF;",
        "TCD_CITER(FRAME_CHANNEL) = 2 * HALF - 1;",
    ),
    "no interrupt at the half": ("TCD_CSR(FRAME_CHANNEL) = 1u << 2 | 1u << 1;", "TCD_CSR(FRAME_CHANNEL) = 1u << 1;"),
    "another request": ("| REQUEST_FLEXPWM2_WRITE0;", "| (REQUEST_FLEXPWM2_WRITE0 + 1);"),
    "no clock of DMA": ("    CCM_CCGR5 |= 3u << 6; ", "    "),
    "no clock of SPI of y": ("CCM_CCGR1 |= 3u << 6 | 3u << 4;", "CCM_CCGR1 |= 3u << 6;"),
    "no clock of the timer": ("CCM_CCGR4 |= 3u << 18 | 3u << 2;", "CCM_CCGR4 |= 3u << 2;"),
    "PLL 2 stays bypassed": ("    CCM_ANALOG_PLL_SYS_CLR = 1u << 16;\n", ""),
    "frames are a bit short": ("1u << 19 | (FRAME_BITS - 1u)", "1u << 19 | (FRAME_BITS - 2u)"),
    "LDAC falls early": ("SETTLE = 60", "SETTLE = -60"),
    "a line that rests does not wake the link": ("LPUART6_CTRL = 1u << 20 |", "LPUART6_CTRL ="),
    "the outputs stay off": (
        "frames[at][0] = frames[at][1] = SPI_CONVERTER.setup[i];",
        "frames[at][0] = frames[at][1] = 0;",
    ),
}


@pytest.mark.parametrize("fault", one_of(8, TEENSY_FAULTS))
def test_a_fault_of_the_teensy41_port_is_found(fault: str, tmp_path: Path) -> None:
    ports = _faulty(tmp_path, *TEENSY_FAULTS[fault], "teensy41/main.c", "common/cortex_m7.h")
    file, boot = _scan(tmp_path, "boot", M7_CHANGES)
    firmware = _firmware("teensy41", tmp_path, file, f"BAUD={M7_BAUD}", ports=ports)
    with pytest.raises((Differs, LinkError, AssertionError)):
        follow_words(_teensy_play_boot(firmware), [commit(boot.program), start()], M7_POWER_UP, codes=True)


# The reference firmware in QEMU, whose log is what SPI of a converter is sent.

QEMU_RATE = 20_000
# By board and [dac] table, converters with the number of frames of their set-up. Volts are in no frame.
QEMU_SCANS: dict[str, tuple[str, dict[str, object], dict[str, int]]] = {
    "16 bits": ("lm3s6965evb", {}, {"ad5541a": 0, "ad5761": 2, "dac8562": 1, "ltc2668": 1}),
    "twos-complement": ("lm3s6965evb", {"dac.coding": "twos-complement"}, {"ad5764": 0}),
    "left-aligned": ("mps2_an386", {"dac.bits": 18, "dac.word_bits": 20, "dac.align": "left"}, {"ad5781": 1}),
}
QEMU_FAULTS = {  # by converter: what is in a file once, what is there instead, and the file
    "ad5541a": ("(&SPI_CONVERTER, &x, &y,", "(&SPI_CONVERTER, &y, &x,", "cortex_m/dac_frames.c"),
    "ad5761": ("done < converter->setups", "done < 1u", "converters/spi_words.h"),  # no range
    "dac8562": (  # outputs A and B exchanged
        "{UINT32_C(0x000000), UINT32_C(0x010000)}",
        "{UINT32_C(0x010000), UINT32_C(0x000000)}",
        "converters/dac8562.h",
    ),
    "ltc2668": ("UINT32_C(0x010000)}", "UINT32_C(0x020000)}", "converters/ltc2668.h"),  # output 2
    "ad5764": (  # the lowest byte first
        "(uint8_t)(frame >> bits)",
        "(uint8_t)(frame >> (converter->frame_bits - 8 - bits))",
        "converters/spi_words.h",
    ),
    "ad5781": ("24, 20, 0, 1,", "24, 20, 1, 1,", "converters/ad5781.h"),  # the word a bit too high
}


def _qemu_play(board: str, executable: Path, frame_bytes: int, scan: PreparedScan | None = None) -> bytes:
    """Return what SPI is sent: the boot scan plays, and if another one is given, it is uploaded, plays, and parks.

    ``frame_bytes`` are those of a frame of the scan.
    """
    log = bytearray()

    with LinkMachine(board.replace("_", "-"), executable) as machine:

        def wait(octets: int) -> None:
            until = time.monotonic() + PATIENCE_S
            log.extend(machine.octets())
            end = len(log) + octets
            while len(log) < end:
                assert time.monotonic() < until, "QEMU does not get there"
                time.sleep(0.01)
                log.extend(machine.octets())

        with Device(machine.url, timeout_s=PATIENCE_S) as client:
            client.arm()
            client.trigger()
            wait(frame_bytes // 2)
            if scan is not None:
                client.upload(scan.image("fourier"), timeout_s=PATIENCE_S)
                wait(frame_bytes * 2)  # part of it was in buffers before
                assert client.status().faults == 0
                client.park()
                wait(frame_bytes // 4)
    return bytes(log)


def _qemu_codes(converter: str, setups: int, log: bytes) -> list[Codes]:
    """Return the codes at the outputs on each tick, of which none is off; the start of the outputs had the first."""
    board = Converters(converter)
    size = board.chips[0].frame_bits // 8
    frames = [int.from_bytes(log[at : at + size], "big") for at in range(0, len(log) - size + 1, size)]
    first, *codes = board.play(frames, setups)
    assert first == codes[0]
    assert len(codes) == len(frames) // 2 - 2 - setups
    return codes


@pytest.mark.parametrize("of", QEMU_SCANS)
def test_frames_of_converters_in_qemu(of: str, tmp_path: Path) -> None:
    """From an upload to the codes at the converter, which its model reads from the bytes of the frames."""
    board, table, converters = QEMU_SCANS[of]
    changes = {
        **SMALL,
        "dac.v_min": -10.0,
        "dac.v_max": 10.0,
        **table,
        "dac.update_rate_hz": float(QEMU_RATE),
        "timing": {**TIMING, "line_rate_hz": QEMU_RATE / 331},
    }
    file, boot = _scan(tmp_path, "boot", changes)
    _, scan = _scan(tmp_path, "scan", {**changes, "x.size_nm": 40.0})
    begin = [commit(boot.program), start()]
    options = [f"BOARD={board}", "CONTROL=link", "DAC=frames"]
    for converter, setups in converters.items():
        frame_bytes = CHIPS[converter]().frame_bits // 4 * scan.program.schedule.frame_ticks
        firmware = _firmware("cortex_m", tmp_path, file, *options, f"CONVERTER={converter}")
        codes = _qemu_codes(converter, setups, _qemu_play(board, firmware, frame_bytes, scan))
        _follow(codes, boot, scan, codes=True)
        options += ["-o", str(tmp_path / "cortex_m" / "command"), "-W", "dac_frames.c"]  # the rest is the same
        ports = _faulty(tmp_path / converter, *QEMU_FAULTS[converter])
        firmware = _firmware("cortex_m", tmp_path, file, *options, f"CONVERTER={converter}", ports=ports)
        log = _qemu_play(board, firmware, frame_bytes)
        with pytest.raises((Differs, AssertionError), match=r"^(?!not all)"):
            follow_words(_qemu_codes(converter, setups, log), begin, codes=True)


# Arduino: the recipe of the README, with Arduino's builder, core and libraries.

ARDUINO = FIRMWARE / "arduino"


def _recipe() -> list[str]:
    """The commands that the README gives up to the IDE."""
    text = (ARDUINO / "README.md").read_text("utf-8").split("Arduino IDE")[0]
    return [line.strip() for line in text.splitlines() if line.startswith("    ")]


@pytest.fixture(scope="module")
def sketch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the sketch after the recipe."""
    examples = tmp_path_factory.mktemp("recipe") / "examples"
    shutil.copytree(REPOSITORY / "examples", examples, ignore=shutil.ignore_patterns("build", "__pycache__"))
    folder = examples / "firmware" / "arduino"
    for command in _recipe():
        assert command.startswith(("tablegen ", "cp "))
        whole = command.replace("tablegen", f"{shlex.quote(sys.executable)} -m tablegen", 1)
        done = subprocess.run(whole, shell=True, cwd=folder, check=True, capture_output=True)
        assert done.stderr == b""
    return folder / "scan_player"


def _compiled(sketch: Path, board: str, folder: Path) -> Path:
    """The sketch as the IDE compiles it; no warning is of ours."""
    out = folder / board.split(":")[0]
    out.mkdir()
    done = run_builder(sketch / "scan_player.ino", board, out)
    assert done.returncode == 0, done.stderr
    assert own_warnings(done) == []
    return out / "scan_player.ino.elf"


def _static_end(executable: Path) -> int:
    return read_executable(executable).symbols["_end"] & 0xFFFF


@pytest.fixture(scope="module")
def avr_board(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The board's program."""
    program = tmp_path_factory.mktemp("avr") / "avr_board"
    run_clean(["gcc", "-std=gnu99", "-O2", HELPERS / "avr_board.c", "-o", program, "-lsimavr", "-lelf", "-lm"])
    return program


def test_arduino_mega(sketch: Path, avr_board: Path, tmp_path: Path) -> None:
    """The sketch in simavr; words are what the converter puts out when LDAC falls."""
    rate = 2000
    text = (
        (ARDUINO / "scan.toml").read_text("utf-8").replace("../../scanner.toml", str(EXAMPLE.parent / "scanner.toml"))
    )
    changes = {
        "lines = 100 ": "lines = 4 ",
        "pixels = 100 ": "pixels = 50 ",
        "line_rate_hz = 2.0": "line_rate_hz = 5.0",
        "size_nm = 400.0": "size_nm = 300.0",
        'motion = "step"': "",
        'mode = "direct"': 'mode = "interpolated"\nlength = 128',
    }
    small = text
    for old, new in changes.items():
        assert old in small
        small = small.replace(old, new)
    scans = []
    for name, content in (("boot", text), ("scan", small)):
        (tmp_path / f"{name}.toml").write_text(content, "utf-8")
        scans.append(PreparedScan.of_plan(make_plan(load(tmp_path / f"{name}.toml"))))
    executable = _compiled(sketch, "mega:cpu=atmega2560", tmp_path)
    with PipeBoard([avr_board, "mega", executable, str(_static_end(executable))], AVR_HZ // rate) as board:
        _play(board, rate, 115200, scans[1], "table")
    lost, free = board.counts
    assert lost == 0
    _follow(board.words, *scans)
    assert free > 400  # bytes that the stack never reached


def test_an_arduino_without_nested_interrupts_loses_bytes(sketch: Path, avr_board: Path, tmp_path: Path) -> None:
    """A negative control: the tick keeps Serial's interrupt off for longer than a UART of an AVR holds bytes."""
    wrong = tmp_path / "scan_player"
    shutil.copytree(sketch, wrong)
    text = (wrong / "scan_player.ino").read_text("utf-8")
    before, middle, after = text.partition("    interrupts();  // but Serial's")
    assert middle
    (wrong / "scan_player.ino").write_text(f"{before}    // {after}", "utf-8")
    executable = _compiled(wrong, "mega:cpu=atmega2560", tmp_path)
    with PipeBoard([avr_board, "mega", executable, str(_static_end(executable))], AVR_HZ // 2000) as board:
        board.tick(100)
        board.receive(bytes(range(1, 256)) * 2)
        board.tick(200)
        lost, _ = board.counts
    assert lost > 0


def test_arduino_uno(sketch: Path, avr_board: Path, tmp_path: Path) -> None:
    """Without the link: it plays what was compiled in, and its stack has room beside that."""
    rate = 2000
    executable = _compiled(sketch, "uno", tmp_path)
    scan = PreparedScan.of_plan(make_plan(load(sketch.parent / "scan.toml")))
    with PipeBoard([avr_board, "uno", executable, str(_static_end(executable))], AVR_HZ // rate) as board:
        board.tick(200)
        for letter in (b"t", b"s"):
            board.receive(letter)
            board.tick(1500)
        board.receive(b"p")
        board.tick(200)
    _, free = board.counts
    assert board.transmit() == b"0\r\n"  # no faults
    heard = follow_words(board.words, [commit(scan.program), start(), park])
    assert heard[2] - heard[1] > 2 * scan.program.schedule.ticks
    assert free > 100


def test_the_arduino_sketch_compiles_for_a_teensy(sketch: Path, tmp_path: Path) -> None:
    """With stand-ins for the headers of its core."""
    run_clean(
        ["arm-none-eabi-g++", "-std=gnu++17", "-mcpu=cortex-m7", "-mthumb", "-ffreestanding", "-D__IMXRT1062__", "-O2",
         "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Werror", f"-I{HELPERS / 'arduino'}",
         "-x", "c++", "-c", sketch / "scan_player.ino", "-o", tmp_path / "sketch.o"]
    )  # fmt: skip


def test_make_run_is_clean_of_underruns(tmp_path: Path) -> None:
    """As the README of the reference firmware says, on a machine that is busy with other tests."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    process = subprocess.Popen(
        [tool("make"), "-C", FIRMWARE / "cortex_m", "run", f"BUILD={tmp_path}", f"PORT={port}",
         f"TABLEGEN={sys.executable} -m tablegen"],
        start_new_session=True, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    log, until = tmp_path / "lines.log", time.monotonic() + PATIENCE_S

    def wait(good: Callable[[], bool]) -> None:
        while not good():
            assert process.poll() is None, "QEMU has ended"
            assert time.monotonic() < until, "QEMU does not get there"
            time.sleep(0.05)

    try:
        wait(log.exists)
        scan = PreparedScan.of_plan(make_plan(load(EXAMPLE)))
        with Device(f"socket://127.0.0.1:{port}", timeout_s=PATIENCE_S) as client:
            client.arm()
            client.trigger()
            for form in ("table", "fourier"):
                client.upload(scan.image(form), timeout_s=PATIENCE_S, force=True)
            played = len(log.read_text("ascii").splitlines())
            wait(lambda: len(log.read_text("ascii").splitlines()) > played + 20)
            assert client.status().faults == 0
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    assert {line.split()[-1] for line in log.read_text("ascii").splitlines()[:-1]} == {"00"}
