"""The output z of a frame as a chart: the volts of its codes, line by line."""

import numpy as np

from tablegen.charts.chart import Chart, DrawnCurve
from tablegen.fixedpoint.frame_program import FrameProgram

_POINTS = 200  # of a line


def tilt_chart(program: FrameProgram, v_zero: float, v_per_code: float) -> Chart:
    """Draw what z plays over a frame; the piezo of z is at ``v_zero + v_per_code code``, in V."""
    ticks = np.arange(_POINTS) * program.fast.phase.ticks // _POINTS
    codes = np.stack([program.at(line, ticks) for line in range(program.lines)]).ravel()
    volts = np.asarray(v_zero + v_per_code * codes, dtype=np.float64)
    frame = DrawnCurve("z", "other", np.arange(codes.size) / _POINTS, volts)
    return Chart("z_frame", "z: frame", "line", "drive [V]", (frame,))
