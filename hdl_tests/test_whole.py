"""A part of a program is not committed: its registers would play over another program's table, and as valid.

Each part is written after a swap, when registers and table of the idle bank are of two programs, and refused; the words
that it lacks make it whole, and it is taken. Direct tables, tables of lines and Fourier words, in both sequencers.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from mutants import Mutant
from programs import random_dual, random_fourier, rendered
from replacing import replace
from sets import common, one_of
from stream_benches import with_sine
from stream_scripts import rendering_clocks

from tablegen.base.resources import verilog_runtime
from tablegen.device.dual_program import DualProgram
from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS, SCAN_WORDS, program_words
from tablegen.fixedpoint.synthesis import FourierWords
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import (
    PROGRAM,
    X_FOURIER,
    X_TABLE,
    Y_FOURIER,
    Y_TABLE,
    Script,
    read_capture,
    read_states,
)
from tablegen.verification.verilog.sequencer_bench import BenchRun, SequencerBench

pytestmark = pytest.mark.common

LINES = SequencerShape(16, 1, 3, 16, 1, 2, 16)
DIRECT = SequencerShape(16, 0, 5, 16, 1, 3, 16)
RENDERED = SequencerShape(16, 1, 4, 16, 1, 3, 16)
HARMONICS = 5
PACE = {0: 3, 1: 41}
COMMIT = (
    3 << 60 | 2 << 16
)  # a clock with a commit, as the bench reads it; of one that is refused the model knows nothing
Place = tuple[int, int]  # region and address
USED = [*range(len(SCAN_WORDS)), *(PAGE_WORDS * page + at for page in (1, 2) for at in range(len(AXIS_WORDS)))]

UNUSED = [(PROGRAM, at) for at in range(3 * PAGE_WORDS) if at not in USED]
BEYOND = 0x5555  # a word that no memory is to hold


def words_of(program: DualProgram, x: FourierWords | None, y: FourierWords | None) -> dict[Place, int]:
    """Every word of a program by its place."""
    registers = program_words(
        program.schedule, program.x, program.y, (x.harmonics if x else 0, y.harmonics if y else 0)
    )
    words = {(PROGRAM, at): registers[at] for at in USED}
    for region, rendered_words, table, own in (
        (X_FOURIER, x, X_TABLE, program.x),
        (Y_FOURIER, y, Y_TABLE, program.y),
    ):
        region, values = (region, rendered_words.in_order) if rendered_words else (table, own.words)
        words |= {(region, at): int(word) for at, word in enumerate(values)}
    return words


def nowhere(shape: SequencerShape, fourier: bool) -> list[Place]:
    """Places that a device has not; with fewer bits of region and address each would be one of its words."""
    ends = {PROGRAM: 3 * PAGE_WORDS, X_TABLE: 1 << shape.x_index_bits, Y_TABLE: 1 << shape.y_index_bits}
    ends |= dict.fromkeys((X_FOURIER, Y_FOURIER), 2 * HARMONICS + 1 if fourier else 0)
    ends |= dict.fromkeys(range(5, 8), 0)
    return [(region, at) for region, end in ends.items() for at in (end, end + 3, *(1 << bit for bit in range(6, 16)))]


def write_nowhere(script: Script, shape: SequencerShape, fourier: bool, pace: int) -> None:
    """Each is refused, and nothing is written."""
    script.wait_writable()
    script.come_to_rest()
    for region, address in nowhere(shape, fourier):
        script.write(region, [BEYOND], address)
        script.refused = True
        script.wait(1)
        script.state(f"write to {address} of {region}", rests=True)
        script.request("clear_faults")
    script.tick_every(pace)


def write(script: Script, words: dict[Place, int]) -> None:
    for (region, at), word in words.items():
        script.write(region, [word], at)


def refuse(script: Script) -> None:
    """A commit that is to be refused."""
    script.wait(1)
    script.commands.append(COMMIT)
    script._pass(1)
    script.wait(1)  # it is decided on the next clock, on which nothing can be written
    script.refused = True


def parts(words: dict[Place, int]) -> Iterator[set[Place]]:
    """What is left out: all but the park code, a region, and single words."""
    regions = {region for region, _ in words}
    yield set(words) - {(PROGRAM, PAGE_WORDS + AXIS_WORDS.index("park_code"))}
    yield from ({place for place in words if place[0] == region} for region in sorted(regions))
    yield from ({(PROGRAM, at)} for at in USED[::5])
    for region in sorted(regions - {PROGRAM}):
        last = max(at for own, at in words if own == region)
        yield from ({(region, at)} for at in (0, last // 2, last))


def script_of(shape: SequencerShape, low_area: int, fourier: bool) -> Script:
    """A scan without end, into which programs are written in two parts."""
    rng = np.random.default_rng(6)
    script = Script()
    script.tick_every(PACE[low_area])

    def some() -> tuple[DualProgram, FourierWords | None, FourierWords | None, int]:
        program = random_dual(rng, shape, (9, 14), lines=(1, 2))
        if not fourier:
            return program, None, None, 1
        x, y = (random_fourier(rng, int(rng.integers(2, HARMONICS + 1))) for _ in range(2))
        program = replace(program, x=rendered(program.x, x), y=rendered(program.y, y))
        return program, x, y, rendering_clocks(shape, x, y, 1)

    def commit(program: DualProgram, clocks: int) -> None:
        script.request("commit", program=program, commit_clocks=clocks)
        script.wait(clocks + 1)
        script.wait_ticks(15)

    def missing(words: dict[Place, int], left_out: set[Place]) -> None:
        """Write all but this, whose commit is refused."""
        write(
            script, dict.fromkeys(UNUSED, 0) | {place: word for place, word in words.items() if place not in left_out}
        )
        refuse(script)

    program, x, y, clocks = some()
    missing(words_of(program, x, y), {(X_FOURIER if fourier else X_TABLE, 0)})  # of the first program too
    write_nowhere(script, shape, fourier, PACE[low_area])
    refuse(script)  # nothing of it counts
    script.load(program, x, y)
    write_nowhere(script, shape, fourier, PACE[low_area])
    commit(program, clocks)
    script.request("arm", "trigger")
    refuse(script)  # registers of what plays, and the table of nothing
    for left_out in list(parts(words_of(program, x, y))):
        program, x, y, clocks = some()
        words = words_of(program, x, y)
        script.wait_writable()
        left_out = left_out & set(words) or {max(words)}  # its table may be shorter
        missing(words, left_out)
        script.wait_ticks(2)
        write(script, {place: words[place] for place in left_out})
        commit(program, clocks)
    # A program that was withdrawn is as complete as before.
    script.come_to_rest()
    script.load(program, x, y)
    script.request("withdraw")
    script.tick_every(PACE[low_area])
    commit(program, clocks)
    script.request("arm", "trigger")
    script.wait_ticks(20)
    refuse(script)
    script.wait_ticks(20)
    return script


CASES = {
    "lines": (LINES, 0, False),
    "direct": (DIRECT, 0, False),
    "fourier": (RENDERED, 0, True),
    "lines in low area": (LINES, 1, False),
}


@dataclass(frozen=True)
class WholeMutant(Mutant):
    """A fault in what counts the words of a program, and the case that finds it."""

    @property
    def path(self) -> Path:
        (found,) = (path for path in verilog_runtime() if path.stem == self.file)
        return found


SEQUENCER, COUNTS, TABLE = "dac_sequencer", "dac_whole", "dac_whole_table"
MUTANTS = [
    WholeMutant("any part is whole", SEQUENCER, "words_fit && whole && ", "words_fit && ", "lines"),
    WholeMutant("registers are not counted", COUNTS, "count[6] && x_whole", "x_whole", "lines"),
    WholeMutant("x is not counted", COUNTS, "x_whole && y_whole", "y_whole", "lines"),
    WholeMutant("y is not counted", COUNTS, "x_whole && y_whole", "x_whole", "lines"),
    WholeMutant("a register may be missing", COUNTS, "FIRST = 7'd26", "FIRST = 7'd27", "lines"),
    WholeMutant("a register more is needed", COUNTS, "FIRST = 7'd26", "FIRST = 7'd25", "lines"),
    WholeMutant("words that are none count", COUNTS, "address[3:0] < SCAN_WORDS", "1'b1", "lines"),
    WholeMutant("registers that were taken count", COUNTS, "if (take)", "if (1'b0)", "lines"),
    WholeMutant("a table that was taken counts", TABLE, "if (take)", "if (1'b0)", "lines"),
    WholeMutant("a withdrawn table is lost", SEQUENCER, ".take(take), .wh", ".take(take | withdraw), .wh", "lines"),
    WholeMutant("a word of a table may be missing", TABLE, "count >= needed", "count + 1 >= needed", "lines"),
    WholeMutant("a direct table has all words", TABLE, "length = wide[BITS:0]", "length = LENGTH", "direct"),
    WholeMutant("a word of a direct table may be missing", TABLE, "count >= needed", "count + 1 >= needed", "direct"),
    WholeMutant("a word of Fourier words may be missing", TABLE, "harmonics, 1'b1}", "harmonics, 1'b0}", "fourier"),
    WholeMutant("Fourier words do not count", TABLE, "(RENDERS && write_fourier)", "1'b0", "fourier"),
    WholeMutant("what does not exist is written", SEQUENCER, "writable && exists;", "writable;", "lines"),
    WholeMutant("what does not exist is not refused", SEQUENCER, "!(writable && exists)", "!writable", "lines"),
    WholeMutant("a page more exists", SEQUENCER, "WORDS = 16'd48", "WORDS = 16'd64", "lines"),
    WholeMutant("a table of x has no end", SEQUENCER, "write_address >> X_INDEX_BITS == 0", "1'b1", "lines"),
    WholeMutant("a table of y has no end", SEQUENCER, "write_address >> Y_INDEX_BITS == 0", "1'b1", "lines"),
    WholeMutant("a table of x is twice as long", SEQUENCER, ">> X_INDEX_BITS ==", ">> (X_INDEX_BITS + 1) ==", "lines"),
    WholeMutant("Fourier words without a renderer", SEQUENCER, "FOURIER != 0 && (write_r", "(write_r", "lines"),
    WholeMutant("other regions exist", SEQUENCER, "write_region == Y_FOURIER) &&", "1'b1) &&", "fourier"),
    WholeMutant("a Fourier word more exists", SEQUENCER, "<= LAST_FOURIER", "<= LAST_FOURIER + 1", "fourier"),
    WholeMutant("the last Fourier word is none", SEQUENCER, "<= LAST_FOURIER", "< LAST_FOURIER", "fourier"),
]  # fmt: skip


def played(case: str, folder: Path, mutant: WholeMutant | None = None) -> tuple[BenchRun, bool]:
    """The script of a case, in Icarus; and whether every write to nowhere was refused."""
    shape, low_area, fourier = CASES[case]
    folder.mkdir(exist_ok=True)
    sources = list(verilog_runtime())
    if mutant is not None:
        changed = folder / f"{mutant.file}.v"
        changed.write_text(mutant.source, "utf-8")
        sources[sources.index(mutant.path)] = changed
    states = folder / "states.hex"
    parameters: dict[str, int | str] = {"LOW_AREA": low_area, "STATES": str(states)}
    if fourier:
        parameters |= {"PLAIN_MULTIPLIER": 1, **with_sine(folder, shape, HARMONICS)}
    bench = SequencerBench("icarus", shape, folder, parameters, sources)
    script = script_of(shape, low_area, fourier)
    run = bench.play(script)
    stored = read_states([int(word) for word in read_capture(states)])
    return run, [state.flags for state in stored] == [state.flags for _, state in script.states]


@pytest.mark.parametrize("case", common(("lines", "direct", "fourier"), CASES))
def test_a_part_of_a_program_is_refused_and_the_rest_makes_it_whole(case: str, tmp_path: Path) -> None:
    run, refuses = played(case, tmp_path)
    assert run.equal, run
    assert refuses


@pytest.mark.rest
@pytest.mark.parametrize("mutant", one_of(2, MUTANTS), ids=lambda mutant: mutant.breaks)
def test_a_mutant_is_found(mutant: WholeMutant, tmp_path: Path) -> None:
    run, refuses = played(mutant.where, tmp_path, mutant)
    assert not (run.equal and refuses)


def test_every_word_of_the_map_is_counted() -> None:
    assert len(USED) == 38


def test_the_page_tells_how_many_mutants_there_are() -> None:
    page = (Path(__file__).resolve().parents[1] / "docs" / "verilog.md").read_text("utf-8")
    assert f"whole; with {len(MUTANTS)} mutants" in page
