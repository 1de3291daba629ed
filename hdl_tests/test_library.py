"""The index in Verilog: ``dac_library`` picks programs out of one memory, and the sequencer plays them as the model does.

Programs are picked in turn while a scan plays: from tables and from Fourier words, out of a fast and a slow memory. A
record that was damaged, or a number that there is not, is not committed, and what plays goes on.
"""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from building import BENCHES, run_clean
from editing import run
from libraries import programs, write_library

from tablegen.device.dual_program import DualProgram
from tablegen.device.sequencer import Sequencer

BENCH = BENCHES / "library_bench.v"
PROGRAMS = 3
TICKS = 260  # a line of the longest, and more
ORDER = (1, 2, 0, 1)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("library")
    done = run("sweep", write_library(folder), "-o", folder / "out", "-j", "1", "-f", "verilog", "-q")
    assert (done.status, done.out, done.err) == (0, "", "")
    return folder / "out"


@dataclass(frozen=True)
class Played:
    """What the bench has seen: a word for each pick, and the codes of every tick in between."""

    picks: list[str]
    codes: list[tuple[int, int, int]]
    model: list[tuple[int, int, int]]


def play(
    library: Path,
    work: Path,
    order: Sequence[int] = ORDER,
    *,
    fourier: bool = False,
    memory: str | None = None,
    clocks: int = 1,
    module: str | None = None,
) -> Played:
    """Simulate the bench in a folder of its own; ``memory`` and ``module`` stand in the place of the library's."""
    work.mkdir(exist_ok=True)
    for path in library.glob("*.mem"):
        shutil.copyfile(path, work / path.name)
    text = memory if memory is not None else memory_text(library, fourier)
    (work / "memory.mem").write_text(text, "ascii")
    (work / "picks.hex").write_text("".join(f"{number:x}\n" for number in order), "ascii")
    sources = [path for path in library.glob("dac_*.v") if path.name != "dac_library.v"]
    (work / "dac_library.v").write_text(module or (library / "dac_library.v").read_text("ascii"), "ascii")
    parameters = {"PICK_COUNT": len(order), "MEMORY_WORDS": text.count("\n"), "MEMORY_CLOCKS": clocks, "TICKS": TICKS}
    parameters["FOURIER"] = int(fourier)
    options = [f"-Plibrary_bench.{name}={value}" for name, value in parameters.items()]
    program = work / "bench.vvp"
    files = [BENCH, work / "dac_library.v", *sources]
    run_clean(["iverilog", "-g2005", "-Wall", "-Wno-timescale", f"-I{library}", *options, "-o", program, *files])
    run_clean(["vvp", "-n", program], cwd=work)
    return seen((work / "capture.txt").read_text("ascii").splitlines(), programs(library))


def memory_text(library: Path, fourier: bool = False) -> str:
    """The memory of the library."""
    return (library / f"lines_library_{'fourier' if fourier else 'tables'}.mem").read_text("ascii")


def seen(lines: list[str], stored: list[DualProgram]) -> Played:
    """The capture beside what the model plays that takes each program on the same tick."""
    model, picks, codes, expected = Sequencer(None), [], [], []
    number, started = 0, False
    for line in lines:
        kind, *words = line.split()
        if kind == "p":
            number = int(words[0])
            picks.append(str(number))
            continue
        if kind != "t":
            picks[-1] += kind
            continue
        swapped, x, y, faults = map(int, words)
        if swapped:
            model.commit(stored[number])
        tick = model.step()
        if swapped and not started:
            model.arm()
            started = model.trigger()
        codes.append((x, y, faults | swapped << 4))
        expected.append((tick.x, tick.y, int(tick.faults) | tick.swapped << 4))
    return Played(picks, codes, expected)


@pytest.mark.parametrize(("fourier", "clocks"), [(False, 1), (False, 7), (True, 0)])
def test_what_is_picked_plays_as_the_model_does(library: Path, tmp_path: Path, fourier: bool, clocks: int) -> None:
    played = play(library, tmp_path / "play", fourier=fourier, clocks=clocks)
    assert played.picks == [str(number) for number in ORDER]
    assert played.codes == played.model
    assert len(played.codes) == 1 + TICKS * len(ORDER)
    assert sum(flags >> 4 for _, _, flags in played.codes) == len(ORDER), "every pick was taken"


def test_what_is_damaged_or_missing_is_not_played(library: Path, tmp_path: Path) -> None:
    """A flipped bit of a table word of program 2, and a number that there is not: the others play on."""
    words = memory_text(library).split()
    at = int(words[2], 16) + 2 + 48 + 100
    words[at] = f"{int(words[at], 16) ^ 0x10:08x}"
    played = play(library, tmp_path / "play", (1, 2, PROGRAMS, 0), memory="".join(f"{word}\n" for word in words))
    assert played.picks == ["1", "2f", f"{PROGRAMS}f", "0"]
    assert played.codes == played.model
    assert sum(flags >> 4 for _, _, flags in played.codes) == 2


MUTANTS = {
    "a wrong sum is committed": ("commit <= word == ~crc;", "commit <= 1'b1;"),
    "the sum begins elsewhere": ("crc <= 32'hFFFFFFFF;", "crc <= 32'h7FFFFFFF;"),
    "another polynomial": ("32'hEDB88320", "32'hEDB88321"),
    "one number too many": ("failed <= wanted > LAST_PROGRAM;", "failed <= 1'b0;"),
    "x and y change places": ("part == PROGRAM ? x_left", "part == PROGRAM ? y_left"),
    "the region of y is that of x": ("(y_fourier ? 3'd4 : 3'd2)", "(y_fourier ? 3'd3 : 3'd1)"),
    "Fourier words of x go into its table": ("(x_fourier ? 3'd3 : 3'd1)", "3'd1"),
    "addresses begin at 1": ("write_address <= 16'd0;", "write_address <= 16'd1;"),
    "a word is written after it was turned": ("write_data <= memory_data;", "write_data <= {memory_data[0], memory_data[31:1]};"),
    "the first record for all": ("memory_address <= wanted[ADDRESS_BITS-1:0];", "memory_address <= {ADDRESS_BITS{1'b0}};"),
}


@pytest.mark.common
@pytest.mark.parametrize("name", MUTANTS)
def test_a_fault_in_the_module_is_found(library: Path, tmp_path: Path, name: str) -> None:
    right, wrong = MUTANTS[name]
    text = (library / "dac_library.v").read_text("ascii")
    assert text.count(right) == 1
    module = text.replace(right, wrong)
    fourier = "Fourier" in name
    words = memory_text(library, fourier).split()
    at = int(words[2], 16) + 2 + 48 + 100
    words[at] = f"{int(words[at], 16) ^ 0x10:08x}"
    memory = "".join(f"{word}\n" for word in words)
    played = play(library, tmp_path / "play", (1, 2, PROGRAMS, 0), memory=memory, module=module, fourier=fourier)
    right_picks = ["1", "2f", f"{PROGRAMS}f", "0"]
    assert (played.picks, played.codes) != (right_picks, played.model)


def test_verilator_has_no_complaint(library: Path, tmp_path: Path) -> None:
    lint = ["verilator", "--lint-only", "-Wall", "-GPROGRAMS=5", library / "dac_library.v"]
    run_clean(lint)


def test_illegal_parameters_stop_the_elaboration(library: Path, tmp_path: Path) -> None:
    for parameter in ("PROGRAMS=0", "PROGRAMS=65537", "ADDRESS_BITS=5", "ADDRESS_BITS=33"):
        name = parameter.partition("=")[0]
        with pytest.raises(AssertionError, match=f"dac_library_{name}_is_not"):
            run_clean(["iverilog", "-g2005", f"-Pdac_library.{parameter}", "-o", tmp_path / "x", library / "dac_library.v"])
