"""A renderer whose SINE_FILE is missing or short commits nothing that it rendered, and says so.

Without a file the sine would be unknown or zero, and so would be every table word, of a scan that plays.
"""

from collections.abc import Sequence
from pathlib import Path

import pytest
from building import BENCHES

from tablegen.base.resources import verilog_runtime
from tablegen.fixedpoint.synthesis import sine_quarter
from tablegen.verification.verilog.simulate import Design, compile_design

WORDS = sine_quarter(4).tolist()  # of the bench: 16 words of x, 8 of y
TAKEN, REFUSED = ("1", "0"), ("0", "1")
# Parameters, words of the file (None: there is none), and what comes of it.
CASES = {
    "whole": ({}, len(WORDS), TAKEN),
    "whole_with_blocks": ({"MULTIPLIER": 1}, len(WORDS), TAKEN),
    "absent": ({}, None, REFUSED),
    "absent_with_blocks": ({"MULTIPLIER": 1}, None, REFUSED),
    "absent_for_x": ({"Y_HARMONICS": 0}, None, REFUSED),
    "absent_for_y": ({"X_HARMONICS": 0}, None, REFUSED),
    "absent_and_not_needed": ({"X_HARMONICS": 0, "Y_HARMONICS": 0}, None, TAKEN),
    "a_word_short": ({}, len(WORDS) - 1, REFUSED),
    "a_word_short_that_y_does_not_use": ({"X_HARMONICS": 0}, len(WORDS) - 1, TAKEN),
}
MUTANTS = {
    "nothing_is_marked": ("dac_fourier", "{1'b1, 30'd0}", "{1'b0, 30'd0}"),
    "another_slot_is_looked_at": ("dac_fourier", "passing[3] && sine_word[30]", "passing[2] && sine_word[30]"),
    "it_is_committed_all_the_same": ("dac_render", "rendered <= !incomplete", "rendered <= 1'b1"),
    "it_is_not_said": ("dac_sequencer", " || unrendered)", ")"),
    "the_last_word_decides": ("dac_render", "(incomplete || missing)", "missing"),
}


SHOWN_BY = ("whole", "absent_for_x", "a_word_short")  # the cases that are enough to find each mutant


def played(folder: Path, sources: list[Path], cases: Sequence[str] = tuple(CASES)) -> list[tuple[str, str]]:
    """Whether the bench committed, and whether a refusal was said, by cases."""
    build = folder / "build"
    build.mkdir()
    instances = []
    for index, case in enumerate(cases):
        parameters, words, _ = CASES[case]
        if words is not None:
            (build / f"{case}.mem").write_text("".join(f"{word:08x}\n" for word in WORDS[:words]), "ascii")
        given = {"SINE_FILE": f'"{case}.mem"', **parameters}
        instances.append(
            f"    sine_bench #({', '.join(f'.{key}({value})' for key, value in given.items())}) bench_{index} (\n"
            f"        .clock(clock), .committed(committed[{index}]), .refused(refused[{index}]), "
            f".ended(ended[{index}]));\n"
        )
    last = len(cases) - 1
    top = folder / "sine_top.v"
    top.write_text(
        "`timescale 1ns / 1ps\nmodule sine_top;\n    reg clock = 0;\n    always #5 clock = !clock;\n"
        f"    wire [{last}:0] committed, refused, ended;\n    reg all_done = 0;\n"
        "    integer file;\n    always @(posedge clock) if (&ended && !all_done) begin\n"
        '        file = $fopen("seen.txt", "w");\n        $fwrite(file, "%b %b", committed, refused);\n'
        "        $fclose(file);\n        all_done <= 1;\n    end\n"
        f"{''.join(instances)}endmodule\n",
        "ascii",
    )
    compiled = compile_design("icarus", Design([top, BENCHES / "sine_bench.v", *sources], "sine_top"), build)
    assert compiled.run("cocotb_outputs") == (1, 0)
    committed, refused = (build / "seen.txt").read_text("ascii").split()
    return list(zip(reversed(committed), reversed(refused), strict=True))


EXPECTED = {case: expected for case, (_, _, expected) in CASES.items()}
SOURCES = [path for path in verilog_runtime() if path.name.startswith("dac_")]


@pytest.mark.common
def test_no_table_of_a_missing_sine_is_committed(tmp_path: Path) -> None:
    assert dict(zip(CASES, played(tmp_path, SOURCES), strict=True)) == EXPECTED


@pytest.mark.rest
@pytest.mark.parametrize("mutant", MUTANTS)
def test_a_mutant_is_found(mutant: str, tmp_path: Path) -> None:
    module, old, new = MUTANTS[mutant]
    sources = []
    for path in SOURCES:
        text = path.read_text("utf-8")
        if path.stem == module:
            assert text.count(old) == 1
            path = tmp_path / path.name
            path.write_text(text.replace(old, new), "utf-8")
        sources.append(path)
    assert played(tmp_path, sources, SHOWN_BY) != [EXPECTED[case] for case in SHOWN_BY]
