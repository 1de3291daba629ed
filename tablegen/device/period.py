"""One period of an axis as arrays: a line of x, a frame of y. Codes and markers in steady state, a value a tick."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from tablegen.device.dual_program import DualProgram
from tablegen.device.schedule import pixel_starts
from tablegen.numerics.arrays import Bools, Ints


@dataclass(frozen=True, eq=False)
class Period:
    """The ticks [first, first + len) of a period. All arrays have the shape (ticks,).

    ``start`` marks the first tick of the period, ``line`` of each line, ``pixel`` of each pixel; ``backward`` is the
    sweep back, and ``inside`` the imaging window of this axis.
    """

    first: int
    codes: Ints
    start: Bools
    line: Bools
    pixel: Bools
    backward: Bools
    inside: Bools

    @property
    def ticks(self) -> Ints:
        """The number of each tick in the period, (ticks,).

        Returns
        -------
        Ints
            Shape (ticks,).
        """
        return np.arange(self.first, self.first + len(self.codes), dtype=np.int64)


def period_of(program: DualProgram, axis: Literal["x", "y"], first: int = 0, stop: int | None = None) -> Period:
    """Return ticks [first, stop) of the period of an axis; to its end unless given.

    For a shaped axis they are those of the first period since the program began: no two periods are the same.

    Raises
    ------
    ValueError
        If the ticks are outside the period.
    """
    schedule = program.schedule
    whole = schedule.ticks if axis == "x" else schedule.frame_ticks
    stop = whole if stop is None else stop
    if not 0 <= first <= stop <= whole:
        raise ValueError(f"ticks {first} to {stop} are outside the {whole} ticks of a period of {axis}")
    k = np.arange(first, stop, dtype=np.int64)
    line, tick = np.divmod(k, schedule.ticks)
    if axis == "x":
        starts = [pixel_starts(window, schedule.pixels) for window in (schedule.forward, schedule.backward)]
        pixel = np.isin(tick, np.concatenate(starts))
        backward, at, windows = tick >= schedule.turn_tick, tick, (schedule.forward, schedule.backward)
        codes = program.x.played(first, stop)
    else:
        pixel = np.zeros(len(k), dtype=np.bool_)
        backward, at, windows = line >= schedule.turn_line, line, (schedule.up, schedule.down)
        codes = program.y.played(first, stop)
    inside = np.zeros(len(k), dtype=np.bool_)
    for window in windows:
        inside |= (at >= window.first) & (at < window.stop)
    return Period(first, codes, k == 0, tick == 0, pixel, backward, inside)
