"""The Fourier renderer in Verilog against ``synthesize``, bit for bit, and against exact arithmetic of the formula.

A job is the words of an axis and what is to come of them; the bench plays one after another and writes down every table
word that leaves. Mutants of the Verilog show that each check can fail.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from math import floor
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from building import BENCHES, REPOSITORY
from replacing import replace
from sets import LONG_TEST, one_of
from variants import plan_of

from tablegen.fixedpoint.rounding import signed_limits
from tablegen.fixedpoint.synthesis import FourierWords, sine_quarter, sine_table, synthesize
from tablegen.numerics.arrays import Ints
from tablegen.verification.verilog.simulate import Design, compile_design

MODULES = REPOSITORY / "firmware_templates" / "verilog"
RENDERER = [MODULES / f"dac_fourier{part}.v" for part in ("", "_product", "_sum")]
START_AGAIN, RESET, WRITE_AGAIN, AND_ONCE_MORE = 1, 2, 4, 8  # flags of the bench
HIGHEST = (1 << 31) - 1


@dataclass(frozen=True)
class Parameters:
    """Those of a renderer; pairs are x and y."""

    index_bits: tuple[int, int]
    word_bits: tuple[int, int]
    harmonics: int
    multiplier: int = 0

    def clocks(self, axis: int, harmonics: int) -> int:
        """How long a rendering takes, as the header of dac_fourier.v has it."""
        digits, latency = ((16, 6), (2, 8))[self.multiplier]
        return ((1 << self.index_bits[axis]) // 2 + 1) * (digits * (2 * harmonics + 3) + 2) + latency


@dataclass(frozen=True)
class Job:
    """Render words; ``write`` them first, or rely on their having been written by a job before."""

    axis: int
    words: FourierWords
    write: bool = True
    event: int = 0
    event_clock: int = 0

    def stimulus(self) -> list[int]:
        """The words of the job in the bench's file."""
        words = [int(word) & 0xFFFFFFFF for word in self.words.in_order] if self.write else []
        return [self.event, self.axis, self.words.harmonics, self.event_clock, len(words), *words]

    def expected(self, parameters: Parameters, table: Sequence[int]) -> list[dict[str, object]]:
        """What the bench is to write down."""
        whole = {
            "axis": self.axis,
            "clocks": parameters.clocks(self.axis, self.words.harmonics),
            "words": list(table),
        }
        cut = {"axis": self.axis, "clocks": self.event_clock, "words": None, "beginning": list(table)}
        first = cut if self.event & RESET else whole
        return [first, whole] if self.event & AND_ONCE_MORE else [first]


def table_of(parameters: Parameters, job: Job) -> list[int]:
    """The table words of a job as the host has them."""
    return synthesize(job.words, 1 << parameters.index_bits[job.axis], parameters.word_bits[job.axis]).tolist()


def failures(
    folder: Path,
    parameters: Parameters,
    jobs: Sequence[Job],
    tables: Sequence[Sequence[int]] | None = None,
    simulator: str = "icarus",
    sources: Sequence[Path] = tuple(RENDERER),
) -> int:
    """Run the jobs; 0 if every word and every duration is as expected, 1 if not."""
    folder.mkdir(parents=True, exist_ok=True)
    tables = tables or [table_of(parameters, job) for job in jobs]
    expected = [part for job, table in zip(jobs, tables, strict=True) for part in job.expected(parameters, table)]
    stimulus = [len(jobs), *(word for job in jobs for word in job.stimulus())]
    quarter = sine_quarter(max(parameters.index_bits))
    for name, words in (("jobs.mem", stimulus), ("sine.mem", quarter.tolist())):
        (folder / name).write_text("".join(f"{word:08x}\n" for word in words), "ascii")
    (folder / "expected.json").write_text(json.dumps(expected), "ascii")
    design = Design(
        sources=[BENCHES / "fourier_bench.v", *sources],
        top="fourier_bench",
        parameters={
            "X_INDEX_BITS": parameters.index_bits[0],
            "Y_INDEX_BITS": parameters.index_bits[1],
            "X_WORD_BITS": parameters.word_bits[0],
            "Y_WORD_BITS": parameters.word_bits[1],
            "HARMONICS": parameters.harmonics,
            "MULTIPLIER": parameters.multiplier,
            "SINE_FILE": str(folder / "sine.mem"),
            "JOB_WORDS": len(stimulus),
        },
    )
    compiled = compile_design(simulator, design, folder / "build")
    results = folder / "results.txt"
    results.unlink(missing_ok=True)
    clocks = len(stimulus) + 2 * sum(parameters.clocks(job.axis, job.words.harmonics) + 100 for job in jobs)
    tests, failed = compiled.run(
        "cocotb_fourier",
        {
            "FOURIER_RESULTS": str(results),
            "FOURIER_EXPECTED": str(folder / "expected.json"),
            "FOURIER_NANOSECONDS": str(10 * clocks),
        },
        [f"+jobs={folder / 'jobs.mem'}", f"+results={results}"],
    )
    assert tests == 1
    return failed


def words_of(a0: int, a: Sequence[int], b: Sequence[int]) -> FourierWords:
    return FourierWords(a0, np.array(a, dtype=np.int64), np.array(b, dtype=np.int64))


def random_words(generator: np.random.Generator, harmonics: int, total: int = (1 << 32) - 1) -> FourierWords:
    """Words whose magnitudes sum to ``total``, or as near to it as 32 bits a word let them; the bound is 2^32 - 1."""
    count = 2 * harmonics + 1
    shares = np.diff(np.sort(generator.integers(0, total + 1, count - 1)), prepend=0, append=total)
    words = np.minimum(shares, HIGHEST) * generator.choice([-1, 1], count)
    return FourierWords(int(words[0]), words[1 : harmonics + 1], words[harmonics + 1 :])


def ties(bits: int) -> list[FourierWords]:
    """Sums that lie half-way between two words, and beside that by less than a bit of a Fourier word."""
    unit = 1 << (31 - bits)
    halves = [(2 * m + 1) * (unit // 2) for m in (0, -1, 3, -4, (1 << (bits - 1)) - 1, -(1 << (bits - 1)) - 1)]
    return [words_of(half, [0], [beside]) for half in halves for beside in (0, 1, -1)]


def extremes() -> list[FourierWords]:
    """Sums at the bound of 4.0, of both signs, and the one word that has no negative."""
    return [
        words_of(HIGHEST, [HIGHEST], [0]),
        words_of(-HIGHEST - 1, [-HIGHEST], [0]),
        words_of(0, [-HIGHEST - 1, 0], [0, HIGHEST]),
        words_of(0, [0], [-HIGHEST - 1]),
        words_of(-HIGHEST, [HIGHEST], [1]),
    ]


@cache
def _exact_sine(j: int, length: int) -> int:
    with mp.workdps(40):
        value = mp.sinpi(mp.mpf(2 * j) / length) * 2**30
        return int(mp.sign(value) * mp.floor(abs(value) + mp.mpf("0.5")))


def exact_word(words: FourierWords, k: int, length: int, bits: int) -> int:
    """A table word by the formula of docs/sequencer.md, with mpmath's sine and without numpy's integers."""
    accumulator = words.a0 << 30
    for n in range(1, words.harmonics + 1):
        accumulator += int(words.a[n - 1]) * _exact_sine((n * k + length // 4) % length, length)
        accumulator += int(words.b[n - 1]) * _exact_sine(n * k % length, length)
    low, high = signed_limits(bits)
    return min(max(floor(Fraction(accumulator, 1 << (61 - bits)) + Fraction(1, 2)), low), high)


def mixed_jobs(parameters: Parameters, seed: int) -> list[Job]:
    """Random words up to the bound on both axes, of every kind of H, then ties and extremes where they fit."""
    generator = np.random.default_rng(seed)
    highest = parameters.harmonics
    jobs = [
        Job(axis, random_words(generator, h, total))
        for axis in (0, 1)
        for h in sorted({1, min(2, highest), highest})
        for total in ((1 << 32) - 1, 1 << 30)
    ]
    for axis in (0, 1):
        jobs += [Job(axis, words) for words in ties(parameters.word_bits[axis])]
        jobs += [Job(axis, words) for words in extremes() if words.harmonics <= highest]
    return jobs


@pytest.mark.common
@pytest.mark.parametrize(
    ("index_bits", "word_bits", "harmonics", "multiplier"),
    [
        ((3, 4), (8, 24), 3, 0),
        ((5, 3), (12, 18), 8, 1),
        ((4, 4), (20, 16), 1, 0),
        pytest.param((3, 4), (8, 24), 3, 1, marks=LONG_TEST),
        pytest.param((5, 3), (12, 18), 8, 0, marks=LONG_TEST),
        pytest.param((4, 4), (20, 16), 1, 1, marks=LONG_TEST),
    ],
)
def test_small_tables_equal_the_host_s(
    tmp_path: Path, index_bits: tuple[int, int], word_bits: tuple[int, int], harmonics: int, multiplier: int
) -> None:
    parameters = Parameters(index_bits, word_bits, harmonics, multiplier)
    assert failures(tmp_path, parameters, mixed_jobs(parameters, seed=harmonics)) == 0


@pytest.mark.rest
@pytest.mark.parametrize(
    "parameters",
    one_of(
        2,
        [
            Parameters((6, 7), (16, 12), 15),
            Parameters((8, 9), (18, 20), 5, multiplier=1),
            Parameters((11, 3), (16, 16), 2, multiplier=1),
            Parameters((10, 12), (24, 8), 4, multiplier=1),
        ],
    ),
    ids=str,
)
def test_longer_tables_equal_the_host_s(tmp_path: Path, parameters: Parameters) -> None:
    generator = np.random.default_rng(7)
    jobs = [Job(axis, random_words(generator, parameters.harmonics)) for axis in (0, 1)]
    assert failures(tmp_path, parameters, jobs) == 0


@pytest.mark.common
def test_512_harmonics(tmp_path: Path) -> None:
    """The most that the addresses allow, far above what the table resolves: n k goes round many times."""
    parameters = Parameters((5, 4), (16, 16), 512, multiplier=1)
    generator = np.random.default_rng(11)
    jobs = [Job(axis, random_words(generator, h)) for axis, h in ((0, 512), (1, 511), (1, 512))]
    assert failures(tmp_path, parameters, jobs) == 0


@pytest.mark.common
@pytest.mark.parametrize("multiplier", [0, 1])
def test_tables_equal_exact_arithmetic(tmp_path: Path, multiplier: int) -> None:
    """Whole tables against the formula, by a route that shares nothing with ``synthesize``."""
    parameters = Parameters((4, 5), (16, 10), 3, multiplier)
    jobs = mixed_jobs(parameters, seed=3)
    tables = [
        [
            exact_word(job.words, k, 1 << parameters.index_bits[job.axis], parameters.word_bits[job.axis])
            for k in range(1 << parameters.index_bits[job.axis])
        ]
        for job in jobs
    ]
    assert failures(tmp_path, parameters, jobs, tables) == 0


def test_the_jobs_reach_what_they_are_for() -> None:
    """Both limits, ties that round up, and neighbours of a tie that round down."""
    parameters = Parameters((4, 5), (16, 10), 3)
    for axis in (0, 1):
        bits = parameters.word_bits[axis]
        reached = {word for job in mixed_jobs(parameters, 3) if job.axis == axis for word in table_of(parameters, job)}
        assert set(signed_limits(bits)) <= reached
        tie, above, below = (table_of(parameters, Job(axis, words)) for words in ties(bits)[6:9])
        assert set(tie) == {4}
        assert set(above) == set(below) == {3, 4}
        assert above != below


@pytest.mark.rest
def test_the_example(tmp_path: Path) -> None:
    """Words of a real plan, 2048 and 4096 long, at the word widths of its tables; on Verilator, for the length."""
    plan = plan_of(tmp_path, {"y.table.length": "4096"})
    x, y = plan.x, plan.y
    parameters = Parameters(
        (x.program.index_bits, y.program.index_bits),
        (x.program.bits, y.program.bits),
        max(x.fourier.harmonics, y.fourier.harmonics),
    )
    assert parameters.index_bits == (11, 12)
    generator = np.random.default_rng(13)
    jobs = [Job(0, x.fourier), Job(1, y.fourier), Job(0, x.fourier, write=False)]
    jobs += [Job(axis, random_words(generator, 16)) for axis in (0, 1)]
    tables: list[list[int]] = [x.program.words.tolist(), y.program.words.tolist(), x.program.words.tolist()]
    tables += [table_of(parameters, job) for job in jobs[3:]]
    for job, table in zip(jobs, tables, strict=True):
        for k in (0, 1, len(table) // 2 - 1, 3 * len(table) // 4, len(table) - 1):
            assert table[k] == exact_word(job.words, k, len(table), parameters.word_bits[job.axis])
    assert failures(tmp_path / "verilator", parameters, jobs, tables, simulator="verilator") == 0


SMALL = Parameters((4, 3), (8, 12), 3)


def eventful_jobs(parameters: Parameters) -> list[Job]:
    """Resets, starts and writes while it renders; axes that keep their words while the other one is written."""
    generator = np.random.default_rng(17)
    x, y, z = (random_words(generator, parameters.harmonics, 1 << 31) for _ in range(3))
    last = parameters.clocks(0, x.harmonics)
    once = last // 9  # about the time of a pair of words
    jobs = [Job(0, x), Job(1, y), Job(0, x, write=False), Job(1, z), Job(1, z, write=False)]
    jobs += [Job(0, x, False, START_AGAIN, clock) for clock in (1, 2, once, last // 2, last - 1, last)]
    jobs += [Job(0, x, False, WRITE_AGAIN, clock) for clock in (1, last // 2)]
    for clock in (1, 2, 5, once, once + 3, once + 7, last // 2, last - 4):
        jobs += [Job(0, x, False, RESET, clock), Job(1, z, False), Job(0, x, False)]
    jobs += [Job(0, x, False, AND_ONCE_MORE), Job(1, z, False, AND_ONCE_MORE)]
    jobs += [Job(0, x, False, RESET | AND_ONCE_MORE, clock) for clock in range(last - 20, last)]
    return [*jobs, Job(0, words_of(1, [0], [0])), Job(1, z, write=False)]


WITH_A_PLAIN_MULTIPLIER = {"the low digit twice", "coefficients not signed"}
NO_GAP = "slot <= digit == LAST_DIGIT[3:0] ? OUT : SHIFT; digit <= digit + 4'd1;"
MUTANTS = {
    "no rounding": ("", "cut + 1'b1", "cut + 1'b0"),
    "one harmonic too few": ("", "harmonics - 10'd1", "harmonics - 10'd2"),
    "the last sine missing": ("", "address == {least_harmonics, 1'b1}", "address == {least_harmonics, 1'b0}"),
    "no saturation": ("", "table_data <= fits ?", "table_data <= 1'b1 ?"),
    "saturation above only": ("", "{(X_WORD_BITS-1){!below}}", "{(X_WORD_BITS-1){1'b1}}"),
    "wrong quadrant": ("", "backwards ? -along : along", "along"),
    "second half not negative": ("", "second_half_s ^ digit_negative", "digit_negative"),
    "no word for a sine of 1": ("", "sine_top <= backwards && along == 0", "sine_top <= 1'b0"),
    "sines of the mirror image": ("", "negative ^ sine_s", "negative"),
    "ends put out twice": ("", "out_2 && !(mirrored_2 && (at_end || position == 0))", "out_2"),
    "the other axis's words": ("", "coefficients[{axis_now, address_1}]", "coefficients[{1'b0, address_1}]"),
    "the other axis's rounding": ("", "axis_now ? y_cut : x_cut", "x_cut"),
    "a start while busy": ("", "if (start && !busy)", "if (start)"),
    "a write while busy": ("", "write && !busy &&", "write &&"),
    "no reset": ("", "if (reset || last)", "if (last)"),
    "sums survive a reset": ("", "clear = !busy ||", "clear ="),
    "no gap": ("", "if (last_term) slot <= GAP;", f"if (last_term) begin {NO_GAP} end"),
    "a digit never negative": ("_product", "take_off <= digit[2]", "take_off <= 1'b0"),
    "no digit of two": ("_product", "twice ?", "1'b0 ?"),
    "the low digit twice": ("_product", "digit_number[0] ? high : low", "low"),
    "coefficients not signed": ("_product", "coefficient_operand * $signed(", "$unsigned(coefficient_operand) * ("),
    "no carry of a negative": ("_sum", "one <= add && negative", "one <= 1'b0"),
    "carried with the wrong sign": ("_sum", "sum >>> DIGIT_BITS", "{2'b00, sum[DIGIT_BITS+32:2]}"),
    "nothing carried": ("_sum", "operand <= sum >>> DIGIT_BITS", "operand <= 0"),
}


@pytest.mark.rest
@pytest.mark.parametrize("multiplier", [0, 1])
def test_what_comes_while_it_renders(tmp_path: Path, multiplier: int) -> None:
    """And all that the mutants below are asked."""
    parameters = replace(SMALL, multiplier=multiplier)
    assert failures(tmp_path, parameters, [*eventful_jobs(parameters), *mixed_jobs(parameters, seed=3)]) == 0


@pytest.mark.rest
@pytest.mark.parametrize("name", one_of(4, MUTANTS))
def test_a_mutant_is_found(tmp_path: Path, name: str) -> None:
    """Negative control: with one thing wrong in the Verilog the comparison fails."""
    part, text, wrong = MUTANTS[name]
    sources = []
    for source in RENDERER:
        verilog = source.read_text("ascii")
        if source.stem == f"dac_fourier{part}":
            assert verilog.count(text) == 1, f"{text} is not once in {source.name}"
            verilog = verilog.replace(text, wrong)
        sources.append(tmp_path / source.name)
        sources[-1].write_text(verilog, "ascii")
    parameters = replace(SMALL, multiplier=int(name in WITH_A_PLAIN_MULTIPLIER))
    jobs = [*eventful_jobs(parameters), *mixed_jobs(parameters, seed=3)]
    assert failures(tmp_path, parameters, jobs, sources=sources) == 1


@pytest.mark.common
def test_a_wrong_word_is_found(tmp_path: Path) -> None:
    """Negative control of the comparison itself: the last bit of one expected word."""
    jobs = mixed_jobs(SMALL, seed=3)
    tables = [table_of(SMALL, job) for job in jobs]
    tables[1][5] ^= 1
    assert failures(tmp_path, SMALL, jobs, tables) == 1


def unfolded(quarter: Ints) -> Ints:
    """A whole sine table from its first quarter, as the renderer does it."""
    back = np.concatenate([[1 << 30], quarter[:0:-1]])
    half = np.concatenate([quarter, back])
    return np.concatenate([half, -half])


@pytest.mark.parametrize("index_bits", range(3, 17))
def test_a_quarter_of_the_sine_is_enough_for_every_length(index_bits: int) -> None:
    quarter = sine_quarter(index_bits)
    assert len(quarter) == 1 << (index_bits - 2)
    assert 0 <= int(quarter.min()) <= int(quarter.max()) < 1 << 30
    assert np.array_equal(unfolded(quarter), sine_table(1 << index_bits))
    assert np.array_equal(sine_quarter(16)[:: 1 << (16 - index_bits)], quarter)
    for j in (1, len(quarter) // 3, len(quarter) - 1):
        assert int(quarter[j]) == _exact_sine(j, 1 << index_bits)
