"""The drive of an output beside x and y in its parts: over a line, over the frame, and steps of y."""

from math import ceil

import numpy as np
from msgspec import Struct

from tablegen.base.figures import at_least
from tablegen.base.input_errors import Unphysical
from tablegen.compensation.hold import hold_inverse
from tablegen.compensation.operator.turned_frame import FrameMotion, linear_frame, linear_slow, rounded_series
from tablegen.config.schema import TiltName
from tablegen.device.schedule import Schedule, Window
from tablegen.fixedpoint.frame_program import MOST_KNOTS
from tablegen.numerics.arrays import Floats
from tablegen.numerics.turns import sine_and_cosine
from tablegen.planning.tilt_motion import TiltMotion
from tablegen.waveform.series import FourierSeries

_LEAST_ROOM = 1.0 / 64.0  # of a line on either side of a step
_HARMONICS_OF_STEP = 4.0  # over this room: what is left out is below 1e-5 of a step
_LEFT_OUT_CODES = 0.02  # of a sine's place by harmonics that are not played


class TiltDrive(Struct, frozen=True, eq=False):
    """The parts of the drive, of v_max; ``fast`` leads over the hold of the converter, where it moves in a line.

    ``gains`` and ``ratios`` are at knots that are ``spacing`` lines apart, as of a ``FrameDrive``.
    """

    slow: FourierSeries
    fast: FourierSeries
    second: FourierSeries
    gains: Floats
    ratios: Floats
    spacing: int


def tilt_drive(name: TiltName, motion: FrameMotion, nm_per_drive: float, schedule: Schedule, codes: float) -> TiltDrive:
    """Return the drive of a linear piezo that follows a motion.

    Parameters
    ----------
    name
        The output, for messages.
    nm_per_drive
        Displacement in nm by a drive of v_max, signed.
    codes
        Those of v_max.

    Raises
    ------
    Unphysical
        If nothing is left between the imaged parts of lines, or of sweeps of y, for the steps of y.
    """
    place = motion.place if isinstance(motion, TiltMotion) else None
    if place is None:
        slow, fast = linear_frame(motion, nm_per_drive)
        fast = fast.times(*hold_inverse(fast.harmonics, schedule.ticks, steps=False))
    else:
        share = motion.fast_nm / nm_per_drive
        slow = linear_slow(motion, nm_per_drive, share * (place.a0 - 0.5))
        fast = rounded_series(_shortened(FourierSeries(0.0, share * place.a, share * place.b), abs(codes)))
        fast = fast.times(*hold_inverse(fast.harmonics, schedule.ticks, steps=True))  # each code is the place itself
    nothing, ones, zeros = FourierSeries(0.0, *np.zeros((2, fast.harmonics))), np.ones(2), np.zeros(2)
    if not isinstance(motion, TiltMotion) or not motion.steps or not motion.slow_nm:
        return TiltDrive(slow, fast, nothing, ones, zeros, schedule.lines)
    level = _level(name, motion, motion.slow_nm / nm_per_drive / (motion.slow_turn * schedule.lines))
    if not schedule.down.count:  # the slow part rises by the same step in every imaged line
        return TiltDrive(slow, fast.plus(level), nothing, ones, zeros, schedule.lines)
    steps, spacing = _steps(name, schedule, motion.slow_turn)
    if not motion.fast_nm:
        return TiltDrive(slow, level, nothing, steps, np.zeros(len(steps)), spacing)
    longest = fast.plus(FourierSeries(0.0, *np.zeros((2, level.harmonics))))  # tables of both have one length
    return TiltDrive(slow, longest, level, np.ones(len(steps)), steps, spacing)


def _shortened(series: FourierSeries, codes: float) -> FourierSeries:
    """Return a series without its highest harmonics, where these are less than a share of a code together."""
    sizes = codes * np.hypot(series.a, series.b)
    behind = np.cumsum(sizes[::-1])[::-1]  # of each harmonic and those above it
    harmonics = max(int(np.count_nonzero(behind > _LEFT_OUT_CODES)), 1)
    return FourierSeries(series.a0, series.a[:harmonics].copy(), series.b[:harmonics].copy())


def _level(name: TiltName, motion: TiltMotion, rise: float) -> FourierSeries:
    """Return what makes a level of a slow part that rises by so much in a line: its fall, and a smooth step.

    It falls straight through the imaged part, ``rise (1/2 - t)``. The step is about the start of the line, where y has
    its own, and has the shape of the integral of a cubic B-spline that just fits between the imaged parts of two lines.
    """
    room = motion.step_room
    if room < _LEAST_ROOM:
        raise Unphysical(
            f"{name} takes {at_least(_LEAST_ROOM, 3)} of a line on either side of a step of y, and the imaged parts "
            f"leave {room:.2g}; narrow x.band_limit.window at its lower end, or take y.motion = 'ramp'"
        )
    n = np.arange(1.0, ceil(_HARMONICS_OF_STEP / room) + 1.0)
    width = 0.5 * room  # of each of the four boxes whose convolution is the spline
    sine, _ = sine_and_cosine(0.5 * width * n)
    box = sine / (np.pi * width * n)
    return rounded_series(FourierSeries(0.0, np.zeros(len(n)), rise * (box * box) * (box * box) / (np.pi * n)))


def _steps(name: TiltName, schedule: Schedule, turn: float) -> tuple[Floats, int]:
    """Return the step of each line as a multiple of that of a line upward, at knots, and the lines between them."""
    spacing = -(-schedule.lines // (MOST_KNOTS - 1))
    values: list[float] = []
    for knot in range(-(-schedule.lines // spacing) + 1):
        up, down = (_touches(window, knot * spacing, spacing) for window in (schedule.up, schedule.down))
        if up and down:
            raise Unphysical(
                f"{name} turns its steps round in {2 * spacing - 2} lines of a frame of {schedule.lines}, and y has "
                f"{schedule.down.first - schedule.up.stop} between its images up and down; narrow "
                "y.band_limit.window, or take y.band_limit.directions = 'forward'"
            )
        values.append(1.0 if up else -turn / (1.0 - turn) if down else np.nan)
    at, known = np.arange(len(values)), np.isfinite(values)
    return np.interp(at, at[known], np.array(values)[known]), spacing


def _touches(window: Window, knot: int, spacing: int) -> bool:
    """Return True if a knot decides the word of a line of a window."""
    return window.first < knot + spacing and knot - spacing < window.stop - 1
