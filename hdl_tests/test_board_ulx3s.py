"""``examples/boards/ulx3s``, whole: from bytes on its serial line to the words at the pins of its converters.

What is simulated are the cells that ``make`` places.
"""

from pathlib import Path

import pytest
from boards import TICKS, Board, ecp5_library, expected_words, make
from building import NAME
from link_talk import is_answer

from tablegen.api.build import build
from tablegen.link.messages import Request

START_CLOCKS = 4096
ULX3S = Board("ulx3s", clocks_per_tick=50, clocks_per_bit=217, limit=800_000)  # HELLO takes 261,000 clocks


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return ULX3S.built(tmp_path_factory.mktemp("board"))


@pytest.fixture(scope="module")
def cells(board: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cells")
    return ULX3S.simulator(board / "build" / "ulx3s.json", folder, *ecp5_library(folder))


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_the_bitstream_is_made(board: Path) -> None:
    """Placed in time for the clock of the board, or nextpnr ends with an error."""
    make(board, "build/ulx3s.bit")
    assert (board / "build" / "ulx3s.bit").read_bytes()[:2] == b"\xff\x00"


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_the_cells_play_the_model_once_they_are_triggered(board: Path, cells: Path) -> None:
    fault, answers, words = ULX3S.played(cells)
    assert all(is_answer(*pair) for pair in zip(answers, (Request.HELLO, Request.ARM, Request.TRIGGER), strict=False))
    assert not fault
    assert len(answers) >= 2
    whole = expected_words(build(board / f"{NAME}.toml").plan.program)
    assert all(len(each) >= TICKS - 2 for each in words)
    assert words == [each[: len(words[0])] for each in whole]


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_memories_that_read_as_0_are_seen(cells: Path) -> None:
    """The control: without what its memories hold the board would not play."""
    _, _, words = ULX3S.played(cells, START_CLOCKS + 200)
    assert words == []
