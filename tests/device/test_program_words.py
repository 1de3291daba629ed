"""The words of a program's slow parts in its pages, read back by the arithmetic of the page on the sequencer."""

import numpy as np
import pytest
from frame_programs import common_knots, scan_program
from programs import random_dual, random_schedule
from replacing import replace

from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS, PIXEL_TABLE_WORD, SLOW_WORDS, program_words
from tablegen.device.schedule import Window
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.verification.play.sequencer_shape import SequencerShape

SHAPE = SequencerShape(16, 1, 6, 16, 3, 5, 20)


@pytest.mark.parametrize("slow", ["xy", "x", "y"])
@pytest.mark.parametrize("lines", [1, 2, 7, 256])
def test_a_page_has_the_line_the_slow_table_and_the_knots(slow: str, lines: int) -> None:
    rng = np.random.default_rng(lines)
    program = common_knots(rng, scan_program(rng, SHAPE, replace(random_schedule(rng, 90, 1), lines=lines), slow))
    words = program_words(program.schedule, program.x, program.y)
    names = dict(enumerate((*AXIS_WORDS, *SLOW_WORDS)))
    assert tuple(names[at] for at in (12, 13, 14, 15)) == SLOW_WORDS
    for page, axis in ((1, program.x), (2, program.y)):
        has = {name: words[page * PAGE_WORDS + at] for at, name in names.items()}
        if not isinstance(axis, FrameProgram):
            assert [has[name] for name in SLOW_WORDS] == [0, 0, 0, 0]
            continue
        assert has["slow_part"] & 127 == len(axis.gains.words) == len(axis.ratios.words)
        assert 1 << (has["slow_part"] >> 8) == len(axis.slow.words)
        assert has["knot_spacing"] == axis.gains.spacing
        assert has["slow_step"] * lines + has["slow_remainder"] in (2**32, 0)  # of one line the step needs 33 bits
        assert (has["phase_period"], has["phase_step"]) == (90, 2**32 // 90)
        assert has["gain"] == axis.slow.gain_word % 2**32
        assert (has["offset_high"] << 18 | has["offset_low"]) == axis.slow.offset_word % 2**50


def test_gains_and_ratios_at_other_lines_have_no_words() -> None:
    rng = np.random.default_rng(3)
    program = common_knots(rng, scan_program(rng, SHAPE, replace(random_schedule(rng, 90, 1), lines=7), "x"))
    assert isinstance(program.x, FrameProgram)
    apart = replace(program.x, ratios=replace(program.x.ratios, spacing=program.x.gains.spacing + 1))
    with pytest.raises(ValueError, match="at different lines"):
        program_words(program.schedule, apart, program.y)


def test_word_14_of_the_scan_says_whether_pixels_have_a_table() -> None:
    program = random_dual(np.random.default_rng(5), SHAPE)
    window = Window(0, 3)
    schedule = replace(program.schedule, ticks=8, pixels=2, forward=window, backward=Window(4, 3))
    with_table = replace(schedule, pixel_table=((1, 2), (2, 1)))
    plain, table = (program_words(each, program.x, program.y) for each in (schedule, with_table))
    assert PIXEL_TABLE_WORD == 14
    assert (plain[14], table[14]) == (0, 1)
    assert plain[:14] + plain[15:] == table[:14] + table[15:]
