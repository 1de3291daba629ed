"""The index in C: it compiles with every program and one runtime, and what it picks plays as the integer model does."""

import re
from pathlib import Path

import numpy as np
import pytest
from building import run_clean
from editing import run
from libraries import NAMES, programs, write_library

from tablegen.device.dual_program import DualProgram
from tablegen.device.sequencer import Sequencer

WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"]
TICKS = 700  # three lines and more
PLAYER = """
#include "lines_library.h"
#include <stdio.h>
#include <stdlib.h>

static dac_sequencer sequencer;
static dac_output buffer[2 * %(ticks)d];
static const dac_converter x = DAC_CONVERTER(LINES_LIBRARY_X, 0), y = DAC_CONVERTER(LINES_LIBRARY_Y, 0);

int main(int count, char **names)
{
    if (!dac_sequencer_init(&sequencer, &x, &y))
        return 1;
    for (int at = 1; at < count; at++) {
        char *end;
        const long given = strtol(names[at], &end, 10);
        const long number = *end == '\\0' ? given : lines_library_number(names[at]);
        if (number < 0 || number >= LINES_LIBRARY_PROGRAMS) {
            printf("none\\n");
            continue;
        }
        if (dac_sequencer_load(&sequencer, &lines_library[number].program) != DAC_LOADED)
            return 2;
        dac_sequencer_commit(&sequencer);
        printf("%%s %%s\\n", lines_library[number].name, lines_library[number].hash);
        if (at == 1) {
            dac_sequencer_fill(&sequencer, buffer, buffer + 1, NULL, 1);
            dac_sequencer_arm(&sequencer, 0);
            dac_sequencer_trigger(&sequencer);
        }
        dac_sequencer_fill(&sequencer, buffer, buffer + 1, NULL, %(ticks)d);
        for (int tick = 0; tick < %(ticks)d; tick++)
            printf("%%u %%u\\n", (unsigned)buffer[2 * tick], (unsigned)buffer[2 * tick + 1]);
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("library")
    done = run("sweep", write_library(folder), "-o", folder / "out", "-j", "1", "-f", "c", "-q")
    assert (done.status, done.out, done.err) == (0, "", "")
    return folder / "out"


def compiled(library: Path, tool: str, *options: str) -> Path:
    """The player with the index, all programs and the one runtime."""
    source, program = library.parent / "player.c", library.parent / f"player_{tool}"
    source.write_text(PLAYER % {"ticks": TICKS}, "ascii")
    sources = [source, *sorted(library.glob("*.c")), *sorted(library.glob("*/*.c"))]
    assert len(sources) > len(NAMES) + 8
    run_clean([tool, *options, *WARNINGS, f"-I{library}", *sources, "-o", program])
    return program


def model_codes(order: list[DualProgram]) -> list[tuple[int, int]]:
    """Codes of the model that loads the programs in turn, as the player does."""
    model, codes = Sequencer(None), []
    for at, program in enumerate(order):
        model.commit(program)
        if at == 0:
            model.step()
            model.arm()
            assert model.trigger()
        codes += [(tick.x, tick.y) for tick in (model.step() for _ in range(TICKS))]
    return codes


@pytest.mark.rest
def test_a_program_that_is_picked_plays_as_the_model_does(library: Path) -> None:
    """By number and by name, one after the other while the scan runs."""
    program = compiled(library, "gcc", "-std=c99", "-O1", "-fsanitize=undefined,address")
    picks = ["1", "even", "0", "broad", "narrow", "2"]
    said = run_clean([program, *picks]).splitlines()
    numbers = [1, 2, 0, 1, 0, 2]
    stored = programs(library)
    names = [line.split()[0] for line in said if not line[0].isdigit()]
    assert names == [NAMES[number] for number in numbers]
    codes = [tuple(map(int, line.split())) for line in said if line[0].isdigit()]
    assert codes == model_codes([stored[number] for number in numbers])
    assert codes != model_codes([stored[number] for number in (1, 2, 1, 1, 0, 2)]), "programs differ"
    assert len(np.unique(np.array(codes), axis=0)) > 500


@pytest.mark.common
def test_a_name_or_number_that_there_is_not_is_none(library: Path) -> None:
    program = compiled(library, "gcc", "-std=c99")
    assert run_clean([program, "7", "narro", "narrower", "-1"]).split() == ["none"] * 4


@pytest.mark.common
@pytest.mark.parametrize("tool", ["clang", "g++"])
def test_other_compilers_take_it(library: Path, tool: str) -> None:
    header = library / "lines_library.h"
    language = ["-std=c++17", "-x", "c++"] if tool == "g++" else ["-std=c99", "-Wconversion"]
    run_clean([tool, *language, *WARNINGS, "-fsyntax-only", f"-I{library}", library / "lines_library.c", header])


def test_the_index_says_what_the_programs_are(library: Path) -> None:
    text = (library / "lines_library.h").read_text("ascii")
    assert dict(re.findall(r"#define (\w+)_NUMBER (\d+)", text)) == {"NARROW": "0", "BROAD": "1", "EVEN": "2"}
    rooms = dict(re.findall(r"#define LINES_LIBRARY_(\w+) (\d+)", text))
    assert (rooms["X_TABLE_ROOM"], rooms["Y_TABLE_ROOM"]) == ("129", "257")
    assert rooms["LONGEST_NAME"] == "6"
    assert (rooms["X_DAC_BITS"], rooms["TABLE_STORAGE_BITS"]) == ("16", "16")


def test_one_runtime_stands_beside_the_programs(library: Path) -> None:
    assert (library / "dac_sequencer.c").exists()
    assert not list(library.glob("*/dac_*"))
    assert not list(library.rglob("*.v")), "formats = c"
