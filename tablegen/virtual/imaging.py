"""Simulated images of the virtual scanner: trace and retrace of a grating or a lattice.

``image_pair`` scans x with a triangle; the slow axis is ideal: a ramp through the frame, which is as high as the line
is long. ``running_frame`` plays the emitted integers of a build on both axes, ``triangle_frame`` triangles on both, as
an uncorrected microscope does; both return the heights and the position of each pixel. Noise depends on the seed alone.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tablegen.compensation.identification import SettledAxis
from tablegen.config.scanner import Coupling
from tablegen.device.schedule import Schedule
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan, Plan
from tablegen.planning.turned_plan import TurnedPlan
from tablegen.virtual.line_error import ideal_triangle
from tablegen.virtual.played import played
from tablegen.virtual.scanner import NO_COUPLING
from tablegen.virtual.turned_run import emitted_volts

_TICKS = 16384  # ticks per line
_STEEPNESS = 2.5  # steepness of the flanks of a bar, rounded as by a tip
_DUTY = 0.3
_ROUGH_WAVES = 40
_FRAME_TICKS = 1 << 16  # ticks of a frame at which the slow axis is evaluated

Position = Callable[[Floats], Floats]  # where an axis is, in nm, at times in its periods
# Where both axes are: at the phases of the columns in a line, (pixels,), and of the pixels in a frame, (lines, pixels),
# without and with the delay of the image.
Move = Callable[[Floats, Floats, Floats], tuple[Floats, Floats]]
Surface = Callable[[Floats, Floats], Floats]  # height at x and y in nm


def grating(pitch_nm: float, angle_deg: float = 3.0) -> Surface:
    """Return bars with round shoulders, wider than their gaps, whose normal is turned from x by an angle."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))

    def height(x: Floats, y: Floats) -> Floats:
        wave = np.sin(2.0 * np.pi * (x * c + y * s) / pitch_nm)
        heights: Floats = np.tanh(_STEEPNESS * (wave + _DUTY))
        return heights

    return height


def hexagonal(constant_nm: float, angle_deg: float = 7.0) -> Surface:
    """Return a hexagonal lattice, its three waves of different heights as of molecules without symmetry."""
    pitch = constant_nm * np.sqrt(3.0) / 2.0

    def height(x: Floats, y: Floats) -> Floats:
        total = np.zeros(np.broadcast(x, y).shape)
        for turned, size in ((0.0, 1.0), (60.0, 0.9), (120.0, 0.8)):
            a = np.radians(angle_deg + turned)
            total = total + size * np.cos(2.0 * np.pi * (x * np.cos(a) + y * np.sin(a)) / pitch + turned)
        return total

    return height


def rough(grain_nm: float, seed: int = 0) -> Surface:
    """Return a surface without a period: random waves, none shorter than ``grain_nm``."""
    random = np.random.default_rng(seed)
    length = grain_nm * 8.0 ** random.random(_ROUGH_WAVES)
    angle, phase = 2.0 * np.pi * random.random((2, _ROUGH_WAVES))

    def height(x: Floats, y: Floats) -> Floats:
        total = np.zeros(np.broadcast(x, y).shape)
        for one, a, p in zip(length, angle, phase, strict=True):
            total = total + np.sqrt(one) * np.cos(2.0 * np.pi * (x * np.cos(a) + y * np.sin(a)) / one + p)
        return total

    return height


def image_pair(
    axis: SettledAxis,
    surface: Surface,
    size_v: float,
    offset_v: float,
    rate_hz: float,
    pixels: int = 256,
    lines: int = 256,
    turn: float = 0.5,
    window: tuple[float, float] = (0.0, 1.0),
    noise: float = 0.05,
    drift: float = 0.0,
    seed: int = 0,
) -> tuple[Floats, Floats]:
    """Simulate trace and retrace of a settled triangle on x.

    Pixels are evenly spread in time over ``window`` of each sweep.

    Parameters
    ----------
    size_v, offset_v
        Peak-to-peak voltage and offset in V.
    noise
        Rms noise, of the heights' peak to peak.
    drift
        Movement of the sample along x over the frame, in lines; it accelerates.

    Returns
    -------
    Heights, shape (lines, pixels) each, the left end of the line first in both.

    Raises
    ------
    ValueError
        If the triangle leaves the driver's range.
    """
    volts = offset_v + size_v * (ideal_triangle(_TICKS, turn) - 0.5)
    displacement_nm = axis.settled(volts, 1.0 / (rate_hz * _TICKS))
    size = float(np.max(displacement_nm) - np.min(displacement_nm))
    place = window[0] + (window[1] - window[0]) * (np.arange(pixels) + 0.5) / pixels
    random = np.random.default_rng(seed)
    images = []
    for time in (turn * place, turn + (1.0 - turn) * (1.0 - place)):
        x = np.interp(time, np.arange(_TICKS) / _TICKS, displacement_nm, period=1.0)
        frame = (np.arange(lines)[:, None] + time) / lines
        heights = surface(x + drift * size * frame**2, size * frame)
        images.append(heights + noise * float(np.ptp(heights)) * random.standard_normal(heights.shape))
    return images[0], images[1]


@dataclass(frozen=True, eq=False)
class SweepImage:
    """One direction of a frame, each array (lines, pixels), the left end first, lines in the order of time.

    ``x_nm`` and ``y_nm`` are the positions of the scanner in the middle of each pixel; ``drift_nm`` is the movement of
    the sample the other way, along x and y: the heights are ``surface(x_nm + drift_nm[0], y_nm + drift_nm[1])``.
    """

    heights: Floats
    x_nm: Floats
    y_nm: Floats
    drift_nm: tuple[Floats, Floats]


@dataclass(frozen=True, eq=False)
class FrameImages:
    """The trace and the retrace of a frame."""

    trace: SweepImage
    retrace: SweepImage


@dataclass(frozen=True)
class Conditions:
    """Disturbances of a frame.

    ``noise`` is rms, of the heights' peak to peak. ``drift`` along x and y is a share of the imaged size, over the
    frame; it accelerates. ``tilt`` along x and y is the rise of a plane over the frame, of the heights' peak to peak.
    Columns show the sample ``late`` pixels late, as with a slow feedback. ``frame`` counts frames, from 0: drift
    continues from one to the next.
    """

    noise: float = 0.05
    drift: tuple[float, float] = (0.0, 0.0)
    tilt: tuple[float, float] = (0.0, 0.0)
    late: float = 0.0
    frame: int = 0
    seed: int = 0


def running_frame(
    plan: Plan,
    x: SettledAxis,
    y: SettledAxis,
    surface: Surface,
    conditions: Conditions | None = None,
    pixels: int | None = None,
    down: bool = False,
    coupling: Coupling = NO_COUPLING,
) -> FrameImages:
    """Simulate a settled frame of the emitted integers of a build.

    Columns are ``pixels`` (those of the scan file, if not given), evenly in time within x's imaging window of each
    sweep; of a sine they are its own. Lines are those of the frame that lie in y's imaging window on its way up, or on
    its way ``down``.

    Raises
    ------
    ValueError
        If y images no line on that way, the scan leaves the range of the virtual scanner, or a sine has other pixels.
    """
    schedule = plan.schedule
    if schedule.pixel_table is None:
        columns = _columns(plan.x.drive.turn, plan.x.band_limit.window, pixels or schedule.pixels)
    elif pixels in (None, schedule.pixels):
        columns = _pixel_columns(schedule)
    else:
        raise ValueError(f"the table of a sine has {schedule.pixels} pixels, not {pixels}")
    part = schedule.down if down else schedule.up
    if part.count == 0:
        raise ValueError(f"y images nothing on its way {'down' if down else 'up'}")
    return _frame(
        _apart(_playing(plan.x, x), _playing(plan.y, y)),
        coupling,
        surface,
        conditions or Conditions(),
        columns=columns,
        numbers=part.first + np.arange(part.count),
        lines=schedule.lines,
    )


def turned_frame(
    plan: TurnedPlan,
    x: SettledAxis,
    y: SettledAxis,
    surface: Surface,
    conditions: Conditions | None = None,
    pixels: int | None = None,
    down: bool = False,
    coupling: Coupling = NO_COUPLING,
) -> FrameImages:
    """Simulate a settled frame of the emitted integers of a scan at an angle, as ``running_frame``.

    ``surface`` is in the directions of the axes: the image shows it turned back by the scan angle.

    Raises
    ------
    ValueError
        As ``running_frame``.
    """
    schedule, motion = plan.schedule, plan.x.motion
    part = schedule.down if down else schedule.up
    if part.count == 0:
        raise ValueError(f"the frame images nothing on its way {'down' if down else 'up'}")
    volts = emitted_volts(plan)
    tick_s = 1.0 / (motion.line_rate_hz * len(volts.t))
    along_x, along_y = (_periodic(axis.settled(its.ravel(), tick_s), 0.5) for axis, its in ((x, volts.x), (y, volts.y)))

    def move(_: Floats, __: Floats, frame: Floats) -> tuple[Floats, Floats]:
        return along_x(frame % 1.0), along_y(frame % 1.0)

    return _frame(
        move,
        coupling,
        surface,
        conditions or Conditions(),
        columns=_columns(motion.fast_turn, motion.fast_window, pixels or schedule.pixels),
        numbers=part.first + np.arange(part.count),
        lines=schedule.lines,
    )


def triangle_frame(
    x: SettledAxis,
    y: SettledAxis,
    surface: Surface,
    size_v: tuple[float, float],
    offset_v: tuple[float, float],
    rate_hz: float,
    conditions: Conditions | None = None,
    pixels: int = 256,
    lines: int = 256,
    turn: tuple[float, float] = (0.5, 0.5),
    window: tuple[float, float] = (0.0, 1.0),
    coupling: Coupling = NO_COUPLING,
) -> FrameImages:
    """Simulate a settled frame of an uncompensated triangle on each axis, x then y: ``lines`` on y's way up.

    Columns are ``pixels``, evenly in time within ``window`` of each sweep of x. A frame takes lines / turn[1] lines.

    Parameters
    ----------
    size_v, offset_v
        Peak-to-peak voltages and offsets in V, x then y.
    turn
        Share of the period in which each axis rises.

    Raises
    ------
    ValueError
        If a triangle leaves the range of the virtual scanner.
    """
    whole = round(lines / turn[1])
    moves = []
    for axis, size, offset, bend, hz in zip((x, y), size_v, offset_v, turn, (rate_hz, rate_hz / whole), strict=True):
        volts = offset + size * (ideal_triangle(_TICKS, bend) - 0.5)
        moves.append(_periodic(axis.settled(volts, 1.0 / (hz * _TICKS)), 0.0))
    return _frame(
        _apart(*moves),
        coupling,
        surface,
        conditions or Conditions(),
        columns=_columns(turn[0], window, pixels),
        numbers=np.arange(lines),
        lines=whole,
    )


@dataclass(frozen=True, eq=False)
class _Columns:
    """Times of the columns of a direction in periods of x, the left end first, and the duration of a column."""

    times: Floats
    lasts: Floats | float


def _columns(turn: float, window: tuple[float, float], pixels: int) -> tuple[_Columns, _Columns]:
    """Return the columns of the trace and of the retrace."""
    width = window[1] - window[0]
    place = window[0] + width * (np.arange(pixels) + 0.5) / pixels
    back = 1.0 - turn
    return _Columns(turn * place, turn * width / pixels), _Columns(turn + back * (1.0 - place), back * width / pixels)


def _pixel_columns(schedule: Schedule) -> tuple[_Columns, _Columns]:
    """Return the pixels of a schedule as columns of the trace and of the retrace."""
    sides = []
    for ticks in schedule.pixel_edges:
        edges = ticks / schedule.ticks
        sides.append(_Columns(0.5 * (edges[:-1] + edges[1:]), np.diff(edges)))
    return sides[0], _Columns(sides[1].times[::-1], np.asarray(sides[1].lasts)[::-1])


def _playing(line: LinePlan, axis: SettledAxis) -> Position:
    drive = played(line, _FRAME_TICKS)
    return _periodic(axis.settled(drive.volts, drive.tick_s), 0.5)


def _periodic(displacement_nm: Floats, middle: float) -> Position:
    """Interpolate values that lie ``middle`` of a tick after the beginning of each tick."""
    turns = (np.arange(len(displacement_nm)) + middle) / len(displacement_nm)

    def position(time: Floats) -> Floats:
        return np.interp(time, turns, displacement_nm, period=1.0)

    return position


def _apart(x: Position, y: Position) -> Move:
    """Return the motion of axes of which x has the period of a line and y that of a frame, in which it is slow."""

    def move(times: Floats, frame: Floats, _: Floats) -> tuple[Floats, Floats]:
        along, across = np.broadcast_arrays(x(times % 1.0), y(frame % 1.0))
        return along, across

    return move


def _frame(
    move: Move,
    coupling: Coupling,
    surface: Surface,
    conditions: Conditions,
    columns: tuple[_Columns, _Columns],
    numbers: np.typing.NDArray[np.int64],
    lines: int,
) -> FrameImages:
    """Simulate the lines of these numbers, of a frame of ``lines``."""
    random = np.random.default_rng(conditions.seed)
    images = []
    for column in columns:
        sample_times = column.times - conditions.late * column.lasts
        frame = (numbers[:, None] + column.times) / lines
        x, y = move(sample_times, frame, (numbers[:, None] + sample_times) / lines)
        if coupling:
            x, y = x + coupling.x_per_y * y, y + coupling.y_per_x * x
        elapsed = (frame - numbers[0] / lines + conditions.frame) / (len(numbers) / lines)
        drift = [share * float(np.ptp(nm)) * elapsed**2 for share, nm in zip(conditions.drift, (x, y), strict=True)]
        heights = surface(x + drift[0], y + drift[1])
        contrast = float(np.ptp(heights))
        across, along = (np.arange(n) / n for n in heights.shape)
        heights = heights + contrast * (conditions.tilt[0] * along + conditions.tilt[1] * across[:, None])
        heights = heights + conditions.noise * contrast * random.standard_normal(heights.shape)
        images.append(SweepImage(heights, x, y, (drift[0], drift[1])))
    return FrameImages(images[0], images[1])
