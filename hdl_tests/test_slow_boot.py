"""dac_slow_boot before a dac_boot: the slow parts, then the program and a commit, wherever it waits or begins again.

What is written follows from random programs, not from the files that are read.
"""

from pathlib import Path

import numpy as np
import pytest
from boot_play import COMMIT, Boots, Clock, Setup, Write, Wrong, some_clocks
from building import BENCHES, REPOSITORY
from slow_scripts import SLOW_FOLDER, X_PARTS, Y_PARTS, random_scan

from tablegen.device.registers import program_words
from tablegen.emit.memory import memory_file
from tablegen.emit.turned_content import TurnedContent
from tablegen.emit.turned_verilog import turned_memories
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.verification.play.sequencer_shape import SequencerShape

pytestmark = pytest.mark.common

SLOW_BOOT = SLOW_FOLDER / "dac_slow_boot.v"
MOST_IDLE = 5  # clocks on which a boot that is not held up writes nothing: both modules begin, and end


def setup(seed: int, shape: SequencerShape, start_clocks: int = 0) -> Setup:
    """A random program of a shape, with a slow part on both axes."""
    program = random_scan(np.random.default_rng(seed), shape, 40, 3, "wild")
    content = TurnedContent("boot", "", program)
    files = {"x": "X", "y": "Y", "slow": "SLOW", "program": "PROGRAM"}
    memories = {one.name: one for one in turned_memories(content)}
    parameters = {"START_CLOCKS": start_clocks, "WORD_BITS": memories["slow"].bits}
    writes: list[Write] = []
    for letter, region, axis in zip("XY", (X_PARTS, Y_PARTS), content.axes, strict=True):
        assert isinstance(axis, FrameProgram)
        parameters |= {
            f"{letter}_WORDS": len(axis.fast.words),
            f"{letter}_WORD_BITS": axis.fast.bits,
            f"{letter}_SLOW_WORDS": len(axis.slow.words),
            f"{letter}_KNOTS": len(axis.gains.words),
        }
        for part, words in enumerate((axis.second, axis.slow.words, axis.gains.words, axis.ratios.words)):
            writes += [(region, part << 14 | at, int(word) & 0xFFFFFFFF) for at, word in enumerate(words)]
    registers = program_words(program.schedule, program.x, program.y)
    writes += [(0, address, word) for address, word in enumerate(registers)]
    for region, axis in zip((1, 2), content.axes, strict=True):
        writes += [(region, address, int(word) & 0xFFFFFFFF) for address, word in enumerate(axis.fast.words)]
    texts = {f"{key}_FILE": memory_file(memories[name].words, memories[name].bits) for name, key in files.items()}
    return Setup(texts, parameters, [*writes, COMMIT])


SETUPS = {
    "cubic": setup(1, SequencerShape(16, 3, 3, 16, 3, 4, 16)),
    "wide": setup(2, SequencerShape(16, 3, 4, 21, 3, 3, 12)),
    "late": setup(3, SequencerShape(16, 3, 3, 16, 3, 3, 16), start_clocks=37),
}


def stimulus(name: str) -> list[Clock]:
    """Return what goes in on the clocks of a setup."""
    return some_clocks(name, SETUPS[name], MOST_IDLE)


FAULTS: dict[str, tuple[str, ...]] = {
    "it_begins_at_once": ("started = waited == START[START_BITS-1:0]", "started = 1'b1", "late"),
    "the_word_does_not_wait": ("now = writing && writable", "now = writing"),
    "the_word_read_does_not_wait": ("        if (writable) begin", "        if (1'b1) begin"),
    "the_address_does_not_wait": ("if (reading && started && writable)", "if (reading && started)"),
    "a_word_has_no_sign": ("{{32{word[WORD_BITS-1]}}, word[", "{32'd0, word["),
    "a_word_is_lost": ("read_at == LAST[", "read_at + 1'b1 == LAST["),
    "the_parts_of_y_are_those_of_x": ("is_y ? Y_PARTS : X_PARTS", "is_y ? X_PARTS : X_PARTS"),
    "y_is_as_long_as_x": ("(is_y ? LAST_Y_TABLE : LAST_X_TABLE)", "LAST_X_TABLE"),
    "its_slow_table_too": ("(is_y ? LAST_Y_SLOW : LAST_X_SLOW)", "LAST_X_SLOW"),
    "its_knots_too": ("(is_y ? LAST_Y_KNOT : LAST_X_KNOT)", "LAST_X_KNOT"),
    "ratios_follow_as_one_part": ("wire ends = place", "wire ends = part != 2'd2 && place"),
    "the_other_boot_does_not_wait": ("boot_writable = writable && !loading", "boot_writable = writable"),
    "the_commit_does_not_wait": ("commit = !loading && boot_commit", "commit = reading && boot_commit"),
    "the_rest_is_not_heard": ("loading ? now : boot_write", "loading ? now : 1'b0"),
    "the_rest_has_no_data": ("wide[31:0] : boot_data", "wide[31:0] : 32'd0"),
    "a_reset_goes_on_where_it_was": ("            read_at <= 0;\n", ""),
    "a_reset_goes_on_at_its_place": ("            place <= 14'd0;\n", ""),
    "a_reset_goes_on_in_its_part": ("            part <= 2'd0;\n", ""),
    "a_reset_goes_on_with_y": ("            is_y <= 1'b0;\n", ""),
    "a_reset_does_not_load": ("            reading <= 1'b1;\n", ""),
    "a_reset_leaves_a_word_on_its_way": ("            writing <= 1'b0;\n", ""),
}  # fmt: skip
BOOTS = Boots(BENCHES / "two_boots_bench.v", SLOW_BOOT, SETUPS, stimulus, MOST_IDLE)
MUTANTS = BOOTS.mutants(FAULTS, where="cubic")


@pytest.fixture(scope="module")
def captured(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    return BOOTS.play(tmp_path_factory.mktemp("boot") / "boot")


@pytest.mark.parametrize("name", SETUPS)
def test_a_boot_is_the_program_wherever_it_waits_or_begins_again(captured: dict[str, list[str]], name: str) -> None:
    assert BOOTS.check(name, captured[name]) >= 3
    assert {(region, data >> 31) for region, _, data in SETUPS[name].writes if region > 4} == {
        (region, sign) for region in (X_PARTS, Y_PARTS) for sign in (0, 1)
    }


@pytest.mark.parametrize("words", [None, -1, 3])
def test_a_file_that_is_missing_or_short_is_said(words: int | None, tmp_path: Path) -> None:
    """The boot goes on to its end, for what stands before the sequencer to withdraw it."""
    flags = BOOTS.flags_without(tmp_path / "boot", "cubic", "SLOW_FILE", words)
    assert flags.count("d") == 1  # missing, booting, and a commit; where there are no words, flags are undefined
    assert not {"5", "1"} & set(flags)
    assert flags[-1] == "8"


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
