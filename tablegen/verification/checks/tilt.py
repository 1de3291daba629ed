"""The outputs beside x and y of a build at 0 degrees, compared with the planes of their slopes at every imaged tick."""

from math import isclose

import numpy as np

from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.frame_program import FrameProgram, played_extremes
from tablegen.manifest.fields import ManifestAxis
from tablegen.manifest.frame_fields import StraightTilt
from tablegen.manifest.read import StoredBuild
from tablegen.numerics.arrays import Floats, Ints

_SAME = 1e-9
_PRINTED = 1e-5  # of a figure with six digits


def wrong_tilt(stored: StoredBuild, z: StraightTilt) -> tuple[int, list[str]]:
    """Compare the codes of an output with its limits, its certificate, and the plane over the wanted places of x and y.

    Returns
    -------
    int, list of str
        How many codes are imaged, and what differs.
    """
    axes, schedule, certificate = stored.manifest.axes, stored.program.schedule, z.certificate
    program, wrong = z.program(stored.manifest.sequence), []
    least, most, steepest = played_extremes(program)
    output, codes = program.output, certificate.codes
    if least < output.code_min or most > output.code_max:
        wrong.append(f"codes {least}..{most} leave {output.code_min}..{output.code_max}")
    if steepest > output.max_step:
        wrong.append(f"a step of {steepest} codes is above the limit of {output.max_step}")
    if (codes.least, codes.most, codes.steepest) != (least, most, steepest):
        wrong.append(
            f"codes {least}..{most}, steps of {steepest}; the certificate has {codes.least}..{codes.most}, "
            f"{codes.steepest}"
        )
    shares = z.slope_x * axes.x.drive.size_nm, z.slope_y * axes.y.drive.size_nm
    for key, value, right in (("fast_nm", z.fast_nm, shares[0]), ("slow_nm", z.slow_nm, shares[1])):
        if not isclose(value, right, rel_tol=_SAME, abs_tol=_SAME):
            wrong.append(f"{key} is {value:g}, slope and size make it {right:g}")
    count, in_lsb = _distance(z, program, schedule, axes.x, axes.y)
    in_nm = in_lsb * abs(z.output.v_per_code * z.nm_per_v)
    for key, value, right in (("error_lsb", certificate.error_lsb, in_lsb), ("error_nm", certificate.error_nm, in_nm)):
        if not isclose(value, right, rel_tol=_PRINTED):
            wrong.append(f"{key} of the certificate is {value:g}, the codes make it {right:g}")
    return count, wrong


def _distance(
    z: StraightTilt, program: FrameProgram, schedule: Schedule, x: ManifestAxis, y: ManifestAxis
) -> tuple[int, float]:
    """Return how many codes are imaged, and the largest distance of one from the wanted height, in LSB."""
    t = (np.arange(schedule.ticks) + 0.5) / schedule.ticks
    place, ticks = _line(t, schedule, x)
    fast, worst = z.fast_nm * (place[ticks] - 0.5), 0.0
    within = np.full(len(ticks), 0.5) if y.line.hold_ticks > 1 else t[ticks]  # steps have the level of the middle
    lines = [line for line in range(schedule.lines) if line in schedule.up or line in schedule.down]
    for line in lines:
        slow = z.slow_nm * (_triangle((line + within) / schedule.lines, y.drive.turn) - 0.5)
        plane = (z.offset_v + (fast + slow) / z.nm_per_v - z.output.v_zero) / z.output.v_per_code
        codes = program.output.clamp(program.at(line, ticks))
        worst = max(worst, float(np.max(np.abs(codes - plane))))
    return len(lines) * len(ticks), worst


def _line(t: Floats, schedule: Schedule, x: ManifestAxis) -> tuple[Floats, Ints]:
    """Return the places of x from 0 to 1 at phases of the ticks of a line, and which ticks are imaged."""
    if (predicted := x.fourier.place) is not None:
        n = np.arange(1, len(predicted.a) + 1)
        turns = 2.0 * np.pi * n * t[:, None]
        place = predicted.a0 + np.cos(turns) @ np.array(predicted.a) + np.sin(turns) @ np.array(predicted.b)
        windows = (schedule.forward, schedule.backward)
        return place, np.concatenate([np.arange(one.first, one.stop) for one in windows])
    place, (low, high) = _triangle(t, x.drive.turn), x.fourier.window
    both = x.fourier.directions == "both"
    return place, np.flatnonzero((place >= low) & (place <= high) & (both | (t <= x.drive.turn)))


def _triangle(phase: Floats, turn: float) -> Floats:
    """Return x from 0 to 1 and back over a period."""
    return np.asarray(np.where(phase <= turn, phase / turn, (1.0 - phase) / (1.0 - turn)))
