"""The imaging windows of a line in ticks, so placed that a pixel of the trace and of the retrace mean the same place.

Tick k lasts from k to k + 1, and a pixel from its marker to the next: its place is that of the middle of its ticks.
"""

from fractions import Fraction
from math import ceil, floor, gcd, lcm

import numpy as np

from tablegen.device.schedule import Schedule, Window, pixel_starts
from tablegen.numerics.arrays import Floats

_HALF = Fraction(1, 2)
_ROUNDING = 1e-12  # share of the line by which equal places may differ in their last bits


def line_windows(
    turn: Fraction, low: Fraction, high: Fraction, both: bool, ticks: int, pixels: int
) -> tuple[Window, Window]:
    """Return trace and retrace of the part ``low``..``high`` of a line that turns at ``turn``; the second may be empty.

    Each has the nearest whole number of ticks. The trace is put within a tick of its ideal place, and the
    retrace where its pixels are at those of the trace, on average over the line, or as near to it as the trace and the
    end of the line allow; of all such, the nearest pair.
    """
    middle = (low + high) / 2
    counts = [_nearest(share * (high - low) * ticks) for share in (turn, 1 - turn)]
    if not both:
        counts[1] = 0
    centres = [_centre(count, pixels) for count in counts]
    ideal_first = turn * middle * ticks - centres[0]
    last = ticks - counts[0] - counts[1]
    if not both:
        return Window(min(max(_nearest(ideal_first), 0), last), counts[0]), Window(0, 0)
    pairs = []
    for first in range(max(floor(ideal_first) - 1, 0), min(ceil(ideal_first) + 1, last) + 1):
        place = (first + centres[0]) / turn  # of the trace's pixels, in ticks of a line that were all forward
        ideal_back = ticks - place * (1 - turn) - centres[1]
        back = min(max(floor(ideal_back + _HALF), first + counts[0]), ticks - counts[1])
        if abs(first - ideal_first) <= 1:
            pairs.append((abs(back - ideal_back), abs(first - ideal_first), first, back))
    _, _, first, back = min(pairs, default=(0, 0, min(max(_nearest(ideal_first), 0), last), ticks - counts[1]))
    return Window(first, counts[0]), Window(back, counts[1])


def pixel_places(schedule: Schedule, turn: float) -> tuple[Floats, Floats]:
    """Return where the pixels of trace and retrace are on the line.

    Returns
    -------
    forward, backward
        Places in 0..1, ascending, shape (pixels,); ``backward`` is empty without a retrace.
    """
    forward = _middles(schedule.forward, schedule.pixels) / (turn * schedule.ticks)
    backward = (schedule.ticks - _middles(schedule.backward, schedule.pixels)) / ((1.0 - turn) * schedule.ticks)
    return forward, backward[::-1]


def retrace_mismatch(schedule: Schedule, turn: float) -> float:
    """Return the largest distance between a pixel's places in trace and retrace, as a share of the line."""
    forward, backward = pixel_places(schedule, turn)
    worst = float(np.max(np.abs(forward - backward))) if len(backward) == len(forward) else 0.0
    return worst if worst > _ROUNDING else 0.0


def matching_lines(turn: Fraction, low: Fraction, high: Fraction, ticks: int, pixels: int, most: int) -> list[int]:
    """Return the ticks of the nearest lines, up to ``most``, whose pixels match and are whole ticks."""
    shares = [share * (high - low) / pixels for share in (turn, 1 - turn)]
    edges = [] if turn == _HALF else [share * low for share in (turn, 1 - turn)]
    step = lcm(*(share.denominator for share in shares + edges))
    around = (ticks // step * step, -(-ticks // step) * step)
    return [near for near in dict.fromkeys(around) if 8 <= near <= most]


def _nearest(value: Fraction) -> int:
    """Return the nearest whole number, ties down: two halves of a line then never overlap."""
    return ceil(value - _HALF)


def _centre(count: int, pixels: int) -> Fraction:
    """Return the ticks from the beginning of a window to the mean of its pixels' middles.

    Pixel p begins at the tick ceil(p count / pixels): the mean of these is late by what the rounding takes.
    """
    return Fraction(count, 2) + _HALF * (1 - Fraction(gcd(count, pixels), pixels))


def _middles(window: Window, pixels: int) -> Floats:
    """Return the middle of each pixel's ticks; empty where the window has fewer ticks than pixels."""
    if window.count < pixels:
        return np.zeros(0)
    edges = np.append(pixel_starts(window, pixels), window.stop)
    middles: Floats = 0.5 * (edges[:-1] + edges[1:])
    return middles
