"""The emitted integers on their way to the piezo: a plan's codes at every tick, as volts behind the amplifier."""

from dataclasses import dataclass

import numpy as np

from tablegen.numerics.arrays import Floats, Ints
from tablegen.planning.line_plan import LinePlan
from tablegen.waveform.sampler import Sampler

# A slow axis can have more ticks a frame than fit in memory; its codes are then sampled this often.
MAX_TICKS = 1 << 20


@dataclass(frozen=True, eq=False)
class PlayedDrive:
    """One period of an axis: codes and volts at the piezo, held for ``tick_s`` each; ``tick`` numbers the ticks.

    All arrays have shape (ticks,). In a period that is too long ``tick`` are evenly spread, each the middle of those
    for which it stands.
    """

    tick: Ints
    tick_s: float
    codes: Ints
    volts: Floats
    period_s: float

    @property
    def time_s(self) -> Floats:
        """The middle of the time for which each code is held.

        Returns
        -------
        Times in s, shape (ticks,).
        """
        return self.period_s * self.turns

    @property
    def turns(self) -> Floats:
        """The same in periods.

        Returns
        -------
        Times in periods, 0..1, shape (ticks,).
        """
        return (np.arange(len(self.codes)) + 0.5) / len(self.codes)


def played(line: LinePlan, most_ticks: int = MAX_TICKS) -> PlayedDrive:
    """Return the output of an undisturbed period of one axis: a line of x, a frame of y.

    For a shaped axis it is the first period since the program began. Where one is too long, its ``volts`` are the mean
    of the shaped codes over the ticks for which one stands.
    """
    period = line.program.ticks
    count = min(period, most_ticks)
    tick = (2 * np.arange(count, dtype=np.int64) + 1) * period // (2 * count)
    program, period_s = line.program, 1.0 / float(line.rate)
    if count == period:
        codes = program.played(0, period)
        levels = codes.astype(np.float64)
    else:
        codes = program.rounded.codes(tick)
        shaped = program.output.shaping.order > 0
        levels = program.output.unrounded(program.samples(tick)) if shaped else codes.astype(np.float64)
    volts = line.converter.v_zero + line.converter.v_per_code * levels
    return PlayedDrive(tick, period_s / count, codes, volts, period_s)


def intended(line: LinePlan, drive: PlayedDrive) -> Floats:
    """Return the position that the model requests in the middle of each tick: rounded where it turns.

    Returns
    -------
    Positions of 0..1, shape (ticks,).
    """
    shape, t = line.drive.shape, drive.turns
    w = Sampler(line.described, 2 * len(t)).at(2 * np.arange(len(t), dtype=np.int64) + 1)
    return np.where(t <= shape.turn, shape.forward.inverse(w), 1.0 - shape.backward.inverse(1.0 - w))
