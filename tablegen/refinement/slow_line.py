"""The slow axis from the same images: from the phases of the rows to the position of y in each line."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from tablegen.base.input_errors import Unphysical
from tablegen.fitting.correlation import correlation_length
from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import Plan
from tablegen.refinement.departure import requested_position
from tablegen.refinement.lattice_line import LatticeLine
from tablegen.refinement.window_line import WindowLine, error_modes

_MOST_DEGREES = 24
_ROWS_A_DEGREE = 4
_MIN_PERIODS = 3.0  # along y, in the frame
_SAME_WAVES = 0.2  # how far waves of two frames may be from whole numbers of each other


def slow_line(plan: Plan, frames: Sequence[LatticeLine]) -> WindowLine:
    """Fit y over the lines of its way up, which the rows are, from the phases of the waves in each.

    ``frames`` follow each other without a pause. Errors of the scanner are the same in each of them; the difference
    from one to the next is drift, whose rate may change linearly. One frame does not separate that change from an error
    of y. Two waves separate a shift along x from one along y; one does not.

    Raises
    ------
    Unphysical
        If rows are missing, y has too few periods, or the frames show different samples.
    """
    line, schedule = plan.y, plan.schedule
    rows, q = frames[0].geometry.rows, frames[0].fit.state.q
    part = frames[0].geometry.part
    if part.times > 1.0:
        raise Unphysical(
            f"rows {part.first_row + 1} to {part.first_row + rows} have data, of {round(rows * part.times)} in the "
            f"image; y is learnt from the whole frame: scan it to its end"
        )
    if rows != schedule.up.count:
        raise Unphysical(
            f"the images have {rows} rows, and this scan images {schedule.up.count} lines of a frame; y is learnt from "
            f"the whole frame: do not crop it, and leave out the lines of the flyback"
        )
    times = (schedule.up.first + np.arange(rows) + 0.5) / schedule.lines
    requested = requested_position(line, times)
    phases, covariance = _without_drift(frames, times)
    straight = np.column_stack([np.ones(rows), requested])
    c = np.linalg.lstsq(straight, phases, rcond=None)[0]
    s = c[1]  # periods in the whole frame, of each wave
    span = float(np.ptp(requested))
    most = float(np.max(np.abs(s))) * span
    if most < _MIN_PERIODS:
        raise Unphysical(
            f"the frame shows {most:.2g} periods of the sample along y; at least {_MIN_PERIODS:g} are needed: turn a "
            f"grating by 30 to 60 degrees, or take a lattice"
        )
    error, spread = _across(phases - straight @ c, covariance, q, s)
    window = line.band_limit.window
    degree = min(_MOST_DEGREES, rows // _ROWS_A_DEGREE)
    place = times / line.drive.turn
    modes = error_modes(place, np.ones(rows, bool), window, degree, "forward").T
    weight = 1.0 / np.sqrt(spread + np.median(spread))
    columns = np.column_stack([straight, modes]) * weight[:, None]
    inverse = np.linalg.inv(columns.T @ columns)
    solved = inverse @ (columns.T @ (weight * error))
    residuals = weight * error - columns @ solved
    correlated = correlation_length(residuals)
    freedom = max(rows / correlated - columns.shape[1], 1.0)
    covariance = inverse[2:, 2:] * float(residuals @ residuals) / freedom
    return WindowLine(
        partial(requested_position, line),
        line.drive.size_nm,
        line.drive.turn,
        window,
        degree,
        "forward",
        np.asarray(solved[2:], dtype=np.float64),
        np.asarray(covariance, dtype=np.float64),
    )


def _without_drift(frames: Sequence[LatticeLine], times: Floats) -> tuple[Floats, Floats]:
    """Return the phases of each row, (rows, waves) of the first frame, and covariances: the mean over the frames."""
    first = frames[0]
    phases, covariances = [first.fit.phases.phase], [first.fit.phases.covariance]
    for frame in frames[1:]:
        back = np.linalg.inv(_same_waves(first, frame))
        phases.append(frame.fit.phases.phase @ back.T)
        covariances.append(back @ frame.fit.phases.covariance @ back.T)
    line = np.column_stack([np.ones_like(times), times])
    # Of each frame against the first: a shift, and the change of the drift rate.
    drifts = [np.linalg.lstsq(line, phase - phases[0], rcond=None)[0] for phase in phases]
    number = np.arange(len(phases))
    faster = sum(k * c[1] for k, c in zip(number, drifts, strict=True)) / max(float(number @ number), 1.0)
    bent = 0.5 * np.outer(times**2, faster)
    mean = np.mean([phase - line @ c - bent for phase, c in zip(phases, drifts, strict=True)], axis=0)
    return mean, np.mean(covariances, axis=0) / len(phases)


def _same_waves(first: LatticeLine, other: LatticeLine) -> Floats:
    """Express the waves of another frame in those of the first, in whole numbers."""
    one, two = (np.column_stack([f.fit.state.q, _across_rows(f)])[:, : len(f.fit.state.q)] for f in (first, other))
    if one.shape == two.shape:
        numbers: Floats = two @ np.linalg.inv(one)
        whole = np.rint(numbers)
        if float(np.max(np.abs(numbers - whole))) < _SAME_WAVES and abs(float(np.linalg.det(whole))) > 0.5:
            return whole
    raise Unphysical("the images do not show one sample; give frames that follow each other")


def _across_rows(frame: LatticeLine) -> Floats:
    """Return the periods of each wave along the rows."""
    slope: Floats = np.polyfit(frame.geometry.y, frame.fit.phases.phase, 1)[0]
    return slope


def _across(phases: Floats, covariance: Floats, q: Floats, s: Floats) -> tuple[Floats, Floats]:
    """Return the error along y of each row, in lines of y, and its variance."""
    if len(q) == 1:
        return phases[:, 0] / s[0], covariance[:, 0, 0] / s[0] ** 2
    across = np.linalg.inv(np.column_stack([q, s]))[1]  # of a shift along x and along y, the second
    return phases @ across, np.einsum("b,ibc,c->i", across, covariance, across)
