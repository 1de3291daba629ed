"""The sequencer with ALTERNATE, both axes by turns in one pipeline: its modules, its paces, and what it plays."""

from pathlib import Path

from tablegen.base.resources import verilog_by_turns, verilog_runtime
from tablegen.verification.play.sequencer_shape import SequencerShape
from tablegen.verification.play.stream import Script

ALTERNATE: dict[str, int | str] = {"ALTERNATE": 1}
PAIR_PACES = (2, 3, 5, 8)  # clocks from tick to tick: even ones and odd ones, which change the turn
DRAIN = 60  # clocks, more than a sample takes

PAIR_SHAPES = {
    "bits_16": SequencerShape(16, 1, 5, 16, 1, 4, 16),
    "bits_8": SequencerShape(8, 1, 2, 8, 1, 3, 8),
    "direct_x": SequencerShape(12, 0, 6, 12, 1, 3, 12),
    "direct_y": SequencerShape(18, 1, 4, 18, 0, 7, 18),
    "direct": SequencerShape(12, 0, 6, 16, 0, 6, 16),
    "bits_22": SequencerShape(22, 1, 3, 24, 1, 3, 24),
    "words_24": SequencerShape(8, 1, 3, 24, 1, 4, 24),
    "words_15": SequencerShape(16, 1, 3, 15, 1, 6, 15),
}


def pair_sources() -> list[Path]:
    """The modules of a sequencer with ALTERNATE."""
    return [*verilog_runtime(), *verilog_by_turns()]


def pair_script(codes: tuple[int, int] = (0, 0)) -> Script:
    """An empty script for it."""
    return Script(codes, drain=DRAIN)
