"""The certificate of a scan at an angle: where the integers of a frame put the tip, by the operators of both axes.

The position of both axes at the imaged ticks is compared with the wanted one: an affine map fitted to it gives the
sizes along and across the lines, the angle between them, and the scan angle; what is left is the residual.
"""

from collections.abc import Callable

import numpy as np
from msgspec import Struct, field

from tablegen.config.schema import TiltName
from tablegen.fixedpoint.frame_program import played_extremes
from tablegen.numerics.arrays import Floats, Ints
from tablegen.planning.frame_tables import compared_ticks
from tablegen.planning.tilt import CodeRange, TiltErrors
from tablegen.planning.turned_plan import FrameGeometry, TurnedAxis, TurnedPlan

_CHORD = 0.05  # of the line


class TurnedErrors(Struct, frozen=True):
    """Errors of a frame by the operators, in percent of the size of each motion unless the name says otherwise.

    ``fast_size`` and ``slow_size`` are errors of the sizes along and across the lines; ``shear`` is by how much the
    angle between both differs from 90 degrees, as a slope; ``rotation_deg`` is the error of the scan angle. ``rms`` is
    the residual about the best affine image, ``worst_line`` that of the worst line; ``mismatch`` the largest distance
    of trace and retrace of a line, as means of 1/20 of it, 0 without a retrace; ``scaling`` the scaling error along the
    mean line, peak to peak, of chords of 1/20 of it. ``code_lsb`` is the largest distance of a code from the drive that
    was learnt, in LSB of the converter, of x and y.
    """

    fast_size: float
    slow_size: float
    shear: float
    rotation_deg: float
    rms: float
    worst_line: float
    mismatch: float
    scaling: float
    code_lsb: tuple[float, float]


class TurnedCertificate(Struct, frozen=True):
    """The certificate of a scan at an angle: its errors, the codes of x and y, and the outputs beside them by name."""

    errors: TurnedErrors
    codes: tuple[CodeRange, CodeRange]
    tilts: dict[TiltName, TiltErrors] = field(default_factory=dict)


def certify_turned(plan: TurnedPlan, progress: Callable[[str], object] = lambda _: None) -> TurnedCertificate:
    """Play the integers of a frame on the operators, and compare the position with the wanted one."""
    progress("playing the frame on the operators")
    schedule = plan.schedule
    ticks = compared_ticks(schedule.ticks)
    positions, distances = [], []
    for axis in plan.axes:
        codes = frame_codes(axis, ticks)
        positions.append(played_position(axis, codes, ticks, schedule.ticks))
        distances.append(_code_distance(axis, codes, ticks, schedule.ticks))
    ranges = tuple(CodeRange(*played_extremes(axis.program)) for axis in plan.axes)
    errors = frame_errors(plan, positions[0], positions[1], (ticks + 0.5) / schedule.ticks)
    return TurnedCertificate(
        TurnedErrors(**errors, code_lsb=(distances[0], distances[1])),
        (ranges[0], ranges[1]),
        {tilt.name: tilt.errors for tilt in plan.tilts},
    )


def played_frame(plan: TurnedPlan) -> "ImagedFrame":
    """Return the positions of a frame on the operators of the plan."""
    ticks = compared_ticks(plan.schedule.ticks)
    x_nm, y_nm = (played_position(axis, frame_codes(axis, ticks), ticks, plan.schedule.ticks) for axis in plan.axes)
    return ImagedFrame.of(plan, x_nm, y_nm, (ticks + 0.5) / plan.schedule.ticks)


def frame_codes(axis: TurnedAxis, ticks: Ints) -> Ints:
    """Return the codes of a frame at some ticks of each line, unshaped, shape (lines, len(ticks))."""
    return axis.program.output.clamp(axis.program.at_all(ticks))


def played_position(axis: TurnedAxis, codes: Ints, ticks: Ints, line_ticks: int) -> Floats:
    """Return the position in nm in the middle of ticks of a frame that repeats: by the operator, and what was learnt.

    Parameters
    ----------
    codes
        Shape (lines, len(ticks)).
    ticks
        Their ticks in the line.
    line_ticks
        All ticks of a line.
    """
    lines = len(codes)
    tick_s = 1.0 / (axis.motion.line_rate_hz * line_ticks)
    time_s = ((np.arange(lines)[:, None] * line_ticks + ticks) * tick_s).ravel()
    u = axis.share(codes).ravel()
    closed = np.append(time_s, lines * line_ticks * tick_s)
    position = axis.piezo.position(closed, np.append(u, u[0]))[:-1].reshape(codes.shape)
    layer = axis.motion.layer
    return position if layer is None else np.asarray(position + layer.at(lines, (ticks + 0.5) / line_ticks))


class ImagedFrame(Struct, frozen=True, eq=False):
    """Positions of a frame beside the wanted ones: along the lines, and across them, on the sample.

    ``fast_nm`` and ``slow_nm`` are the positions, shape (lines, samples), ``t`` the phases of the samples in a line.
    ``maps`` are the affine images of the wanted position that fit the imaged samples best: a constant and the shares of
    the line and of the frame, of either direction. ``left_nm`` is what they leave, shape (imaged lines, samples inside)
    each, at the wanted positions ``along`` and ``across``, -0.5..0.5 of each motion.
    """

    t: Floats
    fast_nm: Floats
    slow_nm: Floats
    maps: tuple[Floats, Floats]
    left_nm: tuple[Floats, Floats]
    along: Floats
    across: Floats

    @classmethod
    def of(
        cls, plan: TurnedPlan, x_nm: Floats, y_nm: Floats, t: Floats, geometry: FrameGeometry | None = None
    ) -> "ImagedFrame":
        """Return positions of both axes beside those that the plan wants.

        Parameters
        ----------
        x_nm, y_nm
            Positions up to a constant, shape (lines, len(t)).
        t
            Phases of the line, shape (samples,).
        geometry
            Coupling of the axes and drift of the sample, where they are others than those of the plan.
        """
        motion = plan.x.motion
        lines = motion.lines
        along = np.broadcast_to(motion.fast(t) - 0.5, (lines, len(t)))
        across = motion.slow((np.arange(lines)[:, None] + t) / lines) - 0.5
        time_s = (np.arange(lines)[:, None] + t) / motion.line_rate_hz
        fast, slow = (geometry or plan.geometry).on_the_sample(x_nm, y_nm, time_s)
        at = np.ix_(np.flatnonzero(motion.imaged), np.flatnonzero(motion.inside(t)))
        design = np.stack([np.ones(along[at].size), along[at].ravel(), across[at].ravel()], axis=1)
        maps, left = [], []
        for values in (fast, slow):
            measured = values[at].ravel()
            solution = np.linalg.lstsq(design, measured, rcond=None)[0]
            maps.append(np.asarray(solution, dtype=np.float64))
            left.append(np.asarray(measured - design @ solution, dtype=np.float64).reshape(along[at].shape))
        return cls(t, fast, slow, (maps[0], maps[1]), (left[0], left[1]), along[at], across[at])

    def line_rms(self, size_nm: tuple[float, float]) -> Floats:
        """Return the residual of each imaged line, rms, as a share of the sizes along and across."""
        fast_nm, slow_nm = size_nm
        squares = (self.left_nm[0] / fast_nm) ** 2 + (self.left_nm[1] / slow_nm) ** 2
        return np.asarray(np.sqrt(np.mean(squares, axis=1)))


def frame_errors(
    plan: TurnedPlan, x_nm: Floats, y_nm: Floats, t: Floats, geometry: FrameGeometry | None = None
) -> dict[str, float]:
    """Return the errors of positions of both axes; the parameters are those of ``ImagedFrame.of``."""
    return errors_of(plan, ImagedFrame.of(plan, x_nm, y_nm, t, geometry))


def errors_of(plan: TurnedPlan, frame: ImagedFrame) -> dict[str, float]:
    """Return the errors of a frame by the names of ``TurnedErrors``, without that of the codes."""
    fast_nm, slow_nm = plan.geometry.size_nm
    (_, fast_fast, fast_slow), (_, slow_fast, slow_slow) = (row.tolist() for row in frame.maps)
    lines = frame.line_rms((fast_nm, slow_nm))
    return {
        "fast_size": 100.0 * (float(np.hypot(fast_fast, slow_fast)) / fast_nm - 1.0),
        "slow_size": 100.0 * (float(np.hypot(fast_slow, slow_slow)) / slow_nm - 1.0),
        "shear": 100.0 * (slow_fast / fast_fast + fast_slow / slow_slow),
        "rotation_deg": float(np.degrees(np.arctan2(slow_fast, fast_fast))),
        "rms": 100.0 * float(np.sqrt(np.mean(lines * lines))),
        "worst_line": 100.0 * float(np.max(lines)),
        "mismatch": _mismatch(plan, frame.fast_nm, frame.t),
        "scaling": _scaling(plan, frame.fast_nm, frame.t),
    }


def _scaling(plan: TurnedPlan, fast: Floats, t: Floats) -> float:
    """Return the scaling error along the mean of all imaged lines, peak to peak, in percent."""
    motion, fast_nm = plan.x.motion, plan.geometry.size_nm[0]
    inside, x = motion.inside(t), motion.fast(t)
    mean = np.mean(fast[motion.imaged], axis=0) / fast_nm
    worst = 0.0
    for going in (t <= motion.fast_turn, t > motion.fast_turn):
        here = np.flatnonzero(inside & going)
        if len(here):
            order = here[np.argsort(x[here])]
            grid = np.linspace(x[order[0]], x[order[-1]], 401)
            step = max(1, min(round(_CHORD / (grid[1] - grid[0])), 400))
            line = np.interp(grid, x[order], mean[order])
            worst = max(worst, float(np.ptp((line[step:] - line[:-step]) / (grid[step] - grid[0]))))
    return 100.0 * worst


def _mismatch(plan: TurnedPlan, fast: Floats, t: Floats) -> float:
    """Return the largest distance of trace and retrace along the line, of bins of 1/20 of it, in percent."""
    motion, fast_nm = plan.x.motion, plan.geometry.size_nm[0]
    if not motion.both:
        return 0.0
    inside, x = motion.inside(t), motion.fast(t)
    low, high = motion.fast_window
    bins = np.clip(((x - low) / (high - low) * 20.0).astype(np.int64), 0, 19)
    worst = 0.0
    # The frame moves on between both: the slow share is not in ``fast`` but for the shear.
    error = fast - fast_nm * (x - 0.5)
    for line in np.flatnonzero(motion.imaged).tolist():
        sides = []
        for going in (t <= motion.fast_turn, t > motion.fast_turn):
            here = inside & going
            count = np.bincount(bins[here], minlength=20)
            sides.append(np.bincount(bins[here], error[line][here], minlength=20) / np.maximum(count, 1))
        worst = max(worst, float(np.max(np.abs(sides[0] - sides[1]))))
    return 100.0 * worst / fast_nm


def _code_distance(axis: TurnedAxis, codes: Ints, ticks: Ints, line_ticks: int) -> float:
    """Return the largest distance of codes from the learnt drive, in LSB, without the hold's lead of half a tick."""
    t = (ticks + 0.5) / line_ticks
    exact = axis.drive.at(len(codes), t)
    span = axis.known.driver.span / abs(axis.converter.v_per_code)
    return float(np.max(np.abs(axis.share(codes) - exact))) * span
