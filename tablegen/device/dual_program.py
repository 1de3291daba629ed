"""What a bank of the device holds."""

from dataclasses import dataclass

from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.program import Program


@dataclass(frozen=True, eq=False)
class DualProgram:
    """What a bank holds: both axes and the schedule they share."""

    x: Program
    y: Program
    schedule: Schedule
