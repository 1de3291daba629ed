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
    """Simulate the settled trace of the emitted integers.

    The recorder averages over a tick about each sample. Time 0 is the line start before the record.

    Parameters
    ----------
    periods, start
        Length and beginning of the record, in periods.
    samples
        Samples per period.
    clock
        Relative error of the recorder's clock; above 0 it is fast.
    delay_s
        Delay of the sensor in s.

    Returns
    -------
    ``time_s``, ``drive_v``, ``displacement_nm``, each of shape (round(periods * samples),).

    Raises
    ------
    ValueError
        If the scan leaves the range of the virtual scanner.
    """
    drive = played(line)
    settled_nm = axis.settled(drive.volts, drive.tick_s)
    turns = start + np.arange(round(periods * samples)) / samples
    true_s = turns * drive.period_s
    # A held output, averaged over a tick, is linear between the middles of its ticks.
    volts = np.interp(turns, drive.turns, drive.volts, period=1.0)
    displacement = np.interp(turns - delay_s / drive.period_s, drive.turns, settled_nm, period=1.0)
    reading = (sensor or Sensor()).read(displacement, true_s)
    return {"time_s": true_s * (1.0 + clock), "drive_v": volts, "displacement_nm": reading}
