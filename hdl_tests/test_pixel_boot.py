"""dac_pixel_boot before a dac_boot: the table of pixels, then the program and a commit, wherever it waits or resets.

What is written follows from random programs, not from the files that are read.
"""

from pathlib import Path

import numpy as np
import pytest
from boot_play import COMMIT, Boots, Clock, Setup, Write, Wrong, some_clocks
from building import BENCHES, REPOSITORY
from programs import random_dual, with_table

from tablegen.base.resources import verilog_runtime
from tablegen.device.registers import program_words
from tablegen.emit.memory import memory_files
from tablegen.verification.play.sequencer_shape import SequencerShape

pytestmark = pytest.mark.common

PIXEL_BOOT = next(path for path in verilog_runtime() if path.name == "dac_pixel_boot.v")
PIXEL_TICKS = 7  # its region
MOST_IDLE = 5  # clocks on which a boot that is not held up writes nothing: both modules begin, and end


def setup(seed: int, ticks: int, start_clocks: int = 0) -> Setup:
    """Make a random program with a table of pixels, and lines of this number of ticks."""
    rng = np.random.default_rng(seed)
    while True:
        program = random_dual(rng, SequencerShape(16, 1, 3, 16, 1, 3, 12), (ticks, ticks))
        schedule = with_table(rng, program.schedule)
        table = schedule.pixel_table
        if table is not None and schedule.pixels > 1:  # a window without ticks has no table
            break
    none = np.zeros(3, np.int64)
    made = memory_files("boot", schedule, program.x, program.y, {"x": none, "y": none})
    parameters = {"PIXELS": schedule.pixels, "START_CLOCKS": start_clocks}
    writes: list[Write] = [(PIXEL_TICKS, at, count) for at, count in enumerate((*table[0], *table[1]))]
    writes += [(0, address, word) for address, word in enumerate(program_words(schedule, program.x, program.y))]
    for region, (letter, axis) in enumerate((("X", program.x), ("Y", program.y)), start=1):
        parameters |= {f"{letter}_WORDS": len(axis.words), f"{letter}_WORD_BITS": axis.bits}
        writes += [(region, address, int(word) & 0xFFFFFFFF) for address, word in enumerate(axis.words)]
    files = {"PROGRAM": "program", "X": "x", "Y": "y", "PIXEL": "pixels"}
    contents = {f"{key}_FILE": made[f"boot_{name}.mem"] for key, name in files.items()}
    return Setup(contents, parameters, [*writes, COMMIT])


SETUPS = {"few": setup(1, 24), "many": setup(3, 60), "late": setup(2, 30, start_clocks=37)}


def stimulus(name: str) -> list[Clock]:
    """Return what goes in on the clocks of a setup."""
    return some_clocks(name, SETUPS[name], MOST_IDLE)


FAULTS: dict[str, tuple[str, ...]] = {
    "it_begins_at_once": ("started = waited == START[START_BITS-1:0]", "started = 1'b1", "late"),
    "the_word_does_not_wait": ("now = writing && writable", "now = writing"),
    "the_word_read_does_not_wait": ("        if (writable) begin", "        if (1'b1) begin"),
    "the_address_does_not_wait": ("if (reading && started && writable)", "if (reading && started)"),
    "a_word_is_lost": ("read_at == LAST[", "read_at + 1'b1 == LAST["),
    "the_backward_window_is_lost": ("WORDS = 2 * PIXELS", "WORDS = PIXELS"),
    "it_writes_elsewhere": ("PIXEL_TICKS = 3'd7", "PIXEL_TICKS = 3'd6"),
    "a_word_goes_one_further": ("place <= read_at;", "place <= read_at + 1'b1;"),
    "the_other_boot_does_not_wait": ("boot_writable = writable && !loading", "boot_writable = writable"),
    "the_commit_does_not_wait": ("commit = !loading && boot_commit", "commit = reading && boot_commit"),
    "the_rest_is_not_heard": ("loading ? now : boot_write", "loading ? now : 1'b0"),
    "the_rest_has_no_data": ("word[15:0]} : boot_data", "word[15:0]} : 32'd0"),
    "the_rest_has_no_address": ("wide_place[15:0] : boot_address", "wide_place[15:0] : 16'd0"),
    "the_rest_has_no_region": ("PIXEL_TICKS : boot_region", "PIXEL_TICKS : 3'd0"),
    "a_reset_goes_on_where_it_was": ("            read_at <= 0;\n", ""),
    "a_reset_does_not_load": ("            reading <= 1'b1;\n", ""),
    "a_reset_leaves_a_word_on_its_way": ("            writing <= 1'b0;\n", ""),
}  # fmt: skip
BOOTS = Boots(BENCHES / "two_boots_bench.v", PIXEL_BOOT, SETUPS, stimulus, MOST_IDLE)
MUTANTS = BOOTS.mutants(FAULTS, where="many")


@pytest.fixture(scope="module")
def captured(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    return BOOTS.play(tmp_path_factory.mktemp("boot") / "boot")


@pytest.mark.parametrize("name", SETUPS)
def test_a_boot_is_the_program_wherever_it_waits_or_begins_again(captured: dict[str, list[str]], name: str) -> None:
    assert BOOTS.check(name, captured[name]) >= 3


@pytest.mark.parametrize("words", [None, -1, 3])
def test_a_file_that_is_missing_or_short_is_said(words: int | None, tmp_path: Path) -> None:
    """The boot goes on to its end, for what stands before the sequencer to withdraw it."""
    flags = BOOTS.flags_without(tmp_path / "boot", "many", "PIXEL_FILE", words)
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
    assert f"in the same way; with {len(MUTANTS)} mutants" in page
