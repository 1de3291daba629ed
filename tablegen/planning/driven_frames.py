"""The drives of both axes of a plan over a frame, for what they leave behind in the next scan."""

import numpy as np

from tablegen.compensation.operator.frame_transient import SAMPLES, DrivenFrame
from tablegen.planning.line_plan import LinePlan, Plan
from tablegen.planning.turned_plan import TurnedPlan


def driven_frames(plan: Plan | TurnedPlan) -> tuple[DrivenFrame, DrivenFrame]:
    """Return the drives of x and y over a frame."""
    if isinstance(plan, TurnedPlan):
        x, y = (
            DrivenFrame(axis.drive.on_grid(axis.motion.lines, SAMPLES), 1.0 / axis.motion.line_rate_hz)
            for axis in plan.axes
        )
        return x, y
    lines, line_s = plan.schedule.lines, 1.0 / float(plan.schedule.line_rate)
    return _straight(plan.x, lines, line_s), _straight(plan.y, lines, line_s)


def _straight(line: LinePlan, lines: int, line_s: float) -> DrivenFrame:
    """Return the drive of an axis of a scan at 0 degrees."""
    drive, t = line.drive, np.arange(SAMPLES) / SAMPLES
    if drive.resting:
        w = np.full((lines, SAMPLES), 0.5)
    elif line.axis == "x":
        w = np.tile(line.drive_series.value(t), (lines, 1))
    else:
        w = line.drive_series.on_grid(lines * SAMPLES).reshape(lines, SAMPLES)
    volts = drive.v_offset + drive.v_amplitude * (w - 0.5)
    return DrivenFrame(np.asarray(drive.driver.share(volts)), line_s)
