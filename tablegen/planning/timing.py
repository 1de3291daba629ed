"""A scan laid out in ticks: the line from the requested rate, its imaging windows, its pixels.

All of it is decided in exact fractions: a window edge at 0.1 of the line is 1/10, not the float beside it.
"""

from fractions import Fraction
from math import ceil, floor, gcd

from msgspec import Struct

from tablegen.base.figures import at_least, at_most
from tablegen.base.input_errors import Problems
from tablegen.config.frame import exact, lines_inside
from tablegen.config.load import Setup
from tablegen.config.schema import FastAxis, SlowAxis, Timing
from tablegen.device.schedule import MAXIMUM_LINE_TICKS, Schedule, Window
from tablegen.fixedpoint.phase import MAXIMUM_TICKS
from tablegen.planning.windows import line_windows


def make_schedule(setup: Setup, problems: Problems) -> Schedule | None:
    """Lay a scan out in ticks; None where ``problems`` grew."""
    scan = setup.scan
    timing = scan.timing
    before = len(problems.entries)
    rate = exact(setup.hardware("x").dac.update_rate_hz)
    ticks = _line_ticks(setup, rate, problems)
    if len(problems.entries) > before:
        return None
    low, high = (exact(edge) for edge in scan.x.band_limit.window)
    both = scan.x.band_limit.directions == "both"
    forward, backward = line_windows(exact(scan.x.turn), low, high, both, ticks, timing.pixels)
    limit = scan.y.band_limit
    inside = lines_inside(scan.y.turn, limit.window, limit.directions == "both", timing.lines)
    up, down = (Window(*lines) for lines in inside)
    _check_pixels(setup, rate, ticks, forward, backward, problems)
    _check_lines(setup, up, down, problems)
    if len(problems.entries) > before:
        return None
    return Schedule(
        ticks=ticks,
        lines=timing.lines,
        update_rate_hz=rate,
        requested_hz=timing.line_rate_hz,
        pixels=timing.pixels,
        settle_lines=0 if timing.settle_lines == "auto" else timing.settle_lines,  # until the axes are known
        turn_tick=ceil(exact(scan.x.turn) * ticks),
        forward=forward,
        backward=backward,
        turn_line=ceil(exact(scan.y.turn) * timing.lines),
        up=up,
        down=down,
    )


def _line_ticks(setup: Setup, rate: Fraction, problems: Problems) -> int:
    """Return the ticks of a line: as given, or so that pixels are whole ticks, or the nearest to the line rate."""
    timing, file = setup.scan.timing, setup.scan_file
    share = _width(setup.scan.x) * exact(setup.scan.x.turn)
    key = "timing.line_rate_hz"
    if timing.ticks_per_line is not None:
        ticks, key = timing.ticks_per_line, "timing.ticks_per_line"
    elif timing.ticks_per_pixel is not None:
        key = "timing.ticks_per_pixel"
        ideal = timing.pixels * timing.ticks_per_pixel / share
        ticks = round(ideal)
        if ideal.denominator != 1 and ticks <= MAXIMUM_LINE_TICKS:
            # Whole are the multiples of the numerator of the share, less what the ticks of a pixel have of it.
            step = share.numerator // gcd(share.numerator, timing.ticks_per_pixel)
            pixels = step * max(1, round(Fraction(timing.pixels, step)))
            fits = f"{pixels} pixels make it so, or change" if pixels <= 65536 else "change"
            problems.add(
                file,
                key,
                f"{timing.pixels} pixels of {timing.ticks_per_pixel} ticks in {float(share):g} of the line make "
                f"{float(ideal):.7g} ticks a line, which is not whole; {fits} x.turn or the window",
            )
    else:
        ticks = floor(rate / exact(timing.line_rate_hz) + Fraction(1, 2))
    if not 8 <= ticks <= MAXIMUM_LINE_TICKS:
        count = str(ticks) if ticks < 1 << 64 else "more than 2^64"
        if key == "timing.line_rate_hz":
            low, high = at_least(float(rate / MAXIMUM_LINE_TICKS), 6), at_most(float(rate / 8), 6)
            fits = f"at {float(rate):g} updates a second the line rate can be {low} to {high} Hz"
        else:
            most = floor(MAXIMUM_LINE_TICKS * share / timing.pixels)
            fits = "take more of them" if ticks < 8 else f"at most {most} fit" if most else "take fewer pixels"
        problems.add(file, key, f"a line of {count} ticks is outside 8..{MAXIMUM_LINE_TICKS}; {fits}")
    elif ticks * timing.lines > MAXIMUM_TICKS:
        what = "lines" if file.written_key("timing.lines")[0] == "timing.lines" else "line periods"
        problems.add(
            file,
            "timing.lines",
            f"{timing.lines} {what} of {ticks} ticks are {ticks * timing.lines} ticks a frame, above {MAXIMUM_TICKS}; "
            f"at most {MAXIMUM_TICKS // ticks} {what} fit",
        )
    return ticks


def _check_pixels(
    setup: Setup, rate: Fraction, ticks: int, forward: Window, backward: Window, problems: Problems
) -> None:
    """Check that a pixel takes at least a tick, in every direction that images."""
    timing, x = setup.scan.timing, setup.scan.x
    sides = [("forward", forward, exact(x.turn), "a larger x.turn")]
    if x.band_limit.directions == "both":
        sides.append(("backward", backward, 1 - exact(x.turn), "directions = 'forward'"))
    for side, window, share, other in sides:
        if window.count < timing.pixels:
            needed = ceil(timing.pixels / (_width(x) * share))  # a window of so many ticks has a tick a pixel
            problems.add(
                setup.scan_file,
                "timing.pixels",
                f"{timing.pixels} pixels do not fit the {window.count} ticks of the {side} imaging window; "
                f"{_longer_line(timing, rate, ticks, needed)}, or "
                + (f"at most {window.count} pixels" if window.count else other),
            )


def _check_lines(setup: Setup, up: Window, down: Window, problems: Problems) -> None:
    """Check that at least one line of a frame lies inside the window, in every direction that images."""
    lines, both = setup.scan.timing.lines, setup.scan.y.band_limit.directions == "both"
    if up.count < 1:
        problems.add(
            setup.scan_file,
            "y.band_limit.window",
            f"not one of the {lines} lines lies inside it; widen it or take more timing.lines",
        )
    elif both and down.count < 1:
        problems.add(
            setup.scan_file,
            "y.band_limit.directions",
            f"not one of the {lines} lines lies inside the backward window; "
            f"take more timing.lines, a lower y.turn or 'forward'",
        )


def _longer_line(timing: Timing, rate: Fraction, ticks: int, needed: int) -> str:
    """Return how to ask for a line of at least ``needed`` ticks in place of ``ticks``."""
    if needed > MAXIMUM_LINE_TICKS:
        return "no line is long enough for so many"
    if timing.ticks_per_line is not None:
        return f"take at least {needed} ticks_per_line"
    if timing.ticks_per_pixel is not None:
        return f"take at least {ceil(Fraction(timing.ticks_per_pixel * needed, ticks))} ticks_per_pixel"
    return f"take a line rate of at most {at_most(float(rate / needed), 6)} Hz"


def _width(axis: FastAxis) -> Fraction:
    low, high = axis.band_limit.window
    return exact(high) - exact(low)


class AxisTiming(Struct, frozen=True):
    """The clock of one axis: its requested and its actual rate in Hz, and how its waveform is advanced.

    A period of the waveform has ``period`` advances of ``hold`` ticks each: 1, or a line for a slow axis in steps.
    """

    rate: Fraction
    requested_hz: float
    period: int
    hold: int

    @classmethod
    def of(cls, setup: Setup, axis: str, schedule: Schedule) -> "AxisTiming":
        """Return the clock of "x", a period a line, or "y", a period a frame."""
        scan: FastAxis = getattr(setup.scan, axis)
        hold = schedule.ticks if isinstance(scan, SlowAxis) and scan.motion == "step" else 1
        if axis == "x":
            return cls(schedule.line_rate, schedule.requested_hz, schedule.ticks // hold, hold)
        return cls(schedule.frame_rate, schedule.requested_hz / schedule.lines, schedule.frame_ticks // hold, hold)
