"""What a bank of the device holds."""

from msgspec import Struct

from tablegen.device.schedule import Schedule
from tablegen.fixedpoint.program import Program


class DualProgram(Struct, frozen=True, eq=False):
    """What a bank holds: both axes and the schedule they share."""

    x: Program
    y: Program
    schedule: Schedule
