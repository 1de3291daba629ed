"""The preview of a change at an angle: the tables that play, with other gains and offsets, before the plan is there.

The parts of the drive that plays are scaled, so that the operator of each axis in time moves by the new shares of the
line and of the frame about the new place. Only their shapes stay those of the scan before.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from msgspec import structs

from tablegen.base.input_errors import Problems, Unphysical
from tablegen.compensation.operator.operator import CENTRE_REACH
from tablegen.compensation.operator.turned_frame import FrameDrive, FrameMotion
from tablegen.config.load import Setup
from tablegen.device.dual_program import ScanProgram
from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.frame_program import FrameProgram, played_bounds, played_extremes
from tablegen.fixedpoint.frame_words import FrameMove
from tablegen.numerics.arrays import Floats
from tablegen.planning.axis_request import ScanRequest
from tablegen.planning.turned_plan import (
    FrameGeometry,
    TurnedAxis,
    TurnedPlan,
    allowed_step,
    at_0_degrees,
    check_reach,
    plan_tilts,
)
from tablegen.waveform.series import FourierSeries

_SAMPLES = 128  # of a line, for the error
_SAMPLES_OF_SCALES = 64
_MOST_LINES = 24  # of a frame that are played
_LEAST_SHARE = 0.02  # of the longer motion: a part that is shorter is not made longer


@dataclass(frozen=True, eq=False)
class _Scaled:
    """An axis of a preview: the words that make its program, and how it is to move by its drive."""

    axis: TurnedAxis
    program: FrameProgram
    move: FrameMove
    motion: FrameMotion
    drive: FrameDrive

    @cached_property
    def error_percent(self) -> float:
        """The largest distance from the wanted position by the operator, in percent of the longer motion."""
        return 100.0 * _played(self.axis, self.motion, self.drive, _SAMPLES)[2] / self.motion.longest_nm


@dataclass(frozen=True, eq=False)
class TurnedPreview:
    """Both axes of a preview. ``program_of_z`` is that of the plan behind it.

    Its errors are worked out when they are asked for, since no check needs them: a preview can play before.
    """

    x: _Scaled
    y: _Scaled
    schedule: Schedule
    program_of_z: ScanProgram | None = None

    @property
    def program(self) -> ScanProgram:
        """The program that plays with other words."""
        return ScanProgram(self.x.program, self.y.program, self.schedule)

    @property
    def moves(self) -> tuple[FrameMove, FrameMove]:
        """The words of x and y that make it of the program that plays."""
        return self.x.move, self.y.move

    @property
    def x_error_percent(self) -> float:
        """The largest distance of x from the wanted position by its operator, in percent of its longer motion."""
        return self.x.error_percent

    @property
    def y_error_percent(self) -> float:
        """The same of y."""
        return self.y.error_percent


def turned_preview(setup: Setup, plan: TurnedPlan) -> TurnedPreview | None:
    """Scale the program that plays to another scan; None where it has other lines or windows, or leaves a limit.

    Nothing is learnt for z and aux, so those of the preview are exact; there is no preview where one begins or ends.
    Of the scan at 0 degrees only schedule and voltages are needed: what else of it is refused, the plan refuses.

    Raises
    ------
    Rejected
        If the schedule or the voltages of the scan at 0 degrees are refused.
    """
    request = ScanRequest.of(at_0_degrees(setup))
    old, new = plan.schedule, request.schedule
    same_keys = ("ticks", "lines", "turn_tick", "forward", "backward", "up", "down")
    if setup.scan.x.motion != "line" or any(getattr(old, key) != getattr(new, key) for key in same_keys):
        return None
    sizes = request.x.voltages.size_nm, request.y.voltages.size_nm
    geometry, problems = FrameGeometry.of(setup, new, sizes), Problems()
    shares, tilts = geometry.shares, plan_tilts(setup, new, request.x.harmonics, geometry, problems)
    if problems.entries or tilts.keys() != {tilt.name for tilt in plan.tilts}:
        return None
    scaled = []
    for axis, voltages in zip(plan.axes, (request.x.voltages, request.y.voltages), strict=True):
        try:
            one = _scaled(setup, axis, voltages.driver.share(voltages.v_offset), *shares[axis.axis])
        except (Unphysical, OverflowError):
            return None
        if one is None:
            return None
        scaled.append(one)
    return TurnedPreview(scaled[0], scaled[1], old, structs.replace(plan, **tilts).program_of_z)


def _scaled(setup: Setup, axis: TurnedAxis, middle: float, fast_nm: float, slow_nm: float) -> _Scaled | None:
    """Scale the parts of an axis; None if it leaves a limit.

    ``middle`` is the offset of the new place, of v_max.
    """
    if min(abs(line.centre - middle) for line in axis.known.operator.lines) > CENTRE_REACH:
        raise Unphysical("no trace of the operator is near this offset")
    motion = replace(axis.motion, fast_nm=fast_nm, slow_nm=slow_nm, centre=middle, layer=None)
    centre = axis.drive.slow.a0 + motion.centre - axis.motion.centre
    longest = max(motion.longest_nm, axis.motion.longest_nm)
    fast = _ratio(fast_nm, axis.motion.fast_nm, _LEAST_SHARE * longest)
    slow = _ratio(slow_nm, axis.motion.slow_nm, _LEAST_SHARE * longest)
    moved_fast, moved_slow, _ = _played(axis, motion, _drive(axis.drive, fast, slow, centre), _SAMPLES_OF_SCALES)
    fast *= fast_nm / moved_fast if abs(moved_fast) > _LEAST_SHARE * abs(fast_nm) else 1.0
    slow *= slow_nm / moved_slow if abs(moved_slow) > _LEAST_SHARE * abs(slow_nm) else 1.0
    drive = _drive(axis.drive, fast, slow, centre)
    check_reach(axis.known, drive, motion.lines)
    move = FrameMove.of(axis.program, fast, slow, axis.converter.code(axis.known.driver.volts(centre)))
    program = _guarded(setup, axis, move.program(axis.program))
    return None if program is None else _Scaled(axis, program, move, motion, drive)


def _guarded(setup: Setup, axis: TurnedAxis, program: FrameProgram) -> FrameProgram | None:
    """Return the program with its slew guard; None if it leaves the range or the slew rate.

    Where the scan file names no slew rate, the guard of the program that plays stays, unless a step is longer.
    """
    output, allowed = program.output, allowed_step(setup, axis.axis, axis.converter)
    for least, most, steepest in (extremes(program) for extremes in (played_bounds, played_extremes)):
        if output.code_min <= least and most <= output.code_max and (allowed is None or steepest <= allowed):
            return program.guarded(max(output.max_step, steepest) if allowed is None else allowed)
    return None


def _ratio(new_nm: float, old_nm: float, least_nm: float) -> float:
    """Return by how much a part is scaled.

    Raises
    ------
    Unphysical
        If there is nothing to scale.
    """
    if abs(old_nm) < least_nm:
        if abs(new_nm) < least_nm:
            return 1.0
        raise Unphysical("the axis does not move in this direction")
    return new_nm / old_nm


def _drive(drive: FrameDrive, fast: float, slow: float, centre: float) -> FrameDrive:
    series = FourierSeries(centre, slow * drive.slow.a, slow * drive.slow.b)
    return replace(drive, slow=series, gains=fast * drive.gains)


def _played(axis: TurnedAxis, motion: FrameMotion, drive: FrameDrive, samples: int) -> tuple[float, float, float]:
    """Return the motions of the line and of the frame in nm, and the largest distance from the wanted position.

    Of a long frame only some lines are played, at so many samples of each.
    """
    lines = np.arange(0, motion.lines, max(motion.lines // _MOST_LINES, 1))
    t = np.arange(samples) / samples
    rows = drive.at(motion.lines, t)[lines]
    u = np.clip(rows.ravel(), 0.0, 1.0)
    time_s = np.arange(len(u) + 1) / (samples * motion.line_rate_hz)
    position = axis.piezo.position(time_s, np.append(u, u[0]))[:-1].reshape(rows.shape)
    at = np.ix_(np.flatnonzero(motion.imaged[lines]), np.flatnonzero(motion.inside(t)))
    along = np.broadcast_to(motion.fast(t) - 0.5, rows.shape)[at].ravel()
    across = (motion.slow((lines[:, None] + t) / motion.lines) - 0.5)[at].ravel()
    measured: Floats = position[at].ravel()
    design = np.stack([np.ones(len(along)), along, across], axis=1)
    _, fast_nm, slow_nm = np.linalg.lstsq(design, measured, rcond=None)[0].tolist()
    left = measured - motion.fast_nm * along - motion.slow_nm * across
    return fast_nm, slow_nm, float(np.max(np.abs(left - np.mean(left))))
