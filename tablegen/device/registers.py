"""The program as a host writes it into a device: pages of 16 words of 32 bits for the scan, for x and for y.

The Verilog registers (``firmware_templates/verilog/``) are at these addresses; ``docs/verilog.md`` has the map.
"""

from tablegen.device.dual_program import AxisProgram
from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.interpolation import index_bits_of
from tablegen.fixedpoint.phase import RationalPhase

PAGE_WORDS = 16
SCAN_WORDS = (
    "line_ticks",
    "frame_lines",
    "settle_lines",
    "turn_tick",
    "forward_first",
    "forward_count",
    "backward_first",
    "backward_count",
    "up_first",
    "up_count",
    "down_first",
    "down_count",
    "pixels",
    "y_steps",
)
PIXEL_TABLE_WORD = len(SCAN_WORDS)  # behind them: 1 where the schedule has a table of pixels, 0 without
AXIS_WORDS = (
    "phase_step",
    "phase_remainder",
    "phase_period",
    "gain",
    "offset_low",
    "offset_high",
    "code_min",
    "code_max",
    "max_step",
    "park_code",
    "harmonics",
    "shaping",
)
# Behind them; all 0 where an axis has no slow part. With one, gain and offset are those of the slow table.
SLOW_WORDS = ("slow_part", "knot_spacing", "slow_step", "slow_remainder")
SLOW_INDEX_SHIFT = 8  # slow_part: the number of knots, and from this bit on the index bits of the slow table
# The offset has up to 44 bits: the low part has those that a serial gain multiplier produces first.
OFFSET_LOW_BITS = 18
_MASK = (1 << 32) - 1


def program_words(schedule: Schedule, x: AxisProgram, y: AxisProgram, harmonics: tuple[int, int] = (0, 0)) -> list[int]:
    """Return all words of a program in order of address, unsigned; unused ones 0. Shape (3 * 16,).

    Parameters
    ----------
    harmonics
        Those of x and y where the device renders the table from Fourier words, 0 where it is uploaded.

    Raises
    ------
    ValueError
        If the gains and the ratios of a slow part are at different lines, for which there are no words.
    """
    steps = not isinstance(y, FrameProgram) and y.hold != 1
    pages = [
        _scan(schedule, steps),
        _axis(x, harmonics[0]),
        _axis(y, harmonics[1]),
    ]
    return [word & _MASK for page in pages for word in page + [0] * (PAGE_WORDS - len(page))]


def _scan(schedule: Schedule, steps: bool) -> list[int]:
    windows = (schedule.forward, schedule.backward, schedule.up, schedule.down)
    return [
        schedule.ticks,
        schedule.lines,
        schedule.settle_lines,
        schedule.turn_tick,
        *(edge for window in windows for edge in (window.first, window.count)),
        schedule.pixels,
        int(steps),
        int(schedule.pixel_table is not None),
    ]


def _axis(axis: AxisProgram, harmonics: int) -> list[int]:
    if isinstance(axis, FrameProgram):  # its table has no gain and no offset, so those of the slow one take their words
        phase, gain, offset = axis.fast.phase, axis.slow.gain_word, axis.slow.offset_word
        slow = _slow(axis)
    else:
        phase, gain, offset = axis.phase, axis.output.gain_word, axis.output.offset_word
        slow = [0] * len(SLOW_WORDS)
    output = axis.output
    return [
        phase.step & _MASK,  # 2^32 where a period is one advance: the phase never moves
        phase.remainder,
        phase.ticks,
        gain,
        offset & ((1 << OFFSET_LOW_BITS) - 1),
        offset >> OFFSET_LOW_BITS,
        output.code_min,
        output.code_max,
        output.max_step,
        output.park_code,
        harmonics,
        output.shaping.word,
        *slow,
    ]


def _slow(axis: FrameProgram) -> list[int]:
    if (len(axis.ratios.words), axis.ratios.spacing) != (len(axis.gains.words), axis.gains.spacing):
        raise ValueError("the gains and the ratios of a slow part are at different lines; a device has one spacing")
    frame = RationalPhase(axis.lines)
    return [
        len(axis.gains.words) | index_bits_of(len(axis.slow.words)) << SLOW_INDEX_SHIFT,
        axis.gains.spacing,
        frame.step & _MASK,
        frame.remainder,
    ]
