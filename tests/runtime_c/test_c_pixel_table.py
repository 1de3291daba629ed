"""Tables of pixels in C against the integer model, by steps and by fills; refusals; mutants to be found."""

import ctypes
from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from building import run_clean
from c_library import BAD_SCHEDULE, LOADED, Library, PixelCProgram, Twin, compile_library
from c_scripts import long_dual
from editing import SCAN, SCANNER, edited, run, write_pair
from programs import random_schedule, with_table
from replacing import replace
from sine_scans import short_sine

from tablegen.base.resources import c_runtime
from tablegen.device.dual_program import DualProgram
from tablegen.verification.play.sequencer_shape import SequencerShape

SHAPE = SequencerShape(16, 1, 5, 16, 1, 6, 16)
TABLE = "-DDAC_PIXEL_TABLE=1"


@cache
def programs() -> list[DualProgram]:
    """Programs with tables of pixels, and without, that image on all lines; of a few lengths of lines."""
    rng = np.random.default_rng(8)
    made = []
    for number in range(14):
        dual = long_dual(rng, SHAPE, (40, 160), (1, 3))
        plain = replace(random_schedule(rng, dual.schedule.ticks, dual.schedule.lines), settle_lines=number % 2)
        made.append(replace(dual, schedule=with_table(rng, plain) if number % 4 else plain))
    return made


def play(library: Library, seed: int, rounds: int = 25) -> Counter[str]:
    """Play commits at any tick beside the model; return how often a table and none played."""
    rng, seen = np.random.default_rng(seed), Counter[str]()
    twin = Twin(library, programs()[0])
    twin.commit(programs()[seed % len(programs())])
    twin.ask("arm", "trigger")
    # A blind fill leaves the pixels unknown up to the next window, so markers are compared without such fills.
    ways = ["blind"] if seed % 4 == 0 else ["step", "fill", "fill"]
    for _ in range(rounds):
        twin.play(int(rng.integers(1, 400)), str(rng.choice(ways)))
        if twin.model.playing is not None:
            seen["none" if twin.model.playing.schedule.pixel_table is None else "table"] += 1
        if twin.model.idle is None and rng.random() < 0.6:
            twin.commit(programs()[int(rng.integers(len(programs())))])
    return seen


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    return Library(compile_library(tmp_path_factory.mktemp("library") / "pixels.so", more=[TABLE]))


def test_tables_of_pixels_equal_the_model(library: Library) -> None:
    seen = Counter[str]()
    for seed in range(12):
        seen += play(library, seed)
    assert min(seen["none"], seen["table"]) > 20, seen


def test_after_a_blind_fill_pixels_go_on_with_the_next_window(library: Library) -> None:
    program = next(each for each in programs() if each.schedule.pixel_table is not None)
    twin = Twin(library, program)
    twin.commit(program)
    twin.ask("arm", "trigger")
    schedule = program.schedule
    twin.play(schedule.forward.first + 1, "blind")
    twin.play(schedule.ticks - schedule.forward.first - 1, "blind")
    twin.play(schedule.ticks, "step")


def loads(library: Library, made: DualProgram, counts: list[int]) -> int:
    """Load a program with any counts."""
    made = replace(made, schedule=replace(made.schedule, pixel_table=None))
    program, alive = library.program(made)
    assert isinstance(program, PixelCProgram)
    words = library.array(ctypes.c_uint16, counts)
    program.schedule.pixel_table = ctypes.addressof(words)
    result = Twin(library, made).device.load(program)
    del alive
    return result


def test_pixels_that_do_not_fill_their_window_are_refused(library: Library) -> None:
    """By C and by the model."""
    made = next(
        each for each in programs() if min(map(max, each.schedule.pixel_table or [(1,)])) > 1 < each.schedule.pixels
    )
    assert made.schedule.pixel_table is not None
    forward, backward = made.schedule.pixel_table
    assert loads(library, made, [*forward, *backward]) == LOADED
    for side, counts in enumerate((forward, backward)):
        for wrong in (
            [counts[0] + 1, *counts[1:]],
            [*counts[:-1], counts[-1] + 1],
            [counts[0] + counts[1], 0, *counts[2:]],
            [*counts[:-1], 65535],
            [n - (at == counts.index(max(counts))) for at, n in enumerate(counts)],
        ):
            table = (wrong, backward) if side == 0 else (forward, wrong)
            assert loads(library, made, [*table[0], *table[1]]) == BAD_SCHEDULE, wrong
            with pytest.raises(ValueError, match="pixels"):
                replace(made.schedule, pixel_table=(tuple(table[0]), tuple(table[1])))


def test_the_macro_of_a_build_takes_its_table(tmp_path: Path) -> None:
    """And the one without a table has none."""
    axis = "TABLE_LENGTH 8\nTABLE_BITS 16\nINDEX_BITS 3\nINTERPOLATED 1\nPHASE_PERIOD 8\nHOLD_TICKS 1\nGAIN_WORD 1\n"
    axis += "OFFSET_WORD 0\nGAIN_Q 20\nCODE_MIN 0\nCODE_MAX 9\nPARK_CODE 0\nMAX_STEP 9\nDAC_BITS 16\nDAC_WORD_BITS 16\n"
    axis += "DAC_TWOS_COMPLEMENT 0\nDAC_LEFT_ALIGNED 0\n"
    scan = "LINE_TICKS 8\nFRAME_LINES 1\nPIXELS 2\nSETTLE_LINES 0\nTURN_TICK 4\nFORWARD_FIRST_TICK 0\nFORWARD_TICKS 4\n"
    scan += "BACKWARD_FIRST_TICK 4\nBACKWARD_TICKS 4\nUP_FIRST_LINE 0\nUP_LINES 1\nDOWN_FIRST_LINE 1\nDOWN_LINES 0\n"
    lines = [*scan.splitlines(), *(f"{side}_{each}" for side in "XY" for each in axis.splitlines())]
    main = '#include "dac_sequencer.h"\n' + "".join(f"#define SCAN_{each}\n" for each in lines)
    main += """static const dac_word scan_x_table[9] = {0}, scan_y_table[9] = {0};
static const uint16_t scan_pixel_table[4] = {1, 3, 3, 1};
static const dac_program one = DAC_PIXEL_PROGRAM(SCAN, scan), other = DAC_PROGRAM(SCAN, scan);
int main(void)
{
    return !(one.schedule.pixel_table == scan_pixel_table && other.schedule.pixel_table == NULL);
}
"""
    (tmp_path / "main.c").write_text(main, "ascii")
    folder = c_runtime()[0].parent
    run_clean(["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", TABLE, f"-I{folder}", "main.c", "-o", "main"], tmp_path)
    run_clean([tmp_path / "main"], tmp_path)


def judge(library: Library) -> None:
    """Raise for a runtime with a fault."""
    test_pixels_that_do_not_fill_their_window_are_refused(library)
    test_tables_of_pixels_equal_the_model(library)


MUTANTS = {
    "the retrace has the table of the trace": ("(window == &plan->forward ? 0 : plan->pixels)", "0"),
    "a pixel is a tick longer": (
        "        s->pixel_rest--;",
        "        if ((markers[i] & DAC_PIXEL) == 0)\n            s->pixel_rest--;",
    ),
    "the first pixel has what was left of the last window": ("        s->pixel_rest = 0;\n    }", "    }"),
    "the table goes on": (
        "        s->next_pixel = plan->pixel_table + (window == &plan->forward ? 0 : plan->pixels);\n",
        "        if (s->next_pixel == NULL)\n            s->next_pixel = plan->pixel_table;\n",
    ),
    "every tick is a pixel": ("        if (s->pixel_rest == 0) {", "        {"),
    "a pixel without a tick is loaded": ("*counts == 0 || ", ""),
    "fewer ticks than the window has are loaded": ("return ticks == 0;", "return true;"),
    "the table of the retrace is not checked": (
        "p->pixel_table + p->pixels, p->pixels, p->backward.count",
        "p->pixel_table, p->pixels, p->forward.count",
    ),
}


@pytest.mark.rest
@pytest.mark.parametrize("mutant", MUTANTS)
def test_every_mutant_is_found(mutant: str, tmp_path: Path) -> None:
    old, new = MUTANTS[mutant]
    texts = {path.name: path.read_text("utf-8") for path in c_runtime()}
    (name,) = (name for name, text in texts.items() if old in text)
    assert texts[name].count(old) == 1, old
    texts[name] = texts[name].replace(old, new)
    for each, text in texts.items():
        (tmp_path / each).write_text(text, "utf-8")
    path = compile_library(tmp_path / "mutant.so", runtime=[tmp_path / each for each in texts], more=[TABLE])
    library = Library(path)
    with pytest.raises(AssertionError):
        judge(library)


PROGRAMS = """
#include "{name}.h"
#include "dac_sequencer.h"
#include <stdio.h>
#define UP {capital}
#define low {name}
static const dac_program one = DAC_PROGRAM({capital}, {name}), other = DAC_PROGRAM(UP, low);
int main(void)
{{
    printf("%d %d\\n", one.schedule.pixel_table != NULL, one.schedule.pixel_table == other.schedule.pixel_table);
    return 0;
}}
"""


@pytest.mark.rest
@pytest.mark.parametrize("compiler", ["gcc -std=c99", "clang -std=c99", "g++ -x c++", "clang++ -x c++ -std=c++17"])
def test_a_program_has_the_table_of_its_header(compiler: str, tmp_path: Path) -> None:
    """Of a build with a sine, and of one without, by the same macro; its names may be macros."""
    for name, has_table in (("sine", 1), ("line", 0)):
        folder = tmp_path / name
        if has_table:
            short_sine(tmp_path, "name = 'sine'")
        else:
            write_pair(tmp_path, edited(SCAN, "name = 'line'"), SCANNER)
        assert run("build", tmp_path / "scan.toml", "-o", folder, "-q").status == 0
        (folder / "main.c").write_text(PROGRAMS.format(name=name, capital=name.upper()), "ascii")
        arrays = folder / f"{name}.c"
        options = ["-Wall", "-Wextra", "-Wpedantic", TABLE, f"-I{folder}"]
        run_clean([*compiler.split(), *options, "-c", folder / "main.c", "-o", folder / "main.o"])
        run_clean(["gcc", *options, "-c", arrays, "-o", folder / "arrays.o"])
        run_clean(["g++", folder / "main.o", folder / "arrays.o", "-o", folder / "main"])
        assert run_clean([folder / "main"]).split() == [str(has_table), "1"]
