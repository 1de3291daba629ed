"""Programs with a slow part in C against the integer model, by steps and by fills; refusals; mutants to be found."""

import ctypes
import faulthandler
import os
from collections import Counter
from ctypes import c_bool, c_uint64
from functools import cache
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from c_library import (
    BAD_PERIOD,
    BAD_SLOW_PART,
    LOADED,
    Library,
    Twin,
    compile_library,
)
from c_scripts import long_dual
from frame_programs import scan_program, shaped_scan
from limits import limit
from programs import random_schedule
from replacing import replace
from sets import common, common_of, one_of

from tablegen.base.resources import c_runtime
from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import ScanProgram
from tablegen.device.sequencer import can_keep
from tablegen.fixedpoint.frame_program import FrameProgram, Knots, SlowTable
from tablegen.fixedpoint.phase import RationalPhase
from tablegen.fixedpoint.shaping import Shaping
from tablegen.verification.play.sequencer_shape import SequencerShape

SLOW = ("-DDAC_SLOW_PART=1", "-DDAC_COMMIT_MODES=1")
OPTIONS: dict[str, tuple[str, ...]] = {
    "plain": (),
    "short": ("-DDAC_LONG_MULTIPLY=0",),
    "fine": (),
    "short_fine": ("-DDAC_LONG_MULTIPLY=0",),
    "spline": ("-DDAC_SPLINE=1",),
    "short_spline": ("-DDAC_LONG_MULTIPLY=0", "-DDAC_SPLINE=1"),
    "shaping": ("-DDAC_SHAPING=3",),
    "short_shaping": ("-DDAC_SHAPING=3", "-DDAC_LONG_MULTIPLY=0"),
    "spline_shaping": ("-DDAC_SHAPING=3", "-DDAC_SPLINE=1"),
    "few_spline_shaping": ("-DDAC_SHAPING=3", "-DDAC_LONG_MULTIPLY=0", "-DDAC_FEW_REGISTERS=1", "-DDAC_SPLINE=1"),
    "wide": ("-DDAC_SPLINE=1",),
    "wide_shaping": ("-DDAC_SHAPING=3", "-DDAC_SPLINE=1"),
    "short_wide": ("-DDAC_LONG_MULTIPLY=0", "-DDAC_SPLINE=1"),
    "few_wide_shaping": ("-DDAC_SHAPING=3", "-DDAC_LONG_MULTIPLY=0", "-DDAC_FEW_REGISTERS=1", "-DDAC_SPLINE=1"),
}
TICKS, LINES = 90, 5
LONG_TICKS = 700  # of lines with many runs
LINEAR = (SequencerShape(16, 1, 5, 16, 1, 6, 16), SequencerShape(16, 1, 8, 12, 1, 3, 16))
CUBIC = (SequencerShape(16, 3, 5, 16, 3, 4, 16), SequencerShape(16, 1, 4, 16, 3, 6, 14))
FINE = (SequencerShape(24, 1, 5, 16, 1, 6, 16), SequencerShape(24, 1, 4, 12, 1, 3, 16))  # a code for each sample
WIDE = (SequencerShape(20, 1, 6, 24, 3, 5, 21), SequencerShape(24, 3, 4, 20, 1, 5, 8))


def shapes(option: str) -> tuple[SequencerShape, ...]:
    if "wide" in option:
        return WIDE
    if "fine" in option:
        return FINE
    return LINEAR + (CUBIC if "spline" in option else ())


@cache
def programs(option: str) -> list[ScanProgram]:
    """Programs of one frame with slow parts of both axes, of one, and of none; and a few of other ticks and lines."""
    rng = np.random.default_rng(11)
    made: list[ScanProgram] = []
    for shape in shapes(option):
        if shape.dac_bits != shapes(option)[0].dac_bits:
            continue
        for slow, kind in (("xy", "smooth"), ("xy", "wild"), ("x", "smooth"), ("y", "smooth"), ("xy", "smooth")):
            schedule = replace(random_schedule(rng, TICKS, 1), lines=LINES)
            made.append(scan_program(rng, shape, schedule, slow, kind))
        made.append(long_dual(rng, shape, (TICKS, TICKS), (LINES, LINES)))
        for ticks, lines in ((60, LINES), (TICKS, 3), (1, 7), (8, 1), (LONG_TICKS, 2)):
            schedule = replace(random_schedule(rng, ticks, 1), lines=lines)
            made.append(scan_program(rng, shape, schedule, "xy"))
    if "shaping" in option:
        made = [shaped_scan(rng, each) for each in made]
    return [replace(each, schedule=replace(each.schedule, settle_lines=int(rng.integers(0, 3)))) for each in made]


def commit(twin: Twin, program: ScanProgram, mode: CommitMode) -> None:
    """Commit a program to both with a mode; one that waits is withdrawn."""
    twin.device.answer()
    if twin.model.idle is not None:
        twin.ask("withdraw")
        twin.device.answer()
    assert twin.device.load(program) == LOADED
    assert twin.device.commit_at(mode)
    twin.model.commit(program, mode)


def library_of(path: Path) -> Library:
    library = Library(path)
    library.dll.dac_sequencer_commit_at.restype = c_bool
    return library


def compiled(folder: Path, option: str, **how: object) -> Path:
    bits, code_bits = (32 if any(name in option for name in names) else 16 for names in (("wide",), ("wide", "fine")))
    more = [*SLOW, *OPTIONS[option]]
    return compile_library(folder / f"{option}.so", bits, code_bits, 2, more=more, **how)  # type: ignore[arg-type]


def play(library: Library, option: str, seed: int, rounds: int = 40) -> Counter[str]:
    """Play commits of all modes at any tick beside the model; return what happened."""
    rng, choice = np.random.default_rng(seed), programs(option)
    twin, seen = Twin(library, choice[0]), Counter[str]()
    commit(twin, choice[int(rng.integers(len(choice)))], CommitMode(int(rng.integers(3))))
    twin.ask("arm", "trigger")
    # A blind fill leaves the pixels unknown up to the next window, so markers are compared without such fills.
    ways = ["blind"] if seed % 3 == 0 else ["step", "fill", "fill"]
    for _ in range(rounds):
        twin.play(int(rng.integers(1, 4 * TICKS)), str(rng.choice(ways)))
        mode, program = CommitMode(int(rng.integers(3))), choice[int(rng.integers(len(choice)))]
        playing = twin.model.playing
        if playing is not None:
            kinds = (isinstance(axis, FrameProgram) for axis in (playing.x, playing.y))
            seen["".join(name for name, slow in zip("xy", kinds, strict=True) if slow) or "none"] += 1
        match str(rng.choice(["commit"] * 6 + ["park", "start", "withdraw", "clear_faults"])):
            case "commit":
                commit(twin, program, mode)
                if mode == CommitMode.KEEP and twin.model.running and playing and can_keep(playing, program):
                    seen["kept"] += 1
            case "start":
                twin.ask("arm", "trigger", frames=int(rng.choice([0, 1, 2])))
            case request:
                twin.ask(request)
        if not twin.model.running and rng.random() < 0.8:
            twin.ask("arm", "trigger", frames=int(rng.choice([0, 0, 3])))
    return seen


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("libraries")


@pytest.mark.common
@pytest.mark.parametrize("option", common_of(6, ("plain", "short_spline"), OPTIONS))
def test_slow_parts_equal_the_model(option: str, folder: Path) -> None:
    library = library_of(compiled(folder, option))
    seen = Counter[str]()
    for seed in range(16):
        seen += play(library, option, seed)
    assert min(seen[name] for name in ("none", "x", "y", "xy", "kept")) > 10, seen


def test_nothing_else_is_played_without_the_option(folder: Path) -> None:
    """The structures are those of today, and no function of a line is linked."""
    library = Library(compile_library(folder / "default.so"))
    assert not library.slow_part
    assert not hasattr(library.dll, "dac_slow_begin_line")


COUNTS = {
    "DAC_CODE_ATTR static void pass(": "uint64_t probe_run_ticks;\nDAC_CODE_ATTR static void pass(",
    "    s->catching_up = false;\n    if (markers == NULL) {": (
        "    probe_run_ticks += ticks;\n    s->catching_up = false;\n    if (markers == NULL) {"
    ),
}


def runtime_with(changes: dict[str, str], folder: Path) -> list[Path]:
    """Write the runtime with other texts, each of which is in it once."""
    texts = {path.name: path.read_text("utf-8") for path in c_runtime()}
    for old, new in changes.items():
        (name,) = (name for name, text in texts.items() if old in text)
        assert texts[name].count(old) == 1, old
        texts[name] = texts[name].replace(old, new)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, "utf-8")
    return [folder / name for name in texts]


def even_waves(option: str, seed: int, ticks: int = 4000, amplitude: float = 0.6) -> ScanProgram:
    """Long smooth lines with ramps, that no limit and no guard touches; shorter ones with 6 ticks from word to word."""
    rng = np.random.default_rng(seed)
    shape = shapes(option)[-1 if "spline" in option else 0]
    schedule = replace(random_schedule(rng, ticks, 1), lines=3, settle_lines=0)
    program = scan_program(rng, shape, schedule, "xy")

    def free(axis: FrameProgram, number: int) -> FrameProgram:
        fast, half, length = axis.fast, 1 << (axis.fast.bits - 1), len(axis.fast.words)
        words = np.floor(amplitude * half * np.sin(2 * np.pi * np.arange(length) / length)).astype(np.int64)
        slow_bits = min(fast.bits, 21)
        turn = 2 * np.pi * (np.arange(8) / 8 + 0.3)
        slow = replace(
            axis.slow,
            words=np.floor((1 << (slow_bits - 2)) * np.sin(turn)).astype(np.int64),
            gain_word=(-1 if number else 1) * (1 << (fast.output.dac_bits + fast.output.gain_q - slow_bits - 6)),
            offset_word=1 << (fast.output.dac_bits + fast.output.gain_q - 1),
        )
        gain = 1600 if "fine" in option else 20_000  # the larger one would not fit there
        gains = replace(axis.gains, words=np.linspace(gain, 1.2 * gain, len(axis.gains.words)).astype(np.int64))
        top = (1 << fast.output.dac_bits) - 1
        order = 1 + (seed + number) % 3 if "shaping" in option else 0
        shaping = Shaping(order, 100 if order == 3 else 0)
        output = replace(fast.output, code_min=0, code_max=top, max_step=top // 32, park_code=top // 2, shaping=shaping)
        if "fine" in option:
            output = replace(output, gain_word=gain)
        return replace(axis, fast=replace(fast, words=words, output=output), slow=slow, gains=gains)

    axes = [free(axis, number) for number, axis in enumerate((program.x, program.y)) if isinstance(axis, FrameProgram)]
    return replace(program, x=axes[0], y=axes[1])


LONG_LINE = 12_274  # of which 32 bits hold the place of 10 ticks between two words, and not that of 64
SHORT_LINES = 200, 0.05  # ticks, and an amplitude by which 16 of them stay in a window


def without_ramps(program: ScanProgram) -> ScanProgram:
    """The program with a slow part of x and y that stands still."""

    def still(axis: FrameProgram) -> FrameProgram:
        return replace(axis, slow=replace(axis.slow, gain_word=0))

    assert isinstance(program.x, FrameProgram)
    assert isinstance(program.y, FrameProgram)
    return replace(program, x=still(program.x), y=still(program.y))


def guarded_waves(steep: str, over: int) -> ScanProgram:
    """Short lines of which one part is steep, beside a slew guard of its largest step less a few codes.

    It is steep by the words that are mixed in, by the gain of its lines, or by their ramps.
    """
    program = even_waves("plain", 0)
    schedule = replace(random_schedule(np.random.default_rng(1), 64, 1), lines=8, settle_lines=0)

    def guarded(axis: FrameProgram) -> FrameProgram:
        fast, q = axis.fast, axis.output.gain_q
        words = np.floor(100 * np.sin(2 * np.pi * np.arange(len(fast.words)) / len(fast.words))).astype(np.int64)
        second = np.where(np.arange(len(words)) % 2, 127, -127) * (steep == "second")
        slow = SlowTable(np.array([0, 0, 8, 8, 0, 0, -8, -8]) * 1000 * (steep == "ramp"), 1 << 12, 1 << 15 + q)
        gain = {"second": 20_000, "gain": 40_000, "ramp": 2000}[steep]
        gains, ratios = (Knots(np.array([word] * 2), 8) for word in (gain, 2000))
        output = replace(fast.output, gain_word=20_000, code_min=0, code_max=65535, park_code=32768, max_step=65535)
        fast = replace(fast, words=words, phase=RationalPhase(schedule.ticks), output=output)
        made = FrameProgram(fast, schedule.lines, gains, ratios, second, slow)
        largest = int(np.max(np.abs(np.diff(made.frame().ravel()))))
        return replace(made, fast=replace(fast, output=replace(output, max_step=max(largest - over, 1))))

    assert isinstance(program.x, FrameProgram)
    assert isinstance(program.y, FrameProgram)
    return replace(program, x=guarded(program.x), y=guarded(program.y), schedule=schedule)


def jumps(ticks: int = 256, height: int = 2048) -> ScanProgram:
    """Lines with jumps by which the value of a code grows by 2^32: 32 bits do not see them."""
    program = even_waves("plain", 1)
    schedule = replace(random_schedule(np.random.default_rng(1), ticks, 1), lines=3, settle_lines=0)

    def jumping(axis: FrameProgram) -> FrameProgram:
        words = np.where(np.arange(256) % 128 < 70, 0, height)
        output = replace(axis.output, gain_word=1, max_step=200)
        fast = replace(axis.fast, words=words, phase=RationalPhase(ticks), output=output)
        gains = Knots(np.full(2, -(1 << 17)), 3)
        ratios, second = Knots(np.zeros(2, np.int64), 3), np.zeros(256, np.int64)
        return FrameProgram(fast, 3, gains, ratios, second, replace(axis.slow, gain_word=axis.slow.gain_word // 16))

    assert isinstance(program.x, FrameProgram)
    assert isinstance(program.y, FrameProgram)
    return ScanProgram(jumping(program.x), jumping(program.y), schedule)


@pytest.mark.common
@pytest.mark.parametrize("option", common(("short",), ("plain", "short")))
def test_jumps_that_32_bits_do_not_see_are_played_one_by_one(option: str, folder: Path) -> None:
    play_fills(library_of(compiled(folder, option)), jumps(), 5000)


SLOW_JUMPS = 4096, 2185  # from the first to the last of the 16 ticks between two words


def long_segments(option: str, seed: int) -> ScanProgram:
    """Lines of any words with many ticks from word to word."""
    rng = np.random.default_rng(seed)
    bits = int(rng.integers(3, 6))
    ticks = int(rng.integers(8 << bits, 40 << bits))
    shape = replace(shapes(option)[0], x_index_bits=bits, y_index_bits=bits)
    schedule = replace(random_schedule(rng, ticks, 1), lines=3)
    return scan_program(rng, shape, schedule, "xy", str(rng.choice(["smooth", "wild"])))


def wide_window() -> ScanProgram:
    """Lines so steep that 16 ticks need a window of 2^12 codes, which 32 bits do not hold."""
    return with_output(even_waves("plain", 1, 512), max_step=65_535)


def crossing(option: str) -> ScanProgram:
    """Smooth lines that pass both limits."""
    top = (1 << shapes(option)[0].dac_bits) - 1
    return with_output(even_waves(option, 2), code_min=4 * top // 9, code_max=5 * top // 9)


def steep_ramps() -> ScanProgram:
    """Lines of 64 ticks from word to word, during which a ramp adds 2^32: the guard acts on every tick."""
    program = even_waves("plain", 1)
    schedule = replace(random_schedule(np.random.default_rng(1), 512, 1), lines=8, settle_lines=0)

    def steep(axis: FrameProgram) -> FrameProgram:
        q, words = axis.output.gain_q, np.array([0] * 6 + [20_000, 0])  # so steep that the window stays narrow
        output = replace(axis.output, max_step=60)
        fast = replace(axis.fast, words=words, phase=RationalPhase(512), output=output)
        slow = SlowTable(np.array([1, 1, -1, -1] * 2) * 30_000, 72_723, 1 << 15 + q)  # 65 codes a tick
        gains, ratios = (Knots(np.full(2, word), 8) for word in (20_000, 0))
        return FrameProgram(fast, 8, gains, ratios, np.zeros(8, np.int64), slow)

    assert isinstance(program.x, FrameProgram)
    assert isinstance(program.y, FrameProgram)
    return ScanProgram(steep(program.x), steep(program.y), schedule)


def with_output(program: ScanProgram, **fields: int) -> ScanProgram:
    def one(axis: FrameProgram) -> FrameProgram:
        return replace(axis, fast=replace(axis.fast, output=replace(axis.output, **fields)))

    assert isinstance(program.x, FrameProgram)
    assert isinstance(program.y, FrameProgram)
    return replace(program, x=one(program.x), y=one(program.y))


def play_fills(library: Library, program: ScanProgram, ticks: int, code: int = 0) -> None:
    """Play the program alone, by fills, from a code of both axes."""
    twin = Twin(library, program, (code, code))
    commit(twin, program, CommitMode.LINE)
    twin.ask("arm", "trigger")
    for _ in range(ticks // 1000):
        twin.play(1000, "fill")


@pytest.mark.common
@pytest.mark.parametrize("option", common_of(6, ("plain", "short_spline"), OPTIONS))
def test_most_ticks_of_smooth_lines_come_from_runs(option: str, tmp_path: Path) -> None:
    """Without that, the tests of the loops for many ticks would show nothing."""
    library = library_of(compiled(tmp_path, option, runtime=runtime_with(COUNTS, tmp_path / "counting")))
    ticks = c_uint64.in_dll(library.dll, "probe_run_ticks")
    for seed in range(4):
        program = even_waves(option, seed)
        assert isinstance(program.x, FrameProgram)
        assert isinstance(program.y, FrameProgram)
        assert np.all(program.x.ramps() * program.y.ramps() != 0), "every line has a ramp on both axes"
        twin = Twin(library, program)
        commit(twin, program, CommitMode.LINE)
        twin.ask("arm", "trigger")
        twin.play(4000)
        before = ticks.value
        for _ in range(10):
            twin.play(900, "fill")
        assert twin.model.fault_counts == dict.fromkeys(twin.model.fault_counts, 0)
        assert ticks.value - before > 0.95 * 9000


SEGMENT_COUNTS = {
    "DAC_NOINLINE uint32_t play_segments(": "uint64_t probe_segment_ticks;\nDAC_NOINLINE uint32_t play_segments(",
    "    axis->code = (int32_t)code;\n    return s.ticks - left;": (
        "    axis->code = (int32_t)code;\n    probe_segment_ticks += s.ticks - left;\n    return s.ticks - left;"
    ),
}


@pytest.mark.common
@pytest.mark.parametrize("option", common(("short",), ("plain", "short", "fine", "short_fine")))
def test_lines_with_many_ticks_from_word_to_word_equal_the_model(option: str, tmp_path: Path) -> None:
    """Smooth ones are played from word to word nearly all the time, those with few ticks between two words never."""
    library = library_of(compiled(tmp_path, option, runtime=runtime_with(SEGMENT_COUNTS, tmp_path / "counting")))
    ticks = c_uint64.in_dll(library.dll, "probe_segment_ticks")
    play_fills(library, even_waves(option, 0), 9000)
    assert ticks.value > 0.95 * 2 * 9000, "of both axes"
    play_fills(library, even_waves(option, 0, LONG_LINE), 13_000)
    assert ticks.value > 0.95 * 2 * 22_000
    for seed in range(12):
        play_fills(library, long_segments(option, seed), 2000)
    for program in (jumps(*SLOW_JUMPS), wide_window(), crossing(option), steep_ramps()):
        play_fills(library, program, 5000)
    before = ticks.value
    play_fills(library, even_waves(option, 0, *SHORT_LINES), 3000)
    assert ticks.value == before


class Loading:
    """A program with slow parts on both axes whose words can be changed, with room for the longest tables."""

    def __init__(self, library: Library, shape: SequencerShape) -> None:
        rng = np.random.default_rng(5)
        schedule = replace(random_schedule(rng, 64, 1), lines=6)
        made = scan_program(rng, shape, schedule, "xy")
        self.twin = Twin(library, made)
        self.program, self.axes = library.program(made)
        word = ctypes.c_int16 if library.word_bytes == 2 else ctypes.c_int32
        self.words: list[dict[str, Any]] = []
        for axis in self.axes:
            assert axis.slow is not None
            words = {
                "gains": (ctypes.c_int32 * 66)(),
                "ratios": (ctypes.c_int16 * 66)(),
                "second": (ctypes.c_int8 * (1 << 16))(),
                "mixed": (word * ((1 << 16) + 3))(),
                "table": (word * ((1 << 15) + 3))(),
            }
            for name, array in words.items():
                setattr(axis.slow, name, ctypes.addressof(array))
            axis.slow.gain_knots, axis.slow.gain_spacing = 3, 3
            axis.slow.ratio_knots, axis.slow.ratio_spacing = 3, 3
            axis.slow.index_bits, axis.slow.gain_word, axis.slow.offset_word = 3, 1, 0
            self.words.append(words)
        assert self.loads() == LOADED

    def loads(self) -> int:
        """Load the program as it is now."""
        return self.twin.device.load(self.program)

    def after(self, **fields: object) -> int:
        """Load the program with other fields in the slow part of x, and again in that of y; the worse result."""
        results = set()
        for axis in self.axes:
            assert axis.slow is not None
            before = {name: getattr(axis.slow, name) for name in fields}
            for name, value in fields.items():
                setattr(axis.slow, name, value)
            results.add(self.loads())
            for name, value in before.items():
                setattr(axis.slow, name, value)
        (result,) = results
        return result

    def with_word(self, name: str, at: int, value: int, **fields: object) -> int:
        """Load the program with another word in an array of both axes."""
        before = [words[name][at] for words in self.words]
        for words in self.words:
            words[name][at] = value
        result = self.after(**fields)
        for words, value_before in zip(self.words, before, strict=True):
            words[name][at] = value_before
        return result


FIELDS: dict[str, tuple[dict[str, int | None], dict[str, int | None]]] = {
    "one knot of the gain": ({"gain_knots": 1, "gain_spacing": 99}, {"gain_knots": 2, "gain_spacing": 6}),
    "66 knots of the gain": ({"gain_knots": 66}, {"gain_knots": 65}),
    "one knot of the ratio": ({"ratio_knots": 1, "ratio_spacing": 99}, {"ratio_knots": 2, "ratio_spacing": 6}),
    "66 knots of the ratio": ({"ratio_knots": 66}, {"ratio_knots": 65}),
    "gains that end before the frame": ({"gain_spacing": 2}, {"gain_spacing": 3}),
    "ratios that end before the frame": ({"ratio_spacing": 2}, {"ratio_spacing": 3}),
    "knots of the gain that are at one line": ({"gain_spacing": 0}, {"gain_spacing": (1 << 32) - 1}),
    "knots of the ratio that are at one line": ({"ratio_spacing": 0}, {"ratio_spacing": (1 << 32) - 1}),
    "a slow table of 4 words": ({"index_bits": 2}, {"index_bits": 3}),
    "a slow table of 2^15 words": ({"index_bits": 15}, {"index_bits": 14}),
    "a gain of the slow table that is too large": ({"gain_word": 1 << 17}, {"gain_word": (1 << 17) - 1}),
    "one that is too small": ({"gain_word": -(1 << 17) - 1}, {"gain_word": -(1 << 17)}),
    "no gains": ({"gains": None}, {}),
    "no ratios": ({"ratios": None}, {}),
    "no memory": ({"mixed": None}, {}),
    "no slow table": ({"table": None}, {}),
    "a second table without its ratios": ({"ratios": None}, {"second": None, "ratios": None, "mixed": None}),
}


@pytest.fixture(scope="module")
def plain(folder: Path) -> Library:
    return library_of(compiled(folder / "loading", "plain"))


@pytest.mark.common
@pytest.mark.parametrize("what", FIELDS)
def test_what_a_slow_part_must_not_have_is_refused(what: str, plain: Library) -> None:
    """On each axis; and the nearest one that is good is loaded."""
    bad, good = FIELDS[what]
    loading = Loading(plain, LINEAR[0])
    assert loading.after(**bad) == BAD_SLOW_PART
    assert loading.after(**good) == LOADED


@pytest.mark.common
def test_words_out_of_range_are_refused(plain: Library, folder: Path) -> None:
    loading = Loading(plain, LINEAR[0])
    for knot in (0, 2):
        for limit_, beyond in ((-(1 << 17), -1), ((1 << 17) - 1, 1)):
            assert loading.with_word("gains", knot, limit_) == LOADED
            assert loading.with_word("gains", knot, limit_ + beyond) == BAD_SLOW_PART
    assert loading.with_word("gains", 3, 1 << 20) == LOADED, "behind the last knot"
    program = loading.program.x
    most = 2 << (program.dac_bits + program.gain_q)
    for sign in (1, -1):
        assert loading.after(offset_word=sign * (most - 1)) == LOADED
        assert loading.after(offset_word=sign * most) == BAD_SLOW_PART
        assert loading.with_word("table", 5, sign, offset_word=sign * (most - 13)) == LOADED
        assert loading.with_word("table", 5, sign, offset_word=sign * (most - 12)) == BAD_SLOW_PART
    for behind in (8, 9, 10):
        assert loading.with_word("table", behind, 1) == BAD_SLOW_PART
    assert loading.with_word("table", 11, 1) == LOADED
    wide = Loading(library_of(compiled(folder / "loading", "wide")), WIDE[0])
    for limit_, beyond in ((-(1 << 20), -1), ((1 << 20) - 1, 1)):
        assert wide.with_word("table", 5, limit_) == LOADED
        assert wide.with_word("table", 5, limit_ + beyond) == BAD_SLOW_PART


@pytest.mark.common
def test_tables_and_outputs_without_a_slow_part_are_refused(plain: Library, folder: Path) -> None:
    loading = Loading(plain, SequencerShape(16, 1, 8, 16, 1, 8, 16))
    table = (ctypes.c_int16 * 1024)()
    for axis in (loading.program.x, loading.program.y):
        before = axis.table, axis.length, axis.index_bits
        axis.table, axis.length, axis.index_bits = ctypes.addressof(table), 512, 9
        assert loading.loads() == BAD_SLOW_PART, "nine bits of a linear table are not mixed"
        axis.table, axis.length, axis.index_bits = ctypes.addressof(table), 64, 0
        assert loading.loads() == BAD_SLOW_PART, "a direct table"
        axis.table, axis.length, axis.index_bits = before
        assert loading.loads() == LOADED
    y = loading.program.y
    for hold, period in ((64, 64), (1, 63), (1, 384), (64, 6)):
        y.hold_ticks, y.phase_period = hold, period
        assert loading.loads() == BAD_PERIOD
    y.hold_ticks, y.phase_period = 1, 64
    x_part, y_part = (axis.slow for axis in loading.axes)
    assert x_part is not None
    assert y_part is not None
    y_part.mixed = x_part.mixed
    assert loading.loads() == BAD_SLOW_PART, "one memory for both"
    y_part.second = None
    assert loading.loads() == LOADED


@pytest.mark.common
def test_a_long_linear_table_may_have_a_slow_part_that_mixes_nothing(plain: Library) -> None:
    """And a mixed table of 256 words is the longest one."""
    rng = np.random.default_rng(3)
    schedule = replace(random_schedule(rng, TICKS, 1), lines=LINES)
    for bits, result in ((8, LOADED), (9, BAD_SLOW_PART)):
        made = scan_program(rng, SequencerShape(16, 1, bits, 16, 1, bits, 16), schedule, "xy")
        assert Twin(plain, made).device.load(made) == result
        straight = replace(made, **{name: unmixed(getattr(made, name)) for name in "xy"})
        twin = Twin(plain, straight)
        commit(twin, straight, CommitMode.LINE)
        twin.ask("arm", "trigger")
        twin.play(700, "fill")


def unmixed(axis: FrameProgram) -> FrameProgram:
    return replace(axis, second=np.zeros_like(axis.second))


DUE = "    s->line_due = true;\n    if (bank"
SAME_KIND = "    if ((now->y.slow == NULL) != (next->y.slow == NULL))\n        return false;\n"
NO_PLACE = "    if (bank->y.slow != NULL) /* it is at the start of a line in both programs */\n        return;\n"
AFTER = "line + 1 == lines ? "
RUN_RAMP = "bank->run_ramp = bank->ramp * ((int64_t)1 << left)"
WINDOW = """        if (out_of_window >> bank->run_bits != 0)
            break;
        axis->code = code;
        done += length;
    }
    return done;
}

#if DAC_SHAPING"""
MUTANTS = {
    "a line is never prepared": ("    s->line_due = false;\n    dac_slow", "    return;\n    dac_slow"),
    "only the first line is prepared": (DUE, "    if (bank"),
    "a line is prepared at every tick": ("    if (!s->line_due)\n        return;\n", ""),
    "y goes on at the end of a line": ("    if (bank->y.slow != NULL)\n        to_start(&s->y);\n", ""),
    "a ramp goes on when x goes back": ("        s->x.rise = rise;\n", ""),
    "a y without a slow part is kept": (SAME_KIND, ""),
    "the place of y is computed": (NO_PLACE, ""),
    "steps have no ramp": ("    axis->rise += bank->ramp;\n", ""),
    "runs have no ramp": ("    axis->rise += bank->ramp * (int64_t)ticks;\n", ""),
    "a ramp stays over the end of a line": ("    axis->rise = 0;\n", ""),
    "the line after the last one is the last one": (f"{AFTER}0 :", f"{AFTER}line :"),
    "a ramp is rounded downwards": ("return distance < 0 ? -ramp : ramp;", "return distance < 0 ? -ramp - 1 : ramp;"),
    "a ramp loses its upper bits": ("(way >> 32) * step + ", ""),
    "the step of a ramp is rounded up": ("UINT32_MAX % ticks == ticks - 1 ? 1u : 0u", "1u"),
    "words are not saturated": ("if ((uint32_t)(word - least) > (uint32_t)-least * 2u - 1u)", "if (false)"),
    "words saturate at the wrong end": ("word < 0 ? least : -least - 1", "word < 0 ? -least - 1 : least"),
    "ratios are cut off": ("((ratio * second + (1 << 11)) >> 12)", "(ratio * second >> 12)"),
    "the first words of the program stand behind": ("mixed[length + i] = mixed[i];", "mixed[length + i] = fast[i];"),
    "knots rise to the nearest word below": ("way.rest + half >= spacing ? 1u : 0u", "0u"),
    "ties of falling knots go down": ("way.rest > half ? 1u : 0u", "way.rest >= half ? 1u : 0u"),
    "the gain is that of the axis": ("    bank->gain = at.gain;\n", ""),
    "offsets are cut off": ("at.offset + ((int64_t)1 << (bank->gain_q - 1u))", "at.offset"),
    "runs have the gain of the axis": ("    bank->run_gain = bank->gain * (INT32_C(1) << left);\n", ""),
    "runs have half of the ramp": (RUN_RAMP, f"{RUN_RAMP} / 2"),
    "a chunk begins with the ramp of the last one": ("        rise += CHUNK * bank->ramp;\n", ""),
    "the words that are mixed in are not steep": (
        "        if (mixes(p)) /* words are mixed to the nearest */",
        "        if (false)",
    ),
    "the gain of the axis is the largest": (
        "        if (distance(p->slow->gains[i], 0) > largest)",
        "        if (false)",
    ),
    "a window is as wide with any ramp": (" || ramp <= bank->ramp_most ?", " || true ?"),
    "runs without a window": (WINDOW, WINDOW.replace("if (out_of_window >> bank->run_bits != 0)", "if (false)")),
}
SUMS = "(from | to | (from + rise) | (to + rise))"
NEAR = "            || ((first - sample + spread) | (last - sample + spread)) > 2 * spread - 1\n"
# Of play_segments(), with either kind of multiplication.
SEGMENT_MUTANTS = {
    "segments have no ramp": ("            value += ramp;\n", ""),
    "a segment begins with the ramp of the last one": ("        rest += rise + ramp;\n", ""),
    "the ramp of a segment is a tick short": ("rest += rise + ramp;", "rest += rise;"),
    "runs of segments begin without what the ramp has added": (
        "const int64_t offset = bank->offset + axis->rise;",
        "const int64_t offset = bank->offset;",
    ),
    "the last sample of a segment is not checked": (SUMS, "(from | (from + rise))"),
    "the last ramp of a segment is not checked": (SUMS, "(from | to)"),
    "a segment may move by 2^32": (NEAR, ""),
    "a segment may pass a limit": ("\n            || !dac_has_room(bank, (int32_t)base)) {", ") {"),
    "a run begins anywhere": ("((uint32_t)unrounded - code + half) >> bank->run_bits != 0", "false"),
    "a segment has a tick more": ("within < asked ? within : asked,", "within < asked ? within + 1 : asked,"),
    "a segment has all ticks that are asked for": ("within < asked ? within : asked,", "asked,"),
    "samples of segments are rounded down": (" + (UINT32_C(1) << (BELOW_SAMPLE - 1))", ""),
    "the code of a run of segments is lost": (
        "    axis->code = (int32_t)code;\n    return s.ticks",
        "    return s.ticks",
    ),
}
LONG_SEGMENT_MUTANTS = {
    "segments of any ramp": ("\n        || ramp > INT64_C(1) << 24)", ")"),
}
FINE_MUTANTS = {
    "more ticks have one check than a position is exact for": ("parts - 1 < SEGMENT_MOST ?", "false ?"),
    "steps of segments are rounded down": ("(uint32_t)(s.step >> 15) + 1,", "(uint32_t)(s.step >> 15),"),
}
SHORT_SEGMENT_MUTANTS = {
    "a segment that begins late has a tick more": ("place <= UINT32_MAX - whole * step ? 1u : 0u", "1u"),
    "any tick is the first of its segment": ("if (place >= step)", "if (false)"),
    "the lower bits of a way are lost": ("upper << 16) + lower;", "upper << 16);"),
}
FED = "            out_of_window |= fed;\n            code = (fed >> bits)"
SHAPED_WINDOW = WINDOW.replace("out_of_window >> bank", "out_of_window >> bits >> bank").replace(
    "axis->code = code", "axis->shaper = shaper;\n        axis->code = (int32_t)code"
)
SHAPED_WINDOW = SHAPED_WINDOW[: SHAPED_WINDOW.index("\n\n#if")]
SHAPED_MUTANTS = {
    "shaped steps have no ramp": ("    sum += axis->rise;\n", ""),
    "shaped runs begin without what the ramp has added": ("(bank->gain_q - 1u)) + rise;", "(bank->gain_q - 1u));"),
    "shaped runs have no ramp": (f"            offset += ramp;\n{FED}", FED),
    "shaped runs round the sum": (
        "int64_t offset = bank->offset - ((int64_t)1 << (bank->gain_q - 1u)) + rise;",
        "int64_t offset = bank->offset + rise;",
    ),
    "remainders are lost at the end of a block": (SHAPED_WINDOW, SHAPED_WINDOW.replace("axis->shaper = shaper;", "")),
    "remainders of a refused block are kept": (
        SHAPED_WINDOW,
        SHAPED_WINDOW.replace("axis->shaper = shaper;", "").replace("  if (out", "axis->shaper = shaper; if (out"),
    ),
    "shaped runs without a window": (
        SHAPED_WINDOW,
        SHAPED_WINDOW.replace("out_of_window >> bits >> bank->run_bits != 0", "false"),
    ),
    "shaped lines without a ramp have the gain of the axis": (
        "(bank)->ramp != 0 || ((bank)->slow != NULL && (bank)->order != 0) ? dac_slow_play",
        "(bank)->ramp != 0 ? dac_slow_play",
    ),
}
SHORT_SHAPED_MUTANTS = {
    "short shaped runs have the gain of the axis": ("    bank->run_gain = bank->gain * (INT32_C(1) << up);\n", ""),
    "short shaped runs have the offset of the axis": (
        "    bank->run_offset = (bank->offset - half) * ((int64_t)1 << up);\n",
        "",
    ),
    "short shaped runs have no ramp": ("    bank->run_ramp = bank->ramp * ((int64_t)1 << up);\n", ""),
    "short shaped runs begin with a small ramp": ("axis->rise * (INT64_C(1) << up)", "axis->rise"),
    "the spread is that of the unshaped gain": (" : bank->gain) << up);", " : bank->gain));"),
}
SHORT_MUTANTS = {
    "a ramp is added twice": ("        b->rest += b->ramp;", "        b->rest += 2 * b->ramp;"),
    "a block begins with the ramp of the last one": ("            offset += ramp * (int64_t)length;\n", ""),
    "runs begin without what the ramp has added": (
        "    if (kind.ramps)\n        offset += axis->rise * (INT64_C(1) << up);\n",
        "",
    ),
    "the spread is that of the axis": (
        "    bank->run_spread = dac_ramp_spread((uint32_t)(bank->gain < 0 ? -bank->gain : bank->gain) << up);\n",
        "",
    ),
}
ALL_MUTANTS = MUTANTS | SHORT_MUTANTS | SHAPED_MUTANTS | SHORT_SHAPED_MUTANTS
ALL_MUTANTS |= SEGMENT_MUTANTS | LONG_SEGMENT_MUTANTS | SHORT_SEGMENT_MUTANTS | FINE_MUTANTS
_FORK = get_context("fork")


def differs(path: Path, option: str) -> bool:
    """Return True if a library differs from the model, crashes or hangs; it plays in a process of its own."""

    def trial() -> None:
        limit(120)
        faulthandler.disable()
        library = library_of(path)
        try:
            for seed in range(3):
                play_fills(library, even_waves(option, seed), 9000)
                play_fills(library, even_waves(option, seed, *SHORT_LINES), 9000)
            play_fills(library, without_ramps(even_waves(option, 3)), 9000)
            play_fills(library, jumps(), 5000)
            play_fills(library, jumps(*SLOW_JUMPS), 5000)
            play_fills(library, wide_window(), 5000)
            play_fills(library, crossing(option), 5000)
            play_fills(library, steep_ramps(), 5000)
            play_fills(library, even_waves(option, 4, LONG_LINE), 13_000)
            for seed in range(20):
                play_fills(library, long_segments(option, seed), 3000)
            for steep, over in product(("second", "gain", "ramp"), (0, 1, 2)):
                play_fills(library, guarded_waves(steep, over), 3000, 1 << 15)
            for seed in range(16):
                play(library, option, seed)
        except AssertionError:
            os._exit(1)
        os._exit(0)

    process = _FORK.Process(target=trial)
    process.start()
    process.join()
    return process.exitcode != 0


@pytest.mark.rest
@pytest.mark.parametrize(
    ("option", "breaks"),
    one_of(
        2,
        [
            *(("plain", breaks) for breaks in MUTANTS),
            *(("short", breaks) for breaks in SHORT_MUTANTS),
            *(("shaping", breaks) for breaks in SHAPED_MUTANTS),
            *(("short_shaping", breaks) for breaks in SHORT_SHAPED_MUTANTS),
            *(("plain", breaks) for breaks in SEGMENT_MUTANTS | LONG_SEGMENT_MUTANTS),
            *(("short", breaks) for breaks in SEGMENT_MUTANTS | SHORT_SEGMENT_MUTANTS),
            *((option, breaks) for option in ("fine", "short_fine") for breaks in FINE_MUTANTS),
        ],
        2,
    ),
)
def test_every_mutant_is_found(option: str, breaks: str, tmp_path: Path) -> None:
    old, new = ALL_MUTANTS[breaks]
    runtime = runtime_with({old: new}, tmp_path / "mutant")
    assert differs(compiled(tmp_path, option, runtime=runtime), option)


@pytest.mark.rest
@pytest.mark.parametrize("option", ["plain", "short", "shaping", "short_shaping", "fine", "short_fine"])
def test_the_runtime_as_it_is_does_not_differ(option: str, tmp_path: Path) -> None:
    assert not differs(compiled(tmp_path, option), option)
