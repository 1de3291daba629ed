"""The preview of a change at an angle: the tables that play, with other gains and offsets, before the plan is there.

The parts of the drive that plays are scaled, so that the operator of each axis in time moves by the new shares of the
line and of the frame about the new place. Only their shapes stay those of the scan before.
"""

from dataclasses import replace

import numpy as np
from msgspec import Struct, structs

from tablegen.base.input_errors import Problems, Unphysical
from tablegen.compensation.operator.turned_frame import FrameDrive, FrameMotion
from tablegen.config.load import Setup
from tablegen.device.dual_program import ScanProgram
from tablegen.fixedpoint.frame_program import FrameProgram
from tablegen.fixedpoint.frame_words import FrameMove
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan, Plan
from tablegen.planning.turned_plan import (
    FrameGeometry,
    TurnedAxis,
    TurnedPlan,
    check_reach,
    plan_at_0,
    plan_tilts,
    within_range,
)
from tablegen.waveform.series import FourierSeries

_ROUNDS = 1
_SAMPLES = 128  # of a line
_MOST_LINES = 24  # of a frame that are played
_LEAST_SHARE = 0.02  # of the longer motion: a part that is shorter is not made longer


class TurnedPreview(Struct, frozen=True, eq=False):
    """Both axes of a preview, and their largest distances from the wanted position by the operators.

    They are in percent of the longer motion of each axis. ``moves`` are the words of x and y that make the program of
    that which plays. ``program_of_z`` is that of the plan behind the preview.
    """

    program: ScanProgram
    moves: tuple[FrameMove, FrameMove]
    x_error_percent: float
    y_error_percent: float
    program_of_z: ScanProgram | None = None


def turned_preview(setup: Setup, plan: TurnedPlan) -> TurnedPreview | None:
    """Scale the program that plays to another scan; None where it has other lines or windows, or leaves a limit.

    Nothing is learnt for z and aux, so those of the preview are exact; there is no preview where one begins or ends.

    Raises
    ------
    Rejected
        If the scan is refused at 0 degrees.
    """
    straight = plan_at_0(setup)
    old, new = plan.schedule, straight.schedule
    same_keys = ("ticks", "lines", "turn_tick", "forward", "backward", "up", "down")
    if any(getattr(old, key) != getattr(new, key) for key in same_keys):
        return None
    geometry, problems = FrameGeometry.of(setup, straight), Problems()
    shares, tilts = geometry.shares, plan_tilts(setup, straight, geometry, problems)
    if problems.entries or tilts.keys() != {tilt.name for tilt in plan.tilts}:
        return None
    programs, moves, errors = [], [], []
    for axis, line in zip(plan.axes, straight.lines, strict=True):
        try:
            program, move, error = _scaled(setup, plan, straight, axis, line, *shares[axis.axis])
        except (Unphysical, OverflowError):
            return None
        if program is None:
            return None
        programs.append(program)
        moves.append(move)
        errors.append(error)
    program_of_z = structs.replace(plan, **tilts).program_of_z
    both = ScanProgram(programs[0], programs[1], old)
    return TurnedPreview(both, (moves[0], moves[1]), errors[0], errors[1], program_of_z)


def _scaled(
    setup: Setup, plan: TurnedPlan, straight: Plan, axis: TurnedAxis, line: LinePlan, fast_nm: float, slow_nm: float
) -> tuple[FrameProgram | None, FrameMove, float]:
    """Return the program of an axis with its parts scaled, None if it leaves a limit; its words, and its error in %."""
    motion = replace(
        axis.motion, fast_nm=fast_nm, slow_nm=slow_nm, centre=line.drive.driver.share(line.drive.v_offset), layer=None
    )
    centre = axis.drive.slow.a0 + motion.centre - axis.motion.centre
    longest = max(motion.longest_nm, axis.motion.longest_nm)
    fast = _ratio(fast_nm, axis.motion.fast_nm, _LEAST_SHARE * longest)
    slow = _ratio(slow_nm, axis.motion.slow_nm, _LEAST_SHARE * longest)
    for number in range(_ROUNDS + 1):
        drive = _drive(axis.drive, fast, slow, centre)
        moved_fast, moved_slow, error_nm = _played(axis, motion, drive)
        if number < _ROUNDS:
            fast *= fast_nm / moved_fast if abs(moved_fast) > _LEAST_SHARE * abs(fast_nm) else 1.0
            slow *= slow_nm / moved_slow if abs(moved_slow) > _LEAST_SHARE * abs(slow_nm) else 1.0
    check_reach(axis.known, drive, motion.lines)
    move = FrameMove.of(axis.program, fast, slow, axis.converter.code(axis.known.driver.volts(centre)))
    problems = Problems()
    program = within_range(setup, straight, line, move.program(axis.program), problems)
    return None if problems.entries else program, move, 100.0 * error_nm / motion.longest_nm


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


def _played(axis: TurnedAxis, motion: FrameMotion, drive: FrameDrive) -> tuple[float, float, float]:
    """Return the motions of the line and of the frame in nm, and the largest distance from the wanted position.

    Of a long frame only some lines are played.
    """
    lines = np.arange(0, motion.lines, max(motion.lines // _MOST_LINES, 1))
    t = np.arange(_SAMPLES) / _SAMPLES
    rows = drive.at(motion.lines, t)[lines]
    u = np.clip(rows.ravel(), 0.0, 1.0)
    time_s = np.arange(len(u) + 1) / (_SAMPLES * motion.line_rate_hz)
    position = axis.piezo.position(time_s, np.append(u, u[0]))[:-1].reshape(rows.shape)
    at = np.ix_(np.flatnonzero(motion.imaged[lines]), np.flatnonzero(motion.inside(t)))
    along = np.broadcast_to(motion.fast(t) - 0.5, rows.shape)[at].ravel()
    across = (motion.slow((lines[:, None] + t) / motion.lines) - 0.5)[at].ravel()
    measured: Floats = position[at].ravel()
    design = np.stack([np.ones(len(along)), along, across], axis=1)
    _, fast_nm, slow_nm = np.linalg.lstsq(design, measured, rcond=None)[0].tolist()
    left = measured - motion.fast_nm * along - motion.slow_nm * across
    return fast_nm, slow_nm, float(np.max(np.abs(left - np.mean(left))))
