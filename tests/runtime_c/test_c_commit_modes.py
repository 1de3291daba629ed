"""Modes of a commit in C against the integer model, by steps and by fills; mutants that these tests have to find."""

import faulthandler
import os
from collections import Counter
from ctypes import c_bool
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from c_library import LOADED, Library, Twin, compile_library
from c_scripts import long_dual, shaped
from limits import limit
from replacing import replace
from sets import common

from tablegen.base.resources import c_runtime
from tablegen.device.commit_mode import CommitMode
from tablegen.device.dual_program import DualProgram
from tablegen.device.sequencer import can_keep
from tablegen.verification.play.sequencer_shape import SequencerShape

MODES = "-DDAC_COMMIT_MODES=1"
OPTIONS = {
    "plain": (),
    "short": ("-DDAC_LONG_MULTIPLY=0",),
    "shaped": ("-DDAC_SHAPING=3",),
    "spline": ("-DDAC_SPLINE=1",),
}
TICKS, LINES = 90, 5
# Tables of y of all lengths and kinds: its position in C depends on them.
SHAPES = [SequencerShape(16, 1, 6, 16, 1, bits, 16) for bits in (3, 5, 8)] + [SequencerShape(16, 1, 6, 16, 0, 9, 16)]
CUBIC = SequencerShape(16, 3, 5, 16, 3, 4, 16)


@cache
def programs(option: str) -> list[DualProgram]:
    """Programs of one frame with y of all kinds, and a few of other ticks and of other lines."""
    rng = np.random.default_rng(7)
    shapes = [*SHAPES, *([CUBIC] * 2 if option == "spline" else [])]
    made = [long_dual(rng, shape, (TICKS, TICKS), (LINES, LINES)) for shape in shapes for _ in range(3)]
    made += [long_dual(rng, SHAPES[1], ticks, lines) for ticks, lines in (((60, 60), (5, 5)), ((90, 90), (3, 3)))]
    made = [replace(each, schedule=replace(each.schedule, settle_lines=int(rng.integers(0, 3)))) for each in made]
    return [shaped(rng, each) for each in made] if option == "shaped" else made


def commit(twin: Twin, program: DualProgram, mode: CommitMode) -> None:
    """Commit a program to both with a mode; one that waits is withdrawn, or gets another mode if it is the same."""
    twin.device.answer()
    if twin.model.idle is not program:
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


def play(library: Library, option: str, seed: int, rounds: int = 40) -> Counter[str]:
    """Play commits of all modes at any tick beside the model; return what happened."""
    rng, choice = np.random.default_rng(seed), programs(option)
    twin, seen = Twin(library, choice[0]), Counter[str]()
    commit(twin, choice[0], CommitMode(int(rng.integers(3))))
    twin.ask("arm", "trigger")
    # A blind fill leaves the pixels unknown up to the next window, so markers are compared without such fills.
    ways = ["blind"] if seed % 3 == 0 else ["step", "fill", "fill"]
    for _ in range(rounds):
        twin.play(int(rng.integers(1, 3 * TICKS)), str(rng.choice(ways)))
        waiting, mode = twin.model.idle, CommitMode(int(rng.integers(3)))
        program = choice[int(rng.integers(len(choice)))]
        if waiting is not None and rng.random() < 0.5:
            program = waiting
        match str(rng.choice(["commit"] * 6 + ["park", "start", "withdraw", "clear_faults"])):
            case "commit":
                commit(twin, program, mode)
                assert twin.model.playing is not None
                kept = mode == CommitMode.KEEP and twin.model.running and can_keep(twin.model.playing, program)
                seen[f"{mode.name} kept" if kept else mode.name] += 1
            case "start":
                twin.ask("arm", "trigger", frames=int(rng.choice([0, 1, 2])))
            case request:
                twin.ask(request)
        if not twin.model.running and rng.random() < 0.7:
            twin.ask("arm", "trigger", frames=int(rng.choice([0, 0, 3])))
    return seen


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("libraries")


@pytest.mark.common
@pytest.mark.parametrize("option", common(("plain", "shaped"), OPTIONS))
def test_modes_equal_the_model(option: str, folder: Path) -> None:
    library = library_of(compile_library(folder / f"{option}.so", more=[MODES, *OPTIONS[option]]))
    seen = Counter[str]()
    for seed in range(12):
        seen += play(library, option, seed)
    assert min(seen[name] for name in ("LINE", "KEEP", "FRAME", "KEEP kept")) > 10, seen


@pytest.mark.common
def test_an_unknown_mode_is_refused(folder: Path) -> None:
    library = library_of(compile_library(folder / "refuses.so", more=[MODES]))
    twin = Twin(library, programs("plain")[0])
    assert not any(twin.device.commit_at(mode) for mode in CommitMode), "nothing was loaded"
    assert twin.device.load(programs("plain")[0]) == LOADED
    assert not twin.device.commit_at(3)
    assert twin.device.writable()
    assert twin.device.commit_at(2)
    assert not twin.device.writable()


@pytest.mark.common
def test_without_the_option_there_are_no_modes(folder: Path) -> None:
    library = Library(compile_library(folder / "default.so"))
    assert not hasattr(library.dll, "dac_sequencer_commit_at")


KEEPS = "now->schedule.line_ticks == next->schedule.line_ticks\n        && "
ADD = "        if ((left & 1u) != 0)\n            dac_advance(&s->y.at, &way);\n"
ADVANCES = "bank->y.holds ? s->line : s->line * bank->schedule.line_ticks"
REQUEST = "mode == DAC_COMMIT_KEEP ? COMMIT_KEEP : COMMIT_FRAME"
UNSETTLE = "    unsettle(s);\n#if DAC_SLOW_PART"
MUTANTS = {
    "frame is not waited for": ("s->commit == COMMIT_FRAME && s->running && s->line != 0", "false"),
    "every mode waits for a frame": ("s->commit == COMMIT_FRAME && s->running && s->line", "s->running && s->line"),
    "keep waits for a frame": ("s->commit == COMMIT_FRAME && s->running", "s->commit != COMMIT && s->running"),
    "a frame is waited for to its second line": ("s->running && s->line != 0", "s->running && s->line != 1"),
    "nothing is kept": ("    if (keeps) {\n", "    if (false) {\n"),
    "every mode keeps": ("s->commit == COMMIT_KEEP && s->running", "s->running"),
    "lines of other ticks are kept": (KEEPS, ""),
    "frames of other lines are kept": ("now->schedule.frame_lines == next->schedule.frame_lines && ", ""),
    "other holds of y are kept": (" && now->y.holds == next->y.holds", ""),
    "a frame that is kept does not settle": (UNSETTLE, "#if DAC_SLOW_PART"),
    "y stays where another table has it": ("way.high == step_before->high && way.low", "true || way.low"),
    "y is not placed": (ADD, ""),
    "y is placed from where it is": ("    to_start(&s->y);\n    for (", "    for ("),
    "y that is held is placed by ticks": (ADVANCES, "s->line * bank->schedule.line_ticks"),
    "y that is not held is placed by lines": (ADVANCES, "s->line"),
    "the mode of the first commit stays": ("s->commit = what;", "s->commit = s->waiting ? s->commit : what;"),
    "modes change places": (REQUEST, "mode == DAC_COMMIT_KEEP ? COMMIT_FRAME : COMMIT_KEEP"),
}
_FORK = get_context("fork")


def differs(path: Path, option: str) -> bool:
    """Return True if a library differs from the model, crashes or hangs; it plays in a process of its own."""

    def trial() -> None:
        limit(120)
        faulthandler.disable()
        library = library_of(path)
        try:
            for seed in range(12):
                play(library, option, seed)
        except AssertionError:
            os._exit(1)
        os._exit(0)

    process = _FORK.Process(target=trial)
    process.start()
    process.join()
    return process.exitcode != 0


def library_with(breaks: str, folder: Path) -> Path:
    """Compile the runtime with a mutant."""
    old, new = MUTANTS[breaks]
    files = []
    for path in c_runtime():
        text = path.read_text("utf-8")
        if path.name == "dac_sequencer.c":
            assert text.count(old) == 1, breaks
            text = text.replace(old, new)
        (folder / path.name).write_text(text, "utf-8")
        files.append(folder / path.name)
    return compile_library(folder / "mutant.so", runtime=files, more=[MODES])


@pytest.mark.rest
@pytest.mark.parametrize("breaks", MUTANTS)
def test_every_mutant_is_found(breaks: str, tmp_path: Path) -> None:
    assert differs(library_with(breaks, tmp_path), "plain")


@pytest.mark.rest
@pytest.mark.parametrize("option", ["plain", "shaped"])
def test_the_runtime_as_it_is_does_not_differ(option: str, tmp_path: Path) -> None:
    assert not differs(compile_library(tmp_path / "library.so", more=[MODES, *OPTIONS[option]]), option)
