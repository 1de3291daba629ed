"""dac_boot: the program of the memory files and nothing else, wherever it has to wait or begins again; then the host.

A boot is every program word, every word of both tables (or their Fourier words) and a commit, each once and in order,
on clocks on which the sequencer takes a write, and none of them right after power-up. It is held up on each of its
clocks, and reset on each. What the words are follows from the programs, not from the files that are read.
"""

import random
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from boot_play import AFTER, BOOT, COMMIT, Boots, Clock, Setup, Wrong, hosts
from building import BENCHES, REPOSITORY
from programs import random_dual, random_fourier
from sets import long

from tablegen.device.registers import program_words
from tablegen.emit.memory import memory_files
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.verilog.simulate import Design, compile_design

pytestmark = pytest.mark.common

X_TABLE, X_FOURIER = 1, 3  # regions; those of y are one more
AT_BOTH_ENDS = 2  # clocks on which a boot that is not held up writes nothing: it reads the first word, it has ended


def setup(seed: int, shape: SequencerShape, harmonics: tuple[int, int] | None = None, start_clocks: int = 0) -> Setup:
    """A random program of a shape; from its tables, or from Fourier words of so many harmonics."""
    rng = np.random.default_rng(seed)
    program = random_dual(rng, shape, (9, 13), lines=(2, 3))
    fourier = [random_fourier(rng, each).in_order for each in harmonics or (1, 1)]
    made = memory_files("boot", program.schedule, program.x, program.y, {"x": fourier[0], "y": fourier[1]})
    kind, region, tables = ("_fourier", X_FOURIER, fourier) if harmonics else ("", X_TABLE, None)
    parameters = {"FOURIER": int(harmonics is not None), "START_CLOCKS": start_clocks}
    registers = program_words(program.schedule, program.x, program.y, harmonics or (0, 0))
    writes = [(0, address, word) for address, word in enumerate(registers)]
    for index, (name, axis) in enumerate((("X", program.x), ("Y", program.y))):
        words = tables[index] if tables else axis.words
        writes += [(region + index, address, int(word) & 0xFFFFFFFF) for address, word in enumerate(words)]
        parameters[f"{name}_WORDS"] = len(words)
        parameters[f"{name}_WORD_BITS"] = 32 if tables else axis.bits
        parameters[f"{name}_HARMONICS"] = harmonics[index] if harmonics else 7  # which no table has
    files = {"PROGRAM": "boot_program.mem", "X": f"boot_x{kind}.mem", "Y": f"boot_y{kind}.mem"}
    return Setup({f"{key}_FILE": made[file] for key, file in files.items()}, parameters, [*writes, COMMIT])


SETUPS = {
    "interpolated": setup(1, SequencerShape(16, 1, 4, 16, 1, 3, 12)),
    "direct": setup(2, SequencerShape(12, 0, 5, 8, 0, 5, 24)),
    "fourier": setup(3, SequencerShape(16, 1, 4, 16, 1, 3, 12), (4, 1)),
    "late": setup(5, SequencerShape(16, 1, 4, 16, 1, 3, 12), start_clocks=37),
    "longest": setup(4, SequencerShape(16, 1, 16, 16, 1, 3, 16)),
}


def boots(clocks: int) -> Iterator[tuple[int, int]]:
    """Reset and writable by clocks: held up on every clock of a boot of so many, reset on every one, and at random."""
    for held in range(clocks):
        long = 1 + held % 3
        for clock in range(clocks + long + AFTER):
            yield 0, int(not held <= clock < held + long)
        yield 1, held % 2
    for last in range(clocks + AFTER):
        for _ in range(last):
            yield 0, 1
        yield 1, int(last % 3 != 0)
    rng = random.Random(clocks)
    for often in (0.5, 0.1, 0.9):
        for _ in range(12 * clocks):
            yield int(rng.random() < 0.3 / clocks), int(rng.random() < often)


def stimulus(name: str) -> list[Clock]:
    """For a setup; the host asks for something on most clocks. It ends with a boot and some clocks of the host."""
    clocks = len(SETUPS[name].writes) + AT_BOTH_ENDS
    levels = list(boots(clocks)) if name != "longest" else []
    start = [(int(clock == 10), clock % 2) for clock in range(SETUPS[name].parameters["START_CLOCKS"])]
    return hosts(name, [*start, *levels, *[(0, 1)] * (clocks + AFTER)])


FAULTS: dict[str, tuple[str, ...]] = {
    "it_begins_at_once": ("started = waited == START[START_BITS-1:0]", "started = 1'b1", "late"),
    "a_word_is_lost": ("writing <= reading &&", "writing <= reading && write_at[0] &&"),
    "the_word_does_not_wait": ("now = writing && writable", "now = writing"),
    "the_address_does_not_wait": ("end else if (reading && started && writable)", "end else if (reading && started)"),
    "the_word_read_does_not_wait": ("        if (writable) begin", "        if (1'b1) begin"),
    "x_has_no_sign": ("{{32{x_word[X_WORD_BITS-1]}}, x_word[", "{32'd0, x_word["),
    "y_has_no_sign": ("{{32{y_word[Y_WORD_BITS-1]}}, y_word[", "{32'd0, y_word["),
    "x_ends_early": ("LAST_X = X_WORDS - 1", "LAST_X = X_WORDS - 2"),
    "y_ends_late": ("LAST_Y = Y_WORDS - 1", "LAST_Y = Y_WORDS", "direct"),
    "tables_go_where_fourier_words_go": ("FOURIER ? 3'd2 : 3'd0", "3'd2"),
    "fourier_words_go_where_tables_go": ("FOURIER ? 3'd2 : 3'd0", "3'd0", "fourier"),
    "tables_have_harmonics": ("FOURIER != 0 && write_at[5:0] == X_", "write_at[5:0] == X_"),
    "harmonics_are_elsewhere": ("Y_HARMONICS_AT = 6'd42", "Y_HARMONICS_AT = 6'd43", "fourier"),
    "no_commit": ("booting ? now && writes == COMMIT && !missing", "booting ? 1'b0"),
    "the_commit_writes_as_well": ("booting ? now && writes != COMMIT", "booting ? now"),
    "the_boot_has_no_end": ("booting <= 1'b0", "booting <= 1'b1"),
    "the_boot_ends_before_its_commit": ("!reading && !writing", "!reading"),
    "the_host_is_heard_in_a_boot": ("writes != COMMIT : host", "writes != COMMIT || host_write : host"),
    "the_host_commits_in_a_boot": ("COMMIT && !missing : host", "COMMIT && !missing || host_commit : host"),
    "the_host_is_not_heard": ("COMMIT : host_write", "COMMIT : 1'b0"),
    "the_host_has_no_commit": ("missing : host_commit", "missing : 1'b0"),
    "the_host_is_heard_elsewhere": ("write_at : host_address", "write_at : write_at"),
    "a_reset_goes_on_where_it_was": ("            read_at <= 17'd0;\n", ""),
    "a_reset_goes_on_in_the_region": ("            reads <= PROGRAM;\n", ""),
    "a_reset_after_the_boot_is_not_heard": ("            reading <= 1'b1;\n", ""),
    "a_reset_does_not_boot": ("            booting <= 1'b1;\n", ""),
    "a_reset_leaves_a_word_on_its_way": ("            writing <= 1'b0;\n", ""),
}  # fmt: skip
BOOTS = Boots(BENCHES / "boot_bench.v", BOOT, SETUPS, stimulus, AT_BOTH_ENDS)
MUTANTS = BOOTS.mutants(FAULTS, where="interpolated")


@pytest.fixture(scope="module")
def captured(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    return BOOTS.play(tmp_path_factory.mktemp("boot") / "boot")


@pytest.mark.rest
@pytest.mark.parametrize("name", SETUPS)
def test_a_boot_is_the_program_wherever_it_waits_or_begins_again(captured: dict[str, list[str]], name: str) -> None:
    ended = BOOTS.check(name, captured[name])
    assert ended == 1 if name == "longest" else ended > len(SETUPS[name].writes)


def test_the_stimulus_does_what_it_is_for() -> None:
    """Hosts, waits and resets, on every clock of a boot; and words of either sign."""
    for name in SETUPS:
        if name == "longest":
            continue
        clocks, since, waits, resets = len(SETUPS[name].writes) + AT_BOTH_ENDS, 0, set(), set()
        for clock in stimulus(name):
            if not clock.writable:
                waits.add(since)
            if clock.reset:
                resets.add(since)
            since = 0 if clock.reset else since + 1
        assert set(range(clocks)) <= waits & resets
    assert {(region, data >> 31) for region, _, data in SETUPS["interpolated"].writes if region > 0} == {
        (region, sign) for region in (1, 2) for sign in (0, 1)
    }


# Of which file no word, or only the first ones, are there.
DAMAGED = {
    **{
        f"{name}_{file}_missing": (name, file, None)
        for name in ("interpolated", "fourier")
        for file in ("PROGRAM", "X", "Y")
    },
    **{
        f"{name}_{file}_short": (name, file, -1)
        for name in ("interpolated", "direct")
        for file in ("PROGRAM", "X", "Y")
    },
    **{f"fourier_{file}_half": ("fourier", file, 2) for file in ("PROGRAM", "X", "Y")},
}


@pytest.mark.parametrize("simulator", long(["icarus"], ["icarus", "verilator"]))
def test_a_file_that_is_missing_or_short_is_never_committed(simulator: str, tmp_path: Path) -> None:
    """And that is said, the boot ends, and the host has access after it: with every file there it is committed."""
    (tmp_path / "build").mkdir()
    instances, cases = [], {"whole": ("interpolated", "X", 0), **DAMAGED}
    for index, (case, (name, file, words)) in enumerate(cases.items()):
        given = [f".{key}({value})" for key, value in SETUPS[name].parameters.items()]
        for key, content in SETUPS[name].files.items():
            lines = content.splitlines(keepends=True)
            if key != f"{file}_FILE" or words is not None:
                kept = lines if key != f"{file}_FILE" or words == 0 else lines[:words]
                (tmp_path / "build" / f"{case}_{key}.mem").write_bytes(b"".join(kept))
            given.append(f'.{key}("{case}_{key}.mem")')
        instances.append(
            f"    missing_bench #({', '.join(given)}) bench_{index} (.clock(clock), .committed(committed[{index}]),\n"
            f"        .missing(missing[{index}]), .ended(ended[{index}]));\n"
        )
    top = tmp_path / "missing_top.v"
    last = len(cases) - 1
    top.write_text(
        "`timescale 1ns / 1ps\nmodule missing_top;\n    reg clock = 0;\n    always #5 clock = !clock;\n"
        f"    wire [{last}:0] committed, missing, ended;\n    reg all_done = 0;\n"
        "    integer file;\n    always @(posedge clock) if (&ended && !all_done) begin\n"
        '        file = $fopen("seen.txt", "w");\n        $fwrite(file, "%b %b", committed, missing);\n'
        "        $fclose(file);\n        all_done <= 1;\n    end\n"
        f"{''.join(instances)}endmodule\n",
        "ascii",
    )
    compiled = compile_design(
        simulator, Design([top, BENCHES / "missing_bench.v", BOOT], "missing_top"), tmp_path / "build"
    )
    assert compiled.run("cocotb_outputs") == (1, 0)
    committed, missing = (tmp_path / "build" / "seen.txt").read_text("ascii").split()
    for index, case in enumerate(cases):
        seen = committed[last - index], missing[last - index]
        assert seen == (("1", "0") if case == "whole" else ("0", "1")), case


@pytest.fixture(scope="module")
def mutants_captured(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    return BOOTS.play(tmp_path_factory.mktemp("boot") / "mutants", MUTANTS)


@pytest.mark.rest
@pytest.mark.parametrize("name", MUTANTS)
def test_a_mutant_is_found(mutants_captured: dict[str, list[str]], name: str) -> None:
    with pytest.raises(Wrong):
        BOOTS.check(MUTANTS[name].where, mutants_captured[name])


def test_the_documentation_counts_them() -> None:
    page = (REPOSITORY / "docs" / "verilog.md").read_text("utf-8")
    assert f"with {len(MUTANTS)} mutants" in page
