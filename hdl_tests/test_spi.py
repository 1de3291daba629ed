"""dac_spi: converters receive every sample that is not missed, in all wirings, and mutants of it are found."""

import random
from pathlib import Path

import numpy as np
import pytest
from replacing import replace
from spi_bench import (
    AD5541A,
    AD5791,
    CHAIN,
    DAC8562,
    PARALLEL,
    SETUPS,
    TWO_SELECTS,
    Difference,
    Mutant,
    Played,
    Spi,
    check,
    expected,
    play,
)
from spi_monitor import ProtocolFault


@pytest.fixture(scope="module")
def all_played(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Played]:
    return play("icarus", tmp_path_factory.mktemp("spi"), SETUPS, 80, {})


@pytest.mark.rest
@pytest.mark.parametrize("name", SETUPS)
def test_converters_receive_every_sample_that_is_not_missed(all_played: dict[str, Played], name: str) -> None:
    want = check(all_played[name])
    assert len(want.sent) > 40, "the stimulus is meant to send"
    assert len(want.missed) > 10, "and to miss"


@pytest.mark.rest
@pytest.mark.parametrize("name", SETUPS)
def test_strobes_a_tick_apart_do_not_wait(all_played: dict[str, Played], name: str) -> None:
    """The formula of the clocks that a tick takes: the first strobes of a stimulus are exactly that apart."""
    played = all_played[name]
    strobes = np.flatnonzero(played.wires["strobe"])[:20]
    assert set(np.diff(strobes).tolist()) == {played.setup.tick}
    select = played.wires["cs_x_n"] & played.wires["cs_y_n"]
    falls = np.flatnonzero(np.diff(select) == -1) + 1
    assert np.array_equal(falls[:: 2 if played.setup.two_frames else 1][:20], strobes + 1)
    assert not played.wires["missed"][: strobes[-1]].any()


@pytest.mark.common
def test_a_reset_at_any_clock_tears_no_frame(all_played: dict[str, Played]) -> None:
    """``check`` compares every frame; this says that resets were met at every clock of a tick."""
    for name in ("ad5541a", "ad5791", "dac8562", "two_selects", "chain"):
        played = all_played[name]
        starts = np.array([clock for clock, _ in expected(played).sent])
        resets = np.flatnonzero(played.wires["reset"])
        since = resets - starts[np.searchsorted(starts, resets, side="right") - 1]
        assert set(range(1, played.setup.tick + 1)) <= set(since.tolist())


def random_setup(generator: random.Random) -> Spi:
    frame_bits = generator.choice((16, 17, 18, 20, 22, 24))
    word_bits = generator.randint(8, frame_bits)
    prefixes = [generator.randrange(2**frame_bits) for _ in "xy"]
    data_lsb = generator.randint(0, frame_bits - word_bits)
    outside = ~((1 << word_bits) - 1 << data_lsb)
    return Spi(
        bits=generator.randint(8, word_bits),
        twos_complement=generator.randrange(2),
        left_aligned=generator.randrange(2),
        word_bits=word_bits,
        frame_bits=frame_bits,
        data_lsb=data_lsb,
        x_prefix=prefixes[0] & outside,
        y_prefix=prefixes[1] & outside,
        topology=generator.choice((PARALLEL, TWO_SELECTS, CHAIN)),
        y_first=generator.randrange(2),
        cpol=generator.randrange(2),
        cpha=generator.randrange(2),
        half_period=generator.choice((1, 1, 2, 3, 4)),
        gap=generator.randint(1, 20),
        ldac_clocks=generator.choice((0, 1, 2, 5)),
        ldac_delay=generator.randint(1, 6),
    )


@pytest.mark.long
@pytest.mark.timeout(86_400)
def test_random_parameters_on_verilator(tmp_path: Path) -> None:
    generator = random.Random(2024)
    setups = {f"random_{index}": random_setup(generator) for index in range(16)}
    sent = 0
    for played in play("verilator", tmp_path, setups, 800, {}).values():
        sent += len(check(played).sent)
    assert sent > 6000


SLOW = Spi(half_period=2)
SHIFT = "(CPHA != 0 ? !active && !setting_up : active)"
EDGE = "            if (active) begin\n                sclk <= RESTING;\n"
END_OF_FRAME = (
    "                if (bits == {COUNT_BITS{1'b0}}) begin\n"
    "                    selected <= 1'b0; paused <= 1'b1; cs_x_n <= 1'b1; cs_y_n <= 1'b1;\n"
    "                    bits <= BITS_TO_SEND[COUNT_BITS-1:0]; pause <= REST_LAST[PAUSE_BITS-1:0];\n"
    "                end\n"
)
LOW_N = "low_n <= !(paused && last && pause <= FALL[PAUSE_BITS-1:0] && pause > RISE[PAUSE_BITS-1:0]);"
MUTANTS: dict[str, Mutant] = {
    "data_half_a_clock_off": Mutant(
        AD5541A, SHIFT, "(CPHA != 0 ? active : !active && !setting_up)", "data changes at the sampling edge"
    ),
    "data_half_a_clock_off_cpha_1": Mutant(
        AD5791, SHIFT, "(CPHA != 0 ? active : !active && !setting_up)", "data changes at the sampling edge"
    ),
    "data_a_clock_early": Mutant(
        SLOW,
        f"selected && half_over && {SHIFT}",
        "selected && active && sclk != RESTING && half != {HALF_BITS{1'b0}}",
        "data changes at the sampling edge",
    ),
    "a_bit_dropped": Mutant(AD5541A, "BITS_TO_SEND = BITS;", "BITS_TO_SEND = BITS - 1;", "15 bits instead of 16"),
    "a_bit_more": Mutant(AD5541A, "BITS_TO_SEND = BITS;", "BITS_TO_SEND = BITS + 1;", "17 bits instead of 16"),
    "a_bit_off": Mutant(AD5541A, "mosi_x = head[FRAME_BITS-1];", "mosi_x = head[FRAME_BITS-2];", "frame of x 0"),
    "y_never_shifts": Mutant(AD5541A, "tail <= {tail[FRAME_BITS-2:0], 1'b0};", "tail <= tail;", "frame of y 0"),
    "wrong_rest_of_sclk": Mutant(AD5541A, "RESTING = CPOL != 0;", "RESTING = CPOL == 0;", "sclk is not at rest"),
    "wrong_edge": Mutant(AD5791, SHIFT, "active", "data changes at the sampling edge"),
    "select_with_the_last_edge": Mutant(
        AD5541A, EDGE, EDGE + END_OF_FRAME, "the select rises with sclk not at rest"
    ),
    "sclk_too_fast": Mutant(
        Spi(half_period=5), "HALF_LAST = HALF_PERIOD - 1;", "HALF_LAST = HALF_PERIOD - 2;", "sclk is high for too short"
    ),
    "gap_too_short": Mutant(
        SETUPS["dac8562_ldac_low"], "GAP_LAST = GAP - 1;", "GAP_LAST = GAP - 2;", "the select is high for too short"
    ),
    "rest_too_short": Mutant(
        replace(AD5541A, ldac_clocks=0), "REST_LAST = REST - 1;", "REST_LAST = REST - 2;", "is high for too short"
    ),
    "ldac_in_the_frame": Mutant(AD5541A, LOW_N, "low_n <= !(selected && active);", "LDAC is low during a frame"),
    "ldac_too_early": Mutant(AD5541A, "FALL = REST - LDAC_DELAY;", "FALL = REST - 1;", "LDAC falls too soon"),
    "ldac_too_short": Mutant(
        AD5541A, "RISE = REST - LDAC_DELAY - LDAC_CLOCKS;", "RISE = REST - LDAC_DELAY - LDAC_CLOCKS + 1;", "LDAC is low"
    ),
    "ldac_after_each_frame": Mutant(
        SETUPS["gap_long"], "!(paused && last && pause", "!(paused && pause", "LDAC falls twice after one frame"
    ),
    "no_ldac": Mutant(AD5541A, LOW_N, "low_n <= 1'b1;", "frame of x: 0, not"),
    "ldac_not_held": Mutant(SETUPS["chain_ldac_low"], "ldac_n = LDAC_HELD != 0;", "ldac_n = 1'b1;", "LDAC is not held"),
    "a_frame_is_torn": Mutant(
        SLOW, "free && (strobe || waiting) && !reset;", "(free && waiting) || (strobe && !paused);", "data changes"
    ),
    "a_reset_tears": Mutant(
        AD5541A,
        "        if (start) begin\n            selected <= 1'b1;",
        "        if (reset) begin selected <= 1'b0; cs_x_n <= 1'b1; cs_y_n <= 1'b1; sclk <= RESTING;\n"
        "            bits <= BITS_TO_SEND[COUNT_BITS-1:0]; paused <= 1'b0;\n"
        "        end else if (start) begin\n            selected <= 1'b1;",
        "the select rises with sclk not at rest",
    ),
    "oldest_wins": Mutant(AD5541A, "        if (strobe) begin", "        if (strobe && !waiting) begin", "frame of x"),
    "missed_when_only_late": Mutant(AD5541A, "missed <= strobe && waiting", "missed <= strobe && busy", "missed"),
    "never_missed": Mutant(AD5541A, "missed <= strobe && waiting && !reset", "missed <= 1'b0", "missed"),
    "mailbox_outlives_reset": Mutant(AD5541A, "if (reset || free) waiting", "if (free) waiting", "frame of x"),
    "axes_change_places": Mutant(SETUPS["chain"], "head <= SWAPPED &&", "head <= !SWAPPED &&", "frame of x 0"),
    "nothing_selected": Mutant(
        SETUPS["two_selects"], "FIRST_X = !(TWO_SELECTS && SWAPPED)", "FIRST_X = !TWO_SELECTS", "with nothing selected"
    ),
    "both_selected": Mutant(
        SETUPS["two_selects"], "FIRST_Y = PARALLEL || (TWO_SELECTS && SWAPPED)", "FIRST_Y = !TWO_FRAMES || TWO_SELECTS",
        "frame of y",
    ),
    "second_frame_first": Mutant(DAC8562, "second <= 1'b0;", "second <= 1'b1;", "change"),
    "prefix_lost": Mutant(AD5791, "framed = prefix;", "framed = {FRAME_BITS{1'b0}};", "frame of x 0"),
}  # fmt: skip


@pytest.fixture(scope="module")
def mutants_played(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Played]:
    setups = {name: mutant.setup for name, mutant in MUTANTS.items()}
    return play("icarus", tmp_path_factory.mktemp("mutants"), setups, 60, MUTANTS)


@pytest.mark.rest
@pytest.mark.parametrize("name", MUTANTS)
def test_a_mutant_is_found(mutants_played: dict[str, Played], name: str) -> None:
    with pytest.raises((ProtocolFault, Difference), match=MUTANTS[name].found):
        check(mutants_played[name])
