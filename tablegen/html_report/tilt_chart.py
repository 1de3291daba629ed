"""An output beside x and y as a chart: the volts of its codes over a frame, line by line."""

import numpy as np

from tablegen.charts.chart import Chart, DrawnCurve
from tablegen.config.schema import TiltName
from tablegen.fixedpoint.frame_program import FrameProgram

_POINTS = 200  # of a line


def tilt_chart(name: TiltName, program: FrameProgram, v_zero: float, v_per_code: float) -> Chart:
    """Draw what an output plays over a frame; its piezo is at ``v_zero + v_per_code code``, in V."""
    ticks = np.arange(_POINTS) * program.fast.phase.ticks // _POINTS
    codes = np.stack([program.at(line, ticks) for line in range(program.lines)]).ravel()
    volts = np.asarray(v_zero + v_per_code * codes, dtype=np.float64)
    frame = DrawnCurve(name, "other", np.arange(codes.size) / _POINTS, volts)
    return Chart(f"{name}_frame", f"{name}: frame", "line", "drive [V]", (frame,))
