"""What the Verilog sequencer that plays both axes by turns (``ALTERNATE``) does not play."""

from tablegen.fixedpoint.program import Program

LEAST_CLOCKS = 2  # from tick to tick
_WIDE_WORDS, _WIDE_CODES = 22, 22  # bits of the words from which on a code has a limit, and that limit


def not_by_turns(x: Program, y: Program) -> tuple[str, str] | None:
    """Return why ``ALTERNATE`` does not play programs of x and y, and the remedy; None if it does.

    Both are of letters, digits, ``_`` and spaces: with ``_`` for each space they are a part of a name in Verilog.
    """
    dac_bits, word_bits = x.output.dac_bits, x.bits
    if "cubic" in (x.mode, y.mode):
        return "plays no cubic table", "LOW_AREA does"
    if x.output.shaping.order or y.output.shaping.order:
        return "plays no shaped output", "LOW_AREA does"
    if dac_bits > _WIDE_CODES:
        return f"plays no more than {_WIDE_CODES} bits of a converter", "LOW_AREA does"
    if word_bits != y.bits:
        return "plays table words of the same bits", f"give both tables {max(word_bits, y.bits)} bits"
    if word_bits < min(dac_bits - 1, _WIDE_WORDS):
        return f"plays table words of {dac_bits - 1} bits or more", f"give both tables {dac_bits - 1} bits"
    return None
