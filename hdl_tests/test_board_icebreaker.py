"""``examples/boards/icebreaker``, whole: from bytes on its serial line to the words at the pins of its converters.

What is simulated are the cells that ``make`` places, with block RAMs that read as 0 for some time after power-up, as
those of the part do (https://github.com/YosysHQ/icestorm/issues/76).
"""

from pathlib import Path

import pytest
from boards import TICKS, Board, expected_words, make
from building import NAME, tool
from link_talk import is_answer
from sets import LONG_TEST

from tablegen.api.build import build
from tablegen.link.messages import Request

pytestmark = [*LONG_TEST]

START_CLOCKS = 4096
ICEBREAKER = Board("icebreaker", clocks_per_tick=96, clocks_per_bit=104, limit=400_000)  # HELLO takes 125,000 clocks
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
    for name in ("yosys", "nextpnr-ice40", "icepack", "make"):
        tool(name)
    return ICEBREAKER.built(tmp_path_factory.mktemp("board"))


@pytest.fixture(scope="module")
def cells(board: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cells")
    library = folder / "cells.v"
    share = Path(tool("yosys")).resolve().parents[1] / "share" / "yosys"
    text = (share / "ice40" / "cells_sim.v").read_text("utf-8")
    assert text.count(RAM_READS) == text.count(RAM) == 1
    text = text.replace(RAM_READS, SLEEPY).replace(RAM, RAM + WAKES)
    library.write_text("`define NO_ICE40_DEFAULT_ASSIGNMENTS\n" + text, "utf-8")
    return ICEBREAKER.simulator(board / "build" / "icebreaker.json", folder, [library])


def test_the_bitstream_is_made(board: Path) -> None:
    """Placed in time for the clock of the board, or nextpnr ends with an error."""
    make(board, "build/icebreaker.bin")
    assert (board / "build" / "icebreaker.bin").stat().st_size == 104090  # of every UP5K


def test_the_cells_play_the_model_once_they_are_triggered(board: Path, cells: Path) -> None:
    fault, answers, words = ICEBREAKER.played(cells, START_CLOCKS - 100)
    assert all(is_answer(*pair) for pair in zip(answers, (Request.HELLO, Request.ARM, Request.TRIGGER), strict=False))
    assert not fault
    assert len(answers) >= 2
    whole = expected_words(build(board / f"{NAME}.toml").plan.program)
    assert all(len(each) >= TICKS - 2 for each in words)
    assert words == [each[: len(words[0])] for each in whole]


def test_memories_that_sleep_longer_than_the_start_are_seen(cells: Path) -> None:
    """The control: without the wait the board would neither answer nor play."""
    _, answers, words = ICEBREAKER.played(cells, START_CLOCKS + 200)
    assert (answers, words) == ([], [])
