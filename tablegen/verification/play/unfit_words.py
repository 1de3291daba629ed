"""Words that do not fit a device, beside those that just do: each is committed by itself, and has to be refused."""

from collections.abc import Callable, Sequence

from tablegen.device.registers import AXIS_WORDS, PAGE_WORDS, SCAN_WORDS
from tablegen.device.widths import AxisWidths, Widths, cut_words
from tablegen.fixedpoint.interpolation import guard_bits
from tablegen.fixedpoint.shaping import MAXIMUM_ZERO
from tablegen.verification.play.placement import Placement
from tablegen.verification.play.sequencer_shape import SequencerShape

TICK_BITS, LINE_BITS, PERIOD_BITS = 24, 16, 31  # of the sequencer in the bench of Verilog
USED = [
    *range(len(SCAN_WORDS)),
    *(page * PAGE_WORDS + at for page in (1, 2) for at in range(len(AXIS_WORDS))),
]  # addresses of the words of a program
_PIXELS = SCAN_WORDS.index("pixels")
_COUNTS = [SCAN_WORDS.index(f"{window}_count") for window in ("forward", "backward")]
_MASK = (1 << 32) - 1
_ZEROS = (MAXIMUM_ZERO, MAXIMUM_ZERO + 1, 255)
Fits = Callable[[int, int], bool]  # address, word


def device_widths(shape: SequencerShape, placement: Placement, harmonics: int) -> Widths:
    """Return the widths of the sequencer in the bench of Verilog; ``harmonics`` are those of its renderer, or 0."""
    x = AxisWidths(shape.x_interpolated != 0, shape.x_index_bits, shape.x_word_bits, TICK_BITS + 1)
    y = AxisWidths(shape.y_interpolated != 0, shape.y_index_bits, shape.y_word_bits, PERIOD_BITS)
    rendered = harmonics if placement.fourier else 0
    return Widths(shape.dac_bits, TICK_BITS, LINE_BITS, x, y, rendered, placement.shaping)


def c_edges(shape: SequencerShape, words: Sequence[int], shaping: int) -> list[tuple[int, int]]:
    """Return the words that the C refuses beside the others of a program, as (address, word), whatever its widths.

    ``shaping`` is the highest order of the device.
    """
    scan = {name: words[at] for at, name in enumerate(SCAN_WORDS)}
    line, lines = scan["line_ticks"], scan["frame_lines"]
    wrong = {"line_ticks": [0, line + 1], "frame_lines": [0], "turn_tick": [line + 1]}
    for window, length in (("forward", line), ("backward", line), ("up", lines), ("down", lines)):
        wrong |= {f"{window}_first": [length + 1], f"{window}_count": [length - scan[f"{window}_first"] + 1]}
    outside = [(SCAN_WORDS.index(name), word) for name, values in wrong.items() for word in values]
    outside.append((SCAN_WORDS.index("y_steps"), 1 - scan["y_steps"]))
    outside += _crowded(words)
    for page, bits in ((1, shape.x_word_bits), (2, shape.y_word_bits)):
        axis = {name: words[page * PAGE_WORDS + at] for at, name in enumerate(AXIS_WORDS)}
        most = 1 << (bits + guard_bits(bits) - 1)
        wrong = {
            "phase_period": [axis["phase_period"] + 1],
            "gain": [1 << 17, -(1 << 17) - 1],
            "offset_high": [most, -most - 1],
            "code_min": [-1, axis["park_code"] + 1],
            "code_max": [1 << shape.dac_bits],
            "max_step": [0, 1 << 24],
            "park_code": [axis["code_min"] - 1, axis["code_max"] + 1],
            "shaping": [*range(shaping + 1, 4), 0x101, 0x102, 3 | 129 << 8] if shaping else [],
        }
        for name, values in wrong.items():
            outside += [(page * PAGE_WORDS + AXIS_WORDS.index(name), word & _MASK) for word in values]
    return outside


def edges(words: Sequence[int], widths: Widths) -> tuple[list[tuple[int, int]], list[dict[int, int]]]:
    """Return words at the edges of what fits a device, as (address, word), and the last that fit as whole programs.

    ``words`` are a program that fits. The first of them would be cut by their registers; those of more pixels than
    ticks of a window are the last.
    """

    def fits(address: int, word: int) -> bool:
        return not cut_words([*words[:address], word, *words[address + 1 :]], widths)

    outside: list[tuple[int, int]] = []
    inside: list[list[tuple[int, int]]] = []
    for address in USED:
        beyond, last = _edges(address, fits)
        outside += [(address, word) for word in beyond]
        inside.append([(address, word) for word in last])
    programs = []
    for number in range(max(map(len, inside))):
        program = dict(one[number % len(one)] for one in inside if one)
        most = [ticks for ticks in (program[address] for address in _COUNTS) if ticks]
        programs.append(program | {_PIXELS: min([program[_PIXELS], *most])})
    return outside + _crowded(words), programs


def _crowded(words: Sequence[int]) -> list[tuple[int, int]]:
    """Return words that leave a pixel of a program without a tick in a window, as (address, word)."""
    used = [address for address in _COUNTS if words[address]]
    if not used:
        return []
    crowded = [(_PIXELS, min(words[address] for address in used) + 1)]
    return crowded + [(address, words[_PIXELS] - 1) for address in used if words[_PIXELS] > 1]


def _edges(address: int, fits: Fits) -> tuple[list[int], list[int]]:
    """Return values of a word that do not fit, near those that do or with one bit more, and those that just fit."""
    of_axis = AXIS_WORDS[address % PAGE_WORDS] if address >= PAGE_WORDS else ""
    if of_axis == "shaping":
        words = [0, 1, 2, 3, 4, 0x80, 0x100, 0x101, 0x102, *(zero << 8 | 3 for zero in _ZEROS), 1 << 16, 1 << 31]
        return [word for word in words if not fits(address, word)], [word for word in words if fits(address, word)]
    beyond = [word for word in (1 << 31, _MASK >> 1) if not fits(address, word)]
    last = []
    for word in sorted({(sign << bit) + by & _MASK for bit in range(32) for sign in (1, -1) for by in (-1, 0, 1)}):
        for neighbour in (word - 1 & _MASK, word + 1 & _MASK):
            if not fits(address, word) and fits(address, neighbour):
                beyond += [] if word == _MASK else [word]
                last.append(neighbour)
    if of_axis == "harmonics":  # what fits would be rendered
        return sorted(set(beyond)), [0]
    return sorted(set(beyond)), last or [0, _MASK]
