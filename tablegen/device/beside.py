"""The program of a second sequencer, which plays the output z beside x and y."""

import numpy as np
from msgspec.structs import replace

from tablegen.device.dual_program import ScanProgram
from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.frame_program import FrameProgram


def program_beside(z: FrameProgram, schedule: Schedule) -> ScanProgram:
    """Return what a second sequencer plays, whose x is z; its y rests at the offset of z, by the same converter.

    It has no table of pixels: where x moves as a sine, its marker of pixels is of pixels of equal length.
    """
    fast, schedule = z.fast, replace(schedule, pixel_table=None)
    return ScanProgram(z, FrameProgram.straight(replace(fast, words=np.zeros_like(fast.words)), z.lines), schedule)
