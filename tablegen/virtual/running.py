"""A sensor on the virtual scanner while a built scan runs: simulated traces for `tablegen refine`, by column name."""

import numpy as np

from tablegen.numerics.arrays import Floats
from tablegen.planning.line_plan import LinePlan
from tablegen.virtual.played import played
from tablegen.virtual.scanner import VirtualAxis
from tablegen.virtual.sensor import Sensor


def running_trace(
    line: LinePlan,
    axis: VirtualAxis,
    periods: float = 5.0,
    samples: int = 2000,
    sensor: Sensor | None = None,
    start: float = 0.0,
    clock: float = 0.0,
    delay_s: float = 0.0,
) -> dict[str, Floats]:
    """``time_s``, ``drive_v``, ``displacement_nm`` of the emitted integers, played for ever before.

    ``samples`` a period, of ``periods`` from ``start`` (in periods) on. The recorder's clock is fast by ``clock``, its
    time 0 the line start before the record; the sensor is late by ``delay_s``.
    """
    drive = played(line)
    moved = axis.settled(drive.volts, drive.tick_s)
    turns = start + np.arange(round(periods * samples)) / samples
    at = np.arange(len(moved)) / len(moved)
    true_s = turns * drive.period_s
    place = np.floor(turns % 1.0 * len(moved) + 1e-6).astype(np.int64) % len(moved)
    displacement = np.interp(turns - delay_s / drive.period_s, at, moved, period=1.0)
    time = true_s * (1.0 + clock)
    reading = (sensor or Sensor()).read(displacement, true_s)
    return {"time_s": time, "drive_v": drive.volts[place], "displacement_nm": reading}
