"""The checks of a device before it takes a program: the specification behind docs/protocol.md.

Devices do the same in C; the host calls it before an upload, to state what would be refused.
"""

from dataclasses import dataclass

import numpy as np

from tablegen.device.dual_program import AxisProgram
from tablegen.device.schedule import MAXIMUM_LINE_TICKS, has_ticks_for_pixels
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.output import GAIN_BITS
from tablegen.fixedpoint.phase import MAXIMUM_TICKS, PHASE_BITS
from tablegen.fixedpoint.rounding import signed_limits
from tablegen.fixedpoint.spline import SPLINE_UNIT
from tablegen.fixedpoint.synthesis import FRACTION_BITS
from tablegen.link.messages import AxisLimits, Reason
from tablegen.link.program_image import Contents
from tablegen.numerics.arrays import Bools, Ints

_CLAMP_ALLOWANCE_CODES = (
    1  # codes: ticks need not visit a word, and rounding may carry it over a limit that no tick crosses
)
_MAXIMUM_STEP = (1 << 24) - 1
_FIRST = np.zeros(1, dtype=np.int64)  # the first advance of a period


@dataclass(frozen=True, eq=False)
class Playing:
    """The state of a device while a program is checked: the programs of x and y, and whether a scan runs."""

    x: AxisProgram
    y: AxisProgram
    running: bool


Finding = tuple[Reason, int]  # a reason and its detail


def first_objection(
    contents: Contents, x: AxisLimits, y: AxisLimits, playing: Playing | None, order: int = 0
) -> Finding | None:
    """Return the first check that a program fails, in the order of the protocol; None where it passes all of them.

    ``x`` and ``y`` are the limits of the device, ``playing`` what it plays now (None: nothing yet), ``order`` the
    highest order of shaping that it has.
    """
    if not _schedule_is_good(contents):
        return Reason.SCHEDULE, 0
    for checked in (_period, _output):
        for page in (1, 2):
            if failure := checked(contents, page):
                return failure
    for page in (1, 2):
        if not _shaping_is_good(contents, page, order):
            return Reason.SHAPING, page - 1
    for page, limits in ((1, x), (2, y)):
        if contents.axis(page, "code_min") < limits.code_min or contents.axis(page, "code_max") > limits.code_max:
            return Reason.CODES, page - 1
    for page, limits in ((1, x), (2, y)):
        if contents.axis(page, "max_step") > limits.max_step:
            return Reason.STEP, page - 1
    for check in (_fourier, _word, _slow_word, _pixel_ticks, _range, _slew):
        for page in (1, 2):
            if failure := check(contents, page):
                return failure
    return _jump(contents, x, y, playing)


def _schedule_is_good(contents: Contents) -> bool:
    ticks, lines = contents.scan("line_ticks"), contents.scan("frame_lines")
    if not 1 <= ticks <= MAXIMUM_LINE_TICKS or not 1 <= lines <= MAXIMUM_TICKS // ticks:
        return False
    windows = (("forward", ticks), ("backward", ticks), ("up", lines), ("down", lines))
    return (
        all(contents.scan(f"{name}_first") + contents.scan(f"{name}_count") <= length for name, length in windows)
        and contents.scan("turn_tick") <= ticks
        and has_ticks_for_pixels(*(contents.scan(name) for name in ("pixels", "forward_count", "backward_count")))
        and contents.scan("y_steps") <= 1
    )


def _period(contents: Contents, page: int) -> Finding | None:
    ticks, lines = contents.scan("line_ticks"), contents.scan("frame_lines")
    of_y = lines if contents.scan("y_steps") else ticks * lines
    expected = ticks if page == 1 or contents.slow(page) else of_y
    period = contents.axis(page, "phase_period")
    step = (1 << PHASE_BITS) // expected & ((1 << PHASE_BITS) - 1)
    good = (
        period == expected
        and contents.axis(page, "phase_step") == step
        and contents.axis(page, "phase_remainder") == (1 << PHASE_BITS) % expected
    )
    return None if good and _frame_is_good(contents, page) else (Reason.PERIOD, page - 1)


def _frame_is_good(contents: Contents, page: int) -> bool:
    """Return True if the slow part of an axis, if there is one, has the lines of the frame."""
    slow, lines = contents.slow(page), contents.scan("frame_lines")
    if slow is None:
        return True
    steps = page == 2 and contents.scan("y_steps")
    return (
        not steps
        and (len(slow.gains) - 1) * contents.axis(page, "knot_spacing") >= lines
        and contents.axis(page, "slow_step") == (1 << PHASE_BITS) // lines & ((1 << PHASE_BITS) - 1)
        and contents.axis(page, "slow_remainder") == (1 << PHASE_BITS) % lines
    )


def _output(contents: Contents, page: int) -> Finding | None:
    shape = contents.shape(page)
    low, high = signed_limits(GAIN_BITS)
    output = contents.output(page)
    reach = _reach(contents, page)
    good = (
        low <= output.gain_word <= high
        and -reach < output.offset_word < reach
        and contents.axis(page, "offset_low") < 1 << 18
        and output.code_min <= output.park_code <= output.code_max < 1 << shape.dac_bits
        and 1 <= output.max_step <= _MAXIMUM_STEP
    )
    return None if good else (Reason.OUTPUT, page - 1)


def _reach(contents: Contents, page: int) -> int:
    """Return twice the range of a code, in the units of an offset word, so that every right offset is below it."""
    output = contents.output(page)
    return 2 << (output.dac_bits + output.gain_q)


def _shaping_is_good(contents: Contents, page: int, order: int) -> bool:
    try:
        return contents.shaping(page).order <= order
    except ValueError:
        return False


def _fourier(contents: Contents, page: int) -> Finding | None:
    words = contents.table(page)
    too_much = contents.axis(page, "harmonics") and int(np.sum(np.abs(words))) >= 4 << FRACTION_BITS
    return (Reason.FOURIER, page - 1) if too_much else None


def _word(contents: Contents, page: int) -> Finding | None:
    wrong = _unfit(contents.table(page), contents.shape(page).word_bits)
    return None if contents.axis(page, "harmonics") else _first(wrong, Reason.WORD, page)


def _slow_word(contents: Contents, page: int) -> Finding | None:
    """Check the words of a slow part that may have more bits than they are sent in: slow table and gains."""
    slow, output, reach = contents.slow(page), contents.output(page), _reach(contents, page)
    if slow is None:
        return None
    offsets = output.gain_word * SPLINE_UNIT * slow.table + output.offset_word
    table = _unfit(slow.table, contents.shape(page).word_bits) | (np.abs(offsets) >= reach)
    before = np.zeros(len(contents.table(page)) + len(slow.second), dtype=np.bool_)
    return _first(np.concatenate([before, table, _unfit(slow.gains, GAIN_BITS)]), Reason.WORD, page)


def _pixel_ticks(contents: Contents, page: int) -> Finding | None:
    """Check the table of pixels of the trace (page 1) or the retrace (2): each has a tick, and they fill the window."""
    if contents.pixel_ticks is None:
        return None
    ticks, count = contents.pixel_ticks[page - 1], contents.scan("forward_count" if page == 1 else "backward_count")
    ends = np.cumsum(ticks)
    return _first(np.append((ticks == 0) | (ends > count), ends[-1] != count), Reason.PIXEL_TICKS, page)


def _unfit(words: Ints, bits: int) -> Bools:
    low, high = signed_limits(bits)
    return (words < low) | (words > high)


def _range(contents: Contents, page: int) -> Finding | None:
    program = contents.program(page)
    if isinstance(program, FrameProgram):
        return _lines_out_of_range(program, page)
    output = program.output
    codes = output.unclamped(program.resting(program.words))
    outside = _CLAMP_ALLOWANCE_CODES + int(output.shaping.excess)
    return _first((codes < output.code_min - outside) | (codes > output.code_max + outside), Reason.RANGE, page)


def _slew(contents: Contents, page: int) -> Finding | None:
    program = contents.program(page)
    if isinstance(program, FrameProgram):
        return _steep_lines(program, page)
    output = program.output
    advances, length = program.phase.ticks, len(program.words)
    max_step = output.max_step - output.shaping.step_excess
    if advances <= 2 * length:
        codes = output.code(program.samples(np.arange(advances, dtype=np.int64) * program.hold))
        return _first(np.abs(np.roll(codes, -1) - codes) > max_step, Reason.SLEW, page)
    rise = program.resting(np.abs(np.roll(program.words, -1) - program.words))
    steepest = int(np.argmax(rise))
    most, gain = int(rise[steepest]), abs(output.gain_word)
    slack = 2 + ((gain * (2 + (most >> 14))) >> output.gain_q)
    if (gain * most * length) >> output.gain_q <= advances * (max_step + slack):
        return None
    return Reason.SLEW, page - 1 + 2 * steepest


def _lines_out_of_range(program: FrameProgram, page: int) -> Finding | None:
    output = program.output
    least, most, _ = program.bounds
    if output.code_min <= least and most <= output.code_max:
        return None
    for line in range(program.lines):
        codes = program.unclamped(line)
        if int(np.min(codes)) < output.code_min or int(np.max(codes)) > output.code_max:
            return Reason.RANGE, page - 1 + 2 * line
    return None


def _steep_lines(program: FrameProgram, page: int) -> Finding | None:
    output = program.output
    max_step = output.max_step - output.shaping.step_excess
    if program.bounds[2] <= max_step:  # a clamp makes no step longer
        return None
    first = codes = output.clamp(program.unclamped(0)[0])
    for line in range(program.lines):
        after = output.clamp(program.unclamped(line + 1)[0]) if line + 1 < program.lines else first
        if int(np.max(np.abs(np.diff(codes, append=after[0])))) > max_step:
            return Reason.SLEW, page - 1 + 2 * line
        codes = after
    return None


def _jump(contents: Contents, x: AxisLimits, y: AxisLimits, playing: Playing | None) -> Finding | None:
    if playing is None:
        return None
    for page, limits, old in ((1, x, playing.x), (2, y, playing.y)):
        new = contents.program(page)
        if playing.running:
            jump = int(np.max(np.abs(_line_starts(old, page) - _first_code(new))))
        else:
            jump = abs(new.output.park_code - old.output.park_code)
        if jump > limits.max_jump:
            return Reason.JUMP, page - 1
    return None


def _line_starts(axis: AxisProgram, page: int) -> Ints:
    """Return the codes from which a program may be replaced, or codes that bound them."""
    if isinstance(axis, FrameProgram):
        return axis.output.clamp(axis.starts)
    # A spline stays between its words, as lines do.
    return axis.output.code(axis.resting(axis.words) if page == 2 else axis.samples(_FIRST))


def _first_code(axis: AxisProgram) -> int:
    """Return the code of the first tick."""
    if isinstance(axis, FrameProgram):
        return int(axis.output.clamp(axis.at(0, _FIRST))[0])
    return int(axis.output.code(axis.samples(_FIRST))[0])


def _first(wrong: Bools, reason: Reason, page: int) -> Finding | None:
    if not wrong.any():
        return None
    return reason, page - 1 + 2 * int(np.argmax(wrong))
