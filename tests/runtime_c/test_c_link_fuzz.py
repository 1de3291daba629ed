"""The kept corpus of ``make fuzz`` with sanitizers, on all of its targets; and that it finds what is broken."""

import subprocess
from collections.abc import Sequence
from pathlib import Path

import mutants
import pytest
from building import run_clean
from c_faults import Mutant as CMutant
from c_mutants_shaping import MUTANTS as SHAPED
from kept_objects import objects
from limits import within
from link_mutants import MUTANTS, Mutant
from test_c_link_moves import SLOW_MUTANTS as MOVED
from test_c_link_slow import MUTANTS as SLOW
from test_c_link_z import MUTANTS as OF_Z

from tablegen.base.resources import c_link, c_runtime

pytestmark = pytest.mark.rest

FUZZ = Path(__file__).parent / "fuzz"
CORPUS = FUZZ / "corpus"
CORPUS_S = 300  # of CPU time; it takes ten
OPTIONS = ("-std=c99", "-O1", "-g", "-fsanitize=fuzzer,address,undefined", "-fno-sanitize-recover=all")
# What leads to codes or memory that must not be, whatever is answered.
FOUND = {
    "code limits of the device are not checked",
    "the step is not checked",
    "every upload goes into the same tables",
    "a frame may be too long",
    "schedules are not checked",
    "a swap in mid-line",
    "the CRC of an answer is wrong",
}


# As `make fuzz` compiles it: the runtime as most have it, with all that it can play, with a second sequencer for z, and
# of scans at an angle that are moved.
TARGETS: dict[str, tuple[str, ...]] = {
    "plain": (),
    "all": ("-DDAC_SPLINE=1", "-DDAC_SHAPING=3"),
    "z": ("-DDAC_SPLINE=1", "-DDAC_COMMIT_MODES=1", "-DDAC_LINK_Z=1"),
    "slow": ("-DDAC_SPLINE=1", "-DDAC_SLOW_PART=1", "-DDAC_MOVE=1"),
}
# Codes of a buffer that are not those of steps, of what only the second target plays.
FOUND_WITH_ALL: dict[str, tuple[str, str, str]] = {
    "a run along a spline begins with a later segment": ("dac_run.h", "goes_on ? 1 : 0", "1"),
    "a shaped tick has half a code less": next(
        (each.file, each.old, each.new) for each in SHAPED if each.breaks == "a tick has half a code less"
    ),
}
# Gains that change while they play, and a read behind the last.
FOUND_WITH_SLOW = {
    name: found[name]
    for found, name in ((MOVED, "a move writes gains that play"), (SLOW, "knots need not reach the end"))
}
# A z that is not on the ticks of x and y, or not of their scan.
FOUND_WITH_Z = ("z is not committed", "z has no mode of its COMMIT", "a trigger is of x and y alone")


def replay(
    folder: Path, target: str = "plain", mutant: mutants.Mutant | Mutant | None = None
) -> subprocess.CompletedProcess[str]:
    """Compile a target, with a mutant in it or with none, and give it every file of the corpus."""
    sources: Sequence[Path] = [*c_runtime(), *c_link()]
    for path in sources:
        text = mutant.source if mutant is not None and mutant.file == path.name else path.read_text("utf-8")
        (folder / path.name).write_text(text, "utf-8")
    copies = [folder / path.name for path in sources]
    program = folder / "link"
    command = ["clang", *OPTIONS, *TARGETS[target]]
    run_clean([*command, *objects(command, [*copies, FUZZ / "link_fuzz.c"]), "-o", program])
    command = [str(program), "-runs=0", f"-artifact_prefix={folder}/", str(CORPUS)]
    return subprocess.run(within(CORPUS_S, command), capture_output=True, text=True, check=False, cwd=folder)


def test_the_corpus_is_small() -> None:
    sizes = [path.stat().st_size for path in CORPUS.iterdir()]
    assert 50 < len(sizes) < 200
    assert sum(sizes) < 300_000


@pytest.mark.parametrize("target", TARGETS)
def test_the_corpus_finds_nothing(target: str, tmp_path: Path) -> None:
    done = replay(tmp_path, target)
    assert done.returncode == 0, done.stderr[-3000:]
    assert "DONE" in done.stderr


@pytest.mark.rest
@pytest.mark.parametrize("name", sorted(FOUND))
def test_the_corpus_finds_what_is_broken(name: str, tmp_path: Path) -> None:
    (mutant,) = (each for each in MUTANTS if each.breaks == name)
    assert replay(tmp_path, mutant=mutant).returncode != 0


@pytest.mark.parametrize("name", FOUND_WITH_ALL)
def test_the_corpus_finds_what_is_broken_in_splines_and_shaping(name: str, tmp_path: Path) -> None:
    assert replay(tmp_path, "all", CMutant(name, *FOUND_WITH_ALL[name])).returncode != 0


@pytest.mark.parametrize("name", FOUND_WITH_Z)
def test_the_corpus_finds_what_is_broken_in_z(name: str, tmp_path: Path) -> None:
    assert replay(tmp_path, "z", Mutant(name, *OF_Z[name])).returncode != 0


@pytest.mark.parametrize("name", FOUND_WITH_SLOW)
def test_the_corpus_finds_what_is_broken_in_slow_parts(name: str, tmp_path: Path) -> None:
    assert replay(tmp_path, "slow", Mutant(name, *FOUND_WITH_SLOW[name])).returncode != 0
