"""Programs with a slow part in C against the integer model, by steps and by fills; refusals; mutants to be found."""

from collections import Counter
from ctypes import c_bool, c_uint64
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from c_library import LOADED, Library, Twin, compile_library
from c_scripts import long_dual
from frame_programs import scan_program
from programs import random_schedule
from replacing import replace
from sets import common

from tablegen.base.resources import c_runtime
from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import ScanProgram
from tablegen.device.sequencer import can_keep
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.verification.play.sequencer_shape import SequencerShape

SLOW = ("-DDAC_SLOW_PART=1", "-DDAC_COMMIT_MODES=1")
OPTIONS: dict[str, tuple[str, ...]] = {
    "plain": (),
    "short": ("-DDAC_LONG_MULTIPLY=0",),
    "spline": ("-DDAC_SPLINE=1",),
    "short_spline": ("-DDAC_LONG_MULTIPLY=0", "-DDAC_SPLINE=1"),
    "shaping": ("-DDAC_SHAPING=3",),
    "short_shaping": ("-DDAC_SHAPING=3", "-DDAC_LONG_MULTIPLY=0"),
    "wide": ("-DDAC_SPLINE=1",),
}
TICKS, LINES = 90, 5
LONG_TICKS = 700  # of lines with many runs
LINEAR = (SequencerShape(16, 1, 5, 16, 1, 6, 16), SequencerShape(16, 1, 8, 12, 1, 3, 16))
CUBIC = (SequencerShape(16, 3, 5, 16, 3, 4, 16), SequencerShape(16, 1, 4, 16, 3, 6, 14))
WIDE = (SequencerShape(20, 1, 6, 24, 3, 5, 21), SequencerShape(24, 3, 4, 20, 1, 5, 8))


def shapes(option: str) -> tuple[SequencerShape, ...]:
    if option == "wide":
        return WIDE
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
    bits = 32 if option == "wide" else 16
    more = [*SLOW, *OPTIONS[option]]
    return compile_library(folder / f"{option}.so", bits, bits, 2, more=more, **how)  # type: ignore[arg-type]


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
@pytest.mark.parametrize("option", common(("plain", "short_spline"), OPTIONS))
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


def even_waves(option: str, seed: int) -> ScanProgram:
    """Long smooth lines with ramps, that no limit and no guard touches."""
    rng = np.random.default_rng(seed)
    shape = shapes(option)[-1 if "spline" in option else 0]
    schedule = replace(random_schedule(rng, 4000, 1), lines=3, settle_lines=0)
    program = scan_program(rng, shape, schedule, "xy")

    def free(axis: FrameProgram, number: int) -> FrameProgram:
        fast, half, length = axis.fast, 1 << (axis.fast.bits - 1), len(axis.fast.words)
        words = np.floor(0.6 * half * np.sin(2 * np.pi * np.arange(length) / length)).astype(np.int64)
        slow_bits = min(fast.bits, 21)
        turn = 2 * np.pi * (np.arange(8) / 8 + 0.3)
        slow = replace(
            axis.slow,
            words=np.floor((1 << (slow_bits - 2)) * np.sin(turn)).astype(np.int64),
            gain_word=(-1 if number else 1) * (1 << (fast.output.dac_bits + fast.output.gain_q - slow_bits - 6)),
            offset_word=1 << (fast.output.dac_bits + fast.output.gain_q - 1),
        )
        gains = replace(axis.gains, words=np.linspace(20000, 24000, len(axis.gains.words)).astype(np.int64))
        top = (1 << fast.output.dac_bits) - 1
        output = replace(fast.output, code_min=0, code_max=top, max_step=top // 32, park_code=top // 2)
        return replace(axis, fast=replace(fast, words=words, output=output), slow=slow, gains=gains)

    axes = [free(axis, number) for number, axis in enumerate((program.x, program.y)) if isinstance(axis, FrameProgram)]
    return replace(program, x=axes[0], y=axes[1])


@pytest.mark.common
@pytest.mark.parametrize("option", common(("plain", "short_spline"), OPTIONS))
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
