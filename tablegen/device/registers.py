"""The program as a host writes it into a device: pages of 16 words of 32 bits for the scan, for x and for y.

The Verilog registers (``firmware_templates/verilog/``) are at these addresses; ``docs/verilog.md`` has the map.
"""

from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.output import Output
from tablegen.fixedpoint.program import Program

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
# The offset has up to 44 bits: the low part has those that a serial gain multiplier produces first.
OFFSET_LOW_BITS = 18
_MASK = (1 << 32) - 1


def program_words(schedule: Schedule, x: Program, y: Program, harmonics: tuple[int, int] = (0, 0)) -> list[int]:
    """Return all words of a program in order of address, unsigned; unused ones 0. Shape (3 * 16,).

    Parameters
    ----------
    harmonics
        Those of x and y where the device renders the table from Fourier words, 0 where it is uploaded.

    Raises
    ------
    ValueError
        If the schedule has a table of pixels.
    """
    if schedule.pixel_table is not None:
        raise ValueError("a program with a table of pixels plays in C alone, neither over the link nor in Verilog")
    pages = [
        _scan(schedule, steps=y.hold != 1),
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
    ]


def _axis(program: Program, harmonics: int) -> list[int]:
    phase, output = program.phase, program.output
    return [
        phase.step & _MASK,  # 2^32 where a period is one advance: the phase never moves
        phase.remainder,
        phase.ticks,
        output.gain_word,
        *_offset(output),
        output.code_min,
        output.code_max,
        output.max_step,
        output.park_code,
        harmonics,
        output.shaping.word,
    ]


def _offset(output: Output) -> list[int]:
    return [output.offset_word & ((1 << OFFSET_LOW_BITS) - 1), output.offset_word >> OFFSET_LOW_BITS]
