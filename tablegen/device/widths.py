"""The check that a program fits the registers of a device of given widths, and the least widths that it fits.

``dac_sequencer`` refuses the commit of any other program. ``dac_fit.v`` has the arithmetic of ``cut_words``: a value
that does not fit would be another one in its register. ``dac_markers.v`` compares pixels with the ticks of windows.
Widths are the parameters of ``dac_sequencer``, in lower case.
"""

from collections.abc import Sequence

from msgspec import Struct

from tablegen.device.registers import AXIS_WORDS, OFFSET_LOW_BITS, PAGE_WORDS, SCAN_WORDS
from tablegen.device.schedule import Schedule, has_ticks_for_pixels
from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.program import Program
from tablegen.fixedpoint.shaping import Shaping

LEAST_LINE_TICKS = 8


class AxisWidths(Struct, frozen=True):
    """The widths of an axis: a table of 2^``index_bits`` words, periods below 2^``period_bits``."""

    interpolated: bool
    index_bits: int
    word_bits: int
    period_bits: int


class Widths(Struct, frozen=True):
    """The widths of a device; at most ``harmonics`` are rendered, 0 without a renderer; ``shaping`` is an order."""

    dac_bits: int
    tick_bits: int
    line_bits: int
    x: AxisWidths
    y: AxisWidths
    harmonics: int = 0
    shaping: int = 0


def misfits(words: Sequence[int], widths: Widths) -> list[str]:
    """Return the words of a program that do not fit, as ``scan.line_ticks`` or ``y.gain``.

    They are those of ``cut_words``, and behind them ``scan.pixels`` where a window has fewer ticks, but not none.
    ``words`` are those of ``program_words``, unsigned, 48 of them.
    """
    names = cut_words(words, widths)
    if has_ticks_for_pixels(*(words[SCAN_WORDS.index(name)] for name in ("pixels", "forward_count", "backward_count"))):
        return names
    return [*names, *(["scan.pixels"] if "scan.pixels" not in names else [])]


def cut_words(words: Sequence[int], widths: Widths) -> list[str]:
    """Return the words of a program that registers would cut, in order of address; ``words`` as of ``misfits``."""
    pages = [words[page * PAGE_WORDS : (page + 1) * PAGE_WORDS] for page in range(3)]
    names = [f"scan.{name}" for name, word in zip(SCAN_WORDS, pages[0], strict=False) if not _scan(name, word, widths)]
    for axis, page, own in (("x", pages[1], widths.x), ("y", pages[2], widths.y)):
        wrong = (name for name, word in zip(AXIS_WORDS, page, strict=False) if not _axis(name, word, own, widths))
        names += [f"{axis}.{name}" for name in wrong]
    return names


def _scan(name: str, word: int, widths: Widths) -> bool:
    if name == "line_ticks":
        return LEAST_LINE_TICKS <= word <= 1 << widths.tick_bits
    if name == "frame_lines":
        return 1 <= word <= 1 << widths.line_bits
    if name == "settle_lines":
        return word < 1 << 8
    if name == "y_steps":
        return word < 1 << 1
    return word < 1 << ((widths.line_bits if name.startswith(("up", "down")) else widths.tick_bits) + 1)


def _axis(name: str, word: int, own: AxisWidths, widths: Widths) -> bool:
    if name == "phase_remainder":
        return not own.interpolated or word < 1 << own.period_bits
    if name == "phase_period":
        return word < 1 << own.period_bits if own.interpolated else word <= 1 << own.index_bits
    if name == "gain":
        return _is_signed(word, 18)
    if name == "offset_low":
        return word < 1 << OFFSET_LOW_BITS
    if name == "offset_high":
        return _is_signed(word, own.word_bits + guard_bits(own.word_bits))
    if name == "harmonics":
        return not widths.harmonics or word <= widths.harmonics
    if name == "shaping":
        return _is_shaping(word, widths.shaping)
    return name == "phase_step" or word < 1 << widths.dac_bits


def _is_shaping(word: int, highest: int) -> bool:
    try:
        return Shaping.of_word(word).order <= highest
    except ValueError:
        return False


def _is_signed(word: int, bits: int) -> bool:
    value = word - (word >> 31 << 32)
    return -(1 << (bits - 1)) <= value < 1 << (bits - 1)


def least_widths(schedule: Schedule, y: Program) -> dict[str, int]:
    """Return the least TICK_BITS, LINE_BITS and PERIOD_BITS of a ``dac_sequencer`` that plays a program, by name."""
    return {
        "TICK_BITS": max((schedule.ticks - 1).bit_length(), 3),
        "LINE_BITS": max((schedule.lines - 1).bit_length(), 1),
        "PERIOD_BITS": y.phase.ticks.bit_length(),
    }
