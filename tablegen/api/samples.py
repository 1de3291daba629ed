"""One period of an axis as arrays, a value a tick: time, volts, codes and markers."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tablegen.device.period import period_of
from tablegen.numerics.arrays import Bools, Floats, Ints
from tablegen.planning.line_plan import Plan


@dataclass(frozen=True, eq=False, repr=False)
class Samples:
    """Ticks of one period of an axis, a line of x or a frame of y. All arrays have the shape (ticks,).

    ``time_s`` begins with the period; the converter holds each code from its time to the next. ``codes`` are what the
    converter plays, straight binary, and ``volts`` what they make at the piezo; ``asked_volts`` is the float waveform
    of which they are samples. ``line``, ``pixel`` and ``start`` are True where a line, a pixel, and the period begin,
    ``backward`` during the sweep back, ``inside`` within the imaging window of the axis.
    """

    axis: Literal["x", "y"]
    time_s: Floats
    volts: Floats
    asked_volts: Floats
    codes: Ints
    start: Bools
    line: Bools
    pixel: Bools
    backward: Bools
    inside: Bools

    def __len__(self) -> int:
        return len(self.codes)

    def __repr__(self) -> str:
        low, high = float(self.volts.min()), float(self.volts.max())
        length = float(self.time_s[-1] - self.time_s[0])
        return f"<{len(self)} samples of {self.axis}: {low:.6g}..{high:.6g} V over {length:.6g} s>"


def samples(plan: Plan, axis: Literal["x", "y"], first: int = 0, stop: int | None = None) -> Samples:
    """Return ticks [first, stop) of the period of an axis, to its end unless given.

    Of a shaped axis it is the first period since the program began; a code of it needs all before it.
    A slow frame has many ticks: 8 bytes a tick for each number, so give ``stop`` where it has 10^8.

    Raises
    ------
    ValueError
        If the ticks are outside of the period.
    """
    line = plan.x if axis == "x" else plan.y
    period = period_of(plan.program, axis, first, stop)
    ticks, hold = period.ticks, line.program.hold
    waveform = line.series.value((ticks // hold) / line.program.phase.ticks)
    return Samples(
        axis=axis,
        time_s=plan.schedule.seconds(ticks),
        volts=line.converter.v_zero + line.converter.v_per_code * period.codes.astype(np.float64),
        asked_volts=line.drive.v_offset + line.drive.v_amplitude * (np.asarray(waveform) - 0.5),
        codes=period.codes,
        start=period.start,
        line=period.line,
        pixel=period.pixel,
        backward=period.backward,
        inside=period.inside,
    )
