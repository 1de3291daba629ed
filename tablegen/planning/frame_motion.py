"""The motion of an output that follows the line and the frame, from the schedule of the scan."""

import numpy as np

from tablegen.compensation.operator.turned_frame import FrameMotion
from tablegen.config.load import Setup
from tablegen.device.schedule import Schedule
from tablegen.numerics.arrays import Bools

_MOST_SLOW_HARMONICS = 24
_LINES_PER_HARMONIC = 3


def frame_motion(
    setup: Setup, schedule: Schedule, harmonics: int, centre: float, fast_nm: float, slow_nm: float
) -> FrameMotion:
    """Return the motion of an output that moves so many nm along the line and the frame of a scan.

    Parameters
    ----------
    harmonics
        Those of the line.
    centre
        The middle of its drive, of v_max.
    fast_nm, slow_nm
        From x = 0 to 1 of each motion.
    """
    x, y = setup.scan.x, setup.scan.y
    lines = np.arange(schedule.lines)
    imaged: Bools = np.array([at in schedule.up or at in schedule.down for at in lines.tolist()], dtype=np.bool_)
    return FrameMotion(
        fast_nm=fast_nm,
        slow_nm=slow_nm,
        fast_turn=x.turn,
        fast_window=x.band_limit.window,
        both=x.band_limit.directions == "both",
        slow_turn=y.turn,
        imaged=imaged,
        line_rate_hz=float(schedule.line_rate),
        harmonics=harmonics,
        slow_harmonics=max(1, min(_MOST_SLOW_HARMONICS, schedule.lines // _LINES_PER_HARMONIC)),
        centre=centre,
    )
