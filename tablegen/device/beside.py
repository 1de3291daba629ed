"""The program of a second sequencer, which plays the outputs z and aux beside x and y."""

import numpy as np
from msgspec.structs import replace

from tablegen.device.dual_program import ScanProgram
from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.frame_program import FrameProgram


def program_beside(schedule: Schedule, z: FrameProgram, aux: FrameProgram | None = None) -> ScanProgram:
    """Return what a second sequencer plays, whose x is z, and whose y aux.

    Without aux its y rests at the offset of z, by the same converter.

    It has no table of pixels: where x moves as a sine, its marker of pixels is of pixels of equal length.
    """
    fast, schedule = z.fast, replace(schedule, pixel_table=None)
    if aux is not None:
        return ScanProgram(z, aux, schedule)
    return ScanProgram(z, FrameProgram.straight(replace(fast, words=np.zeros_like(fast.words)), z.lines), schedule)


def rests(program: ScanProgram) -> bool:
    """Return True if the y of a second sequencer rests, as it does without aux."""
    y = program.y
    parts = (y.fast.words, y.second, y.slow.words) if isinstance(y, FrameProgram) else (y.words,)
    return not any(np.any(words) for words in parts)
