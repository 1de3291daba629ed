"""The emitted integers on their way to the piezo: a plan's codes at every tick, as volts behind the amplifier."""

from dataclasses import dataclass

import numpy as np

from tablegen.numerics.arrays import Floats, Ints
from tablegen.planning.line_plan import LinePlan
from tablegen.waveform.sampler import Sampler

# A slow axis can have more ticks a frame than fit in memory; its codes are then looked at this often.
MAX_TICKS = 1 << 20


@dataclass(frozen=True, eq=False)
class PlayedDrive:
    """One period of an axis: codes, and volts at the piezo, at ``tick`` numbers that are ``tick_s`` apart."""

    tick: Ints
    tick_s: float
    codes: Ints
    volts: Floats
    period_s: float

    @property
    def time_s(self) -> Floats:
        """When each code is put out."""
        return self.period_s * np.arange(len(self.codes)) / len(self.codes)


def played(line: LinePlan, most_ticks: int = MAX_TICKS) -> PlayedDrive:
    """What an undisturbed period of one axis puts out: a line of x, a frame of y."""
    period = line.program.ticks
    count = min(period, most_ticks)
    tick = np.arange(count, dtype=np.int64) * period // count
    codes = line.program.codes(tick)
    period_s = 1.0 / float(line.rate)
    volts = line.converter.v_zero + line.converter.v_per_code * codes.astype(np.float64)
    return PlayedDrive(tick, period_s / count, codes, volts, period_s)


def intended(line: LinePlan, drive: PlayedDrive) -> Floats:
    """The position, 0..1, that the scan file's model asks for at each of these ticks: rounded where the line turns."""
    shape = line.drive.shape
    k = np.arange(len(drive.codes), dtype=np.int64)
    t = k / len(k)
    w = Sampler(line.described, len(k)).at(k)
    return np.where(t <= shape.turn, shape.forward.inverse(w), 1.0 - shape.backward.inverse(1.0 - w))
