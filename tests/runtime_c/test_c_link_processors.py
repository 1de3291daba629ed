"""The C link by other compilers, with sanitizers, without a long multiplication, and in the other byte order."""

from pathlib import Path

import pytest
from link_replay import Replay, compile_replay, differs, random_replay
from sets import long

from tablegen.verification.play.sequencer_shape import SequencerShape

pytestmark = pytest.mark.rest

SANITIZED = ("-std=c99", "-O1", "-g", "-fsanitize=undefined,address", "-fno-sanitize-recover=all")
MODES = "-DDAC_COMMIT_MODES=1"
MOVES = "-DDAC_MOVE=1"
STORE = ("-DDAC_STORE=1", "-DDAC_LIBRARY=2")
WAYS = {
    "gcc": (("gcc",), SANITIZED),
    "clang": (("clang",), SANITIZED),
    "small": (("gcc",), ("-std=c99", "-Os")),
    "no long multiplication, small slices": (
        ("clang",),
        ("-std=c11", "-O3", "-DDAC_LONG_MULTIPLY=0", "-DDAC_LINK_SLICE=5"),
    ),
}


@pytest.fixture(scope="module")
def replays() -> list[Replay]:
    """Of tables in 16 bits and in 32, with a key and without."""
    kinds = [
        SequencerShape(16, 1, 5, 16, 1, 4, 16),
        SequencerShape(12, 1, 4, 16, 0, 4, 14),
        SequencerShape(24, 1, 4, 18, 1, 3, 24),
    ]
    return [random_replay(shape, seed, keyed) for shape in kinds for seed, keyed in ((1, False), (2, True), (3, False))]


@pytest.fixture(scope="module")
def replays_with_modes() -> list[Replay]:
    """Of devices whose COMMIT may have a mode."""
    kinds = [SequencerShape(16, 1, 5, 16, 1, 4, 16), SequencerShape(24, 1, 4, 18, 1, 3, 24)]
    return [random_replay(shape, seed, keyed, modes=True) for shape in kinds for seed, keyed in ((4, False), (5, True))]


@pytest.fixture(scope="module")
def replays_with_moves() -> list[Replay]:
    """Of devices that take MOVE."""
    kinds = [SequencerShape(16, 1, 5, 16, 1, 4, 16), SequencerShape(24, 1, 4, 18, 1, 3, 24)]
    return [random_replay(shape, seed, keyed, moves=True) for shape in kinds for seed, keyed in ((8, False), (9, True))]


@pytest.fixture(scope="module")
def replays_with_a_store() -> list[Replay]:
    """Of devices that keep programs, and play them by number."""
    kinds = [SequencerShape(16, 1, 5, 16, 1, 4, 16), SequencerShape(24, 1, 4, 18, 1, 3, 24)]
    how = {"store": True, "plays": True}
    return [random_replay(shape, seed, keyed, **how) for shape in kinds for seed, keyed in ((6, False), (7, True))]


def hold(replays: list[Replay], folder: Path, emulator: str | None = None, **how: tuple[str, ...]) -> None:
    programs = {bits: compile_replay(folder / f"replay_{bits}", bits, **how) for bits in (16, 32)}
    for replay in replays:
        assert len(replay.heard) > 2000
        found = differs(programs[replay.bits], replay, emulator)
        assert found is None, found


@pytest.mark.parametrize("way", long([way for way in WAYS if way != "gcc"], WAYS))
def test_compilers_and_sanitizers(way: str, replays: list[Replay], tmp_path: Path) -> None:
    compiler, options = WAYS[way]
    hold(replays, tmp_path, compiler=compiler, options=options)


@pytest.mark.long
@pytest.mark.timeout(86_400)
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_sanitizers_with_modes_of_a_commit(compiler: str, replays_with_modes: list[Replay], tmp_path: Path) -> None:
    hold(replays_with_modes, tmp_path, compiler=(compiler,), options=(*SANITIZED, MODES))


@pytest.mark.parametrize("compiler", long(["gcc"], ["gcc", "clang"]))
def test_sanitizers_with_moves(compiler: str, replays_with_moves: list[Replay], tmp_path: Path) -> None:
    hold(replays_with_moves, tmp_path, compiler=(compiler,), options=(*SANITIZED, MOVES))


@pytest.mark.parametrize("compiler", long(["gcc"], ["gcc", "clang"]))
def test_sanitizers_with_kept_programs(compiler: str, replays_with_a_store: list[Replay], tmp_path: Path) -> None:
    hold(replays_with_a_store, tmp_path, compiler=(compiler,), options=(*SANITIZED, *STORE))


def test_the_other_byte_order(
    replays: list[Replay], replays_with_modes: list[Replay], replays_with_a_store: list[Replay], tmp_path: Path
) -> None:
    """And a processor of 32 bits."""
    options = ("-std=c99", "-O2", "-static")
    hold(replays, tmp_path, "qemu-mips", compiler=("mips-linux-gnu-gcc",), options=options)
    assert (tmp_path / "replay_16").read_bytes()[4:6] == b"\1\2"
    hold(replays_with_modes, tmp_path, "qemu-mips", compiler=("mips-linux-gnu-gcc",), options=(*options, MODES))
    hold(replays_with_a_store, tmp_path, "qemu-mips", compiler=("mips-linux-gnu-gcc",), options=(*options, *STORE))
